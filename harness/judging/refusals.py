"""Samples at which an engine gives no number, and which singularity is the reason, by the description alone."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress

import numpy as np

from screwgauge.problem import GivenMotion, Problem, Rows
from screwgauge.quantities import QUANTITIES
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.equations.kinematics import pose
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import gimbal_lock, near_singularity
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution

#: Condition number above which a singular pose, or a gimbal lock, is near enough to be what was met.
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


def refusals(mechanism: Mechanism, problem: Problem, solution: Solution) -> tuple[Refusal, ...]:
    """All samples of a given motion that an engine solved without giving every number, with their reasons."""
    motion = problem.task
    if not isinstance(motion, GivenMotion):
        return ()
    groups: dict[tuple[tuple[int, ...], tuple[str, ...]], list[str]] = {}
    for quantity in (name for name in QUANTITIES if name in solution.values):
        lost = ~np.isfinite(solution.values[quantity].array)
        # an engine that says nothing of its conditioning has refused nothing: what it lacks is its own fault
        lost &= ~(solution.conditions.get(quantity, np.zeros(1)) <= linear.SINGULAR)[:, None]
        if lost.any():
            some = [bool(column.any()) for column in lost.T]
            part = () if all(some) else tuple(compress(solution.values[quantity].components, some))
            groups.setdefault((tuple(np.flatnonzero(lost.any(axis=1)).tolist()), part), []).append(quantity)
    refused = []
    for (rows, part), quantities in groups.items():
        first = motion.y[rows[0]]
        what = _reason(mechanism, problem.rule, quantities, first)
        t = ", ".join(f"{motion.t[i]:.6g}" for i in rows[:SHOWN]) + (", ..." if len(rows) > SHOWN else "")
        sentence = (
            f"{what} at {len(rows)} of {len(motion)} samples (t = {t} s; first at {mechanism.described(first)}): "
            f"{', '.join(quantities)}{' of ' if part else ''}{', '.join(part)} not given there"
        )
        refused.append(Refusal(solution.engine, tuple(quantities), np.array(rows), what, sentence))
    return tuple(refused)


def _reason(mechanism: Mechanism, rule: str, quantities: list[str], y: Array) -> str:
    lay = layout(mechanism)
    at = pose(lay, positions(lay, y[None], np.zeros(1)))
    system = loop_equations(lay)
    if not linear.condition(system.matrix(at))[0] < NEAR:
        return near_singularity(lay, at)
    orientations = system.chart_conditions(at.q)[0]  # condition numbers of the cut joints' coordinates
    if orientations.size and not orientations.max() < NEAR:
        return gimbal_lock(lay, int(np.argmax(np.where(np.isnan(orientations), np.inf, orientations))))
    if rule != "min_norm" and all(QUANTITIES[name].ruled for name in quantities):
        return f"rule {rule} is singular"
    return f"the equations of {', '.join(quantities)} are singular"
