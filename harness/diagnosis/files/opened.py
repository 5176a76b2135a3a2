"""A model file beside what was read from it: which of its links make up which body, and where they stand."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from types import ModuleType

import numpy as np

from screwgauge.diagnosis.files import write_mjcf, write_urdf
from screwgauge.diagnosis.files.layout import Link, UnpatchableError
from screwgauge.diagnosis.files.xml_text import XmlText
from screwgauge.diagnosis.transformations import axis
from screwgauge.models.matter import Matter, combined, displaced, of_body, relative
from screwgauge.models.readings.assemble import matrix
from screwgauge.models.readings.reading import JointReading, Reading
from screwgauge.reference.rotations import Array, cross, rotation

#: Tag of the outermost element -> who writes such a file.
WRITERS: Mapping[str, ModuleType] = {"robot": write_urdf, "mujoco": write_mjcf}


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A model file about to be changed.

    Attributes:
        xml: Its text.
        writer: What writes such a file.
        links: Its links, each after the one before it.
        owner: Body that each link is part of; empty of the ground's, and of massless links between two joints.
        reading: What was read from it.
    """

    xml: XmlText
    writer: ModuleType
    links: list[Link]
    owner: list[str]
    reading: Reading

    @property
    def urdf(self) -> bool:
        return self.writer is write_urdf

    def of(self, body: str) -> list[int]:
        """The links that make up a body; the one that its joints lead to is the first."""
        return [i for i, owner in enumerate(self.owner) if owner == body]

    def parts(self, body: str) -> dict[int, Matter]:
        """What each of its links adds to a body, in the frame of the body."""
        whole = self.reading.bodies[body]
        said = {i: (self.links[i].matter, relative(whole.pose, self.links[i].frame)) for i in self.of(body)}
        parts = {i: displaced(matter, T) for i, (matter, T) in said.items() if matter is not None}
        silent = [i for i in said if i not in parts]
        if silent:  # the geoms of one of them are what is left
            parts[silent[0]] = reduce(lambda left, part: combined(left, part, -1.0), parts.values(), of_body(whole))
        return parts


def opened(text: str, reading: Reading) -> Opened:
    """Puts a file beside its reading.

    Raises:
        DescriptionError: The file is no XML.
        UnpatchableError: It is no URDF or MJCF, or not that of the reading.
    """
    xml = XmlText(text, reading.name)
    if xml.root.tag not in WRITERS:
        raise UnpatchableError(f"<{xml.root.tag}> begins neither a URDF nor an MJCF")
    writer = WRITERS[xml.root.tag]
    links, ends = writer.links(xml), {body.joints[-1]: name for name, body in reading.bodies.items()}
    known = {joint for link in links for joint in link.joints}
    floating = [name for joint, name in ends.items() if joint not in known]  # a base freed when it was read
    owner = list[str]()
    for link in links:
        if unknown := [joint for joint in link.joints if joint not in reading.joints]:
            raise UnpatchableError(f"joint '{unknown[0]}' of the file is not in what {reading.library} read")
        last = [*link.joints][-1:]
        near = owner[link.near] if link.near >= 0 else "".join(floating[:1])
        owner.append(ends.get(last[0], "") if last else near)
    if lost := {*reading.bodies} - {*owner}:
        raise UnpatchableError(f"body '{min(lost)}' does not stand in the file itself")
    return Opened(xml, writer, links, owner, reading)


def frames_of(file: Opened, target: Reading) -> list[Array]:
    """Frames of the links in the world, at home, if the machine were as in another reading of it. Shape (4, 4) each."""
    D, frames = list[Array](), list[Array]()
    for link, owner in zip(file.links, file.owner, strict=True):
        D.append(_displacement(file.reading, target, link, owner, D))
        F = D[-1] @ link.frame
        if file.urdf and link.joints:  # in a URDF the axis goes through the origin of the link
            F = F @ matrix(_off_axis(F, target.joints[next(iter(link.joints))]), np.eye(3))
        frames.append(F)
    return frames


def move(file: Opened, target: Reading, gone: Collection[int] = ()) -> list[Array]:
    """Writes placements and axes of another reading of the same machine.

    Args:
        gone: Links that are to be taken out: what hangs on them is hung, where it is, on what is before them.

    Returns:
        Frame of each link in the world. Shape (4, 4) each.
    """
    frames = frames_of(file, target)
    for i, (link, F) in enumerate(zip(file.links, frames, strict=True)):
        if i in gone:
            continue
        if link.near >= 0:
            old = relative(file.links[link.near].frame, link.frame)
            rehung = _rehung(file, link, gone)
            new = relative(frames[rehung.near], F)
            if file.urdf:
                new = new @ _turned_back(file, target, link, F)
            if rehung is not link:
                file.writer.hang(file.xml, rehung, file.links[rehung.near])
            if rehung is not link or not _same(old, new):
                file.writer.place(file.xml, rehung, new)
        for name, element in link.joints.items():
            before, after = _local(link.frame, file.reading.joints[name]), _local(F, target.joints[name])
            if not _same(before[0], after[0]) or (not file.urdf and not _same(before[1], after[1])):
                file.writer.direct(file.xml, element, *after)
    return frames


def _rehung(file: Opened, link: Link, gone: Collection[int]) -> Link:
    """A link on the one before it that stays; itself where that is the one before it."""
    while link.near in gone:
        before = file.links[link.near]
        link = replace(link, near=before.near, base=before.base @ link.base)
    return link


def _same(old: Array, new: Array) -> bool:
    return float(np.abs(new - old).max()) <= write_urdf.SAME * max(1.0, float(np.abs(old).max()))


def _displacement(reading: Reading, target: Reading, link: Link, owner: str, near: list[Array]) -> Array:
    """Of a link in the world."""
    if owner:
        old, new = reading.bodies[owner].pose, target.bodies[owner].pose
        return np.eye(4) if np.array_equal(old, new) else np.asarray(new @ np.linalg.inv(old))
    if not link.joints:
        return near[link.near] if link.near >= 0 else np.eye(4)
    name = [*link.joints][-1]
    return _shortest(reading.joints[name], target.joints[name])


def _shortest(old: JointReading, new: JointReading) -> Array:
    """Displacement that takes the axis of a joint to another one and does not turn about it."""
    a, b = axis(old), axis(new)
    turn = cross(a, b)
    s = float(np.linalg.norm(turn))
    R = rotation(turn / s, np.array(np.arctan2(s, a @ b))) if s > 0.0 else np.eye(3)
    return matrix(new.centre - R @ old.centre, R)


def _off_axis(F: Array, joint: JointReading) -> Array:
    """From the origin of a frame to the nearest point of a hinge's axis, in the frame. Shape (3,)."""
    if joint.kind != "hinge":
        return np.zeros(3)
    along, r = axis(joint), joint.centre - F[:3, 3]
    step = r - (along @ r) * along
    return np.asarray(F[:3, :3].T @ step) if np.abs(step).max() > write_urdf.SAME else np.zeros(3)


def _turned_back(file: Opened, target: Reading, link: Link, F: Array) -> Array:
    """From home, which the file counts as zero, to the zero of the target. Shape (4, 4)."""
    for name in link.joints:
        joint, angle = target.joints[name], file.reading.joints[name].home - target.joints[name].home
        if angle != 0.0:
            along, turns = _local(F, joint)[0], joint.kind == "hinge"
            return matrix(np.zeros(3), rotation(along, np.array(angle))) if turns else matrix(angle * along, np.eye(3))
    return np.eye(4)


def _local(F: Array, joint: JointReading) -> tuple[Array, Array]:
    """Axis of a joint and a point on it, in a frame. Shape (3,) each."""
    return F[:3, :3].T @ axis(joint), F[:3, :3].T @ (joint.centre - F[:3, 3])
