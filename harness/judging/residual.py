"""A residual over time: what an equation leaves over, against what it is measured, and its row in the judge's table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.rotations import Array

COLUMNS = [
    *("engine", "residual", "unit", "max_abs", "max_scaled", "worst_component", "worst_t"),
    *("tolerance", "ok", "reason"),
]


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """What an equation leaves over.

    Attributes:
        components: Names of the columns.
        t: Times [s]. Shape (n,).
        values: Shape (n, m).
        scale: Measure of a small residual, one number or one for each component, shape (m,).
        tolerance: Largest scaled residual, where it is not that of all the other equations.
    """

    name: str
    unit: str
    components: Sequence[str]
    t: Array
    values: Array
    scale: float | Array
    tolerance: float | None = None

    def row(self, engine: str, tolerance: float) -> dict[str, object]:
        """The worst of it: how large, where, when. `COLUMNS` names the entries."""
        scaled = np.abs(self.values) / self.scale
        lost = ~np.isfinite(scaled)
        i, k = divmod(int(np.argmax(np.where(lost, np.inf, scaled))), scaled.shape[1])
        worst, limit = float(scaled[i, k]), tolerance if self.tolerance is None else self.tolerance
        return {
            "engine": engine,
            "residual": self.name,
            "unit": self.unit,
            "max_abs": float(np.abs(self.values).max()),
            "max_scaled": worst,
            "worst_component": self.components[k],
            "worst_t": float(self.t[i]),
            "tolerance": limit,
            "ok": bool(worst <= limit),
            "reason": f"not a number at t = {self.t[i]:g} s" if lost.any() else "",
        }


def largest(*arrays: Array) -> float:
    """The largest magnitude, numbers only; 0 if there is none."""
    return max(float(np.nanmax(np.abs(array), initial=0.0)) for array in arrays)
