"""Tables of a scene file as objects: loads, springs, motors, tolerances, figures; each checked when it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from screwgauge.quantities import check_quantities
from screwgauge.reference.applied import JointSpring, Load, Motor, PointSpring, Spring
from screwgauge.reference.description import check_keys, read_text, required
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.expressions import number, vector
from screwgauge.reference.files import beside, check_count
from screwgauge.reference.mechanism import GROUND, Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.motion import read_terms


@dataclass(frozen=True, slots=True)
class Figure:
    """Curves of one quantity and unit, in panels side by side.

    Attributes:
        panels: Label and the patterns (``leg1.*``) of the components of each panel.
    """

    title: str
    quantity: str
    unit: str
    panels: tuple[tuple[str, tuple[str, ...]], ...]


T = TypeVar("T")
GRID = "take a longer step or a shorter duration"


def read_list(data: dict[str, Any], key: str, where: str) -> list[Any]:
    items = data.get(key, [])
    if not isinstance(items, list):
        raise DescriptionError(f"'{key}' is not a list", where, f"write [[{key}]]")
    check_count(len(items), "entries", f"{where}, {key}")
    return items


def read_items(data: dict[str, Any], key: str, where: str, read: Callable[[Any, str], T]) -> tuple[T, ...]:
    """The entries of a list, each read by `read`, which is also told where it stands."""
    return tuple(read(item, f"{where}, {key}") for item in read_list(data, key, where))


def check_name(kind: str, name: str, known: Iterable[str], where: str) -> str:
    """The name, if it is one of those known.

    Raises:
        UnknownNameError: It is not.
    """
    if name not in known:
        raise UnknownNameError(kind, name, known, where)
    return name


def read_vector(table: dict[str, Any], key: str, where: str) -> Array:
    """Three numbers, zeros where there are none. Shape (3,)."""
    return vector(table.get(key, [0, 0, 0]), f"{where}.{key}")


def positive(value: Any, where: str, remedy: str = "give a positive number") -> float:
    result = number(value, where)
    if result <= 0.0:
        raise DescriptionError(f"{result:g} is not positive", where, remedy)
    return result


def read_times(values: list[Any], where: str) -> Array:
    check_count(len(values), "samples", where, GRID)
    if all(isinstance(v, float) for v in values):  # also numpy's
        t = np.array(values, dtype=float)
    else:
        t = np.array([number(v.item() if isinstance(v, np.generic) else v, where) for v in values])
    if not len(t):
        raise DescriptionError("there are no times", where, "give at least one time in s")
    if not np.isfinite(t).all():
        raise DescriptionError("the times are not all finite numbers", where, "give times in s")
    return t


def read_grid(table: Any, sampled: Array | None, where: str) -> Array:
    if table is None:
        if sampled is None:
            raise DescriptionError("there is no time grid", where, "add [time] with duration and step, or times")
        return sampled
    check_keys(table, {"duration", "step", "times"}, where)
    if "times" in table:
        if not isinstance(table["times"], list) or len(table) > 1:
            raise DescriptionError("'times' is no list on its own", where, "write times = [...], or duration and step")
        return read_times(table["times"], f"{where}.times")
    duration = positive(required(table, "duration", where), f"{where}.duration")
    step = positive(required(table, "step", where), f"{where}.step")
    check_count(duration / step, "samples", where, GRID)
    if step > duration * (1 + 1e-12):
        what = f"the step of {step:g} s is longer than the duration of {duration:g} s"
        raise DescriptionError(what, where, "check their units, or write times = [...]")
    # multiples of the step; a duration that is no whole number of steps ends at the last one before it
    return np.arange(int(duration / step * (1 + 1e-12)) + 1, dtype=float) * step


def read_names(value: Any, where: str) -> tuple[str, ...]:
    """A list of names, once each; whether they are known, and any is there, is for others to say."""
    if not isinstance(value, list):
        raise DescriptionError(f"{value!r} is no list of names", where, "write a list")
    return tuple(dict.fromkeys(str(name) for name in value))


def read_models(table: Any, folder: Path, where: str) -> dict[str, Path]:
    if not isinstance(table, dict):
        raise DescriptionError(f"{table!r} is not a table", where, "write engine = 'file'")
    return {engine: beside(folder, read_text(table, engine, where)) for engine in table}


def read_figure(table: Any, where: str) -> Figure:
    check_keys(table, {"title", "quantity", "unit", "panels"}, where)
    quantity = check_quantities([required(table, "quantity", where)], where)[0]
    panels = required(table, "panels", where)
    lists = panels.values() if isinstance(panels, dict) else [None]
    check_count(len(lists), "panels", where)
    if not all(isinstance(items, list) and all(isinstance(item, str) for item in items) for items in lists):
        raise DescriptionError("'panels' is not a table of lists", where, "write label = ['pattern', ...]")
    return Figure(
        title=read_text(table, "title", where),
        quantity=quantity,
        unit=read_text(table, "unit", where),
        panels=tuple((label, tuple(patterns)) for label, patterns in panels.items()),
    )


_AMOUNTS = ("stiffness", "rest", "damping")
_ENDS = ("first", "first_point", "second", "second_point")


def read_load(mechanism: Mechanism, table: Any, where: str) -> Load:
    """``by`` exerts the load, ``on`` feels it; one is a body, the other the environment."""
    check_keys(table, {"on", "by", "point", "force", "torque"}, where)
    on, by = (read_text(table, key, where) for key in ("on", "by"))
    if (on == "environment") == (by == "environment"):
        raise DescriptionError(f"on = '{on}', by = '{by}'", where, "one is a body, the other 'environment'")
    body, sign = (on, 1.0) if by == "environment" else (by, -1.0)
    check_name("body", body, [*(each.name for each in mechanism.bodies), "environment"], where)
    point = table.get("point", "com")
    if not {"force", "torque"} & table.keys():
        raise DescriptionError("the load exerts nothing", where, "give a force or a torque")
    return Load(
        body=body,
        point=None if point == "com" else vector(point, f"{where}.point"),
        force=sign * read_vector(table, "force", where),
        torque=sign * read_vector(table, "torque", where),
    )


def read_spring(mechanism: Mechanism, table: Any, where: str) -> Spring:
    """A spring and damper along a joint coordinate, or on the line between points of two bodies.

    Raises:
        ScrewgaugeError: Unknown names, negative stiffness, damping or length, or nothing that it exerts.
    """
    check_keys(table, {"coordinate", *_ENDS, *_AMOUNTS}, where)
    amounts = {key: number(table.get(key, 0), f"{where}.{key}") for key in _AMOUNTS}
    if ("coordinate" in table) == ("first" in table):
        remedy = "write coordinate = ..., or first, first_point, second, second_point"
        raise DescriptionError("a spring has either a coordinate or two ends", where, remedy)
    try:
        spring = _ends(table, where, amounts)
    except DescriptionError as error:
        raise DescriptionError(error.what, error.where if where in error.where else where, error.remedy) from None
    if not (spring.stiffness or spring.damping):
        raise DescriptionError("the spring exerts nothing", where, "give a stiffness or a damping")
    if isinstance(spring, JointSpring):
        check_name("coordinate", spring.coordinate, mechanism.coordinates, where)
    else:
        for body in (spring.first, spring.second):
            check_name("body", body, mechanism.body_index, where)
    return spring


def _ends(table: dict[str, Any], where: str, amounts: dict[str, float]) -> Spring:
    if "coordinate" in table:
        odd = [key for key in _ENDS if key in table]
        if odd:
            raise DescriptionError(f"'{odd[0]}' does not belong to a joint's spring", where, "remove it")
        return JointSpring(read_text(table, "coordinate", where), **amounts)
    return PointSpring(
        first=read_text(table, "first", where),
        first_point=read_vector(table, "first_point", where),
        second=read_text(table, "second", where, GROUND),
        second_point=read_vector(table, "second_point", where),
        **amounts,
    )


def read_motor(mechanism: Mechanism, table: Any, where: str) -> Motor:
    """A force along a joint coordinate over time, in the terms of a motion."""
    check_keys(table, {"coordinate", "offset", "polynomial", "harmonics"}, where)
    coordinate = check_name("coordinate", read_text(table, "coordinate", where), mechanism.coordinates, where)
    terms = {key: value for key, value in table.items() if key != "coordinate"}
    if not terms:
        raise DescriptionError("the motor exerts nothing", where, "give offset, polynomial or harmonics")
    return Motor(coordinate, *read_terms(terms, where))
