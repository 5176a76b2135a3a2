from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np
from campaigns.corpus import mjcf_frames
from campaigns.corpus.poses import EYE, Array, Random, numbers, point
from campaigns.corpus.urdf_scrambler import MOVING, end, origin

T = TypeVar("T")


class NoPlaceError(Exception):
    """The edit fits nowhere."""


class Parts:
    """A model file and what it has.

    Attributes:
        root: Of its XML.
        urdf: Whether it is a URDF, and not an MJCF.
    """

    def __init__(self, root: ET.Element) -> None:
        self.root = root
        self.urdf = root.tag == "robot"

    @classmethod
    def read(cls, file: Path) -> Parts:
        return cls(ET.parse(file).getroot())

    # --- trees

    @cached_property
    def parents(self) -> dict[ET.Element, ET.Element]:
        return {inner: outer for outer in self.root.iter() for inner in outer}

    @cached_property
    def above(self) -> dict[str, ET.Element]:
        return {end(joint, "child"): joint for joint in self.root.iterfind("joint")}

    def bodies(self) -> list[ET.Element]:
        some = self.root.iterfind("link") if self.urdf else self.root.iterfind("worldbody//body")
        return [body for body in some if body.get("name") and self.mass(body) > 0.0 and self.carrier(body)]

    def joints(self) -> list[ET.Element]:
        if self.urdf:
            return [j for j in self.root.iterfind("joint") if j.get("type") in MOVING and j.find("mimic") is None]
        some = self.root.iterfind("worldbody//body/joint")
        return [j for j in some if j.get("name") and j.get("type", "hinge") in ("hinge", "slide")]

    def single(self) -> list[ET.Element]:
        if self.urdf:
            return self.joints()
        return [j for j in self.joints() if len([k for k in self.parents[j] if k.tag in ("joint", "freejoint")]) == 1]

    def mass(self, body: ET.Element) -> float:
        inertial = body.find("inertial")
        if inertial is None:
            return 0.0
        place = inertial.find("mass") if self.urdf else inertial
        return float(place.get("value" if self.urdf else "mass", "0")) if place is not None else 0.0

    def carrier(self, body: ET.Element) -> str:
        """Name of the body that it is fixed to, itself if it moves; empty on the ground."""
        if self.urdf:
            name = body.get("name", "")
            while name in self.above and self.above[name].get("type") == "fixed":
                name = end(self.above[name], "parent")
            return name if name in self.above else ""
        at: ET.Element | None = body
        while at is not None and at.tag == "body":
            if at.find("joint") is not None or at.find("freejoint") is not None:
                return at.get("name", "")
            at = self.parents.get(at)
        return ""

    def lump(self, body: ET.Element) -> list[str]:
        some = self.root.iterfind("link") if self.urdf else self.root.iterfind("worldbody//body")
        near = self.carrier(body)
        return [other.get("name", "") for other in some if self.carrier(other) == near and self.mass(other) > 0.0]

    def owner(self, joint: ET.Element) -> str:
        return end(joint, "child") if self.urdf else self.parents[joint].get("name", "")

    def before(self, joint: ET.Element) -> str:
        if self.urdf:
            return end(joint, "parent")
        outer = self.parents[self.parents[joint]]
        return outer.get("name", "") if outer.tag == "body" else ""

    def placed(self, name: str) -> Array:
        T = np.eye(4)
        if self.urdf:
            while name in self.above:
                T = origin(self.above[name]) @ T
                name = end(self.above[name], "parent")
            return np.asarray(T)
        at = next((b for b in self.root.iterfind("worldbody//body") if b.get("name") == name), None)
        while at is not None and at.tag == "body":
            T = mjcf_frames.pose_of(at, self.root) @ T
            at = self.parents.get(at)
        return np.asarray(T)

    def world(self, name: str) -> Array:
        return self.placed(name)[:3, :3]

    def line(self, joint: ET.Element) -> tuple[Array, Array]:
        T = self.placed(self.owner(joint))
        at = numbers(joint.get("pos", "0 0 0")) if not self.urdf else np.zeros(3)
        return point(T, at), np.asarray(T[:3, :3] @ self.axis(joint))

    def previous(self, joint: ET.Element) -> ET.Element | None:
        some = self.root.iterfind("link") if self.urdf else self.root.iterfind("worldbody//body")
        before = next((body for body in some if body.get("name") == self.before(joint)), None)
        near = self.carrier(before) if before is not None else ""
        return next((other for other in self.joints() if near and self.owner(other) == near), None)

    def behind(self, joint: ET.Element) -> list[ET.Element]:
        def carried(other: ET.Element) -> bool:
            name = self.owner(other)
            if not self.urdf:
                return any(at is self.parents[joint] for at in self._outwards(other))
            while name in self.above and self.above[name] is not joint:
                name = end(self.above[name], "parent")
            return name in self.above

        return [other for other in self.joints() if carried(other)]

    def _outwards(self, joint: ET.Element) -> Iterator[ET.Element]:
        at: ET.Element | None = self.parents[joint]
        while at is not None:
            yield at
            at = self.parents.get(at)

    # --- numbers

    def slides(self, joint: ET.Element) -> bool:
        return joint.get("type") in ("prismatic", "slide")

    def axis(self, joint: ET.Element) -> Array:
        """In axes of the body behind it. Unit vector, shape (3,)."""
        if self.urdf:
            at = joint.find("axis")
            v = numbers(at.get("xyz", "1 0 0")) if at is not None else EYE[0]
        else:
            v = numbers(joint.get("axis", "0 0 1"))
        return np.asarray(v / np.linalg.norm(v))

    def referred(self) -> set[str]:
        names = {m.get("joint", "") for m in self.root.iter("mimic")}
        for tag in ("equality", "tendon"):
            for part in self.root.iterfind(f"{tag}//*"):
                names |= {part.get(key, "") for key in ("joint", "joint1", "joint2")}
        return names - {""}


def pick(some: Sequence[T] | Iterator[T], rng: Random) -> T:
    """Draw one of some items.

    Raises:
        NoPlaceError: The list is empty.
    """
    listed = [*some]
    if not listed:
        raise NoPlaceError
    return listed[int(rng.integers(len(listed)))]


def child(element: ET.Element, tag: str) -> ET.Element:
    first = element.find(tag)
    return first if first is not None else ET.SubElement(element, tag)
