"""Questions for benches: the motion of a scene, its true states, or a modified motion.

Each question is a function of scene, engine and wanted quantities. Additional arguments are bound by
`functools.partial`, so that questions can be pickled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from screwgauge.models.generate import write_models
from screwgauge.models.layout import lay_out
from screwgauge.models.mjcf import PARTS
from screwgauge.problem import GivenMotion, Integration, ModelFiles, Problem, Rows
from screwgauge.quantities import GIVEN
from screwgauge.reference.errors import DescriptionError
from screwgauge.solution import Values
from screwgauge.study.linkages import four_bar_states, write_four_bar
from screwgauge.study.methods import Method
from screwgauge.study.reference_values import PreparedScene, Reference, reference_values, sizes
from screwgauge.study.solving import model_files

ALL_PARTS = "all of them"
EDGE = 2  # number of samples at each end at which np.gradient, applied twice, is one-sided


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """Problems for one model, with reference values.

    Attributes:
        problems: Problems that one model solves in turn.
        n_sample: Number of samples that the answers deliver.
        reference: Values with which the answers are compared.
        rows: Samples of the joined answers for which the reference has values; all by default.
    """

    files: ModelFiles
    problems: tuple[Problem, ...]
    n_sample: int
    reference: Reference
    rows: Rows | None = None


Question = Callable[[PreparedScene, str, Sequence[str]], Trial]


def motion(posed: PreparedScene, engine: str, wanted: Sequence[str], *, whole: bool = False) -> Trial:
    """Pose the prescribed motion. `whole`: at all times of the scene, not only at the times of comparison."""
    task = (posed.whole if whole else posed.scene).motion
    rows = np.searchsorted(task.t, posed.t)
    return Trial(posed.files(engine), (posed.problem(*wanted, task=task),), len(task), posed.reference, rows)


def single_samples(posed: PreparedScene, engine: str, wanted: Sequence[str]) -> Trial:
    """Pose one problem for each sample of the prescribed motion."""
    tasks = [posed.scene.motion.part(slice(i, i + 1)) for i in range(len(posed.t))]
    problems = tuple(posed.problem(*wanted, task=task) for task in tasks)
    return Trial(posed.files(engine), problems, len(tasks), posed.reference)


def true_states(
    posed: PreparedScene, engine: str, wanted: Sequence[str], *, pushed: bool = False, bare: bool = False
) -> Trial:
    """Pose the question for actuator forces along the true motion of a tree.

    Args:
        pushed: Ask for accelerations under the true forces instead.
        bare: Ask for forces along the tree coordinates instead.
    """
    return Trial(posed.files(engine), (_on_tree(posed, pushed, bare),), len(posed.t), posed.reference)


@lru_cache(maxsize=3)
def _on_tree(posed: PreparedScene, pushed: bool, bare: bool) -> Problem:
    """Return the problem of `true_states`, cached because many methods share it."""
    mechanism = posed.scene.mechanism
    tree = lay_out(mechanism, "minimal").coordinates
    coordinates = tuple(name for name in mechanism.coordinates if name in tree)
    if pushed:
        return posed.acceleration_problem(coordinates)
    return posed.problem("tree_force" if bare else "actuator_force", task=posed.states(coordinates))


def four_bar(posed: PreparedScene, engine: str, wanted: Sequence[str]) -> Trial:
    """Pose the question for accelerations of a four-bar, whose closing rows are redundant."""
    folder, (problem, right) = posed.folder / "four-bar", four_bar_states(len(posed.t))
    folder.mkdir(exist_ok=True)
    reference = Reference("closed form", dict.fromkeys(wanted, right), "", dict.fromkeys(wanted, sizes(right)))
    return Trial(write_four_bar(folder), (problem,), len(posed.t), reference)


def difference(posed: PreparedScene, engine: str, wanted: Sequence[str], *, part: float, ends: bool = False) -> Trial:
    """Pose the motion at evenly spaced times for numerical differentiation.

    Args:
        part: Approximate step, as a fraction of the duration.
        ends: Compare only the samples at the ends, where differences are one-sided.

    Raises:
        DescriptionError: The times of comparison are not evenly spaced.
    """
    t, reference = posed.t, posed.reference
    if len(t) < 3 or not np.allclose(np.diff(t), t[1] - t[0], rtol=1e-9):
        raise DescriptionError(
            "the compared times are not evenly spaced", "finite differences", "use an evenly spaced grid"
        )
    duration = float(t[-1] - t[0])
    fine = max(1, round((t[1] - t[0]) / (part * duration)))
    n = fine * (len(t) - 1)
    grid = t[0] + np.arange(n + 1) * (duration / n)
    if ends:
        rows = np.r_[0:EDGE, n + 1 - EDGE : n + 1]
        values = reference_values(posed.whole, grid[rows], wanted).values
    else:
        rows = np.arange(len(t)) * fine
        inner = (rows >= EDGE) & (rows < n + 1 - EDGE)
        rows, values = rows[inner], {name: reference.values[name].at(inner) for name in wanted}
    problem = posed.problem(*wanted, task=posed.whole.moved(grid))
    return Trial(posed.files(engine), (problem,), len(rows), replace(reference, values=values), rows)


def speed_up(posed: PreparedScene, engine: str, wanted: Sequence[str], *, speed: float) -> Trial:
    """Pose the motion through the same poses at a different speed."""
    task, reference = posed.scene.motion, posed.reference
    task = GivenMotion(task.t, task.y, speed * task.yd, speed**2 * task.ydd)
    # all velocity terms are quadratic: s times the speed at the same poses yields s^2 times the accelerations
    like = {name: reference.values[name] for name in wanted}
    right = {name: Values(v.components, v.units, speed**2 * v.array) for name, v in like.items()}
    problem = posed.problem(*wanted, task=task)
    return Trial(posed.files(engine), (problem,), len(task), replace(reference, values=right))


def step(posed: PreparedScene, engine: str, wanted: Sequence[str], *, part: float, halves: bool = False) -> Trial:
    """Pose the motion at the steps of a method that starts from the first pose.

    Args:
        part: Step, as a fraction of the duration.
        halves: Also include the times halfway between steps.
    """
    t, parts = posed.t, 2 if halves else 1
    step, n = part * float(t[-1] - t[0]), int((1 + 1e-12) / part)
    grid = t[0] + np.arange(parts * n + 1) * (step / parts)
    rows = np.minimum(np.rint((t - t[0]) / step).astype(int), n)
    met = np.abs(grid[::parts][rows] - t) <= 1e-9 * max(1.0, abs(t[-1]))
    reference = replace(posed.reference, values={name: posed.reference.values[name].at(met) for name in wanted})
    problem = posed.problem(*wanted, task=posed.whole.moved(grid))
    # the method returns the times of comparison, whatever the number of steps between them
    return Trial(posed.files(engine), (problem,), len(t), reference, rows[met])


def simulation(
    posed: PreparedScene, engine: str, wanted: Sequence[str], *, method: str = "", rtol: float = 0.0
) -> Trial:
    """Pose a simulation from the start; the wanted observables follow from the joint coordinates.

    Args:
        method, rtol: Method of scipy, and its tolerances rtol = atol; by default, as in the scene.
    """
    task = posed.scene.start
    if method:
        task = replace(task, integration=Integration(method, rtol, rtol, task.integration.near))
    problem = posed.problem("joint_position", "joint_velocity", "joint_acceleration", task=task)
    return Trial(posed.files(engine), (problem,), len(task), posed.reference)


def omit(
    posed: PreparedScene,
    engine: str,
    wanted: Sequence[str],
    *,
    computed: Sequence[str] = GIVEN,
    absent: str = "",
    part: str = "",
) -> Trial:
    """Pose the prescribed motion without a quantity or force, for comparison with the engine's own full answer.

    Args:
        computed: Quantities to compute.
        absent: Force to omit, ``gravity`` or ``load``; empty for none.
        part: Part to add to the model file although mechanics does not need it; empty for none.
    """
    problem, folder, scene = posed.problem(*computed), posed.folder, posed.scene
    if absent == "gravity":
        problem = replace(problem, applied=replace(problem.applied, gravity=np.zeros(3)))
    if absent == "load":
        problem = replace(problem, applied=replace(problem.applied, loads=()))
    if part:
        folder = folder / f"with-{part}"
        include = frozenset(PARTS) if part == ALL_PARTS else frozenset({part})
        write_models(scene.mechanism, folder, gravity=scene.applied.g, include=include)
    whole = _all_values(posed, engine.removesuffix("-full"))
    return Trial(model_files(scene, engine, folder), (problem,), len(posed.t), whole)


@lru_cache(maxsize=3)
def _all_values(posed: PreparedScene, engine: str) -> Reference:
    """Return an engine's values of all quantities of a scene, scaled by the largest magnitude of each unit."""
    values = Method(engine).load(posed.files(engine)).solve(posed.problem(*GIVEN)).values
    scales = {name: {unit: size or 1.0 for unit, size in sizes(has).items()} for name, has in values.items()}
    return Reference(engine, values, "", scales)
