"""Questions of stress cases: problems for methods, with reference values, and the resulting findings.

The second half has questions that several cases share: given motions, compared with the truth, and accelerations of
true states under the true forces. Questions of single cases are in the modules that ``cases.toml`` names.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import Path
from textwrap import shorten

import numpy as np

from screwgauge.judging.judge import judge
from screwgauge.judging.residual import Residual
from screwgauge.judging.trust import refusals
from screwgauge.models.files.loops import loops_of
from screwgauge.models.generate import write_models
from screwgauge.problem import GivenMotion, InitialValue, Integration, ModelFiles, Problem
from screwgauge.quantities import GIVEN
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed_motion import ClosedMotion, motion_at
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Frame, Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.solution import TRUTH, Failure, Solution, Values
from screwgauge.study.methods import Method
from screwgauge.study.reference_values import PreparedScene, Reference, deviation, pose_scene, sizes
from screwgauge.study.solving import ask, model_files, solve
from screwgauge.witness.joints import MechanismTree
from screwgauge.witness.kinematics import TreeMotion
from screwgauge.witness.tree import stack_frames

#: Scaled error below which no warning is needed: the largest tolerance with which a scene agrees.
GOOD = 1e-9
OK, DEGRADED, REFUSED, SILENT = "ok", "degraded", "refused", "silently-wrong"
VERDICTS = (OK, DEGRADED, REFUSED, SILENT)


@dataclass(frozen=True, slots=True)
class Finding(Residual):
    """Error of an engine in one quantity against the truth, for one severity of a stress case; a row of a stress table.

    Attributes:
        a: Name of the engine; a setting may follow, as in ``mujoco RK4``.
        tolerance: Largest scaled error that a warning or an error estimate by the engine admits.
        reason: Reason for a refusal, text of a warning, or cause of the error.
        condition: Condition number of the solved system; NaN without a solution.
        time_s: Run time [s].
        own: True for our own solver.
        case, severity: Stress case and its severity.
    """

    tolerance: float = GOOD
    condition: float = math.nan
    time_s: float = math.nan
    own: bool = False
    case: str = ""
    severity: float = math.nan

    @property
    def engine(self) -> str:
        """Name of the engine."""
        return self.a

    @property
    def explanation(self) -> str:
        """Reason, or a remark that the engine states no reason."""
        silent = not self.reason and not math.isfinite(self.error)
        return "not a number, without any warning" if silent else self.reason

    @property
    def verdict(self) -> str:
        """``ok``, ``degraded`` (fewer than nine digits, with a warning), ``refused`` (no number, with a reason), or
        ``silently-wrong`` (anything else).
        """
        if not math.isfinite(self.error):
            return REFUSED if self.reason and math.isnan(self.error) else SILENT
        if self.error <= GOOD:
            return OK
        return DEGRADED if self.error <= self.tolerance else SILENT


OWN = "screw"  # the engine that represents our own solver
LONGEST = 500  # number of characters of a reason: some errors print a whole state


UNKNOWN = Reference("", {}, "", {})


def values_of(question: Question, solution: Solution) -> Mapping[str, Values]:
    """Return the values of a solution."""
    return solution.values


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """Problem for methods, with reference values. Plain data that can be pickled.

    Attributes:
        files: Engine -> model files.
        methods: Methods that solve the problem; by default the methods of the case in ``cases.toml`` whose `of`
            equals the `of` of the question.
        quantities: Measured quantities, in order.
        right: True values of the compared components; `UNKNOWN` without true values, in which case the judge measures.
        read: Module-level function that extracts the measured quantities from a solution.
        cause: Cause of a silent error of methods other than our own; ``{notes}`` stands for the notes of the solution.
        remarks: Quantity -> remark that is added whatever the error.
        admitted: Quantity -> admitted scaled error, which replaces the method's estimate.
        by: Description of the source of an admitted error.
        condition: Condition number of the closed loops, if used instead of the condition number of the solved system.
        refused: Reason why no method is asked.
        unanswerable: Reason why no number is correct, so that a method must refuse the question.
    """

    mechanism: Mechanism
    files: Mapping[str, ModelFiles]
    problem: Problem
    methods: tuple[Method, ...]
    quantities: tuple[str, ...]
    right: Reference
    read: Callable[[Question, Solution], Mapping[str, Values]] = values_of
    cause: str = ""
    remarks: Mapping[str, str] = field(default_factory=dict)
    admitted: Mapping[str, float] = field(default_factory=dict)
    by: str = "its error estimate"
    condition: float | None = None
    refused: str = ""
    unanswerable: str = ""
    of: str = ""

    @property
    def known(self) -> bool:
        """True if the question has reference values."""
        return bool(self.right.values)


def pose_question(
    scene: Scene, folder: Path, problem: Problem, methods: tuple[Method, ...], names: tuple[str, ...], right: Reference
) -> Question:
    """Pose a question about quantities of a scene whose model files are in a folder."""
    return Question(scene.mechanism, files_of(scene, folder, methods), problem, methods, names, right)


def files_of(scene: Scene, folder: Path, methods: tuple[Method, ...] = ()) -> dict[str, ModelFiles]:
    """Return the model files of a scene in a folder, for the default engines and for given methods."""
    names = dict.fromkeys([*ENGINES, *(method.engine for method in methods)])
    return {name: model_files(scene, name, folder) for name in names}


def with_integration(question: Question, integration: Integration) -> Question:
    """Return a question about a simulation with a different method or tolerance."""
    task = question.problem.task
    if not isinstance(task, InitialValue):
        raise TypeError("the task is not a simulation")
    return replace(question, problem=replace(question.problem, task=replace(task, integration=integration)))


def findings(question: Question) -> Iterator[Finding]:
    """Yield a finding for each method and quantity: its error, the admitted error, and the reason."""
    for method in question.methods:
        yield from _findings_of(question, method)


def _findings_of(question: Question, method: Method) -> Iterator[Finding]:
    row, error = Finding("", a=method.name, own=method.engine == OWN), math.nan
    solution: Solution | Failure = Failure(method.name, question.refused)
    if not question.refused:
        solution = ask(method, question.files[method.engine], question.problem)
    refused = solution.reason if isinstance(solution, Failure) else _broken_off(question, solution)
    if not refused and not isinstance(solution, Failure):
        row = replace(row, time_s=_time(solution))
        if not question.unanswerable:
            yield from _measure(question, solution, row)
            return
        refused, error = question.unanswerable, math.inf
    for quantity in question.quantities:
        yield replace(row, quantity=quantity, error=error, reason=shorten(refused, LONGEST, placeholder=" ..."))


def _broken_off(question: Question, solution: Solution) -> str:
    """Return the reason why a solution does not count (it stopped, or the engine warned about a step), if any."""
    warned = solution.warnings if isinstance(question.problem.task, InitialValue) else ()
    return solution.stopped or "; ".join(warned)


def scaled_error(values: Values, right: Values, scales: Mapping[str, float]) -> float:
    """Return the largest error relative to its scale; NaN or infinite if a value is NaN or infinite.

    Samples without a reference value are ignored.

    Args:
        values: Values of at least the components of `right`, in any order.
        scales: Unit -> scale.
    """
    largest = sizes(deviation(values.pick(right.components), right))
    return float(np.max([size / scales[unit] for unit, size in largest.items()])) if largest else math.nan


def _measure(question: Question, solution: Solution, row: Finding) -> Iterator[Finding]:
    """Yield the findings for a solution; without reference values, yield the finding of the judge."""
    if not question.known:
        yield _judge(question, solution, row)
        return
    values, excuses = question.read(question, solution), _excuses(question, solution)
    for quantity in question.quantities:
        excuse = excuses.get(quantity, "") or excuses.get("", "")
        yield _compare(question, solution, replace(row, quantity=quantity), values[quantity], excuse)


def _compare(question: Question, solution: Solution, blank: Finding, values: Values, excuse: str) -> Finding:
    """Compute the error of a quantity, the admitted error, and the reason.

    Args:
        excuse: The engine's explanation for a NaN.
    """
    quantity, right = blank.quantity, question.right
    error = scaled_error(values, right.values[quantity], right.scales[quantity])
    scales, admitted = right.scales[quantity], solution.errors[quantity].absolute if quantity in solution.errors else {}
    bound = max([_estimate(solution, quantity), *(admitted.get(unit, 0.0) / scales[unit] for unit in scales)])
    bound = max(GOOD, question.admitted.get(quantity, bound))
    condition = float(np.max(solution.condition)) if question.condition is None else question.condition
    finding = replace(blank, error=error, tolerance=bound, condition=condition)
    admits = f"{question.by} admits {bound:.1e}" if bound > GOOD else ""
    if math.isinf(bound):
        admits = f"according to {question.by} no digit may be correct"
    if math.isnan(error):  # only the engine's explanation counts
        return replace(finding, reason=excuse or admits)
    silent = finding.verdict == SILENT and not finding.own
    cause = question.cause.replace("{notes}", "; ".join(solution.notes)) if silent else ""
    return replace(finding, reason="; ".join(filter(None, (cause, question.remarks.get(quantity, ""), admits))))


def _judge(question: Question, solution: Solution, blank: Finding) -> Finding:
    """Return the largest residual of the judge, which stands for all quantities without reference values."""
    table = judge(question.mechanism, question.problem, solution)
    return replace(
        blank,
        quantity="judge",
        error=float(table["max_scaled"].max(skipna=False)),
        tolerance=max([GOOD, *(_estimate(solution, quantity) for quantity in solution.errors)]),
        condition=float(np.nanmax(solution.condition)),
        reason="largest residual of the judge, as no truth is available",
    )


def _excuses(question: Question, solution: Solution) -> dict[str, str]:
    """Return quantity -> the singularity that prevents a number; "" -> notes on all quantities."""
    if not isinstance(question.problem.task, GivenMotion):
        return {}
    refused = refusals(question.mechanism, question.problem, solution)
    return {"": "; ".join(solution.notes), **{quantity: one.what for one in refused for quantity in one.quantities}}


def _estimate(solution: Solution, quantity: str) -> float:
    """Return the largest error that the engine estimates for a quantity; 0 without an estimate."""
    return solution.errors[quantity].largest if quantity in solution.errors else 0.0


def _time(solution: Solution) -> float:
    if solution.cost is not None:
        return solution.cost.wall_s
    return sum(timing.min_s for timing in solution.timings)


SCENE = "3ups-upu-s"
#: Poses (a, b) [rad] without symmetry, and rates and accelerations for which inertial forces are as large as weights.
POSES = np.array([[0.1, 0.05], [-0.15, 0.12], [0.2, -0.1]])
RATES = np.array([[7.0, 4.0], [5.0, -8.0], [-3.0, 6.0]])
ACCELERATIONS = np.array([[-30.0, 90.0], [70.0, 20.0], [-100.0, -50.0]])

ENGINES = ("screw", "pinocchio", "mujoco")
QUANTITIES = ("joint_acceleration", "com_acceleration", "generalized_force", "actuator_force", "reaction")
#: Quantities that the judge needs and that the truth provides.
JUDGED = tuple(name for name in GIVEN if not name.startswith("tree_force"))

TIMES = (0.5, 1.0, 2.5)  # instants of the default scene [s]
ACCELERATION = "joint_acceleration"
SCREW = Method("screw")


def exact_text(value: float) -> str:
    """Format all digits of a float64, so that readers of the exact string get the same number as all other readers."""
    return format(Decimal(float(value)), "f")


def scene_in_motion(scene: Scene, quick: bool) -> Scene:
    """Return the scene at the poses, rates and accelerations of this module; if `quick`, only at the first pose."""
    return scene_at(scene, *(array[: 1 if quick else None] for array in (POSES, RATES, ACCELERATIONS)))


def scene_at(scene: Scene, y: Array, yd: Array | None = None, ydd: Array | None = None) -> Scene:
    """Return the scene at given states, one second apart, with the same doubles for every engine.

    Args:
        y, yd, ydd: Independent coordinates and derivatives; zero by default. Shape (n, k).
    """
    zero, t = np.zeros_like(y), np.arange(len(y), dtype=float)
    rates, seconds = (zero.copy() if array is None else array for array in (yd, ydd))
    motion = GivenMotion(t, y.copy(), rates, seconds)
    return replace(scene, task=motion)


def compare(
    scene: Scene,
    folder: Path,
    *,
    engines: tuple[str, ...] = ENGINES,
    quantities: tuple[str, ...] = QUANTITIES,
    setting: str = "",
    cause: str = "",
) -> Question:
    """Pose a given motion to engines, without reference values if the truth lacks a sample.

    Args:
        setting: Suffix of the names of engines.
        cause: Cause of a silent error of an engine other than our own.
    """
    write_models(scene.mechanism, folder, gravity=scene.applied.g)
    methods = tuple(Method(name, label=f"{name} {setting}".strip()) for name in engines)
    truth = solve(scene, (TRUTH,), quantities)[0].get(TRUTH)
    known = truth is not None and truth.rows is None
    right = Reference.by_size(TRUTH, scene.mechanism, truth.values) if truth is not None and known else UNKNOWN
    question = pose_question(scene, folder, scene.problem(quantities if known else JUDGED), methods, quantities, right)
    return replace(question, cause=cause)


def loaded_scene(folder: Path) -> PreparedScene:
    """Pose the default scene with its load at three instants."""
    return pose_scene(load_scene(SCENE).at(TIMES), folder, samples=len(TIMES))


def push(posed: PreparedScene, *methods: Method) -> Question:
    """Ask `screw` for accelerations of all joints, and other methods for accelerations of tree joints."""
    mechanism = posed.scene.mechanism
    names = mechanism.coordinates if methods[:1] == (SCREW,) else tree_coordinates(mechanism)
    values = {ACCELERATION: posed.reference.values[ACCELERATION].pick(names)}
    right = replace(posed.reference, values=values)  # the scales remain those of all joints
    return pose_question(posed.scene, posed.folder, posed.acceleration_problem(names), methods, (ACCELERATION,), right)


def tree_coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the coordinates of the tree in the engines' model files with the minimal cut."""
    return loops_of(mechanism, "minimal").tree


def closure_residuals(motion: TreeMotion[MechanismTree]) -> tuple[Array, Array]:
    """Return the distances [m] and velocities [m/s] between the points that close the loops, child minus parent."""
    tree = motion.tree
    closures = loops_of(tree.mechanism, "minimal").closures
    parent, child = (
        motion.links.frames(
            stack_frames([tree.fix(getattr(c, side), Frame(x)) for c in closures for x in getattr(c, f"{side}_points")])
        )
        for side in ("parent", "child")
    )
    return child.p - parent.p, child.v - parent.v


def true_velocities(posed: PreparedScene) -> ClosedMotion:
    """Compute closed poses and velocities with `screw`."""
    lay, motion = layout(posed.scene.mechanism), posed.scene.motion
    return motion_at(lay, positions(lay, motion.y, motion.t), motion.yd)


def loop_condition(at: ClosedMotion) -> float:
    """Return the largest condition number of the closed loops."""
    return float(at.condition.max())
