"""Hinges that stand for fixed joints are no coordinates of anybody's: answers are shown and compared without them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from screwgauge.quantities import QUANTITIES
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Values

#: What quantities have of each joint coordinate.
ALONG = ("joint", "tree", "axis")


def without_fixed(mechanism: Mechanism, solutions: Mapping[str, Solution]) -> dict[str, Solution]:
    """Solutions without the coordinates of fixed joints, which are zero."""
    if len(mechanism.moving) == len(mechanism.coordinates):
        return {**solutions}
    held = {*mechanism.coordinates} - {*mechanism.moving}
    return {name: replace(one, values=_without(one.values, held)) for name, one in solutions.items()}


def _without(values: Mapping[str, Values], held: set[str]) -> dict[str, Values]:
    along = {name for name in values if QUANTITIES[name].of in ALONG}
    return {name: has.pick(_kept(has, held)) if name in along else has for name, has in values.items()}


def _kept(values: Values, held: set[str]) -> tuple[str, ...]:
    return tuple(name for name in values.components if name not in held)


def add_fixed(mechanism: Mechanism, columns: Mapping[str, dict[str, Array]], n: int) -> None:
    """Add the coordinates of fixed joints to the columns of a table with n rows, by quantity and component."""
    held = {*mechanism.coordinates} - {*mechanism.moving}
    for quantity, has in columns.items():
        if QUANTITIES[quantity].of in ALONG:
            has |= {name: np.zeros(n) for name in held - {*has}}
