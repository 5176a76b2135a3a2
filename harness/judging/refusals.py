"""Samples at which an engine gives no number, and which singularity is the reason, by the description alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.problem import Rows
from screwgauge.quantities import QUANTITIES
from screwgauge.reference import linear
from screwgauge.reference.closing import make_closing
from screwgauge.reference.kinematics import positions
from screwgauge.reference.pose import layout
from screwgauge.reference.rotations import Array
from screwgauge.reference.singular import chart_lock, near_singularity
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution

#: Condition number above which a singularity of the pose, or of a chart, is near enough to be what was met.
NEAR = 1e8
SHOWN = 5


@dataclass(frozen=True, slots=True, eq=False)
class Refusal:
    """Quantities of one engine that are refused at some samples for one reason.

    Attributes:
        rows: The samples. Shape (n,).
        what: What is singular there, without a full stop.
        sentence: The same with pose, times and what is missing.
    """

    engine: str
    quantities: tuple[str, ...]
    rows: Rows
    what: str
    sentence: str


def refusals(scene: Scene, solution: Solution) -> tuple[Refusal, ...]:
    """All samples that an engine solved without giving every number, with their reasons."""
    groups: dict[tuple[int, ...], list[str]] = {}
    for quantity in (name for name in QUANTITIES if name in solution.values):
        values = solution.values[quantity]
        missing = np.asarray(~np.isfinite(values.array).all(axis=1))
        # an engine that says nothing of its conditioning has refused nothing: what it lacks is its own fault
        missing &= ~(solution.conditions.get(quantity, np.zeros(1)) <= linear.SINGULAR)
        if missing.any():
            groups.setdefault(tuple(np.flatnonzero(missing).tolist()), []).append(quantity)
    return tuple(
        _refusal(scene, solution.engine, tuple(quantities), np.array(rows)) for rows, quantities in groups.items()
    )


def _refusal(scene: Scene, engine: str, quantities: tuple[str, ...], rows: Rows) -> Refusal:
    motion = scene.motion
    what = _reason(scene, quantities, motion.y[rows[0]])
    times = ", ".join(f"{t:.6g}" for t in motion.t[rows[:SHOWN]]) + (", ..." if len(rows) > SHOWN else "")
    pose = scene.mechanism.described(motion.y[rows[0]])
    sentence = (
        f"{what} at {len(rows)} of {len(motion)} samples (t = {times} s; first at {pose}): "
        f"{', '.join(quantities)} not given there"
    )
    return Refusal(engine, quantities, rows, what, sentence)


def _reason(scene: Scene, quantities: tuple[str, ...], y: Array) -> str:
    lay = layout(scene.mechanism)
    at = positions(lay, y[None], np.zeros(1))
    system = make_closing(lay)
    if not linear.condition(system.matrix(at))[0] < NEAR:
        return near_singularity(lay, at)
    charts = system.readers(at)[1][0]
    if charts.size and not charts.max() < NEAR:
        return chart_lock(lay, int(np.argmax(np.where(np.isnan(charts), np.inf, charts))))
    if scene.rule != "min_norm" and all(QUANTITIES[name].ruled for name in quantities):
        return f"rule {scene.rule} is singular"
    return f"the equations of {', '.join(quantities)} are singular"
