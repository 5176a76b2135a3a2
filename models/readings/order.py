"""In which order libraries index the joints of a model file, as its text tells."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from screwgauge.models.readings.files import joints_in
from screwgauge.models.readings.source import Source


@dataclass(frozen=True, slots=True)
class Branch:
    """What hangs on a link.

    Attributes:
        name: By which siblings are sorted: of the joint, or of the link that is welded there.
        joints: That move; none of a link that is fixed.
        behind: Further branches, as the file has them.
    """

    name: str
    joints: tuple[str, ...]
    behind: tuple[Branch, ...]


def by_name(source: Source) -> tuple[str, ...]:
    """Joints in the order that Pinocchio gives those of a URDF: siblings sorted by the names of their joints."""
    return tuple(_joints(_branches(source), by_names=True))


def in_file(source: Source) -> tuple[str, ...]:
    """Joints in the order that MuJoCo gives them: from the ground outwards, siblings as the file has them."""
    return tuple(_joints(_branches(source), by_names=False))


def _joints(branches: tuple[Branch, ...], *, by_names: bool) -> Iterator[str]:
    waiting = list(branches)
    if by_names:
        waiting.sort(key=lambda branch: branch.name)
    for branch in waiting:
        yield from branch.joints
        yield from _joints(branch.behind, by_names=by_names)


def _branches(source: Source) -> tuple[Branch, ...]:
    if source.form == "mjcf":
        return tuple(branch for world in source.root.iterfind("worldbody") for branch in _bodies(world))
    carried: dict[str, list[tuple[str, bool, str]]] = {}
    for joint in source.root.iterfind("joint"):
        near, far = (end.get("link", "") for end in (joint.find("parent"), joint.find("child")) if end is not None)
        carried.setdefault(near, []).append((joint.get("name", ""), joint.get("type") != "fixed", far))
    return _links(carried, source.root_link)


def _links(carried: dict[str, list[tuple[str, bool, str]]], link: str) -> tuple[Branch, ...]:
    return tuple(
        Branch(name, (name,) if moves else (), _links(carried, far)) for name, moves, far in carried.get(link, ())
    )


def _bodies(element: ET.Element) -> Iterator[Branch]:
    """Bodies in an element itself, those in frames included."""
    for child in element:
        if child.tag == "frame":
            yield from _bodies(child)
        elif child.tag == "body":
            joints = tuple(joint.get("name", "") for joint in joints_in(child))
            yield Branch(joints[0] if joints else child.get("name", ""), joints, tuple(_bodies(child)))
