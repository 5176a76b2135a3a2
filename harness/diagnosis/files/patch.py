"""Writes changes of a reading into the text of the file that it was read from, and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.differences.change import Change, applied
from screwgauge.diagnosis.files.layout import Link, UnpatchableError
from screwgauge.diagnosis.files.opened import Opened, move, opened
from screwgauge.diagnosis.files.write_urdf import SAME
from screwgauge.diagnosis.files.xml_text import Element
from screwgauge.models.matter import Matter, displaced, of_body, plainest, relative, same, shared, spread
from screwgauge.models.readings.reading import BodyReading, ClosureReading, CouplingReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array

#: Changes that take parts out.
LESS = ("branch", "link")


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A changed text.

    Attributes:
        text: Of the whole file.
        left: Each change that could not be written into it, and why.
    """

    text: str
    left: tuple[tuple[Change, str], ...] = ()


def patched(
    text: str,
    reading: Reading,
    changes: Sequence[Change],
    *,
    plain: bool = False,
    spell: Callable[[str], str] = str,
) -> Patch:
    """A model file with changes made.

    Args:
        text: Of the file.
        reading: What was read from it; the changes are those of it.
        plain: Whole inertials in the axes of their links instead of the least change.
        spell: The value of an attribute -> as it is to be written.

    Raises:
        DescriptionError: The file is no XML.
    """
    try:
        file = opened(text, reading)
    except UnpatchableError as error:
        return Patch(text, tuple((change, str(error)) for change in changes))
    file.xml.spell = spell
    left = list[tuple[Change, str]]()
    done = list[Change]()
    for change in changes:
        try:
            _check(file, change)
            done.append(change)
        except UnpatchableError as error:
            left.append((change, str(error)))
    gone = {i for change in done if change.what == "link" for i in _moved(file, change.item)}
    try:
        _write(file, applied(reading, [change for change in done if change.what not in LESS]), plain, gone)
    except UnpatchableError as error:
        return Patch(text, (*left, *((change, str(error)) for change in done)))
    for change in done:
        if change.what == "branch":
            file.writer.drop(file.xml, _carried(file, change.item))
    if gone:
        file.writer.splice(file.xml, [file.links[i] for i in gone])
    return Patch(file.xml.text(), tuple(left))


def _check(file: Opened, change: Change) -> None:
    """Whether the file can say it.

    Raises:
        UnpatchableError: It cannot.
    """
    if change.what not in file.writer.SAYS:
        raise UnpatchableError(f"a {'URDF' if file.urdf else 'MJCF'} cannot say {change.what}")
    if change.what in ("mass", "com", "inertia"):
        file.writer.check_matter(file.xml)
        links = file.of(change.item)
        if len(links) > 1 and all(file.links[i].matter is None for i in links):
            raise UnpatchableError(f"the mass of '{change.item}' is that of the geoms of several bodies")


def _write(file: Opened, target: Reading, plain: bool, gone: Collection[int]) -> None:
    """Args: gone: Links that are to be taken out."""
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
    """Writes properties of joints, couplings and gears. `elements`: of the joints."""
    reading = file.reading
    for name, joint in target.joints.items():
        for what in file.writer.JOINT:
            if getattr(joint, what) != getattr(reading.joints[name], what):
                file.writer.tell(file.xml, elements[name], what, np.array(getattr(joint, what)))
    for name, coupling in target.couplings.items():
        if not np.array_equal(coupling.polynomial, reading.couplings[name].polynomial):
            file.writer.couple(file.xml, elements[coupling.joint], coupling)
    for name, (_, gear) in target.actuators.items():
        if gear != reading.actuators[name][1]:
            file.writer.drive(file.xml, name, gear)


def _close(file: Opened, frames: Sequence[Array], target: Reading) -> None:
    """Writes closures, and how soft constraints are."""
    at = {GROUND: np.eye(4), **{name: body.pose for name, body in target.bodies.items()}}
    ends = {n: (at[c.first] @ c.first_frame, at[c.second] @ c.second_frame) for n, c in target.closures.items()}
    for name, closure in target.closures.items():
        old = file.reading.closures[name]
        if closure.first_frame is not old.first_frame or closure.second_frame is not old.second_frame:
            placed = {link.element: frame for link, frame in zip(file.links, frames, strict=True)}
            file.writer.close(file.xml, name, ends, placed)
    old_soft, new_soft = ({n: c.softness for n, c in _constraints(r)} for r in (file.reading, target))
    for name, softness in new_soft.items():
        if softness != old_soft[name]:
            file.writer.soften(file.xml, name, softness)


def _constraints(reading: Reading) -> Iterator[tuple[str, ClosureReading | CouplingReading]]:
    yield from reading.closures.items()
    yield from reading.couplings.items()


def _fill(file: Opened, frames: list[Array], name: str, body: BodyReading, plain: bool) -> None:
    """Writes the mass properties of a body, changed in the one of its links where the change is the plainest."""
    old = file.reading.bodies[name]
    T, parts = {i: relative(old.pose, file.links[i].frame) for i in file.of(name)}, file.parts(name)
    new = _changed(parts, of_body(old), of_body(body))
    if len(parts) > 1 and not all(part.possible for i, part in new.items() if part is not parts[i]):
        raise UnpatchableError(f"several links make up '{name}', and no change of one or of all of them does")
    for i, part in new.items():
        now = relative(body.pose, frames[i])
        if part is not parts[i] or np.abs(now - T[i]).max() > SAME:
            file.writer.fill(file.xml, file.links[i], displaced(part, relative(now, np.eye(4))), plain=plain)


def _changed(parts: dict[int, Matter], old: Matter, new: Matter) -> dict[int, Matter]:
    """What a body is made of when it changes: one part, if that can be, else all of them."""
    if same(old, new):
        return parts
    chosen, matter = plainest(parts, old, new)
    if matter.possible or len(parts) == 1:
        return {**parts, chosen: matter}
    found = spread(parts, old, new)
    return found if all(part.possible for part in found.values()) else shared(parts, new)


def _moved(file: Opened, joint: str) -> list[int]:
    """The links of the body that a joint moves, and those without mass between its joints."""
    name = file.reading.moved_by(joint)
    joints = {*file.reading.bodies[name].joints}
    return [i for i, link in enumerate(file.links) if file.owner[i] == name or joints & {*link.joints}]


def _carried(file: Opened, joint: str) -> list[Link]:
    """The links behind a joint."""
    gone = set[int]()
    for i, link in enumerate(file.links):
        if joint in link.joints or link.near in gone:
            gone.add(i)
    return [file.links[i] for i in gone]
