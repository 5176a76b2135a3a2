import xml.etree.ElementTree as ET
from collections.abc import Callable

import numpy as np
from campaigns.corpus.parts import child, pick
from campaigns.editors.elements import (
    Edit,
    Editor,
    bodies,
    check_place,
    is_urdf,
    moving_joints,
    numbers,
    of_mjcf,
    of_urdf,
    put,
    two_of,
)


def weight(factor: Callable[[np.random.Generator], float]) -> Editor:
    """A mass times a factor."""

    def edit(root: ET.Element, rng: np.random.Generator) -> Edit:
        body = pick(bodies(root), rng)
        place, name = (body.find("inertial/mass"), "value") if is_urdf(root) else (body.find("inertial"), "mass")
        return Edit(put(place, name, float(place.get(name)) * factor(rng)), body.get("name"))

    return edit


def centre_of_mass(root: ET.Element, rng: np.random.Generator) -> Edit:
    body = pick(bodies(root), rng)
    inertial = body.find("inertial")
    place, name = (child(inertial, "origin"), "xyz") if is_urdf(root) else (inertial, "pos")
    step = np.eye(3)[rng.integers(3)] * rng.uniform(1e-4, 2e-2)
    return Edit(put(place, name, numbers(place.get(name, "0 0 0")) + step), body.get("name"))


def inertia(root: ET.Element, rng: np.random.Generator) -> Edit:
    body = pick(bodies(root), rng)
    place = body.find("inertial/inertia") if is_urdf(root) else body.find("inertial")
    name = "ixx" if is_urdf(root) else "diaginertia" if place.get("diaginertia") else "fullinertia"
    values = numbers(place.get(name))
    values[0] *= 1.0 + rng.uniform(1e-3, 0.05)
    return Edit(put(place, name, values), body.get("name"))


def placement(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    parents = {inner: outer for outer in root.iter() for inner in outer}
    place, name = (child(joint, "origin"), "xyz") if is_urdf(root) else (parents[joint], "pos")
    step = np.eye(3)[rng.integers(3)] * rng.uniform(1e-4, 5e-2)
    return Edit(put(place, name, numbers(place.get(name, "0 0 0")) + step), joint.get("name"))


@of_urdf
def turn(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    place = child(joint, "origin")
    angles = numbers(place.get("rpy", "0 0 0"))
    angles[rng.integers(3)] += rng.uniform(1e-3, 0.3)
    return Edit(put(place, "rpy", angles), joint.get("name"))


def reversed_axis(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    place, name = (child(joint, "axis"), "xyz") if is_urdf(root) else (joint, "axis")
    check_place(is_urdf(root) or place.get(name) is not None)
    return Edit(put(place, name, -numbers(place.get(name, "1 0 0"))), joint.get("name"))


def damping(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    place = child(joint, "dynamics") if is_urdf(root) else joint
    return Edit(put(place, "damping", rng.uniform(0.5, 3.0)), joint.get("name"))


def friction(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    place, name = (child(joint, "dynamics"), "friction") if is_urdf(root) else (joint, "frictionloss")
    return Edit(put(place, name, rng.uniform(0.5, 3.0)), joint.get("name"))


@of_mjcf
def armature(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    return Edit(put(joint, "armature", rng.uniform(0.01, 0.3)), joint.get("name"))


@of_urdf
def limits(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick([j for j in moving_joints(root) if j.find("limit") is not None and j.get("type") != "continuous"], rng)
    place = joint.find("limit")
    return Edit(put(place, "upper", float(place.get("upper", "0")) + rng.uniform(0.01, 0.3)), joint.get("name"))


def leading(root: ET.Element) -> list[ET.Element]:
    followed = {mimic.get("joint") for mimic in root.iter("mimic")}
    return [joint for joint in moving_joints(root) if joint.get("name") not in followed]


@of_urdf
def fixed(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(leading(root), rng)
    joint.set("type", "fixed")
    return Edit("joint made fixed", joint.get("name"))


@of_urdf
def missing(root: ET.Element, rng: np.random.Generator) -> Edit:
    near = {j.find("parent").get("link") for j in root.iterfind("joint")}
    joint = pick([joint for joint in leading(root) if joint.find("child").get("link") not in near], rng)
    link = next(k for k in root.iterfind("link") if k.get("name") == joint.find("child").get("link"))
    root.remove(joint)
    root.remove(link)
    return Edit(f"joint and link {link.get('name')} taken out", joint.get("name"))


@of_urdf
def mimic(root: ET.Element, rng: np.random.Generator) -> Edit:
    one, two = two_of(moving_joints(root), rng)
    ET.SubElement(one, "mimic", joint=two.get("name"), multiplier="0.5")
    return Edit(f"follows {two.get('name')} at 0.5", one.get("name"))


@of_mjcf
def gravity(root: ET.Element, rng: np.random.Generator) -> Edit:
    return Edit(put(child(root, "option"), "gravity", [0.0, 0.0, -9.81 + rng.uniform(1e-3, 0.1)]), "gravity")


RIGID: dict[str, Editor] = {
    "mass": weight(lambda rng: 1.0 + rng.uniform(1e-3, 0.2)),
    "centre of mass": centre_of_mass,
    "inertia": inertia,
    "grams": weight(lambda rng: 1000.0),
    "placement": placement,
    "turn": turn,
    "reversed axis": reversed_axis,
    "damping": damping,
    "friction": friction,
    "armature": armature,
    "limits": limits,
    "fixed": fixed,
    "missing": missing,
    "mimic": mimic,
    "gravity": gravity,
}
