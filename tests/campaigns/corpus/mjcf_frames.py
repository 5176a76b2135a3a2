import xml.etree.ElementTree as ET
from math import radians

import numpy as np
from campaigns.corpus.poses import (
    EYE,
    Array,
    inverse,
    numbers,
    of_quaternion,
    point,
    pose,
    text,
    to_quaternion,
    turn,
    unit,
)

ORIENTATIONS = ("quat", "euler", "axisangle", "xyaxes", "zaxis")
#: What has a pose in the frame of a body.
POSED = ("body", "geom", "site", "camera", "light", "inertial")


class CannotError(Exception):
    """An MJCF that is not rewritten: what it has of defaults or composites would move along."""


def in_degrees(root: ET.Element) -> bool:
    return all(c.get("angle", "degree") == "degree" for c in root.iterfind("compiler"))


def sequence(root: ET.Element) -> str:
    return next((c.get("eulerseq", "xyz") for c in root.iterfind("compiler") if c.get("eulerseq")), "xyz")


def orientation(element: ET.Element, root: ET.Element) -> Array:
    """Shape (3, 3)."""
    scale = radians(1.0) if in_degrees(root) else 1.0
    if value := element.get("quat"):
        return of_quaternion(numbers(value))
    if value := element.get("axisangle"):
        *v, angle = numbers(value)
        return turn(np.array(v), angle * scale)
    if value := element.get("euler"):
        R = EYE
        for letter, angle in zip(sequence(root), numbers(value), strict=True):
            step = turn(EYE["xyz".index(letter.lower())], angle * scale)
            R = R @ step if letter.islower() else step @ R
        return np.asarray(R)
    if value := element.get("xyaxes"):
        v = numbers(value)
        x = unit(v[:3])
        y = unit(v[3:] - (v[3:] @ x) * x)
        return np.array([x, y, np.cross(x, y)]).T
    if value := element.get("zaxis"):
        z = unit(numbers(value))
        v = np.cross(EYE[2], z)
        if np.linalg.norm(v) < 1e-12:
            return EYE if z[2] > 0 else turn(EYE[0], np.pi)
        return turn(v, float(np.arctan2(np.linalg.norm(v), z[2])))
    return EYE


def pose_of(element: ET.Element, root: ET.Element) -> Array:
    """Shape (4, 4)."""
    return pose(orientation(element, root), numbers(element.get("pos", "0 0 0")))


def put_pose(element: ET.Element, T: Array) -> None:
    for name in ORIENTATIONS:
        element.attrib.pop(name, None)
    element.set("pos", text(T[:3, 3]))
    element.set("quat", text(to_quaternion(T[:3, :3])))


def move_frame(root: ET.Element, body: ET.Element, X: Array) -> None:
    put_pose(body, pose_of(body, root) @ X)
    back = inverse(X)
    for child in body:
        if child.tag == "joint":
            child.set("pos", text(point(back, numbers(child.get("pos", "0 0 0")))))
            if child.get("type") != "ball":
                child.set("axis", text(back[:3, :3] @ numbers(child.get("axis", "0 0 1"))))
        elif child.tag == "inertial":
            _move_inertial(child, root, back)
        elif child.tag in POSED and child.get("fromto"):
            ends = numbers(child.get("fromto", ""))
            child.set("fromto", text([*point(back, ends[:3]), *point(back, ends[3:])]))
        elif child.tag in ("body", "geom", "site"):
            put_pose(child, back @ pose_of(child, root))
    _move_anchors(root, body.get("name", ""), X)


def _move_inertial(inertial: ET.Element, root: ET.Element, back: Array) -> None:
    if full := inertial.get("fullinertia"):  # MuJoCo takes no orientation beside it
        xx, yy, zz, xy, xz, yz = numbers(full)
        R = back[:3, :3]
        I = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
        inertial.set("pos", text(point(back, numbers(inertial.get("pos", "0 0 0")))))
        inertial.set("fullinertia", text([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]))
    else:
        put_pose(inertial, back @ pose_of(inertial, root))


def _move_anchors(root: ET.Element, name: str, X: Array) -> None:
    """Rewrite closures: an anchor in the frame of its first body, the pose of a weld in those of both."""
    for room in root.iterfind("equality"):
        for part in room:
            if part.tag == "connect" and part.get("anchor") and part.get("body1") == name:
                part.set("anchor", text(point(inverse(X), numbers(part.get("anchor", "")))))
            if part.tag == "weld" and name in (part.get("body1"), part.get("body2")) and part.get("relpose"):
                raise CannotError("a weld with a pose of its own")


def check_movable(root: ET.Element) -> None:
    """True if elements of the file itself state all poses and axes, and no defaults do.

    Raises:
        CannotError: They do not.
    """
    for default in root.iter("default"):
        for part in default:
            for name in ("pos", "axis", "fromto", *ORIENTATIONS):
                if part.tag in ("joint", "geom", "site", "inertial") and part.get(name):
                    raise CannotError(f"{name} of {part.tag} in a default")
            if part.tag == "joint" and part.get("type"):
                raise CannotError("type of joint in a default")
    for tag in ("include", "composite", "flexcomp", "frame", "replicate", "attach"):
        if root.find(f".//{tag}") is not None:
            raise CannotError(f"has {tag}")
