"""Elements of a scene that exert something: loads, springs and dampers, motors. Read from TOML."""

from __future__ import annotations

from typing import Any

from screwgauge.reference.applied import JointSpring, Load, Motor, PointSpring, Spring
from screwgauge.reference.description import check_keys, read_text
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.expressions import number, vector
from screwgauge.reference.mechanism import GROUND, Mechanism
from screwgauge.scene.entries import check_name, read_vector
from screwgauge.scene.motion import read_terms

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
