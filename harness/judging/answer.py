"""One engine's answer at the samples that are judged, and what equations leave over of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwgauge.judging.kinetics import Motions, walk
from screwgauge.problem import GivenMotion, InitialValue, Problem, Rows, States
from screwgauge.quantities import FLOOR, SOLVED, arm, natural_scales
from screwgauge.reference.applied import Applied
from screwgauge.reference.graph import SpanningTree, spanning_tree
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Values

Row = dict[str, Any]
COLUMNS = [
    *("engine", "residual", "unit", "max_abs", "max_scaled", "worst_component", "worst_t"),
    *("tolerance", "ok", "reason"),
]


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """One engine's answer at n samples.

    Attributes:
        applied: What acts besides actuators.
        t: Times [s]. Shape (n,).
        values: Quantity -> values.
        work: What motors, loads and dampers have put in [J], shape (n,); None if it is not known.
        motions: What its joint coordinates make of the mechanism; derivatives that it lacks count as zero.
        scales: Natural scale of each unit.
        tolerance: Scaled residual up to which an equation holds.
        tolerances: Errors that the engine admits, see `Solution`.
    """

    engine: str
    mechanism: Mechanism
    applied: Applied
    tree: SpanningTree
    t: Array
    values: Mapping[str, Values]
    work: Array | None
    motions: Motions
    scales: Mapping[str, float]
    tolerance: float
    tolerances: Mapping[str, Mapping[str, float]]

    def __getitem__(self, quantity: str) -> Array:
        """Values of a quantity. Shape (n, n_component)."""
        return self.values[quantity].array

    def has(self, *quantities: str) -> bool:
        """Whether it has all of these quantities."""
        return set(quantities) <= set(self.values)

    def residual(
        self, name: str, unit: str, components: Sequence[str], missing: Array, size: float | Array, of: str
    ) -> Row:
        """The worst of what an equation leaves over: how large, where, when. One row of `COLUMNS`.

        Args:
            components: Names of the columns.
            missing: What the equation leaves over. Shape (n, m).
            size: What that is measured by, one number or one for each component, shape (m,).
            of: Quantity whose rounding alone, as the engine admits it, is no fault.
        """
        L = self.scales["m"]
        admitted = [size * arm(unit, L) / arm(has, L) for has, size in self.tolerances.get(of, {}).items()]
        rounding = max(admitted, default=0.0) / self.tolerance
        scaled = np.abs(missing) / np.maximum(size, max(FLOOR * self.scales[unit], rounding))
        lost = ~np.isfinite(scaled)
        i, k = divmod(int(np.argmax(np.where(lost, np.inf, scaled))), len(components))
        worst, t = float(scaled[i, k]), float(self.t[i])
        where = {"residual": name, "unit": unit, "worst_component": components[k], "worst_t": t}
        error = {"max_abs": float(np.abs(missing).max()), "max_scaled": worst, "tolerance": self.tolerance}
        reason = f"not a number at t = {t:g} s" if lost.any() else ""
        return {"engine": self.engine, **where, **error, "ok": worst <= self.tolerance, "reason": reason}


def answer_at(
    mechanism: Mechanism, problem: Problem, solution: Solution, rows: Rows, tolerance: float = SOLVED
) -> Answer:
    """The answer at some samples. It has to have joint positions."""
    values = {name: values.at(rows) for name, values in solution.values.items()}
    tree, scales = spanning_tree(mechanism), natural_scales(mechanism)
    motion = np.zeros((3, len(rows), len(mechanism.coordinates)))
    for derivative, name in zip(motion, ("joint_position", "joint_velocity", "joint_acceleration"), strict=True):
        if name in values:
            derivative[:] = values[name].array
    return Answer(
        engine=solution.engine,
        mechanism=mechanism,
        applied=problem.applied,
        tree=tree,
        t=timed(problem).t[rows],
        values=values,
        work=None if solution.work is None else solution.work[rows],
        motions=walk(mechanism, tree, *motion),
        scales={**scales, "J": scales["N m"]},
        tolerance=tolerance,
        tolerances=solution.tolerances,
    )


def timed(problem: Problem) -> GivenMotion | InitialValue:
    """The task; a TypeError if it is no motion over time."""
    if isinstance(problem.task, States):
        raise TypeError("states of an open tree are no motion over time: there is nothing to compare or to judge")
    return problem.task


def largest(*arrays: Array) -> float:
    """The largest magnitude, numbers only; 0 if there is none."""
    return max(float(np.nanmax(np.abs(array), initial=0.0)) for array in arrays)
