"""Accelerations of the loaded default scene from its true actuator forces, engine by engine."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path
from time import perf_counter

from screwgauge.reference import linear
from screwgauge.reference.forward import Forces, forward_dense
from screwgauge.reference.kinematics import Velocities, positions, velocities
from screwgauge.reference.pose import Layout, layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.study.bench.case import Case, make_case
from screwgauge.study.bench.projection import Given, given
from screwgauge.study.bench.score import score
from screwgauge.study.stress.case import GOOD, Finding

TIMES = (0.5, 1.0, 2.5)  # [s] of the default scene
ACCELERATION = "joint_acceleration"


@lru_cache(maxsize=1)
def loaded() -> Case:
    """The default scene at three instants with its reference values, and Pinocchio's tree loaded."""
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        case = make_case(load_scene("3ups-upu-s").at(TIMES), Path(folder), samples=len(TIMES), quick=True)
        pinocchio_given(case)
    return case


def pinocchio_given(case: Case) -> Given:
    """Pinocchio's tree with the true motion."""
    from screwgauge.study.bench.contestants_pinocchio import load

    found: Given = case.share("pinocchio forward", lambda: given(case, *load(case)))
    return found


def motion(case: Case) -> tuple[Layout, Velocities]:
    """Poses and rates by `screw`."""
    lay, given_motion = layout(case.scene.mechanism), case.scene.motion
    return lay, velocities(lay, positions(lay, given_motion.y, given_motion.t), given_motion.yd)


def screw(case: Case) -> Finding:
    """What `screw` makes of it."""
    clock = perf_counter()
    lay, rate = motion(case)
    loads = [(load.body, load.point, load.force, load.torque) for load in case.scene.loads]
    actuators = case.reference.values["actuator_force"].array
    found = forward_dense(lay, rate, Forces(actuators, gravity=case.scene.gravity, loads=loads)).qdd
    seconds = perf_counter() - clock
    names = case.scene.mechanism.coordinates
    return finding(case, "screw", names, found, seconds=seconds, condition=float(linear.condition(rate.A).max()))


def finding(
    case: Case,
    label: str,
    coordinates: tuple[str, ...],
    found: Array,
    *,
    seconds: float,
    condition: float,
    cause: str = "",
    admitted: float = GOOD,
) -> Finding:
    """Error of joint accelerations.

    Args:
        found: Of some coordinates. Shape (n, m).
        cause: The reason given if the error is larger than a result without warning may have.
    """
    outcome = case.outcome(ACCELERATION, found, coordinates)
    error = score(outcome, case.reference.values[ACCELERATION], case.scales[ACCELERATION]).max_scaled
    reason = cause if error > GOOD else ""
    return Finding(label, ACCELERATION, error, admitted, condition, seconds, reason)
