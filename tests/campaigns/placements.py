"""Kinds of change of axes, placements, limits, gravity, printed digits and of what is there at all."""

from __future__ import annotations

import re

import numpy as np
from campaigns.marks import end, is_urdf, joints, moving, pose
from campaigns.mutant import CannotError, Expected, Random
from campaigns.mutations import _joint
from support.robots import unit

from screwgauge.diagnosis.files.layout import compilers, numbers
from screwgauge.diagnosis.files.write_mjcf import orient
from screwgauge.diagnosis.files.xml_text import Element, XmlText
from screwgauge.models.placement import number_text, rpy, vector_text
from screwgauge.reference.rotations import Array, rotation

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
NUMBERS = re.compile(rf"\s*{_NUMBER}(?:\s+{_NUMBER})*\s*")


def _axis(xml: XmlText, joint: Element) -> Array:
    if is_urdf(xml):
        found = joint.find("axis")
        axis = numbers(found.get("xyz") if found else "", "1 0 0")
    else:
        axis = numbers(joint.get("axis"), "0 0 1")
    return np.asarray(axis / np.linalg.norm(axis))


def _set_axis(xml: XmlText, joint: Element, axis: Array) -> None:
    if is_urdf(xml):
        xml.set_in(joint, "axis", xyz=vector_text(axis))
    else:
        xml.set(joint, axis=vector_text(axis))


def _written(xml: XmlText, joint: Element) -> bool:
    """Whether the axis stands at the joint itself and not in a default."""
    return is_urdf(xml) or bool(joint.get("axis"))


def axis_reversed(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    joint = _joint(xml, rng, lambda joint: _written(xml, joint))
    _set_axis(xml, joint, -_axis(xml, joint))
    return [Expected(joint.get("name"), ("sign",))]


def axis_tilted(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    joint = _joint(xml, rng, lambda joint: _written(xml, joint))
    axis = _axis(xml, joint)
    across = np.cross(axis, unit(rng))
    tilted = axis + np.tan(size) * across / np.linalg.norm(across)
    _set_axis(xml, joint, tilted / np.linalg.norm(tilted))
    return [Expected(joint.get("name"), ("axis",), 2.0 * np.sin(0.5 * size))]


def _mount(xml: XmlText, joint: Element) -> Element:
    """What holds the placement of what a joint carries."""
    body = joint if is_urdf(xml) else joint.parent
    if body is None or (not is_urdf(xml) and len(moving(body)) > 1):
        raise CannotError("several joints share the placement")
    return body


def _replace(xml: XmlText, mount: Element, T: Array) -> None:
    if is_urdf(xml):
        xml.set_in(mount, "origin", xyz=vector_text(T[:3, 3]), rpy=vector_text(rpy(T[:3, :3])))
        return
    xml.set(mount, pos=vector_text(T[:3, 3]))
    orient(xml, mount, T[:3, :3])


def placement_shift(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    joint = _joint(xml, rng)
    mount = _mount(xml, joint)
    T, step = pose(xml, mount), 0.1 * size
    T[:3, 3] += step * unit(rng)
    _replace(xml, mount, T)
    return [Expected(joint.get("name"), ("placement",), step)]


def placement_turn(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    joint = _joint(xml, rng)
    mount = _mount(xml, joint)
    T = pose(xml, mount)
    across = np.cross(_axis(xml, joint), unit(rng))  # about its axis it would be another zero
    T[:3, :3] = T[:3, :3] @ rotation(across / np.linalg.norm(across), np.array(size))
    _replace(xml, mount, T)
    return [Expected(joint.get("name"), ("placement", "axis"), size)]


def placement_in_millimetres(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    joint = _joint(xml, rng, lambda joint: bool(np.linalg.norm(pose(xml, _mount_of(xml, joint))[:3, 3]) > 1e-3))
    mount = _mount(xml, joint)
    T = pose(xml, mount)
    step = 999.0 * float(np.linalg.norm(T[:3, 3]))
    T[:3, 3] *= 1000.0
    _replace(xml, mount, T)
    return [Expected(joint.get("name"), ("placement",), step, "in mm")]


def _mount_of(xml: XmlText, joint: Element) -> Element:
    return joint if is_urdf(xml) or joint.parent is None else joint.parent


def placement_turn_lost(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    def turned(joint: Element) -> bool:
        R = pose(xml, _mount_of(xml, joint))[:3, :3]
        axis = _axis(xml, joint)
        return bool(np.abs(R @ axis - axis).max() > 1e-2)

    joint = _joint(xml, rng, turned)
    mount = _mount(xml, joint)
    T = pose(xml, mount)
    T[:3, :3] = np.eye(3)
    _replace(xml, mount, T)
    return [Expected(joint.get("name"), ("placement", "axis"), np.nan, "no rotation")]


def zero_offset(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    """What a hinge carries is turned about it, so that its zero is elsewhere."""
    joint = _joint(xml, rng, lambda joint: (joint.get("type") or "hinge") in ("revolute", "continuous", "hinge"))
    mount = _mount(xml, joint)
    if not is_urdf(xml) and np.any(numbers(joint.get("pos"))):
        raise CannotError("the axis does not go through the origin of the body")
    T = pose(xml, mount)
    T[:3, :3] = T[:3, :3] @ rotation(_axis(xml, joint), np.array(size))
    _replace(xml, mount, T)
    return [Expected(joint.get("name"), ("zero", "placement"), size)]


def _upper(joint: Element) -> float:
    limit = joint.find("limit")
    return float(limit.get("upper", "0")) if limit else 0.0


def limit_changed(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    if is_urdf(xml):
        joint = _joint(
            xml, rng, lambda joint: joint.get("type") in ("revolute", "prismatic") and joint.find("limit") is not None
        )
        old = _upper(joint)
        step = size * max(1.0, abs(old))
        xml.set_in(joint, "limit", upper=number_text(old + step))
    else:
        joint = _joint(xml, rng, lambda joint: bool(joint.get("range")))
        low, high = numbers(joint.get("range"))
        degrees = compilers(xml).get("angle") != "radian" and joint.get("type", "hinge") == "hinge"
        step = size * max(1.0, abs(high))
        xml.set(joint, range=vector_text([low, high + step]))
        step *= np.pi / 180.0 if degrees else 1.0
    return [Expected(joint.get("name"), ("limits",), step)]


def _gravity(xml: XmlText, change: Array) -> list[Expected]:
    if is_urdf(xml):
        raise CannotError("a URDF has no gravity")
    option = xml.root.find("option")
    old = numbers(option.get("gravity") if option else "", "0 0 -9.81")
    xml.set_in(xml.root, "option", gravity=vector_text(old + change))
    return [Expected("", ("gravity",), float(np.linalg.norm(change)))]


def gravity_value(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    return _gravity(xml, np.array([0.0, 0.0, 9.81 * size]))


def gravity_direction(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    return _gravity(xml, 9.81 * size * np.array([1.0, 0.0, 0.0]))


def compensation(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    if is_urdf(xml):
        raise CannotError("a URDF has no gravcomp")
    own = [joint.parent for joint in joints(xml) if joint.parent and joint.parent.find("inertial")]
    bodies = [body for body in own if all(moving(child) for child in body.children if child.tag == "body")]
    if not bodies:
        raise CannotError("no body with an inertial")
    body = bodies[rng.integers(len(bodies))]
    old = float(body.get("gravcomp", "0"))
    xml.set(body, gravcomp=number_text(old + size))
    return [Expected(body.get("name"), ("gravcomp",), size)]


def gear_changed(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    rooms = [] if is_urdf(xml) else [element for element in xml.root.children if element.tag == "actuator"]
    motors = [motor for room in rooms for motor in room.children if motor.tag == "motor" and motor.get("joint")]
    if not motors:
        raise CannotError("no motor of a joint")
    motor = motors[rng.integers(len(motors))]
    old = float(motor.get("gear", "1").split()[0])
    xml.set(motor, gear=number_text(old * (1.0 + size)))
    return [Expected(motor.get("name"), ("gear",), old * size)]


def joint_fixed(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    """A joint that does not move any more."""
    referred = (
        set()
        if is_urdf(xml)
        else {
            value
            for element in xml.root.iter("motor", "position", "joint", "jointpos", "actuator", "connect", "weld")
            if element.parent and element.parent.tag not in ("body",)
            for value in element.attributes.values()
        }
    )
    mimicked = {element.get("joint") for element in xml.root.iter("mimic")}
    joint = _joint(xml, rng, lambda joint: joint.get("name") not in referred | mimicked)
    if is_urdf(xml):
        xml.set(joint, type="fixed")
    else:
        xml.replace(joint)
    return [Expected(joint.get("name"), ("branch", "joint"))]


def branch_missing(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    """A last link that is not there, with its joint."""
    if not is_urdf(xml):
        raise CannotError("only of a URDF")
    mimicked = {element.get("joint") for element in xml.root.iter("mimic")}
    near = {end(element, "parent") for element in xml.root.children if element.tag == "joint"}
    last = [j for j in joints(xml) if end(j, "child") not in near and j.get("name") not in mimicked]
    if not last or len(joints(xml)) < 2:
        raise CannotError("no last link behind a joint")
    joint = last[rng.integers(len(last))]
    for element in xml.root.children:
        if element is joint or (element.tag == "link" and element.get("name") == end(joint, "child")):
            xml.replace(element)
    return [Expected(joint.get("name"), ("branch", "joint"))]


def digits(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    """The file printed with six or seven digits."""
    places, changed = 6 + int(rng.integers(2)), False
    for element in xml.root.iter():
        for name, text in element.attributes.items():
            short = " ".join(f"{float(word):.{places}g}" for word in text.split()) if NUMBERS.fullmatch(text) else text
            if any(float(a) != float(b) for a, b in zip(short.split(), text.split(), strict=True) if short != text):
                changed = True
                xml.set(element, **{name: short})
    if not changed:
        raise CannotError("all numbers are short")
    return [Expected("", ("digits",))]


def anchor_moved(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    """Where a closure of an MJCF holds one of its bodies."""
    step = 0.1 * size * unit(rng)
    sites = {element.get("name"): element for element in xml.root.iter("site")}
    parts = [part for room in xml.root.iter("equality") for part in room.children if part.tag == "connect"]
    parts = [part for part in parts if part.get("name") and part.get("site1") in sites]
    if not parts:
        raise CannotError("no closure of two sites")
    part = parts[rng.integers(len(parts))]
    site = sites[part.get("site1")]
    xml.set(site, pos=vector_text(numbers(site.get("pos")) + step))
    return [Expected(part.get("name"), ("first_frame", "second_frame"), float(np.linalg.norm(step)))]


def coupling_changed(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    """By how much a joint follows another one."""
    found = [joint for joint in xml.root.children if joint.find("mimic") is not None] if is_urdf(xml) else []
    if not found:
        raise CannotError("no joint follows another one")
    joint = found[rng.integers(len(found))]
    mimic = joint.find("mimic")
    old = float(mimic.get("multiplier", "1")) if mimic else 1.0
    xml.set_in(joint, "mimic", multiplier=number_text(old * (1.0 + size)))
    return [Expected(joint.get("name"), ("polynomial",), abs(old * size))]
