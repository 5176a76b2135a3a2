"""Removal of hinges that represent fixed joints: results are shown and compared without their coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.quantities import FORCE, QUANTITIES, RATE
from screwgauge.reference.mechanism import Mechanism
from screwgauge.solution import Solution, Values

#: Kinds of quantities with one component for each joint coordinate.
ALONG = ("joint", "tree", "axis")


def without_fixed(mechanism: Mechanism, solutions: Mapping[str, Solution]) -> dict[str, Solution]:
    """Return solutions without the coordinates of fixed joints, which are zero."""
    if len(mechanism.moving) == len(mechanism.coordinates):
        return {**solutions}
    held = {*mechanism.coordinates} - {*mechanism.moving}
    return {name: replace(one, values=_drop(one.values, held)) for name, one in solutions.items()}


def _drop(values: Mapping[str, Values], held: set[str]) -> dict[str, Values]:
    along = {name for name in values if QUANTITIES[name].of in ALONG}
    return {name: has.pick(_moving_components(has, held)) if name in along else has for name, has in values.items()}


def _moving_components(values: Values, held: set[str]) -> tuple[str, ...]:
    return tuple(name for name in values.components if name not in held)


def with_fixed(mechanism: Mechanism, values: Mapping[str, Values]) -> dict[str, Values]:
    """Add the coordinates of fixed joints, which are zero, to values from which an engine or a table omits them."""
    held = [name for name in mechanism.coordinates if name not in mechanism.moving]
    return {name: _fill(name, has, held, mechanism.coordinates) if held else has for name, has in values.items()}


def _fill(quantity: str, values: Values, held: Sequence[str], coordinates: Sequence[str]) -> Values:
    """Insert zeros for the coordinates of fixed joints into a quantity, in the order of all coordinates."""
    lost, what = [name for name in held if name not in values.components], QUANTITIES[quantity]
    if what.of not in ("joint", "axis") or not lost:
        return values
    unit = f"rad{RATE[what.needs]}" if what.of == "joint" else FORCE["rad"]
    names, units = (*values.components, *lost), (*values.units, *[unit] * len(lost))
    whole = Values(names, units, np.concatenate([values.array, np.zeros((len(values.array), len(lost)))], axis=1))
    return whole.pick(tuple(name for name in coordinates if name in names)) if {*names} <= {*coordinates} else whole
