"""What contestants are measured against: the engine ``truth`` where there is one, else ``screw``, and it says so."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from screwgauge.engines.registry import ENGINES
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Values
from screwgauge.study.run import run

TRUTH, STANDIN = "truth", "screw"
MOST = 200  # times that the truth solves at once


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Values that errors are measured against.

    Attributes:
        engine: Where they come from.
        note: A sentence for the report.
    """

    engine: str
    values: Mapping[str, Values]
    note: str


def reference_values(scene: Scene, times: Array, quantities: Iterable[str]) -> Reference:
    """Values of a scene at chosen times.

    Args:
        times: [s]. Shape (n,).
        quantities: Names.

    Raises:
        ScrewgaugeError: The scene cannot be computed at all.
    """
    names = tuple(quantities)
    reason = "the engine truth does not exist in this version"
    if TRUTH in ENGINES:
        found = _solve(scene, times, names, TRUTH)
        if not isinstance(found, Failure):
            note = "Errors are against the engine `truth`: ball arithmetic with a rigorous radius."
            return Reference(TRUTH, found, note)
        reason = found.reason
    found = _solve(scene, times, names, STANDIN)
    if isinstance(found, Failure):
        raise RuntimeError(f"no reference values: {found.reason}")
    note = (
        f"Errors are against the engine `{STANDIN}` in double precision, **not against a truth** ({reason}): "
        "errors below 1e-12 mean nothing, and contestants that share its code look better than they are."
    )
    return Reference(STANDIN, found, note)


def _solve(scene: Scene, times: Array, quantities: tuple[str, ...], engine: str) -> Mapping[str, Values] | Failure:
    parts = []
    for first in range(0, len(times), MOST):
        results = run(scene.at(times[first : first + MOST]), engines=(engine,), quantities=quantities)
        if engine in results.failures:
            return results.failures[engine]
        parts.append(results.solutions[engine].values)
    return {
        name: Values(part.components, part.units, np.concatenate([p[name].array for p in parts]))
        for name, part in parts[0].items()
    }
