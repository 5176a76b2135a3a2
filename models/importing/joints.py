"""Converts links of a machine to joints of a description: R and P, or U, S, C and F where axes meet exactly."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.models.kinds import kind_of
from screwgauge.models.machine import Element, Link, Machine, contract, graph_at_home
from screwgauge.models.poses import screw
from screwgauge.models.readings.compiled import RESISTS
from screwgauge.models.readings.reading import FREEDOMS, JointReading, Reading
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.errors import first_few
from screwgauge.reference.mechanism import GROUND, KINDS, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array, rotation

#: Largest cosine between orthogonal axes, and largest distance between intersecting axes as a fraction of the length;
#: descriptions are only checked to 1e-12.
RIGHT, MEET = 1e-13, 1e-14
#: Names of joints with several degrees of freedom.
COMPOSITE = {"S": "a ball joint", "U": "a universal joint", "C": "a cylindrical joint", "F": "a free joint"}
#: Entries of unit vectors and rotations below this value are rounding errors of zero.
NOTHING = 4e-16
#: Value of the missing limit of a joint with only one limit [rad, m].
FAR = 1e10
#: Sine of a spherical joint's second home angle above which the axes are nearly coplanar; at 1 they are coplanar.
STEEP = 0.8


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Consecutive hinges or slides of a link that form one joint.

    Attributes:
        kind: One of `KINDS`.
        freedoms: Name -> hinge or slide, from the near body outwards.
        point: Intersection of all axes. Shape (3,).
        name: Name of the joint; empty if the joint takes the name of its hinges and slides.
    """

    kind: str
    freedoms: Mapping[str, JointReading]
    point: Array
    name: str = ""

    @property
    def axes(self) -> tuple[JointReading, ...]:
        """All hinges and slides of the group."""
        return tuple(self.freedoms.values())


def prune(machine: Machine, followed: Collection[str]) -> Machine:
    """Remove massless bodies that do not carry other bodies, unless couplings depend on their joints."""
    bodies, links, remarks = dict(machine.bodies), list(machine.links), list(machine.remarks)
    while True:
        bare = [name for name, body in bodies.items() if name != GROUND and not body.local.mass]
        held = {name: [link for link in links if link.joins(name)] for name in bare}
        idle = {name: some[0] for name, some in held.items() if len(some) == 1 and some[0].articulated}
        idle = {name: link for name, link in idle.items() if not {*followed} & {*link.joints}}
        if not idle:
            return replace(machine, bodies=bodies, links=tuple(links), remarks=tuple(remarks))
        for name, link in idle.items():
            links.remove(link)
            del bodies[name]
            remarks.append(
                f"'{name}' has no mass and carries no other body; it is left out with {few_names(link.joints)}."
            )


def followed_joints(reading: Reading) -> set[str]:
    """Return the joints on which other joints depend through a coupling."""
    return {name for coupling in reading.couplings.values() for name in coupling.function.terms}


def graph_of(reading: Reading) -> Machine:
    """Build the graph of a reading with closed loops, merging links through massless crosses."""
    machine = prune(graph_at_home(reading), followed_joints(reading))
    pinned = {machine.part_of(end) for c in reading.closures.values() for end in (c.first, c.second)}
    return contract(machine, [n for n, body in machine.bodies.items() if not body.local.mass and n not in pinned])


def groups(
    link: Link, machine: Machine, driven: Collection[str], coupled: Collection[str]
) -> tuple[list[Group], list[str]]:
    """Group the degrees of freedom of a link into joints of a description; report divided composite joints.

    Driven joints stay separate, and coupled joints do not become part of S and F joints.
    """
    out, remarks, i = list[Group](), list[str](), 0
    while i < len(link.elements):
        group, count = None, 1
        for n in (6, 3, 2):
            part = link.elements[i : i + n]
            alone = {*driven} if n == 2 else {*driven, *coupled}
            if len(part) < n or not _single(part) or alone & {each.joint for each in part}:
                continue
            if (kind := kind_of(part, machine.length)[0]) not in COMPOSITE:
                continue
            made = _composite(kind, part, machine)
            if isinstance(made, Group):
                group, count = made, n
                break
            if kind != "F":
                names = few_names(each.joint for each in part)
                remarks.append(f"{names} form {COMPOSITE[kind]}, but {made}: they are divided into simpler joints.")
        out.append(group or _single_joint(link.elements[i], link, machine))
        i += count
    return out, remarks


def _single(part: tuple[Element, ...]) -> bool:
    """Return True if every element is a joint with one degree of freedom."""
    return all(each.joint and FREEDOMS[each.kind] == 1 for each in part)


def _single_joint(element: Element, link: Link, machine: Machine) -> Group:
    """Turn an element into a separate joint: a hinge, slide, ball or free joint, or the hinge that closures form."""
    name = element.joint or pin_name(element.closures)
    if FREEDOMS[element.kind] > 1:
        kind = "S" if element.kind == "ball" else "F"
        made = ball(name, kind, machine.bodies[link.near].pose, machine.bodies[link.far].pose, element.centre)
    elif element.joint:
        made = Group("R" if element.kind == "hinge" else "P", _freedoms([element], machine.reading), element.centre)
    else:
        made = Group("R", {name: JointReading("hinge", element.screw, element.centre)}, element.centre)
    return made if FREEDOMS[element.kind] == 1 and element.joint else replace(made, name=name)


def pin_name(closures: Sequence[str]) -> str:
    """Return the name of the joint that replaces closures."""
    return closures[0] if len(closures) == 1 else closures[0].removesuffix(".1")


def _freedoms(part: Iterable[Element], reading: Reading) -> dict[str, JointReading]:
    """Return the hinges and slides of the reading, with screws as seen from the near side."""
    return {each.joint: replace(reading.joints[each.joint], screw=each.screw) for each in part}


def _composite(kind: str, part: tuple[Element, ...], machine: Machine) -> Group | str:
    """Merge consecutive hinges and slides into one joint of a description, or return why this is impossible."""
    freedoms, length = _freedoms(part, machine.reading), machine.length
    axes = [*freedoms.values()]
    if kind == "F":
        return _free(freedoms, part, machine)
    if kind == "C":
        turning = dict(sorted(freedoms.items(), key=lambda named: named[1].kind))  # the hinge first
        hinge, slide = turning.values()
        aligned = np.abs(hinge.direction - slide.direction).max() < RIGHT
        return Group("C", turning, hinge.centre) if aligned else "their directions differ"
    point = np.asarray(kind_of(part, length)[1])
    if not _orthogonal(at_zero(axes, np.eye(3))[0] if kind == "S" else np.array([axis.direction for axis in axes])):
        return "their axes are not at right angles"
    off = max(float(np.linalg.norm(np.cross(axis.direction, point - axis.centre))) for axis in axes)
    if not off < MEET * length:
        return f"their axes miss the common point by {off:.2g} m"
    steep = kind == "S" and not abs(np.sin(axes[1].home)) < STEEP
    return _from_home(freedoms, point) if steep else Group(kind, freedoms, point)


def _free(freedoms: Mapping[str, JointReading], part: tuple[Element, ...], machine: Machine) -> Group | str:
    """Build a free joint from three perpendicular slides and a ball, or return why this is impossible."""
    axes = [*freedoms.values()]
    E = np.array([axis.direction for axis in axes[:3]])
    serial = [axis.kind == "hinge" for axis in axes] == list(KINDS["F"]) and kind_of(part[3:], machine.length)[0] == "S"
    if not serial or not _orthogonal(E) or np.linalg.det(E) < 0.0:
        return "they are not three slides at right angles and a ball joint"
    turns = _composite("S", part[3:], machine)
    return turns if isinstance(turns, str) else Group("F", freedoms, turns.point)


def _from_home(names: Iterable[str], point: Array) -> Group:
    """Build a spherical joint with angles measured from the home pose, where its own axes are nearly in gimbal lock."""
    axes = zip(names, np.eye(3), strict=True)
    return Group("S", {f"{n}.from-home": JointReading("hinge", screw(True, e, point), point) for n, e in axes}, point)


def _orthogonal(E: Array) -> bool:
    return bool(np.abs(E @ E.T - np.eye(len(E))).max() < RIGHT)


def at_zero(axes: Sequence[JointReading], R: Array) -> tuple[Array, Array]:
    """Return the joint axes at zero coordinates, in the child's axes at the home pose, and the total rotation.

    In the serial product of rotations, the last axis is expressed in the child frame; each earlier axis is expressed in
    the frame that results from undoing the subsequent rotations.
    """
    E, P = np.empty((len(axes), 3)), np.eye(3)
    for i in reversed(range(len(axes))):
        E[i] = P @ (R.T @ axes[i].direction)
        if axes[i].kind == "hinge":
            P = rotation(_unit(E[i]), np.array(axes[i].home)) @ P
    return E, P


def _unit(v: Array) -> Array:
    clean = np.where(np.abs(v) < NOTHING, 0.0, v)
    return np.asarray(clean / np.linalg.norm(clean))


def _tidy(R: Array) -> Array:
    """Round the entries of a rotation matrix that are nearly zero or one."""
    near = np.round(R)
    return np.where(np.abs(R - near) < 2.0 * NOTHING, near, R) + 0.0


def frame(pose: Array, R: Array, point: Array, length: float) -> Frame:
    """Express a frame, given in the world, relative to a body with the given pose."""
    p = pose[:3, :3].T @ (point - pose[:3, 3])
    return Frame(np.where(np.abs(p) < NOTHING * length, 0.0, p) + 0.0, _tidy(pose[:3, :3].T @ R))


def joint(group: Group, name: str, near: tuple[str, Array], far: tuple[str, Array], length: float) -> Joint:
    """Build a joint of a description with the coordinates and home values of the grouped hinges and slides.

    Args:
        near, far: Bodies that the joint connects, and their poses. Shape (4, 4).
    """
    (parent, before), (child, behind) = near, far
    R = behind[:3, :3]
    E, P = at_zero(group.axes, R)
    near_R, far_R = R @ P.T, R
    slid = sum((axis.home * axis.direction for axis in group.axes if axis.kind == "slide"), np.zeros(3))
    if group.kind == "F":  # slides along the axes of the frame in the parent
        D = np.array([axis.direction for axis in group.axes[:3]]).T
        E, far_R, near_R = E[3:] @ near_R.T @ D, R @ near_R.T @ D, D
    elif group.kind == "C":
        E = E[:1]
    return Joint(
        name=name,
        kind=group.kind,
        parent=parent,
        child=child,
        axes=np.array([_unit(e) for e in E]),
        coordinates=tuple(group.freedoms),
        home=np.array([axis.home for axis in group.axes]),
        limits=np.array([bounds(axis.limits) for axis in group.axes]),
        parent_frame=frame(before, near_R, group.point - slid, length),
        child_frame=frame(behind, far_R, group.point, length),
    )


def bounds(limits: tuple[float, float]) -> tuple[float, float]:
    """Convert limits to the form of a description: both finite or both infinite."""
    low, high = limits
    if not low < high or np.isinf(limits).all():
        return -np.inf, np.inf
    return max(low, -FAR), min(high, FAR)


def ball(name: str, kind: str, near: Array, far: Array, point: Array) -> Group:
    """Build a ball (S) or free joint (F) with zero home angles; the axes of a free joint are the parent's axes.

    Args:
        near, far: Poses of the bodies that the joint connects. Shape (4, 4).
    """
    R = (near if kind == "F" else far)[:3, :3]
    home = near[:3, :3].T @ (point - near[:3, 3])
    turns = {f"{name}.q{i + 1}": JointReading("hinge", screw(True, e, point), point) for i, e in enumerate(R.T)}
    if kind == "S":
        return Group(kind, turns, point)
    slides = {
        f"{name}.{x}": JointReading("slide", screw(False, e, point), point, float(value))
        for x, e, value in zip("xyz", R.T, home, strict=True)
    }
    return Group(kind, slides | turns, point)


#: Number of names that a phrase lists.
SHOWN = 6


def springs_of(reading: Reading, mechanism: Mechanism) -> tuple[JointSpring, ...]:
    """List the springs of hinges and slides."""
    return tuple(
        JointSpring(name, joint.stiffness, joint.rest)
        for name, joint in reading.joints.items()
        if name in mechanism.coordinates and joint.stiffness > 0.0
    )


def left_out(reading: Reading, mechanism: Mechanism) -> tuple[str, ...]:
    """Describe the omitted content and name its owners."""
    gone = {n: joint for n, joint in reading.joints.items() if n not in mechanism.coordinates}
    names_by = {
        f"{what} of": [name for name, joint in gone.items() if getattr(joint, what)]
        for what in ("armature", "friction", "stiffness", "damping")
    } | {
        "compensated gravity of": [name for name, body in reading.bodies.items() if body.gravcomp],
        "inertia of massless bodies": [n for n, body in reading.bodies.items() if body.inertia.any() and not body.mass],
        "gear other than 1 of actuator": [name for name, (_, gear) in reading.actuators.items() if gear != 1.0],
    }
    phrases = [f"{what} {few_names(names)}" for what, names in names_by.items() if names]
    density, viscosity = reading.medium
    if density or viscosity:
        phrases.append(f"medium of density {density:g} kg/m^3 and viscosity {viscosity:g} Pa s")
    held = ("mimic of", "include ", RESISTS)  # couplings, includes and resistances of actuators are reported separately
    return (*phrases, *(phrase for phrase in reading.ignored if not phrase.startswith(held)))


def few_names(names: Iterable[str]) -> str:
    """List the first names and count the remaining names."""
    return first_few((f"'{name}'" for name in names), SHOWN)
