"""Writes changes in a reading into the text of its model file, and leaves everything else unchanged."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from screwgauge.diagnosis.properties import INERTIAL, PROPERTIES, Change, apply_changes
from screwgauge.models.files import mjcf, urdf
from screwgauge.models.files.urdf import SAME
from screwgauge.models.files.xml import Element, TextLink, UnpatchableError, XmlText
from screwgauge.models.matter import Matter, displace, divide, is_same, plainest, remainder, spread
from screwgauge.models.poses import matrix, relative, shortest_step
from screwgauge.models.readings.reading import BodyReading, JointReading, Reading
from screwgauge.reference.rotations import Array, rotation

#: Tag of the outermost element -> module that writes the format.
WRITERS: Mapping[str, ModuleType] = {"robot": urdf, "mujoco": mjcf}


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A model file opened for changes.

    Attributes:
        xml: Parsed text.
        writer: Module that writes the format of the file.
        links: Links, parents first.
        owner: Body of each link; empty for links of the ground, and for massless links between two joints.
        reading: Reading of the file.
    """

    xml: XmlText
    writer: ModuleType
    links: list[TextLink]
    owner: list[str]
    reading: Reading

    @property
    def urdf(self) -> bool:
        return self.writer is urdf

    def of(self, body: str) -> list[int]:
        """List the links of a body, starting with the link that its joints move."""
        return [i for i, owner in enumerate(self.owner) if owner == body]

    def parts(self, body: str) -> dict[int, Matter]:
        """Return the mass properties of each link of a body, in the frame of the body."""
        whole = self.reading.bodies[body]
        links = {i: (self.links[i].matter, relative(whole.pose, self.links[i].frame)) for i in self.of(body)}
        parts = {i: displace(matter, T) for i, (matter, T) in links.items() if matter is not None}
        silent = [i for i in links if i not in parts]
        if silent:  # the remainder belongs to the geoms of one of these links
            parts[silent[0]] = remainder(whole, parts.values())
        return parts


def open_model(text: str, reading: Reading) -> Opened:
    """Open a model file, given its text and its reading.

    Raises:
        DescriptionError: The file is not XML.
        UnpatchableError: The file is neither a URDF nor an MJCF, or does not match the reading.
    """
    xml = XmlText(text, reading.name)
    if xml.root.tag not in WRITERS:
        raise UnpatchableError(f"the root element <{xml.root.tag}> is neither <robot> (URDF) nor <mujoco> (MJCF)")
    writer = WRITERS[xml.root.tag]
    links, ends = writer.links(xml), {body.joints[-1]: name for name, body in reading.bodies.items()}
    known = {joint for link in links for joint in link.joints}
    floating = [name for joint, name in ends.items() if joint not in known]  # a floating base added by the reader
    owner = list[str]()
    for link in links:
        if unknown := [joint for joint in link.joints if joint not in reading.joints]:
            raise UnpatchableError(f"{reading.library} did not read joint '{unknown[0]}' of the file")
        last = [*link.joints][-1:]
        near = owner[link.near] if link.near >= 0 else "".join(floating[:1])
        owner.append(ends.get(last[0], "") if last else near)
    if lost := {*reading.bodies} - {*owner}:
        raise UnpatchableError(f"body '{min(lost)}' is not defined in the file itself")
    return Opened(xml, writer, links, owner, reading)


def frames_of(file: Opened, target: Reading) -> list[Array]:
    """Return the world frames of the links at the home pose of a second reading of the machine. Shape (4, 4) each."""
    D, frames = list[Array](), list[Array]()
    for link, owner in zip(file.links, file.owner, strict=True):
        D.append(_displacement(file.reading, target, link, owner, D))
        F = D[-1] @ link.frame
        if file.urdf and link.joints:  # the axis of a URDF passes through the origin of the link
            F = F @ matrix(_off_axis(F, target.joints[next(iter(link.joints))]), np.eye(3))
        frames.append(F)
    return frames


def move(file: Opened, target: Reading, gone: Collection[int] = ()) -> list[Array]:
    """Write the placements and axes of a second reading of the same machine.

    Args:
        gone: Links to remove; their children are attached to an ancestor without moving.

    Returns:
        World frame of each link. Shape (4, 4) each.
    """
    frames = frames_of(file, target)
    for i, (link, F) in enumerate(zip(file.links, frames, strict=True)):
        if i in gone:
            continue
        if link.near >= 0:
            old = relative(file.links[link.near].frame, link.frame)
            rehung = _rehang(file, link, gone)
            new = relative(frames[rehung.near], F)
            if file.urdf:
                new = new @ _turn_to_zero(file, target, link, F)
            if rehung is not link:
                file.writer.hang(file.xml, rehung, file.links[rehung.near])
            if rehung is not link or not _is_equal(old, new):
                file.writer.place(file.xml, rehung, new)
        for name, element in link.joints.items():
            before, after = _express(link.frame, file.reading.joints[name]), _express(F, target.joints[name])
            if not _is_equal(before[0], after[0]) or (not file.urdf and not _is_equal(before[1], after[1])):
                file.writer.direct(file.xml, element, *after)
    return frames


def _rehang(file: Opened, link: TextLink, gone: Collection[int]) -> TextLink:
    """Attach a link to its nearest remaining ancestor."""
    while link.near in gone:
        before = file.links[link.near]
        link = replace(link, near=before.near, base=before.base @ link.base)
    return link


def _is_equal(old: Array, new: Array) -> bool:
    return float(np.abs(new - old).max()) <= SAME * max(1.0, float(np.abs(old).max()))


def _displacement(reading: Reading, target: Reading, link: TextLink, owner: str, near: list[Array]) -> Array:
    """Return the displacement of a link in the world frame. Shape (4, 4)."""
    if owner:
        old, new = reading.bodies[owner].pose, target.bodies[owner].pose
        return np.eye(4) if np.array_equal(old, new) else np.asarray(new @ np.linalg.inv(old))
    if not link.joints:
        return near[link.near] if link.near >= 0 else np.eye(4)
    joints = (each.joints[[*link.joints][-1]] for each in (reading, target))
    return shortest_step(*((joint.direction, joint.centre) for joint in joints))


def _off_axis(F: Array, joint: JointReading) -> Array:
    """Compute the vector from a frame's origin to the nearest point of a hinge axis, in that frame. Shape (3,)."""
    if joint.kind != "hinge":
        return np.zeros(3)
    along, r = joint.direction, joint.centre - F[:3, 3]
    step = r - (along @ r) * along
    return np.asarray(F[:3, :3].T @ step) if np.abs(step).max() > SAME else np.zeros(3)


def _turn_to_zero(file: Opened, target: Reading, link: TextLink, F: Array) -> Array:
    """Compute the displacement from home, the zero pose of the file, to the target's zero pose. Shape (4, 4)."""
    for name in link.joints:
        joint, angle = target.joints[name], file.reading.joints[name].home - target.joints[name].home
        if angle != 0.0:
            along, turns = _express(F, joint)[0], joint.kind == "hinge"
            return matrix(np.zeros(3), rotation(along, np.array(angle))) if turns else matrix(angle * along, np.eye(3))
    return np.eye(4)


def _express(F: Array, joint: JointReading) -> tuple[Array, Array]:
    """Express the axis of a joint and a point on it in a frame. Shape (3,) each."""
    return F[:3, :3].T @ joint.direction, F[:3, :3].T @ (joint.centre - F[:3, 3])


#: Changes that remove parts.
LESS = ("branch", "link")


#: Changes that could not be written, and why.
Left = tuple[tuple[Change, str], ...]


def change_file(
    text: str,
    reading: Reading,
    changes: Sequence[Change],
    *,
    plain: bool = False,
    spell: Callable[[str], str] = str,
) -> tuple[str, Left]:
    """Apply changes to the text of a model file.

    Args:
        text: Text of the file.
        reading: Reading of the file, to which the changes refer.
        plain: Write complete inertials in the axes of their links instead of making the smallest change.
        spell: Function that formats the value of an attribute.

    Returns:
        Text of the changed file, and the changes that could not be written.

    Raises:
        DescriptionError: The file is not XML.
    """
    try:
        file = open_model(text, reading)
    except UnpatchableError as error:
        return text, tuple((change, str(error)) for change in changes)
    file.xml.spell = spell
    left = list[tuple[Change, str]]()
    done = list[Change]()
    for change in changes:
        try:
            _check(file, change)
            done.append(change)
        except UnpatchableError as error:
            left.append((change, str(error)))
    gone = {i for change in done if change.what == "link" for i in _links_of_joint(file, change.item)}
    try:
        _write(file, apply_changes(reading, [change for change in done if change.what not in LESS]), plain, gone)
    except UnpatchableError as error:
        return text, (*left, *((change, str(error)) for change in done))
    for change in done:
        if change.what == "branch":
            file.writer.drop(file.xml, _descendants(file, change.item))
    if gone:
        file.writer.splice(file.xml, [file.links[i] for i in gone])
    return file.xml.text(), tuple(left)


def _check(file: Opened, change: Change) -> None:
    """Check that the format of the file supports a change.

    Raises:
        UnpatchableError: The change is not supported.
    """
    if not getattr(PROPERTIES[change.what], "urdf" if file.urdf else "mjcf"):
        raise UnpatchableError(f"{'URDF' if file.urdf else 'MJCF'} cannot express {change.what}")
    if change.what in INERTIAL:
        file.writer.check_matter(file.xml)
        links = file.of(change.item)
        if len(links) > 1 and all(file.links[i].matter is None for i in links):
            raise UnpatchableError(f"the mass of '{change.item}' comes from the geoms of several bodies")


def _write(file: Opened, target: Reading, plain: bool, gone: Collection[int]) -> None:
    """Write all parts of the target that differ from the file; remove the links in `gone`."""
    frames, reading = move(file, target, gone), file.reading
    elements = {name: element for link in file.links for name, element in link.joints.items()}
    for name, body in target.bodies.items():
        _fill(file, frames, name, body, plain)
        if body.gravcomp != reading.bodies[name].gravcomp:
            for i in file.of(name):
                file.writer.tell_body(file.xml, file.links[i].element, body.gravcomp)
    _move(file, target, elements)
    _close(file, frames, target)
    if target.gravity is not None and np.any(target.gravity != reading.gravity):
        file.writer.tell_model(file.xml, gravity=target.gravity)
    if target.medium != reading.medium:
        file.writer.tell_model(file.xml, density=target.medium[0], viscosity=target.medium[1])


def _move(file: Opened, target: Reading, elements: Mapping[str, Element]) -> None:
    """Write properties of joints, couplings and gears into the given elements of the joints."""
    reading = file.reading
    for name, joint in target.joints.items():
        for what in file.writer.JOINT:
            if getattr(joint, what) != getattr(reading.joints[name], what):
                file.writer.tell(file.xml, elements[name], what, np.array(getattr(joint, what)))
    for name, coupling in target.couplings.items():
        if not coupling.function.equals(reading.couplings[name].function):
            file.writer.couple(file.xml, elements[coupling.joint], coupling)
    for name, actuator in target.actuators.items():
        if actuator.gear != reading.actuators[name].gear:
            file.writer.drive(file.xml, name, actuator.gear)


def _close(file: Opened, frames: Sequence[Array], target: Reading) -> None:
    """Write closures and the softness of constraints."""
    ends = {name: tuple(frame for _, frame in target.ends(name)) for name in target.closures}
    for name, closure in target.closures.items():
        old = file.reading.closures[name]
        if closure.first_frame is not old.first_frame or closure.second_frame is not old.second_frame:
            placed = {link.element: frame for link, frame in zip(file.links, frames, strict=True)}
            file.writer.close(file.xml, name, ends, placed)
    before, after = (
        {**{n: c.softness for n, c in r.closures.items()}, **{n: c.softness for n, c in r.couplings.items()}}
        for r in (file.reading, target)
    )
    for name, softness in after.items():
        if softness != before[name]:
            file.writer.soften(file.xml, name, softness)


def _fill(file: Opened, frames: list[Array], name: str, body: BodyReading, plain: bool) -> None:
    """Write the mass properties of a body; if possible, change only one of its links in the simplest way."""
    old = file.reading.bodies[name]
    T, parts = {i: relative(old.pose, file.links[i].frame) for i in file.of(name)}, file.parts(name)
    new = _change_parts(parts, old, body)
    if len(parts) > 1 and not all(part.possible for i, part in new.items() if part is not parts[i]):
        raise UnpatchableError(
            f"'{name}' consists of several links, and changing one link or all links cannot yield the new values"
        )
    for i, part in new.items():
        now = relative(body.pose, frames[i])
        if part is not parts[i] or np.abs(now - T[i]).max() > SAME:
            file.writer.fill(file.xml, file.links[i], displace(part, relative(now, np.eye(4))), plain=plain)


def _change_parts(parts: dict[int, Matter], old: Matter, new: Matter) -> dict[int, Matter]:
    """Change one part of a body if this is possible, or else all parts."""
    if is_same(old, new):
        return parts
    chosen, matter = plainest(parts, old, new)
    if matter.possible or len(parts) == 1:
        return {**parts, chosen: matter}
    alike = spread(parts, old, new)
    return alike if all(part.possible for part in alike.values()) else divide(parts, new)


def _links_of_joint(file: Opened, joint: str) -> list[int]:
    """List the links of the body that a joint moves, and the massless links between the joints of that body."""
    name = file.reading.moved_by(joint)
    joints = {*file.reading.bodies[name].joints}
    return [i for i, link in enumerate(file.links) if file.owner[i] == name or joints & {*link.joints}]


def _descendants(file: Opened, joint: str) -> list[TextLink]:
    """List the links that descend from a joint."""
    gone = set[int]()
    for i, link in enumerate(file.links):
        if joint in link.joints or link.near in gone:
            gone.add(i)
    return [file.links[i] for i in gone]
