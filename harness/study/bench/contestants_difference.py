"""What shortcuts cost: differentiating positions numerically, and forgetting Jdot v."""

from __future__ import annotations

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.kinematics import closure_system, positions
from screwgauge.reference.pose import layout
from screwgauge.reference.rotations import Array
from screwgauge.solution import Values
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestant import Contestant, Outcome, Task
from screwgauge.study.bench.reference import reference_values

#: Steps as parts of the motion's duration: 1e-3 s to 5e-2 s on a scene of 10 s.
PARTS = (1e-4, 2e-4, 5e-4, 1e-3, 2.5e-3, 5e-3)
EDGE = 2  # samples at each end where np.gradient, applied twice, is one-sided
SPEEDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
_ORDER = {"joint_velocity": 1, "joint_acceleration": 2}


def interior(quick: bool) -> list[Contestant]:
    """Central differences of positions, away from the ends of the trajectory."""
    return [_difference(part, quantity, False) for quantity in _ORDER for part in _parts(quick)]


def ends(quick: bool) -> list[Contestant]:
    """The same at the two samples at each end, where the differences are one-sided."""
    return [_difference(part, "joint_acceleration", True) for part in _parts(quick)]


def _parts(quick: bool) -> tuple[float, ...]:
    return PARTS[1:] if quick else PARTS


def _difference(part: float, quantity: str, at_ends: bool) -> Contestant:
    times = "once" if _ORDER[quantity] == 1 else "twice"
    where = "the two samples at each end" if at_ends else "interior"
    return Contestant(
        f"step = {part:g} of the duration, {where}",
        (quantity,),
        f"from y: positions of every step of the trajectory, np.gradient {times}",
        lambda case: _task(case, part, quantity, at_ends),
        series="ends" if at_ends else "interior",
        parameter=("step / duration", part),
        label=f"{part:g} T",
        drawn=not at_ends,
    )


def _grid(case: Case, part: float) -> tuple[Array, Array, float]:
    """Times in steps of about that part of the duration, the rows of the compared times among them, and the step."""
    t = case.times
    if len(t) < 3 or not np.allclose(np.diff(t), t[1] - t[0], rtol=1e-9):
        raise DescriptionError("the compared times are not evenly spread", "finite differences", "give an even grid")
    duration = float(t[-1] - t[0])
    fine = max(1, round((t[1] - t[0]) / (part * duration)))
    n = fine * (len(t) - 1)
    return t[0] + np.arange(n + 1) * (duration / n), np.arange(len(t)) * fine, duration / n


def _task(case: Case, part: float, quantity: str, at_ends: bool) -> Task:
    grid, rows, step = _grid(case, part)
    motion, lay = case.whole.at(grid).motion, layout(case.scene.mechanism)

    def call() -> Array:
        q = positions(lay, motion.y, motion.t).q
        for _ in range(_ORDER[quantity]):
            q = np.gradient(q, step, axis=0)
        return q

    if at_ends:
        rows = np.r_[0:EDGE, len(grid) - EDGE : len(grid)]
        reference = reference_values(case.whole, grid[rows], (quantity,)).values[quantity]
    else:
        inner = (rows >= EDGE) & (rows < len(grid) - EDGE)
        rows, like = rows[inner], case.reference.values[quantity]
        reference = Values(like.components, like.units, like.array[inner])

    def read(array: Array) -> dict[str, Outcome]:
        return {quantity: Outcome(Values(reference.components, reference.units, array[rows]), reference)}

    return Task(call, read, len(rows))


def missing_jdotv(quick: bool) -> list[Contestant]:
    """Accelerations from the loops without their velocity terms, at several speeds through the same poses."""

    def make(speed: float) -> Contestant:
        return Contestant(
            f"speed x {speed:g}, error against the largest acceleration at speed x 1",
            ("joint_acceleration",),
            "from y and its derivatives: positions, rates, A a = [0; ydd]; all samples at once",
            lambda case: _without(case, speed),
            parameter=("speed", speed),
            label="Jdot v left out",
            drawn=speed == 1.0,
        )

    return [make(speed) for speed in SPEEDS]


def _without(case: Case, speed: float) -> Task:
    lay, motion = layout(case.scene.mechanism), case.scene.motion
    yd, ydd = speed * motion.yd, speed**2 * motion.ydd

    def call() -> Array:
        A = closure_system(lay, positions(lay, motion.y, motion.t))
        right = np.concatenate([np.zeros((len(yd), A.shape[1] - yd.shape[1])), ydd], axis=1)
        return linear.solve(A, right[..., None])[..., 0]

    name = "joint_acceleration"
    like = case.reference.values[name]
    # all velocity terms are quadratic: at the same poses, s times the speed makes s^2 times the accelerations
    reference = Values(like.components, like.units, speed**2 * like.array)

    def read(array: Array) -> dict[str, Outcome]:
        return {name: Outcome(Values(like.components, like.units, array), reference)}

    return Task(call, read, len(yd))
