"""What methods are measured against: the engine ``truth`` where it is installed, else ``screw``, and it says so."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.judging.compare import reference_scale
from screwgauge.judging.residual import Deviation
from screwgauge.problem import Rows
from screwgauge.quantities import natural_scales
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Values
from screwgauge.study.run import run

TRUTH, STANDIN = "truth", "screw"
_NOTES = {
    TRUTH: "Errors are against the engine truth: ball arithmetic with a rigorous radius.",
    STANDIN: f"Errors are against the engine {STANDIN} in double precision, not against a truth ({{reason}}): "
    "errors below 1e-12 mean nothing, and contestants that share its code look better than they are.",
}
MOST = 200  # times that the truth solves at once


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Values that errors are measured against.

    Attributes:
        engine: Where they come from.
        note: A sentence for the report.
        scales: Quantity -> unit -> S of the scaled error.
    """

    engine: str
    values: Mapping[str, Values]
    note: str
    scales: Mapping[str, Mapping[str, float]]

    @classmethod
    def by_size(cls, engine: str, mechanism: Mechanism, values: Mapping[str, Values], note: str = "") -> Reference:
        """Values that errors are measured against by their own size, or by a natural scale where they vanish."""
        natural = natural_scales(mechanism)
        scales = {
            name: {unit: reference_scale(has, unit, natural[unit]) for unit in dict.fromkeys(has.units)}
            for name, has in values.items()
        }
        return cls(engine, values, note, scales)

    def score(self, quantity: str, values: Values, rows: slice | Rows = slice(None)) -> Deviation:
        """Error of some components of a quantity, at some samples of the reference."""
        right = self.values[quantity].pick(values.components).at(rows)
        return score(quantity, deviation(values, right), self.scales[quantity])


def deviation(values: Values, right: Values) -> Values:
    """What is wrong at the samples for which the reference has a number.

    Args:
        right: Of the same samples and components.
    """
    known = np.isfinite(right.array).all(axis=1)
    return Values(values.components, values.units, (values.array - right.array)[known])


def score(quantity: str, off: Values, scales: Mapping[str, float]) -> Deviation:
    """Largest and RMS scaled error over all samples and components: not a number as soon as one is none.

    Args:
        off: See `deviation`.
        scales: Unit -> S.
    """
    error = np.abs(off.array) / np.array([scales[unit] for unit in off.units])
    lost = int((~np.isfinite(error)).any(axis=1).sum())
    if lost or not error.size:
        return Deviation(quantity, reason=f"not a number at {lost} of {len(error)} samples")
    most = float(error.max())
    return Deviation(quantity, error=most, max_abs=most, rms=float(np.sqrt(np.mean(error**2))), scale=1.0)


def sizes(values: Values) -> dict[str, float]:
    """Unit -> largest magnitude; nothing of no numbers."""
    if not values.array.size:
        return {}
    size = np.abs(values.array).max(axis=0)
    return {unit: float(size[[u == unit for u in values.units]].max()) for unit in dict.fromkeys(values.units)}


def reference_values(scene: Scene, times: Array, quantities: Iterable[str]) -> Reference:
    """Values of a scene at chosen times, by its description.

    Args:
        times: [s]. Shape (n,).
        quantities: Names.

    Raises:
        ScrewgaugeError: The scene cannot be computed at all.
    """
    names, reason, scene = tuple(quantities), "", replace(scene, models={})
    for engine, note in _NOTES.items():
        values = _solve(scene, times, names, engine)
        if not isinstance(values, Failure):
            return Reference.by_size(engine, scene.mechanism, values, note.format(reason=reason))
        reason = values.reason
    raise RuntimeError(f"no reference values: {reason}")


def _solve(scene: Scene, times: Array, quantities: tuple[str, ...], engine: str) -> dict[str, Values] | Failure:
    parts = []
    for first in range(0, len(times), MOST):
        results = run(scene.at(times[first : first + MOST]), engines=(engine,), quantities=quantities)
        if engine in results.failures:
            return results.failures[engine]
        parts.append(results.solutions[engine].values)
    return {name: joined(part[name] for part in parts) for name in parts[0]}


def joined(parts: Iterable[Values]) -> Values:
    """Samples of one quantity, one part after the other."""
    found = list(parts)
    return Values(found[0].components, found[0].units, np.concatenate([part.array for part in found]))
