"""Our own solver: its parts, its precisions, and per sample against whole trajectory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from screwgauge.engines.screw.inverse import solve_layout
from screwgauge.problem import Motion
from screwgauge.reference import dynamics
from screwgauge.reference.chains import closed_form
from screwgauge.reference.continuation import Evaluation, corrector, follow, newton
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.kinematics import accelerations, closure_system, velocities
from screwgauge.reference.pose import Layout, layout, pose
from screwgauge.reference.precision import in_precision
from screwgauge.reference.rotations import Array
from screwgauge.solution import Values
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestant import NOTHING, QUANTITIES, Contestant, Outcome, Task, count

_FROM_Y = "from y and its derivatives"


def floor(quick: bool) -> list[Contestant]:
    """An empty loop over the samples: what the clock and a Python loop cost by themselves."""

    def prepare(case: Case) -> Task:
        n = len(case.times)

        def call() -> None:
            for _ in range(n):
                pass

        return Task(call, lambda _: {}, n)

    return [
        Contestant("empty loop", (NOTHING,), "a Python loop over the samples that does nothing", prepare, drawn=False)
    ]


def closed(quick: bool) -> list[Contestant]:
    """Positions in closed form, never corrected, and all that follows from them."""

    def make(quantity: str) -> Contestant:
        return Contestant(
            "whole trajectory, no Newton step",
            (quantity,),
            f"{_FROM_Y}: closed form, then all samples at once",
            lambda case: _pipeline(case, quantity, np.float64, _closed),
            label="closed form",
        )

    return [make(quantity) for quantity in QUANTITIES]


def single(quick: bool) -> list[Contestant]:
    """The same in single precision from the first operation to the last."""

    def make(quantity: str) -> Contestant:
        return Contestant(
            "whole trajectory, all arrays float32",
            (quantity,),
            f"{_FROM_Y}: closed form (Newton where that leaves gaps), then all samples at once",
            lambda case: _pipeline(case, quantity, np.float32, _closed_or_mended),
            label="float32",
        )

    return [make(quantity) for quantity in QUANTITIES]


def newton_closed(quick: bool) -> list[Contestant]:
    """Positions by Newton's method on the loops, from predictions along the path; so many steps."""

    def make(quantity: str, steps: int) -> Contestant:
        name = count(steps, "Newton step") if steps < 60 else "Newton to rounding"
        return Contestant(
            f"whole trajectory, {name} after the prediction",
            (quantity,),
            f"{_FROM_Y}: path from home, Newton, then all samples at once",
            lambda case: _pipeline(case, quantity, np.float64, lambda lay, motion: _newton(lay, motion, steps)),
            label="converged" if steps == 60 else count(steps, "step"),
        )

    return [make(quantity, steps) for quantity in QUANTITIES for steps in (0, 1, 2, 60)]


def trajectory(quick: bool) -> list[Contestant]:
    """The engine `screw` on all samples at once: the compared ones, and all of the scene."""

    def make(quantity: str, whole: bool) -> Contestant:
        def prepare(case: Case) -> Task:
            motion = case.whole.motion if whole else case.scene.motion
            rows = np.searchsorted(motion.t, case.times)
            problem, lay = case.problem("screw", (quantity,), motion), layout(case.scene.mechanism)

            def read(values: Values) -> dict[str, Outcome]:
                return {quantity: case.outcome(quantity, values.array[rows])}

            return Task(lambda: solve_layout(problem, lay).values[quantity], read, len(motion))

        times = "all samples of the scene" if whole else "the compared samples"
        covers = f"{_FROM_Y}: the engine screw, model loaded"
        label = "all samples" if whole else "trajectory"
        return Contestant(f"whole trajectory, {times}", (quantity,), covers, prepare, label=label)

    return [make(quantity, whole) for quantity in QUANTITIES for whole in ((False,) if quick else (False, True))]


def per_sample(quick: bool) -> list[Contestant]:
    """The engine `screw` called for one sample after the other."""

    def make(quantity: str) -> Contestant:
        def prepare(case: Case) -> Task:
            lay, motion = layout(case.scene.mechanism), case.scene.motion
            problems = [case.problem("screw", (quantity,), motion.part(slice(i, i + 1))) for i in range(len(motion))]

            def call() -> list[Array]:
                return [solve_layout(problem, lay).values[quantity].array[0] for problem in problems]

            return Task(call, lambda rows: {quantity: case.outcome(quantity, np.array(rows))}, len(motion))

        covers = f"{_FROM_Y}: the engine screw, one call a sample, model loaded"
        return Contestant("one sample at a time", (quantity,), covers, prepare, label="per sample")

    return [make(quantity) for quantity in QUANTITIES]


Positions = Callable[[Layout, Motion], Array]


def _closed(lay: Layout, motion: Motion) -> Array:
    q = closed_form(lay, motion.y)
    if q is None:
        raise ClosureError("no closed form", "this mechanism", "its chains are not all of the kinds U-P-U and U-P-S")
    return q


def _closed_or_mended(lay: Layout, motion: Motion) -> Array:
    q = _closed(lay, motion)
    if np.abs(pose(lay, q).residual).max() <= 64 * np.finfo(q.dtype).eps:
        return q
    return newton(_closing(lay), q, motion.y, most=5)[0]


def _newton(lay: Layout, motion: Motion, most: int) -> Array:
    evaluate, home = _closing(lay), lay.mechanism.home
    start = follow(corrector(evaluate), home, home[lay.mechanism.independent_columns], motion.y, motion.t)
    return newton(evaluate, start, motion.y, most=most)[0] if most else start


def _closing(lay: Layout) -> Evaluation:
    """Closing errors and their derivative."""
    columns = lay.mechanism.independent_columns

    def evaluate(q: Array, goal: Array) -> tuple[Array, Array]:
        at = pose(lay, q)
        return np.concatenate([at.residual.reshape(len(q), -1), q[:, columns] - goal], axis=1), closure_system(lay, at)

    return evaluate


def _pipeline(case: Case, quantity: str, dtype: Any, positions: Positions) -> Task:
    """Positions as given, then the solver as far as the quantity needs it, in one precision."""
    lay = layout(in_precision(case.scene.mechanism, dtype))
    motion = Motion(*(getattr(case.scene.motion, name).astype(dtype) for name in ("t", "y", "yd", "ydd")))
    gravity = case.scene.gravity.astype(dtype)
    loads = [
        (
            x.body,
            None if x.point is None else x.point.astype(dtype),
            x.force.astype(dtype),
            x.torque.astype(dtype),
        )
        for x in case.scene.loads
    ]

    def call() -> Array:
        q = positions(lay, motion)
        return q if quantity == QUANTITIES[0] else beyond(lay, q, motion, gravity, loads, quantity)

    def read(array: Array) -> dict[str, Outcome]:
        if array.dtype != dtype:
            raise TypeError(f"computed in {array.dtype}, not in {np.dtype(dtype)}")
        return {quantity: case.outcome(quantity, array)}

    return Task(call, read, len(motion))


def beyond(lay: Layout, q: Array, motion: Motion, gravity: Array, loads: list[Any], quantity: str) -> Array:
    """Joint rates, accelerations or actuator forces (minimum norm) from joint positions."""
    at = pose(lay, q)
    rate = velocities(lay, at, motion.yd)
    if quantity == "joint_velocity":
        return rate.w
    beta, screws = accelerations(lay, rate, motion.ydd)
    if quantity == "joint_acceleration":
        return beta
    moving = dynamics.body_motion(lay, at, rate.V, screws)
    F, T = dynamics.required_wrench(lay, at, moving, gravity, loads)
    Q = dynamics.generalized_force(lay, rate, moving, F, T)
    return dynamics.min_norm(rate.K[:, lay.mechanism.actuated_columns], Q)
