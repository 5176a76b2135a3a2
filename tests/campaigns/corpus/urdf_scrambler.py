"""The same URDF, said differently, by its XML alone."""

import copy
import xml.etree.ElementTree as ET

import numpy as np
from campaigns.corpus.poses import Array, Random, direction, inverse, numbers, of_rpy, pose, text, to_rpy, turn
from campaigns.corpus.scrambled import ALL, FRAMES, HOME, NAMES, ORDER, SIGNS, Scrambled, coordinate, numbered, shuffled

MOVING = ("revolute", "continuous", "prismatic")
JOINT = ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic")


def scramble_urdf(root: ET.Element, rng: Random, do: frozenset[str] = ALL) -> Scrambled:
    """A copy with other names, order, frames of links, home pose and directions of axes, the machine being the same.

    Joints that others follow, and those that follow, keep home and direction. Visuals, collisions and what is no part
    of URDF are left out, since they stand in frames and under names that change.
    """
    done = Scrambled(copy.deepcopy(root))
    tree = done.root
    _stripped(tree)
    joints = list(tree.iterfind("joint"))
    coupled = {m.get("joint", "") for m in tree.iter("mimic")} | {
        joint.get("name", "") for joint in joints if joint.find("mimic") is not None
    }
    free = [joint for joint in joints if joint.get("type") in MOVING and joint.get("name") not in coupled]
    if HOME in do:
        for joint in free:
            _another_home(joint, rng, done)
    if SIGNS in do:
        for joint in free:
            if rng.random() < 0.4:
                _reverse(joint, done)
    if FRAMES in do:
        for joint in joints:
            _another_frame(tree, joint, rng, done)
    if NAMES in do:
        _rename(tree, rng, done)
    if ORDER in do:
        shuffled(tree, rng)
    return done


def _stripped(tree: ET.Element) -> None:
    kept = {"robot": ("link", "joint"), "link": ("inertial",), "joint": JOINT}
    for parent in [tree, *tree.iterfind("link"), *tree.iterfind("joint")]:
        for child in [*parent]:
            if child.tag not in kept[parent.tag]:
                parent.remove(child)


def origin(element: ET.Element) -> Array:
    at = element.find("origin")
    if at is None:
        return np.eye(4)
    return pose(of_rpy(numbers(at.get("rpy", "0 0 0"))), numbers(at.get("xyz", "0 0 0")))


def put_origin(element: ET.Element, T: Array) -> None:
    at = element.find("origin")
    if at is None:
        at = ET.SubElement(element, "origin")
    at.set("xyz", text(T[:3, 3]))
    at.set("rpy", text(to_rpy(T[:3, :3])))


def axis(joint: ET.Element) -> Array:
    at = joint.find("axis")
    v = numbers(at.get("xyz", "1 0 0")) if at is not None else np.array([1.0, 0.0, 0.0])
    return np.asarray(v / (np.linalg.norm(v) or 1.0))  # a fixed joint may have none


def put_axis(joint: ET.Element, v: Array) -> None:
    at = joint.find("axis")
    if at is None:
        at = ET.SubElement(joint, "axis")
    at.set("xyz", text(v))


def end(joint: ET.Element, tag: str) -> str:
    at = joint.find(tag)
    return at.get("link", "") if at is not None else ""


def _another_home(joint: ET.Element, rng: Random, done: Scrambled) -> None:
    q = coordinate(joint.get("type", ""), rng)
    step = pose(p=q * axis(joint)) if joint.get("type") == "prismatic" else pose(turn(axis(joint), q))
    put_origin(joint, origin(joint) @ step)
    limit = joint.find("limit")
    if limit is not None:
        for name in ("lower", "upper"):
            if limit.get(name):
                limit.set(name, text(float(limit.get(name, "0")) - q))
    done.homes[joint.get("name", "")] = q


def _reverse(joint: ET.Element, done: Scrambled) -> None:
    put_axis(joint, -axis(joint))
    limit = joint.find("limit")
    if limit is not None:
        low, high = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
        limit.set("lower", text(-high))
        limit.set("upper", text(-low))
    done.flipped.add(joint.get("name", ""))


def _another_frame(tree: ET.Element, joint: ET.Element, rng: Random, done: Scrambled) -> None:
    """Give the link behind a joint another frame: a hinge's axis still passes through its origin."""
    name = end(joint, "child")
    v = axis(joint)
    way = rng.uniform(-0.1, 0.1) * v if joint.get("type") in ("revolute", "continuous") else rng.uniform(-0.1, 0.1, 3)
    X = pose(turn(direction(rng), rng.uniform(0.2, 3.0)), way)
    put_origin(joint, origin(joint) @ X)
    if joint.get("type") != "fixed":
        put_axis(joint, X[:3, :3].T @ v)
    for link in tree.iterfind("link"):
        inertial = link.find("inertial")
        if link.get("name") == name and inertial is not None:
            put_origin(inertial, inverse(X) @ origin(inertial))
    for other in tree.iterfind("joint"):
        if end(other, "parent") == name:
            put_origin(other, inverse(X) @ origin(other))
    done.frames[name] = X


def _rename(tree: ET.Element, rng: Random, done: Scrambled) -> None:
    links = [link.get("name") for link in tree.iterfind("link")]
    joints = [joint.get("name") for joint in tree.iterfind("joint")]
    of_links, of_joints = numbered(links, "part", rng), numbered(joints, "pivot", rng)
    for link in tree.iterfind("link"):
        link.set("name", of_links[link.get("name", "")])
    for joint in tree.iterfind("joint"):
        joint.set("name", of_joints[joint.get("name", "")])
        for tag in ("parent", "child"):
            at = joint.find(tag)
            if at is not None:
                at.set("link", of_links[at.get("link", "")])
        for mimic in joint.iter("mimic"):
            mimic.set("joint", of_joints[mimic.get("joint", "")])
    done.names = {f"joint {old}": new for old, new in of_joints.items()}
    done.names |= {f"body {old}": new for old, new in of_links.items()}
