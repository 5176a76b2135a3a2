"""Reading -> mechanism, with all that a description and its scene cannot hold named."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.models.importing.assemble import assemble, choose
from screwgauge.models.importing.joints import Group, graph_of, groups, joint, left_out, listed, pin_name, springs_of
from screwgauge.models.machine import Body as RigidBody
from screwgauge.models.machine import Machine
from screwgauge.models.readings.reading import CouplingReading, Reading, renamed
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.couplings import Coupling
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.files import check_count
from screwgauge.reference.lint import implausible
from screwgauge.reference.mechanism import GROUND, Body, Joint, Mechanism
from screwgauge.reference.rotations import Array

#: Of mass and squared length of the model: what merging links leaves of moments of inertia that are zero.
ROUNDING = 1e-16
#: Names that are taken: the fixed world of a description, that of MuJoCo, and who exerts loads.
TAKEN = (GROUND, "world", "environment")


@dataclass(frozen=True, slots=True, eq=False)
class Imported:
    """A mechanism made from a reading.

    Attributes:
        springs: Stiffness and damping of its joints, which a scene holds.
        gravity: World axes [m/s^2], shape (3,); None where the file does not say it.
        names: Name in the file -> name in the description, where they differ.
        remarks: How it was made, a sentence each.
        left_out: What is in the file and in neither description nor scene, a phrase each.
    """

    mechanism: Mechanism
    springs: tuple[JointSpring, ...]
    gravity: Array | None
    names: Mapping[str, str]
    remarks: tuple[str, ...]
    left_out: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be independent (label -> coordinate) and actuated (joints); None leaves it to the file."""

    independent: Mapping[str, str] | None = None
    actuated: Sequence[str] | None = None

    def otherwise(self, independent: Mapping[str, str], actuated: Sequence[str]) -> Wanted:
        """The same, and these where nothing was chosen."""
        chosen = independent if self.independent is None else self.independent
        return Wanted(chosen, actuated if self.actuated is None else self.actuated)


def describe(
    reading: Reading,
    where: str,
    wanted: Wanted,
    given: Sequence[Joint] = (),
    keyframes: Mapping[str, Mapping[str, float]] | None = None,
) -> Imported:
    """The mechanism that was read.

    Args:
        where: The file, to blame.
        given: Joints that close loops, as they are already known; others are made from the points that coincide.
        keyframes: Poses that may be near a good home, name -> joint -> coordinate [rad or m].

    Raises:
        ScrewgaugeError: Nothing moves, loops do not close, or a choice does not fit.
    """
    own, names = _renamed(reading)
    poses = {key: {names.get(name, name): x for name, x in q.items()} for key, q in (keyframes or {}).items()}
    reading, moves = assemble(own, where, poses)
    graph = graph_of(reading)
    if not any(link.articulated for link in graph.links):
        said = " ".join(graph.remarks)
        raise DescriptionError(f"has no degree of freedom ({said})", where, "give mass to what moves, or free a joint")
    actuated = _actuated(graph, wanted.actuated, where)
    moved = any(joint.home != own.joints[name].home for name, joint in reading.joints.items())
    known = {} if moved else {one.name: one for one in given}  # their coordinates are those of the file's home
    mechanism, composites = _mechanism(graph, frozenset(actuated or ()), known, where)
    names |= {reading.name: mechanism.name} if reading.name != mechanism.name else {}
    mechanism, doubt = choose(mechanism, actuated, wanted.independent, where)
    odd = (f"Check this: {sentence}." for sentence in implausible(mechanism))
    remarks = [*moves, *graph.remarks, *composites, *filter(None, (doubt,)), *odd]
    if not reading.actuators and wanted.actuated is None:
        open_chain = "every hinge and slide of the open chain that follows no other"
        rule = "every independent coordinate that is a hinge or slide" if reading.closures else open_chain
        driven = listed(joint.name for joint in mechanism.actuators) or "of which there is none"
        remarks.append(f"The file names no actuators: driven is {rule}, {driven}; --actuated chooses others.")
    return Imported(
        mechanism, springs_of(reading, mechanism), reading.gravity, names, tuple(remarks), left_out(reading, mechanism)
    )


def _mechanism(
    graph: Machine, driven: frozenset[str], known: Mapping[str, Joint], where: str
) -> tuple[Mechanism, list[str]]:
    """The mechanism, nothing being independent or actuated yet, and which composite joints it cannot hold."""
    reading = graph.reading
    joints, carriers, remarks = _joints(graph, driven, known)
    solid = [_body(name, body, graph.length, where) for name, body in graph.bodies.items() if name != GROUND]
    for count, what in ((len(solid) + len(carriers), "bodies"), (len(joints), "joints")):
        check_count(count, what, where)
    left = {name for link in graph.links for name in link.joints}
    mechanism = Mechanism(
        name=_accepted([reading.name], "model")[reading.name],
        bodies=(*solid, *carriers),
        joints=joints,
        independent={},
        title=reading.name,
        group="imported",
        where=where,
        couplings=tuple(_coupling(n, entry, where) for n, entry in reading.couplings.items() if entry.joint in left),
    )
    if not mechanism.mass:
        raise DescriptionError("no body that moves has mass", where, "give mass to one at least")
    return mechanism, remarks


def _renamed(reading: Reading) -> tuple[Reading, dict[str, str]]:
    """The reading with names that a description accepts, and those that changed."""
    joints = _accepted(reading.joints, "joint")
    names = {
        "bodies": _accepted(reading.bodies, "body"),
        "joints": joints,
        "closures": _accepted(reading.closures, "loop", (*TAKEN, *joints.values())),
        "couplings": _accepted(reading.couplings, "coupling"),
    }
    changed = {old: new for table in names.values() for old, new in table.items() if old != new}
    known = {name: entry for name, entry in reading.couplings.items() if entry.joint in joints}
    return renamed(replace(reading, couplings=known), names), changed


def _actuated(graph: Machine, chosen: Sequence[str] | None, where: str) -> list[str] | None:
    """Joints that are driven: those chosen, those of the file, or all of an open chain; None where nothing says so."""
    reading = graph.reading
    can = [name for link in graph.links for name in link.joints if reading.joints[name].kind in ("hinge", "slide")]
    if chosen is not None:
        for name in chosen:
            if name not in can:
                raise UnknownNameError("hinge or slide", name, can, f"{where}, --actuated")
        return list(chosen)
    driven = [name for name, _ in reading.actuators.values() if name in can]
    if not driven and not reading.closures:
        coupled = {coupling.joint for coupling in reading.couplings.values()}
        driven = [name for name in can if name not in coupled]
    return list(dict.fromkeys(driven)) or None


def _coupling(name: str, entry: CouplingReading, where: str) -> Coupling:
    """A coupling; one that depends on nothing that moves holds its joint."""
    powers = np.trim_zeros(entry.polynomial[1:], "b") if entry.of else np.zeros(0)
    of = entry.of if len(powers) else ""
    return Coupling(name, entry.joint, of, np.append(entry.polynomial[:1], powers), f"{where}, coupling '{name}'")


def _body(name: str, body: RigidBody, length: float, where: str) -> Body:
    matter = body.local
    if not matter.mass:
        return Body(name, 0.0, np.zeros(3), np.zeros((3, 3)))
    inertia = 0.5 * (matter.inertia + matter.inertia.T)
    inertia[np.abs(inertia) < ROUNDING * matter.mass * length**2] = 0.0
    return Body(name, matter.mass, matter.com, inertia, f"{where}, body '{name}'")


def _joints(
    graph: Machine, driven: frozenset[str], given: Mapping[str, Joint]
) -> tuple[tuple[Joint, ...], list[Body], list[str]]:
    """All joints, the bodies without mass between those of one link, and which composite joints had to be divided."""
    pins = {pin_name(one.closures) for link in graph.links for one in link.elements if one.closures}
    names = {GROUND, *graph.bodies, *graph.reading.joints, *pins}
    coupled = {name for entry in graph.reading.couplings.values() for name in (entry.joint, entry.of)}
    used, carriers, joints, remarks = {*graph.reading.joints}, list[Body](), list[Joint](), list[str]()
    for link in graph.links:
        steps, divided = groups(link, graph, driven, coupled)
        remarks += divided
        near = link.near, graph.bodies[link.near].pose
        for i, group in enumerate(steps):
            far = link.far, graph.bodies[link.far].pose
            if i < len(steps) - 1:  # has the axes of the body at the end, and its origin in the joint
                pose = far[1].copy()
                pose[:3, 3] = group.point
                far = _unused(f"{group.axes[0].name}.carrier", names), pose
                carriers.append(Body(far[0], 0.0, np.zeros(3), np.zeros((3, 3))))
            name = group.name or _joint_name(group, used)
            known = given.get(group.name)  # of closures
            joints.append(known or joint(group, name, near, far, graph.length))
            near = far
    return tuple(joints), carriers, remarks


def _joint_name(group: Group, used: set[str]) -> str:
    """That of its one freedom, or what the names of several have in common."""
    if len(group.axes) == 1:
        return group.axes[0].name
    parts = {axis.name.rpartition(".")[0] for axis in group.axes}
    whole = parts.pop() if len(parts) == 1 else ""
    return _unused(whole or "+".join(axis.name for axis in group.axes), used)


def _accepted(names: Iterable[str], kind: str, taken: Iterable[str] = TAKEN) -> dict[str, str]:
    """Each name, or one like it that a description accepts and nothing else has.

    Args:
        kind: What stands in for a name that has no usable character.
    """
    wanted = list(dict.fromkeys(names))
    fine = {name for name in wanted if re.fullmatch(r"\w[\w.:+-]*", name) and name not in {*taken}}
    used, result = {*taken, *fine}, {}
    for name in wanted:
        result[name] = name if name in fine else _unused(re.sub(r"[^\w.:+-]+", "-", name).strip("-.:+") or kind, used)
    return result


def _unused(name: str, used: set[str]) -> str:
    """The name, numbered if it is used already; used from now on."""
    number, base = 2, name
    while name in used:
        name, number = f"{base}-{number}", number + 1
    used.add(name)
    return name
