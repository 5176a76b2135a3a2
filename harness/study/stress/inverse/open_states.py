"""States of the engines' open tree with the cut joints apart, and what the engines make of them."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.tree.closure import make_loops
from screwgauge.models.generate import write_models
from screwgauge.quantities import QUANTITIES as KNOWN
from screwgauge.reference import linear
from screwgauge.reference.forward import Forces, forward
from screwgauge.reference.kinematics import accelerations, positions, velocities
from screwgauge.reference.pose import layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution
from screwgauge.study.bench import contestants_mujoco as mj
from screwgauge.study.bench import contestants_pinocchio as pn
from screwgauge.study.bench.case import Case, pick, scales_of
from screwgauge.study.bench.projection import Given, closing_rows, given, loads_on_joints
from screwgauge.study.bench.reference import Reference
from screwgauge.study.bench.score import score
from screwgauge.study.run import solve
from screwgauge.study.stress.case import SILENT, Finding
from screwgauge.study.stress.inverse.measure import ENGINES, compared, still

#: Proximal settings that reach rounding on loops of full rank.
MU, ITERATIONS = 1e-10, 5
#: Baumgarte's gains: critically damped with the time constant of MuJoCo's default solref, 0.02 s.
KP, KD = 1.0 / 0.02**2, 2.0 / 0.02
HARD, PASSES = mj.STIFFEST, 7
FORWARD = "forward_acceleration"

_TAKEN = "the state is taken for a closed one: the answer is that of a mechanism pulled apart by the gap"
_SPRINGS = f"{_TAKEN}; springs on the gap make it smaller later, not the answer right"
_STIFF = "mj_inverse returns the force of its soft constraints: the gap times stiffness times apparent mass"
_SOFT = "soft constraints: (1 - d) / d of the constraint forces is missing, on closed states too"


@dataclass(frozen=True, slots=True, eq=False)
class OpenState:
    """Joint coordinates and rates of a tree. Shapes (n, n_v); y, yd: the independent ones among them, (n, k)."""

    coordinates: tuple[str, ...]
    q: Array
    v: Array
    y: Array
    yd: Array

    def given(self, closed: Given) -> Given:
        """The state in place of the true one; accelerations stay."""
        order = [self.coordinates.index(name) for name in closed.tree.coordinates]
        q = self.q[:, order]
        load = loads_on_joints(closed.case, closed.tree, closed.loops, q)
        return replace(closed, q=q, v=self.v[:, order], load=load)


def findings(scene: Scene, gap: float) -> Iterator[Finding]:
    """What engines make of states with cut joints apart by `gap` [m], drifting apart at `gap` [m/s].

    Args:
        scene: The closed states that are pulled apart.
    """
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        write_models(scene.mechanism, Path(folder), gravity=scene.gravity)
        state = pulled_apart(_case(scene, Path(folder), {}), gap)
        scene = still(scene, state.y, state.yd, scene.motion.ydd)
        exact = "truth" if find_spec("flint") else "screw"
        quantities = [name for name in KNOWN if not name.startswith("tree_force")]
        solutions, _ = solve(scene, (*ENGINES, exact), quantities)
        case = _case(scene, Path(folder), solutions[exact].values)
        for name in ENGINES:
            label = name if name == "screw" else f"{name} projected"
            for quantity in ("generalized_force", "actuator_force"):
                yield replace(compared(scene, solutions[name], solutions[exact], quantity), engine=label)
        yield _screw(case, solutions["screw"])
        yield from _pinocchio(case, solutions["pinocchio"], state)
        yield from _mujoco(case, solutions["mujoco"], state)


def _case(scene: Scene, folder: Path, values: Mapping[str, Any]) -> Case:
    reference = Reference("truth", values, "")
    return Case(scene, scene, folder, reference, scales_of(scene, reference), False)


def pulled_apart(case: Case, gap: float) -> OpenState:
    """Moves the tree's coordinates until the cut joints are apart, the independent coordinates being held."""
    tree, file = pn.load(case)
    loops = make_loops(tree, file)
    solutions, _ = solve(case.scene, ("screw",), ("joint_position", "joint_velocity"))
    q, v = (
        pick(solutions["screw"].values[name], tree.coordinates).array for name in ("joint_position", "joint_velocity")
    )
    k = len(loops.independent)
    wanted = _direction(loops.gaps(tree.poses(q)).shape, 0.3)
    hold = np.zeros((len(q), k))
    for _ in range(3):  # Newton's method
        left = gap * wanted - loops.gaps(tree.poses(q))
        A = closing_rows(tree, loops, q)
        q = q + linear.solve(A, np.concatenate([left, hold], axis=1)[..., None])[..., 0]
    A = closing_rows(tree, loops, q)
    drift = gap * _direction(wanted.shape, 1.1)
    v = linear.solve(A, np.concatenate([drift, case.scene.motion.yd], axis=1)[..., None])[..., 0]
    at = tree.poses(q)
    charts = loops.charts(at)
    y = [charts[joint].q[:, i] if column is None else q[:, column] for column, joint, i in loops.independent]
    return OpenState(tree.coordinates, q, v, np.stack(y, axis=1), (A[:, -k:] @ v[..., None])[..., 0])


def _direction(shape: tuple[int, ...], phase: float) -> Array:
    """A pattern without symmetry, its largest component one in every sample."""
    pattern = np.cos(phase + 1.7 * np.arange(np.prod(shape, dtype=int))).reshape(shape)
    return np.asarray(pattern / np.abs(pattern).max(axis=1, keepdims=True))


def _finding(case: Case, engine: str, quantity: str, array: Array, start: Given | None, reason: str) -> Finding:
    """Against the truth of the closed state; the reason is said where the answer is wrong."""
    known = "joint_acceleration" if quantity == FORWARD else quantity
    components = None if start is None or quantity != FORWARD else start.tree.coordinates
    outcome = case.outcome(known, array, components)
    error = score(outcome, case.reference.values[known], case.scales[known]).max_scaled
    finding = Finding(engine, quantity, error)
    return replace(finding, reason=reason) if finding.verdict == SILENT else finding


def _screw(case: Case, solution: Solution) -> Finding:
    """Our accelerations for the true actuator forces, at the poses that the independent coordinates give."""
    scene, lay = case.scene, layout(case.scene.mechanism)
    motion = scene.motion
    rate = velocities(lay, positions(lay, motion.y, motion.t), motion.yd)
    loads = [(load.body, load.point, load.force, load.torque) for load in scene.loads]
    forces = Forces(case.reference.values["actuator_force"].array, gravity=scene.gravity, loads=loads)
    response = forward(lay, rate, forces)
    qdd, _ = accelerations(lay, rate, response.ydd)
    found = _finding(case, "screw", FORWARD, qdd, None, "")
    estimate = float(np.max(solution.estimate.get("joint_acceleration", np.zeros(1))))
    return replace(found, condition=float(response.condition.max()), admitted=max(found.admitted, estimate))


def _closed(closed: Given, solution: Solution) -> Given:
    """An engine's own closed state."""
    names = closed.tree.coordinates
    q, v = (pick(solution.values[name], names).array for name in ("joint_position", "joint_velocity"))
    return replace(closed, q=q, v=v)


def _pinocchio(case: Case, solution: Solution, state: OpenState) -> Iterator[Finding]:
    closed = given(case, *pn.load(case))
    raw = state.given(closed)
    force = raw.actuator_forces(raw.tree.tree_force(raw.q, raw.v, raw.a))
    yield _finding(case, "pinocchio raw", "actuator_force", force, raw, _TAKEN)
    settings = pin.ProximalSettings(0.0, 0.0, MU, ITERATIONS)
    for engine, start, gains, cause in (
        ("pinocchio projected", _closed(closed, solution), None, ""),
        ("pinocchio raw", raw, None, _TAKEN),
        ("pinocchio raw Baumgarte", raw, (KP, KD), _SPRINGS),
    ):
        model, data, models, datas = pn.contacts(start)
        for contact in models:
            if gains is not None:
                contact.m_baumgarte_parameters.Kp, contact.m_baumgarte_parameters.Kd = gains
        array = pn.forward(start, model, data, models, datas, settings)()
        yield _finding(case, engine, FORWARD, array, start, cause)


def _mujoco(case: Case, solution: Solution, state: OpenState) -> Iterator[Finding]:
    tree, file = mj.load(case)
    closed = given(case, tree, file)
    raw = state.given(closed)
    force = raw.actuator_forces(tree.tree_force(raw.q, raw.v, raw.a))
    yield _finding(case, "mujoco raw", "actuator_force", force, raw, _TAKEN)
    for engine, d in (("mujoco raw", None), (f"mujoco raw d={HARD:g}", HARD)):
        tree, file = mj.load(case)
        if d is not None:
            mj.soften(tree, d)
        yield _soft_tree_force(engine, replace(closed, tree=tree), replace(raw, tree=tree))
        floor, found = (_accelerations(replace(one, tree=tree)) for one in (closed, raw))
        at_rest = _finding(case, engine, FORWARD, floor, closed, "").error
        finding = _finding(case, engine, FORWARD, found, raw, "")
        cause = _SOFT if at_rest > 0.5 * finding.error else _SPRINGS
        yield replace(finding, reason=cause if finding.verdict == SILENT else "")
    own = replace(_closed(closed, solution), tree=tree)  # with the hard constraints of the last turn
    yield _finding(case, "mujoco projected", FORWARD, _accelerations(own, PASSES), own, "")


def _accelerations(start: Given, passes: int = 0) -> Array:
    return mj.forward_call(*mj.with_equality(start), start, passes)()


def _soft_tree_force(engine: str, closed: Given, raw: Given) -> Finding:
    """`mj_inverse` with constraints on, against itself without them on the closed state: there they have no force."""
    tree = closed.tree
    right = tree.tree_force(closed.q, closed.v, closed.a)
    soft, _ = tree.soft_force(raw.q, raw.v, raw.a, np.zeros(3))
    slides = [i for i, name in enumerate(tree.coordinates) if name.endswith(".q3") and name != "s.q3"]
    error = 0.0
    for columns in (slides, [i for i in range(right.shape[1]) if i not in slides]):  # N, and N m
        scale = float(np.abs(right[:, columns]).max())
        error = max(error, float(np.abs(soft[:, columns] - right[:, columns]).max()) / scale)
    finding = Finding(engine, "tree_force", error)
    return replace(finding, reason=_STIFF) if finding.verdict == SILENT else finding
