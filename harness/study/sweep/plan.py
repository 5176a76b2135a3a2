"""Sweep files, which specify the scattering numbers of a scene, their distributions, and the recorded statistics."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.engines.screw.matter import ENTRIES
from screwgauge.engines.screw.variants import STATISTICS
from screwgauge.quantities import OF_MOTION, check_quantities
from screwgauge.reference.errors import DescriptionError, UnknownNameError, check_choice, first_few, quote
from screwgauge.reference.expressions import number
from screwgauge.reference.files import is_path, named_file
from screwgauge.reference.parameters import numbers, resolve
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, check_name, read_text, read_toml, require
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene

DESIGNS = ("random", "sobol")
TABLES = ("csv", "parquet")
#: Kinds of scatter; their sizes are standard deviation, half width, and relative deviation of consistent bodies.
KINDS = ("normal", "uniform", "body")
_KEYS = ("scene", "title", "quantities", "statistics", "variants", "seed", "design", "check", "table", "indices")
_GRID = ("from", "to", "count", "values")
#: Largest number of variants, and of points in a grid.
MOST = 10_000_000
#: Statistics recorded by default.
KEPT = ("peak", "rms")


@dataclass(frozen=True, slots=True)
class Scatter:
    """Distribution of numbers of the scene.

    Attributes:
        name: Full name of a number; or ``bodies.NAME`` for a body, whose ten numbers are drawn together so that every
            draw is physically consistent.
        kind: One of `KINDS`.
        size: Standard deviation or half width, in the unit of the number; dimensionless for a body.
        value: Value of the number in the scene; zero for a body.
        changes: In a sweep, the change of each column due to one standard deviation, to first order. Shape (C,).
    """

    name: str
    kind: str
    size: float
    value: float
    changes: Array = field(default_factory=lambda: np.empty(0), compare=False)

    @property
    def numbers(self) -> list[str]:
        """Full names of the numbers that scatter."""
        return [f"{self.name}.{entry}" for entry in ENTRIES] if self.kind == "body" else [self.name]

    @property
    def deviation(self) -> float:
        """Standard deviation of the distribution."""
        return self.size / 3.0**0.5 if self.kind == "uniform" else self.size


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Specification of a sweep. It can be pickled.

    Attributes:
        scene: The nominal scene.
        count: Number of draws, for each point of the grid if there is a grid.
        scatter: What scatters: a number adds one dimension to a draw, and a body adds ten.
        grid: Full name of a number -> its values.
        check: Number of variants that are checked by the engines of the scene.
        indices: Number of draws for Sobol's indices; 0 to omit them.
    """

    scene: Scene
    title: str
    quantities: tuple[str, ...]
    statistics: tuple[str, ...]
    count: int
    seed: int
    design: str
    scatter: tuple[Scatter, ...]
    grid: Mapping[str, Array]
    check: int
    table: str
    indices: int
    file: Path

    @property
    def variants(self) -> int:
        """Number of variants."""
        return self.count * int(np.prod([len(values) for values in self.grid.values()], dtype=int))


def read_plan(file: Path) -> Plan:
    """Read the file of a sweep.

    Raises:
        ScrewgaugeError: The file is malformed, or names numbers that the scene lacks.
    """
    data, where = read_toml(file), str(file)
    check_keys(data, [*_KEYS, "scatter", "grid"], where)
    name = read_text(data, "scene", where)
    scene = load_scene(named_file(file.parent, name) if is_path(name) else name)
    if scene.simulated:
        raise DescriptionError("a simulated scene cannot be swept", f"{where}, scene", "add a [motion]")
    known = numbers(scene.mechanism, scene.applied)
    scatter = tuple(
        one for item in data.get("scatter", {}).items() for one in _scatter(item, known, f"{where}, scatter")
    )
    grid = {
        key: values for item in data.get("grid", {}).items() for key, values in _grid(item, known, f"{where}, grid")
    }
    if not (scatter or grid):
        raise DescriptionError("no number changes", where, "add [scatter] or [grid]")
    names = [name for one in scatter for name in one.numbers] + [*grid]
    if twice := [one for one in dict.fromkeys(names) if names.count(one) > 1]:
        raise DescriptionError(f"{first_few(twice, 3)} scatter twice", where, "use narrower patterns")
    plan = Plan(
        scene=scene,
        title=read_text(data, "title", where, f"Variants of {scene.title}"),
        quantities=check_quantities(data.get("quantities", ["actuator_force"]), where, OF_MOTION),
        statistics=tuple(check_choice("statistic", data.get("statistics", [*KEPT]), STATISTICS, where)),
        count=_read_count(data, "variants", 1000 if scatter else 1, 1, where),
        seed=_read_count(data, "seed", 0, 0, where),
        design=check_name("design", data.get("design", DESIGNS[0]), DESIGNS, where),
        scatter=scatter,
        grid=grid,
        check=_read_count(data, "check", 2, 0, where),
        table=check_name("table", data.get("table", TABLES[0]), TABLES, where),
        indices=_read_count(data, "indices", 0, 0, where),
        file=file,
    )
    if plan.variants > MOST:
        raise DescriptionError(f"{plan.variants} variants", where, f"use at most {MOST}")
    return plan


def _read_count(data: Mapping[str, Any], key: str, usual: int, least: int, where: str) -> int:
    value = data.get(key, usual)
    count = value if isinstance(value, int) and not isinstance(value, bool) else number(value, f"{where}, {key}")
    if count != int(count) or not least <= count <= MOST:
        raise DescriptionError(
            f"{quote(value)} is not a valid count", f"{where}, {key}", f"use a whole number of at least {least}"
        )
    return int(count)


def _scatter(item: tuple[str, Any], known: Mapping[str, float], where: str) -> list[Scatter]:
    """Read an entry of ``[scatter]``."""
    pattern, table = item
    where = f"{where}.{pattern}"
    check_keys(table, KINDS, where)
    if len(table) != 1:
        raise DescriptionError(f"{len(table)} distributions", where, "use exactly one: { normal = 0.001 }")
    ((kind, size),) = table.items()
    if kind == "body":
        bodies = _bodies(pattern, known, where)
        return [Scatter(name, kind, _share(size, where), 0.0) for name in bodies]
    found = [
        Scatter(name, kind, _size(size, known[name], where), known[name]) for name in resolve(known, [pattern], where)
    ]
    if still := [one.name for one in found if not one.size]:
        what = f"{first_few(still, 3)} cannot scatter by a percentage, because the nominal value is zero"
        raise DescriptionError(what, where, "state the scatter in the unit of the number")
    return found


def _bodies(pattern: str, known: Mapping[str, float], where: str) -> list[str]:
    """Return the bodies with mass that match a pattern ``bodies.NAME`` or ``NAME``."""
    masses = {name: value for name, value in known.items() if name.endswith(".mass") and value}
    try:
        return [name.removesuffix(".mass") for name in resolve(masses, [f"{pattern}.mass"], where)]
    except UnknownNameError:
        raise UnknownNameError("body with mass", pattern, (n.removesuffix(".mass") for n in masses), where) from None


def _share(value: Any, where: str) -> float:
    """Read a positive fraction, ``"2 %"`` or 0.02."""
    match = re.fullmatch(r"\s*(.+?)\s*%\s*", value) if isinstance(value, str) else None
    share = number(match[1], where) / 100.0 if match else number(value, where)
    if not share > 0.0:
        raise DescriptionError(f"{quote(value)} is not a valid scatter", where, 'use a positive number, or "1 %"')
    return share


def _size(value: Any, nominal: float, where: str) -> float:
    """Read the size of a scatter: a number, or a percentage of the nominal value."""
    share = _share(value, where)
    return share * abs(nominal) if isinstance(value, str) and "%" in value else share


def _grid(item: tuple[str, Any], known: Mapping[str, float], where: str) -> list[tuple[str, Array]]:
    """Read the values in an entry of ``[grid]``."""
    pattern, table = item
    where = f"{where}.{pattern}"
    check_keys(table, _GRID, where)
    if "values" in table:
        listed = table["values"]
        if not isinstance(listed, list) or not listed or len(table) > 1:
            raise DescriptionError(
                f"{quote(listed)} is not a valid list of values",
                where,
                "use a non-empty list, and no other key",
            )
        values = np.array([number(x, where) for x in listed])
    else:
        first, last = (number(require(table, key, where), f"{where}.{key}") for key in ("from", "to"))
        values = np.linspace(first, last, _read_count(table, "count", 2, 2, where))
    return [(name, values) for name in resolve(known, [pattern], where)]
