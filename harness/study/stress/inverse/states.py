"""States, ladders and changed mechanisms that the cases of inverse dynamics share."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from screwgauge.models.catalog import load_mechanism, mechanism_tables
from screwgauge.reference.expressions import number
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene, load_scene

SCENE = "3ups-upu-s"
#: Poses (a, b) [rad] with no symmetry, and rates and accelerations that make inertia matter as much as weight does.
POSES = np.array([[0.1, 0.05], [-0.15, 0.12], [0.2, -0.1]])
RATES = np.array([[7.0, 4.0], [5.0, -8.0], [-3.0, 6.0]])
ACCELERATIONS = np.array([[-30.0, 90.0], [70.0, 20.0], [-100.0, -50.0]])

Tables = dict[str, Any]


def decades(first: int, last: int, step: int = 1) -> tuple[float, ...]:
    """Powers of ten with exponents from `first` to `last`, both included."""
    sign = 1 if last >= first else -1
    return tuple(float(f"1e{k}") for k in range(first, last + sign, sign * step))


def exactly(value: float) -> str:
    """All digits of a float64: what reads the text exactly gets the number that all others get."""
    return format(Decimal(float(value)), "f")


def times(text: Any, factor: float) -> str:
    """A number of a description, which may be text, times a factor."""
    return exactly(number(text, "description") * factor)


def each(table: Mapping[str, Any], factor: float) -> Tables:
    """A table of numbers, such as an inertia, times a factor."""
    return {key: times(value, factor) for key, value in table.items()}


def all_of(values: Iterable[Any], factor: float) -> list[str]:
    """A list of numbers, such as a position, times a factor."""
    return [times(value, factor) for value in values]


@contextmanager
def changed(change: Callable[[Tables], None]) -> Iterator[Scene]:
    """The default scene without its load, its mechanism changed.

    The change is written as a description, from which every engine's own model file is made as usual. It lasts as
    long as the context.

    Args:
        change: Changes the tables of the description in place.
    """
    tables = mechanism_tables(SCENE)
    change(tables)
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        path = Path(folder) / f"{SCENE}.toml"
        path.write_text(tomli_w.dumps(tables), encoding="utf-8")
        yield replace(load_scene(SCENE), mechanism=load_mechanism(path), mechanism_file=path, loads=())


def samples(array: Array, quick: bool) -> Array:
    """All states, or one of them."""
    return array[:1] if quick else array
