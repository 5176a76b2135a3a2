"""Entries of a scene file as objects: loads, springs, motors, tolerances, figures. Each is checked when it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.quantities import check_quantities
from screwgauge.reference.applied import JointSpring, Load, Motor, PointSpring, Spring
from screwgauge.reference.courses import Course, Samples
from screwgauge.reference.errors import DescriptionError, quote
from screwgauge.reference.expressions import number, vector
from screwgauge.reference.files import check_count, named_file
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.points import Point
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, check_name, read_items, read_text, read_vector, require
from screwgauge.scene.keys import read_keys
from screwgauge.scene.motion import read_column, read_course


@dataclass(frozen=True, slots=True)
class Figure:
    """Curves of a quantity with one unit in panels side by side, or a contour plot over a grid.

    Attributes:
        panels: Label of each panel, and patterns (``leg1.*``) of its components.
        contour: Component drawn over the two coordinates of a grid; empty for curves.
    """

    title: str
    quantity: str
    unit: str
    panels: tuple[tuple[str, tuple[str, ...]], ...]
    contour: str = ""


GRID = "use a longer step or a shorter duration"


def read_times(values: list[Any], where: str) -> Array:
    check_count(len(values), "samples", where, GRID)
    if all(isinstance(v, float) for v in values):  # numpy floats are instances of float, too
        t = np.array(values, dtype=float)
    else:
        t = np.array([number(v.item() if isinstance(v, np.generic) else v, where) for v in values])
    if not len(t):
        raise DescriptionError("the list of times is empty", where, "add at least one time in s")
    if not np.isfinite(t).all():
        raise DescriptionError("times must be finite numbers", where, "write times in s")
    return t


def read_grid(table: Any, sampled: Array | None, where: str) -> Array:
    if table is None:
        if sampled is None:
            raise DescriptionError("the time grid is missing", where, "add [time] with duration and step, or times")
        return sampled
    given = read_keys("time", table, where)
    if given["times"] is not None:
        if not isinstance(given["times"], list) or len(table) > 1:
            raise DescriptionError(
                "'times' must be a list and the only key", where, "write times = [...], or duration and step"
            )
        return read_times(given["times"], f"{where}.times")
    for key in ("duration", "step"):
        require(table, key, where)
    duration, step = float(given["duration"]), float(given["step"])
    check_count(duration / step, "samples", where, GRID)
    if step > duration * (1 + 1e-12):
        what = f"the step of {step:g} s is longer than the duration of {duration:g} s"
        raise DescriptionError(what, where, "check their units, or write times = [...]")
    # a duration that is not a whole number of steps ends at the last step before it
    return np.arange(int(duration / step * (1 + 1e-12)) + 1, dtype=float) * step


def read_models(table: Any, folder: Path, where: str) -> dict[str, Path]:
    if not isinstance(table, dict):
        raise DescriptionError(f"{quote(table)} is not a table", where, "write engine = 'file'")
    return {engine: named_file(folder, read_text(table, engine, where)) for engine in table}


def read_figure(table: Any, where: str) -> Figure:
    given = read_keys("figures", table, where)
    quantity, contour = check_quantities([given["quantity"]], where)[0], given["contour"]
    if contour is not None:
        check_keys(table, {"title", "quantity", "contour"}, where)
        return Figure(given["title"], quantity, "", (), contour)
    unit, panels = require(table, "unit", where), require(table, "panels", where)
    lists = panels.values() if isinstance(panels, dict) else [None]
    check_count(len(lists), "panels", where)
    if not all(isinstance(items, list) and all(isinstance(item, str) for item in items) for items in lists):
        raise DescriptionError("'panels' is not a table of lists", where, "write label = ['pattern', ...]")
    named = tuple((label, tuple(patterns)) for label, patterns in panels.items())
    return Figure(given["title"], quantity, unit, named)


def read_points(mechanism: Mechanism, data: dict[str, Any], where: str) -> tuple[Point, ...]:
    """Read ``[[points]]``: named points of bodies whose velocities are requested.

    Raises:
        ScrewgaugeError: A body is unknown, or a name is already in use.
    """
    bodies = [body.name for body in mechanism.bodies]

    def read(table: Any, where: str) -> Point:
        given = read_keys("points", table, where)
        return Point(given["name"], check_name("body", given["body"], bodies, where), given["point"])

    points = read_items(data, "points", where, read)
    taken = [*bodies, *(one.name for one in points)]
    for one in points:
        if taken.count(one.name) > 1:
            raise DescriptionError(f"the name '{one.name}' occurs twice", f"{where}, points", "rename one")
    return points


_ENDS = ("first", "first_point", "second", "second_point")


def read_load(mechanism: Mechanism, table: Any, where: str, folder: Path = Path()) -> Load:
    """Read a load that ``by`` exerts on ``on``: a body and the environment, or vice versa.

    Args:
        folder: Folder of CSV files.
    """
    given = read_keys("loads", table, where)
    on, by, point = given["on"], given["by"], given["point"]
    if (on == "environment") == (by == "environment"):
        raise DescriptionError(
            f"exactly one of on = '{on}' and by = '{by}' must be 'environment'",
            where,
            "set one to a body and the other to 'environment'",
        )
    body, sign = (on, 1.0) if by == "environment" else (by, -1.0)
    check_name("body", body, [*(each.name for each in mechanism.bodies), "environment"], where)
    if not {"force", "torque"} & table.keys():
        raise DescriptionError("the load has neither a force nor a torque", where, "add a force or a torque")
    at = None if point == "com" else vector(point, f"{where}.point")
    if not any(isinstance(x, dict) for key in ("force", "torque") for x in _as_list(table.get(key))):
        force, torque = (sign * read_vector(table, key, where) for key in ("force", "torque"))
        return Load(body, at, force, torque, given["axes"])
    courses = [one.times(sign) for key in ("force", "torque") for one in _components(table, key, where, folder)]
    return Load.over_time(body, at, tuple(courses), given["axes"])


def _as_list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _components(table: dict[str, Any], key: str, where: str, folder: Path) -> Iterator[Course | Samples]:
    """Yield the three components of a load: numbers, functions of time, or columns of a CSV file."""
    values, where = table.get(key, [0, 0, 0]), f"{where}.{key}"
    if not isinstance(values, list) or len(values) != 3:
        raise DescriptionError(f"{quote(values)} is not a list of three components", where, "write three components")
    for axis, value in zip("xyz", values, strict=True):
        if not isinstance(value, dict):
            yield Course.of(number(value, where))
        elif "csv" in value:
            check_keys(value, {"csv", "column"}, where)
            column = read_text(value, "column", where, f"{'m' if key == 'torque' else 'f'}{axis}")
            yield read_column(named_file(folder, read_text(value, "csv", where)), column)
        else:
            yield read_course(value, where)


def read_spring(mechanism: Mechanism, table: Any, where: str) -> Spring:
    """Read a spring and damper along a joint coordinate, or along the line between points of two bodies.

    Raises:
        ScrewgaugeError: A name is unknown, stiffness, damping or length is negative, or stiffness and damping are zero.
    """
    given = read_keys("springs", table, where)
    if ("coordinate" in table) == ("first" in table):
        remedy = "write coordinate = ..., or first, first_point, second, second_point"
        raise DescriptionError("a spring must have either a coordinate or two ends", where, remedy)
    along = "coordinate" in table
    if along and (odd := [key for key in _ENDS if key in table]):
        raise DescriptionError(f"'{odd[0]}' is not a key of a spring along a coordinate", where, "remove it")
    kind, apart = (JointSpring, _ENDS) if along else (PointSpring, ("coordinate",))
    try:
        spring: Spring = kind(**{key: value for key, value in given.items() if key not in apart})
    except DescriptionError as error:
        raise DescriptionError(error.what, error.where if where in error.where else where, error.remedy) from None
    if not (spring.stiffness or spring.damping):
        raise DescriptionError("the spring has neither stiffness nor damping", where, "add stiffness or damping")
    if isinstance(spring, JointSpring):
        check_name("coordinate", spring.coordinate, mechanism.moving, where)
    else:
        for body in (spring.first, spring.second):
            check_name("body", body, mechanism.body_index, where)
    return spring


def read_motor(mechanism: Mechanism, table: Any, where: str) -> Motor:
    """Read a force along a joint coordinate as a function of time, in the format of a motion."""
    coordinate = check_name("coordinate", read_keys("motors", table, where)["coordinate"], mechanism.moving, where)
    terms = {key: value for key, value in table.items() if key != "coordinate"}
    if not terms:
        raise DescriptionError("the motor has no terms", where, "add offset, polynomial or harmonics")
    return Motor(coordinate, read_course(terms, where))


_ACTING: dict[str, tuple[Callable[..., Any], Any]] = {
    "springs": (read_spring, Spring),
    "motors": (read_motor, Motor),
}


def _read_acting(mechanism: Mechanism, read: Callable[..., Any], kind: Any, entry: Any, where: str) -> Any:
    return entry if isinstance(entry, kind) else read(mechanism, entry, where)


def read_applied(mechanism: Mechanism, data: dict[str, Any], where: str, folder: Path) -> dict[str, Any]:
    """Return fields of `Applied` from entries of a scene file; entries that are already objects are kept.

    Args:
        folder: Folder of CSV files.
    """
    given: dict[str, Any] = {}
    if "gravity" in data:
        given["gravity"] = vector(data["gravity"], f"{where}, gravity")
    acting: dict[str, tuple[Callable[..., Any], Any]] = {"loads": (partial(read_load, folder=folder), Load), **_ACTING}
    for key, (read, kind) in acting.items():
        if key in data:
            given[key] = read_items(data, key, where, partial(_read_acting, mechanism, read, kind))
    return given


def as_written(value: Any) -> Any:
    """Convert tuples, arrays and numpy numbers to lists and plain numbers, as in a file."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, dict):
        return {key: as_written(item) for key, item in value.items()}
    return [as_written(item) for item in value] if isinstance(value, list | tuple) else value
