"""Accelerations of the loaded default scene with stiff springs whose force the actuators take over."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter

import numpy as np

from screwgauge.models.loops import loops_of
from screwgauge.reference import linear
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.forward import Forces, forward_dense, inertia_matrix
from screwgauge.reference.rotations import Array
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestants_mujoco import forward_call, soften, with_equality
from screwgauge.study.bench.contestants_pinocchio import contacts
from screwgauge.study.bench.contestants_pinocchio import forward as pinocchio_call
from screwgauge.study.bench.projection import Given, given
from screwgauge.study.stress.case import GOOD, Finding
from screwgauge.study.stress.driven.loaded import ACCELERATION, finding, loaded, motion, pinocchio_given
from screwgauge.study.stress.driven.mujoco_steps import add_springs, load_tree
from screwgauge.study.stress.stiff.springs import leg_springs

PASSES = 6  # of refinement: the softness is not what is looked at here
SAFETY = 8.0  # roundings of a spring's force: of its length, of product and sum, in both directions


def climb(stiffness: float) -> Iterator[Finding]:
    """Every engine for the same motion; springs and the actuators that undo them know each length only to eps."""
    case = loaded()
    springs = leg_springs(case.scene.mechanism, stiffness)
    extra = _undone(case, springs)
    admitted = _admitted(case, springs)
    words = f"spring forces are known to eps times stiffness times length: {admitted:.1e} is admitted"
    ways = {"screw": _screw, "pinocchio": _pinocchio, "mujoco": _mujoco}
    condition = float(linear.condition(motion(case)[1].A).max())
    for engine, way in ways.items():
        coordinates, found, seconds = way(case, springs, extra)
        yield finding(
            case,
            engine,
            coordinates,
            found,
            seconds=seconds,
            condition=condition,
            cause=words,
            admitted=admitted,
        )


_Found = tuple[tuple[str, ...], Array, float]


def _undone(case: Case, springs: tuple[JointSpring, ...]) -> Array:
    """Actuator forces that take over what the springs exert on the true motion. Shape (n, n_spring)."""
    names = tuple(spring.coordinate for spring in springs)
    q, v, _ = case.given(names)
    k, c, rest = (np.array([getattr(s, key) for s in springs]) for key in ("stiffness", "damping", "rest"))
    return np.asarray(k * (q - rest) + c * v)


def _admitted(case: Case, springs: tuple[JointSpring, ...]) -> float:
    """Scaled error of joint accelerations that the rounding of the springs' lengths and rates may cause."""
    lay, rate = motion(case)
    q, v, _ = case.given(tuple(spring.coordinate for spring in springs))
    spring = springs[0]
    force = SAFETY * linear.EPS * float((spring.stiffness * np.abs(q) + spring.damping * np.abs(v)).max())
    columns = [lay.mechanism.coordinates.index(s.coordinate) for s in springs]
    moved = np.linalg.solve(inertia_matrix(lay, rate), rate.K[:, columns].swapaxes(1, 2))
    joints = force * np.abs(rate.K @ moved).sum(axis=2).max(axis=0)
    like = case.reference.values[ACCELERATION]
    scale = np.array([case.scales[ACCELERATION][unit] for unit in like.units])
    return max(GOOD, float((joints / scale).max()))


def _screw(case: Case, springs: tuple[JointSpring, ...], extra: Array) -> _Found:
    clock = perf_counter()
    lay, rate = motion(case)
    loads = [(load.body, load.point, load.force, load.torque) for load in case.scene.loads]
    actuators = case.reference.values["actuator_force"].array + extra
    forces = Forces(actuators, gravity=case.scene.gravity, loads=loads, springs=springs)
    found = forward_dense(lay, rate, forces).qdd
    return case.scene.mechanism.coordinates, found, perf_counter() - clock


def _with(start: Given, springs: tuple[JointSpring, ...], extra: Array, *, explicit: bool) -> Given:
    """What acts on a tree with the further actuator forces, and with the springs' where the engine has no springs."""
    tau = start.load.copy()
    for k, spring in enumerate(springs):
        column = start.tree.coordinates.index(spring.coordinate)
        tau[:, column] += extra[:, k]
        if explicit:
            q, v = start.q[:, column], start.v[:, column]
            tau[:, column] -= spring.stiffness * (q - spring.rest) + spring.damping * v
    return replace(start, load=tau)


def _pinocchio(case: Case, springs: tuple[JointSpring, ...], extra: Array) -> _Found:
    import pinocchio as pin

    start = _with(pinocchio_given(case), springs, extra, explicit=True)
    settings = pin.ProximalSettings(0.0, 0.0, 1e-10, 5)
    call = pinocchio_call(start, *contacts(start), settings)
    clock = perf_counter()
    found = call()
    return start.tree.coordinates, found, perf_counter() - clock


def _mujoco(case: Case, springs: tuple[JointSpring, ...], extra: Array) -> _Found:
    tree = load_tree(case.scene)
    start = given(case, tree, loops_of(case.scene.mechanism, "minimal"))
    start = _with(start, springs, extra, explicit=False)
    soften(tree, 0.9999)
    add_springs(tree.model, springs)
    call = forward_call(*with_equality(start), start, PASSES)
    clock = perf_counter()
    found = call()
    return tree.coordinates, found, perf_counter() - clock
