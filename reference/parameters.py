"""Reads or changes parameters of a mechanism and its applied forces by name, or replaces them by nodes of a trace.

Names are paths in a description, e.g. ``bodies.coupler.mass`` or ``joints.left.parent.x``. Two tilts [rad] rotate a
joint frame about two directions orthogonal to the first axis of the joint.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import partial
from typing import Any, TypeVar

import numpy as np

from screwgauge.reference.applied import Applied
from screwgauge.reference.equations.screws import rotation
from screwgauge.reference.errors import DescriptionError, UnknownNameError, first_few
from screwgauge.reference.expressions import number
from screwgauge.reference.mechanism import Body, Frame, Joint, Mechanism
from screwgauge.reference.resistance import RESISTS
from screwgauge.reference.rotations import Array, across
from screwgauge.reference.traced.trace import apply

XYZ = "xyz"
#: Entries of an inertia tensor, by name.
TENSOR = {f"{XYZ[i]}{XYZ[k]}": (i, k) for i in range(3) for k in range(i, 3)}
TILTS = ("tilt1", "tilt2")
SIDES = ("parent", "child")
#: Number of matches that a message lists for an ambiguous name.
NAMED = 3

Item = TypeVar("Item", Body, Joint, Frame)
Numbers = Mapping[str, Any]
"""Name -> a float, an array over variants, or a node of a trace."""


def numbers(mechanism: Mechanism, applied: Applied | None = None) -> dict[str, float]:
    """Collect every changeable parameter of bodies, joints and applied forces by its full name."""
    return dict([*_of_bodies(mechanism), *_of_joints(mechanism), *([] if applied is None else _of_applied(applied))])


def _of_bodies(mechanism: Mechanism) -> Iterator[tuple[str, float]]:
    for body in mechanism.bodies:
        name = f"bodies.{body.name}"
        yield f"{name}.mass", float(body.mass)
        yield from _vector(f"{name}.com", body.com)
        for key, (i, k) in TENSOR.items():
            yield f"{name}.inertia.{key}", float(body.inertia[i, k])


def _of_joints(mechanism: Mechanism) -> Iterator[tuple[str, float]]:
    for joint in mechanism.joints:
        name = f"joints.{joint.name}"
        for side, (_, frame) in zip(SIDES, joint.sides, strict=True):
            yield from _vector(f"{name}.{side}", frame.p)
            yield from ((f"{name}.{side}.{tilt}", 0.0) for tilt in TILTS)
        for what in RESISTS if not joint.fixed else ():
            yield from _list(f"{name}.{what}", getattr(joint, what))


def _of_applied(applied: Applied) -> Iterator[tuple[str, float]]:
    yield from _vector("gravity", applied.g)
    for i, load in enumerate(applied.loads, 1):
        if not load.courses and load.force.ndim == 1:
            yield from _vector(f"loads.{i}.force", load.force)
            yield from _vector(f"loads.{i}.torque", load.torque)
    for i, spring in enumerate(applied.springs, 1):
        yield from ((f"springs.{i}.{what}", float(getattr(spring, what))) for what in ("stiffness", "rest", "damping"))


def _vector(name: str, values: Array) -> Iterator[tuple[str, float]]:
    yield from ((f"{name}.{axis}", float(x)) for axis, x in zip(XYZ, values, strict=True))


def _list(name: str, values: Array) -> Iterator[tuple[str, float]]:
    """Yield a number for each coordinate of a joint; names are numbered from 1 if there are several."""
    many = len(values) > 1
    yield from ((f"{name}.{i}" if many else name, float(x)) for i, x in enumerate(values, 1))


#: Last or second-to-last part of a name -> unit.
_UNITS = {
    "mass": "kg",
    "com": "m",
    "inertia": "kg m^2",
    "parent": "m",
    "child": "m",
    "tilt1": "rad",
    "tilt2": "rad",
    "gravity": "m/s^2",
    "force": "N",
    "torque": "N m",
}


def unit(name: str) -> str:
    """Return the unit of a parameter, given its full name, or an empty string if the unit depends on the object."""
    *_, before, last = name.split(".")
    return _UNITS.get(last, _UNITS.get(before, ""))


def inertial(name: str) -> bool:
    """Return True for a mass or resistance parameter, which affects forces but not given motions."""
    return name.startswith("bodies.") or bool(resisting_joint(name))


def resisting_joint(name: str) -> str:
    """Return the joint whose rotor, damping or friction is the given parameter, or an empty string."""
    found = re.fullmatch(rf"joints\.(.+)\.(?:{'|'.join(RESISTS)})(?:\.\d+)?", name)
    return found[1] if found else ""


def geometric(name: str) -> bool:
    """Return True for a parameter that places a joint, and thus changes how loops close."""
    return name.startswith("joints.") and name.split(".")[-2] in SIDES


def resolve(known: Mapping[str, float], patterns: Sequence[str], where: str) -> list[str]:
    """Resolve names and patterns to full names in the order of `known`.

    A name may omit its first part, e.g. ``coupler.mass``, if it remains unique. Patterns may contain ``*``, ``?`` and
    ``[xyz]``, and match full or short names.

    Raises:
        UnknownNameError: A name or pattern does not match any parameter.
        DescriptionError: A name matches several parameters.
    """
    found = dict.fromkeys(name for pattern in patterns for name in _match(known, pattern, where))
    return [name for name in known if name in found]


def _match(known: Mapping[str, float], pattern: str, where: str) -> list[str]:
    wanted = _as_written(pattern)
    names = [name for name in known if wanted in (name, _short_name(name))]
    if len(names) > 1:
        what = f"'{pattern}' is ambiguous: {first_few(names, NAMED)}"
        raise DescriptionError(what, where, "write the full name")
    names = names or [name for name in known if any(fnmatchcase(one, wanted) for one in (name, _short_name(name)))]
    if not names:
        raise UnknownNameError("number", pattern, [*known, *map(_short_name, known)], where)
    return names


def _short_name(name: str) -> str:
    first, _, rest = name.partition(".")
    return rest if first in ("bodies", "joints") else name


def _as_written(pattern: str) -> str:
    """Convert a pattern to the names of `numbers`: drop quotes, turn ``parent_frame.position[0]`` into ``parent.x``."""
    text = pattern.replace('"', "").replace("_frame.position", "")
    return re.sub(r"\b(parent|child|com|force|torque|gravity)\[([012])\]", lambda x: f"{x[1]}.{XYZ[int(x[2])]}", text)


def changed_to(rule: Any, value: float, where: str) -> float:
    """Apply a rule: a new value, or a string in which x is the present value, e.g. ``"1.01 x"`` or ``"x + 0.002"``.

    Raises:
        DescriptionError: The rule is neither a value nor such a string.
    """
    text = rule.strip() if isinstance(rule, str) else ""
    if not re.search(r"(?<![a-z0-9_])x(?![a-z0-9_])|\dx\b", text):
        return number(rule, where)
    product = re.sub(r"([\d.)])\s*x\b", r"\1*x", text)
    return number(re.sub(r"(?<![a-z0-9_])x(?![a-z0-9_])", f"({value!r})", product), where)


def mechanism_with(mechanism: Mechanism, values: Numbers, *, symbolic: bool = False) -> Mechanism:
    """Replace numbers of a mechanism.

    Args:
        symbolic: True if the values are nodes of a trace or arrays, shape (...), which cannot be validated.

    Raises:
        DescriptionError: The new numbers are invalid for a body or joint.
    """
    make, get = replace_unchecked if symbolic else replace, partial(_value, values, symbolic)
    bodies = tuple(_body(body, get, make) for body in mechanism.bodies)
    joints = tuple(_joint(joint, get, make) for joint in mechanism.joints)
    if symbolic:
        made: Mechanism = replace_unchecked(mechanism, bodies=bodies, joints=joints)
        _forget(made, home=mechanism.home, bodies=bodies)
        return made
    if any(a is not b for a, b in zip((*bodies, *joints), (*mechanism.bodies, *mechanism.joints), strict=True)):
        return replace(mechanism, bodies=bodies, joints=joints)
    return mechanism


def replace_unchecked(item: Any, **changes: Any) -> Any:
    """Replace fields of a record without running its checks."""
    made = copy(item)
    for name, value in changes.items():
        object.__setattr__(made, name, value)
    return made


def _forget(mechanism: Mechanism, *, home: Array, bodies: Sequence[Body]) -> None:
    """Clear values that were cached for the old parameters; the home pose remains an array of floats."""
    kept = {"coordinates", "moving", "units", "limits", "body_index", "independent_columns", "actuated_columns"}
    fields = {*type(mechanism).__dataclass_fields__}
    for name in [*vars(mechanism)]:
        if name not in fields | kept:
            del vars(mechanism)[name]
    vars(mechanism)["home"] = home
    masses = [body.mass for body in bodies]
    floats = all(isinstance(mass, float) for mass in masses)
    vars(mechanism)["masses"] = np.array(masses, dtype=home.dtype if floats else object)


Get = Callable[[str, Any], Any]


def _value(values: Numbers, symbolic: bool, name: str, present: Any) -> Any:
    """Look up a number by name, or the entries of a vector by the name of the vector. Shape (3,)."""
    if not isinstance(present, np.ndarray):
        return values.get(name, present)
    keys = {3: [f"{name}.{axis}" for axis in XYZ]}.get(len(present), [])
    if not any(key in values for key in keys):
        return present
    entries = [values.get(key, x) for key, x in zip(keys, present, strict=True)]
    return np.array(entries, dtype=object if symbolic else float)


def _body(body: Body, get: Get, make: Callable[..., Body]) -> Body:
    name = f"bodies.{body.name}"
    changes = {"mass": get(f"{name}.mass", body.mass), "com": get(f"{name}.com", body.com)}
    entries = {key: get(f"{name}.inertia.{key}", body.inertia[at]) for key, at in TENSOR.items()}
    if any(entries[key] is not body.inertia[at] and entries[key] != body.inertia[at] for key, at in TENSOR.items()):
        tensor = np.zeros((3, 3), dtype=np.array([*entries.values()]).dtype)
        for key, (i, k) in TENSOR.items():
            tensor[i, k] = tensor[k, i] = entries[key]
        changes["inertia"] = tensor
    made: Body = _update(body, changes, make)
    return made


def _joint(joint: Joint, get: Get, make: Callable[..., Joint]) -> Joint:
    name, changes = f"joints.{joint.name}", dict[str, Any]()
    for side, (_, frame) in zip(SIDES, joint.sides, strict=True):
        changes[f"{side}_frame"] = _frame(frame, f"{name}.{side}", joint.axes[0], get)
    for what in RESISTS if not joint.fixed else ():
        present = getattr(joint, what)
        keys = [f"{name}.{what}.{i}" if len(present) > 1 else f"{name}.{what}" for i, _ in enumerate(present, 1)]
        entries = [get(key, x) for key, x in zip(keys, present.tolist(), strict=True)]
        if entries != present.tolist():
            changes[what] = np.array(entries)
    made: Joint = _update(joint, changes, make)
    return made


def _frame(frame: Frame, name: str, axis: Array, get: Get) -> Frame:
    p, R = get(name, frame.p), frame.R
    for tilt, direction in zip(TILTS, across(axis)[1], strict=True):
        angle = get(f"{name}.{tilt}", 0.0)
        if not isinstance(angle, float) or angle:
            R = R @ rotation(direction, _box(apply("sin", angle)), _box(apply("cos", angle)))
    return frame if p is frame.p and R is frame.R else Frame(p, R)


def _box(x: Any) -> Array:
    """Wrap a scalar of any type in a zero-dimensional array."""
    box = np.empty((), dtype=float if isinstance(x, float) else object)
    box[()] = x
    return box


def applied_with(applied: Applied, values: Numbers, *, symbolic: bool = False) -> Applied:
    """Replace numbers of applied forces, see `mechanism_with`.

    Raises:
        DescriptionError: The new numbers are invalid for a spring.
    """
    make, get = replace_unchecked if symbolic else replace, partial(_value, values, symbolic)
    loads = tuple(
        _update(load, {what: get(f"loads.{i}.{what}", getattr(load, what)) for what in ("force", "torque")}, make)
        for i, load in enumerate(applied.loads, 1)
    )
    springs = tuple(
        _update(
            one,
            {what: get(f"springs.{i}.{what}", getattr(one, what)) for what in ("stiffness", "rest", "damping")},
            make,
        )
        for i, one in enumerate(applied.springs, 1)
    )
    gravity = get("gravity", applied.g)
    changes: dict[str, Any] = {"loads": loads, "springs": springs}
    if gravity is not applied.g and not np.array_equal(gravity, applied.g):
        changes["gravity"] = gravity
    return replace(applied, **changes)


def _update(item: Any, changes: Mapping[str, Any], make: Callable[..., Any]) -> Any:
    """Replace the changed fields of an item; return the item itself if no field differs."""
    new = {name: value for name, value in changes.items() if value is not getattr(item, name)}
    return make(item, **new) if new else item
