"""Reads formats that define links and joints as a graph (SDF, USD): chooses a tree and closes the remaining loops.

A joint of any kind can close a loop: the joint carries a massless copy of its child, which is welded to the child.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from heapq import heappop, heappush
from typing import Any

import numpy as np

from screwgauge.models.kinematics import displace_joint
from screwgauge.models.matter import NOTHING, Matter
from screwgauge.models.poses import screw
from screwgauge.models.readings.assemble import assemble
from screwgauge.models.readings.reading import (
    OWN,
    BodyReading,
    ClosureReading,
    CouplingReading,
    JointReading,
    Reading,
)
from screwgauge.reference.couplings import PolynomialSum
from screwgauge.reference.errors import ModelFileError, UnknownNameError
from screwgauge.reference.files import check_count
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array

#: Name by which a joint refers to the world instead of a link.
WORLD = ""
#: Smallest magnitude of limits that count as infinite [rad or m]; tolerance for treating directions as coplanar.
_BOUNDLESS, _DEPENDENT = 1e16, 1e-5


def link(matter: Matter, pose: Array, *, weightless: bool = False) -> BodyReading:
    """Build a link that is not yet part of a tree, given its world pose, shape (4, 4)."""
    return BodyReading(matter.mass, matter.com, matter.inertia, WORLD, (), pose, gravcomp=float(weightless))


def bounds(low: float, high: float) -> tuple[float, float]:
    """Return limits; replace limits far beyond any motion with infinity."""
    low, high = (math.copysign(math.inf, x) if abs(x) >= _BOUNDLESS else x for x in (low, high))
    return low, high


@dataclass(frozen=True, slots=True, eq=False)
class GraphJoint:
    """A joint between two links, or between a link and the world.

    Attributes:
        parent, child: Links; `WORLD` for the world.
        freedoms: Name -> hinge, slide or ball, from the parent outwards, at the parent's location; empty for a fixed
            joint.
        step: World-frame displacement that moves the child into the joint. Shape (4, 4).
        loop: True if the file requests that the joint close a loop.
    """

    parent: str
    child: str
    freedoms: Mapping[str, JointReading]
    step: Array = field(default_factory=lambda: np.eye(4))
    loop: bool = False

    def displace_freedoms(self, T: Array) -> dict[str, JointReading]:
        """Return the joint's hinges, slides and balls after displacing its parent by T, shape (4, 4)."""
        return {name: displace_joint(freedom, T) for name, freedom in self.freedoms.items()}


Mimic = tuple[str, str, str, float, float]
"""Coordinate, joint that it follows, suffix of the followed coordinate (if that joint has several coordinates),
constant, and slope."""


def _couplings(
    mimics: Iterable[Mimic], joints: Mapping[str, GraphJoint], where: str
) -> Iterator[tuple[str, CouplingReading]]:
    """Convert mimics to coordinates and their couplings; a joint that mimics a fixed joint is locked at its offset."""
    every = {name for joint in joints.values() for name in joint.freedoms}
    for coordinate, leader, nth, *law in mimics:
        name = next((each for each in (f"{leader}.{nth}", leader) if each in every - {coordinate}), "")
        if not name and (leader not in joints or joints[leader].freedoms):
            raise UnknownNameError("joint", leader, every - {coordinate}, f"{where}, mimic of {coordinate}")
        yield coordinate, CouplingReading(coordinate, PolynomialSum.of({name: np.array(law)}))


def in_series(joints: Mapping[str, GraphJoint], rounding: float) -> tuple[dict[str, GraphJoint], list[str]]:
    """Merge several joints between the same two links into a series; return all joints, and messages about the series.

    Joints with several degrees of freedom, and joints with dependent screws, such as the two hinges of a door, do not
    become part of a series: they close a loop.

    Args:
        rounding: See `read_graph`.
    """
    found, pairs = dict[str, GraphJoint](), dict[tuple[str, str], list[str]]()
    for name, joint in joints.items():
        same = pairs.get((joint.parent, joint.child), [])
        freedoms = {**found[same[0]].freedoms, **joint.freedoms} if same else joint.freedoms
        screws = np.array([freedom.screw for freedom in freedoms.values()])
        if joint.loop or len(joint.freedoms) != 1 or (same and np.linalg.matrix_rank(screws, rounding) < len(screws)):
            found[name] = joint
            continue
        pairs[joint.parent, joint.child] = [*same, name]
        found[[*same, name][0]] = replace(found[same[0]] if same else joint, freedoms=freedoms)
    several = [names for names in pairs.values() if len(names) > 1]
    return found, [
        f"Joints {', '.join(names)} connect the same bodies; they are read as joints in series." for names in several
    ]


def read_graph(
    links: Mapping[str, BodyReading],
    joints: Mapping[str, GraphJoint],
    where: str,
    *,
    mimics: Iterable[Mimic] = (),
    rounding: float = 0.0,
    still: Collection[str] = (),
    **rest: Any,
) -> Reading:
    """Choose a spanning tree in file order, avoiding joints marked as loop closing as far as possible.

    Args:
        links: Links with mass properties and poses; links without a connection to the world float.
        where: Name of the file, for error messages.
        rounding: Largest loop gap and angle between axes that count as zero [m or rad].
        still: Links that stay in place without a joint to the world instead of floating.
        rest: Further fields of the `Reading`.

    Raises:
        ScrewgaugeError: A moving body has the name of the ground, a mimic refers to a missing joint, or the file has no
            links or too many links.
    """
    check_count(len(links), "links", where)
    if not links:
        raise ModelFileError("has no link or rigid body", where, "choose the file that describes the machine")
    shift, tree, moving = {WORLD: np.eye(4)}, dict[str, BodyReading](), dict[str, JointReading]()
    loops, names = dict(joints), Counter(name for joint in joints.values() for name in joint.freedoms)
    if twice := [name for name, count in names.items() if count > 1]:
        raise ModelFileError(f"two coordinates are called '{twice[0]}'", where, "rename one of the joints")
    for name, by, back in _walk(links, joints):
        if not by:
            free = {_free_name(f"{name}_free", names): JointReading("free", np.zeros(6), links[name].pose[:3, 3])}
            near, shift[name], freedoms = WORLD, np.eye(4), {} if name in still else free
        else:
            joint = loops.pop(by)
            near, step = (joint.child, np.linalg.inv(joint.step)) if back else (joint.parent, joint.step)
            shift[name] = shift[near] @ step
            freedoms = joint.displace_freedoms(shift[joint.parent])
            if back:
                freedoms = {n: replace(freedoms[n], screw=-freedoms[n].screw) for n in reversed(freedoms)}
        tree[name] = replace(links[name], near=near, joints=tuple(freedoms), pose=shift[name] @ links[name].pose)
        moving |= freedoms
    welds = dict[str, tuple[str, str, Array]]()
    for name, joint in loops.items():
        home = links[joint.child].pose if joint.child else np.eye(4)
        pose, closed = shift[joint.parent] @ joint.step @ home, shift[joint.child] @ home
        pose = closed if np.abs(pose - closed).max() <= rounding else pose
        end, freedoms = joint.parent, joint.displace_freedoms(shift[joint.parent])
        if freedoms:
            end = _free_name(f"{joint.child or GROUND}.{name}", links)
            copy = replace(link(NOTHING, pose), near=joint.parent, joints=tuple(freedoms))
            tree[end], moving = replace(copy, copy_of=joint.child or GROUND), moving | freedoms
        welds[f"{name}.loop"] = joint.child, end, pose
    reading = assemble(
        tree,
        _align(moving, rounding),
        where,
        library=OWN,
        couplings=dict(_couplings(mimics, joints, where)),
        frames={n: joint.child for n, joint in joints.items() if not (joint.freedoms or n in links)},
        **rest,
    )
    return replace(reading, closures={name: _weld(reading, *ends) for name, ends in welds.items()})


def _free_name(name: str, names: Collection[str]) -> str:
    """Return the name, with as many ``_`` appended as needed to make it unused."""
    while name in names:
        name += "_"
    return name


def _align(joints: Mapping[str, JointReading], rounding: float) -> dict[str, JointReading]:
    """Make joint directions exactly parallel or perpendicular if they nearly are, as loops require."""
    known, aligned = list[Array](), dict[str, JointReading]()
    for name, joint in joints.items():
        way = joint.direction
        if rounding and way.any():
            near = (sign * other for other in known for sign in (1.0, -1.0))
            parallel = next((other for other in near if np.abs(other - way).max() <= rounding), None)
            if parallel is None:
                square = np.array([other for other in known if abs(other @ way) <= rounding]).reshape(-1, 3)
                way = way - np.linalg.pinv(square, _DEPENDENT) @ (square @ way)
                known.append(way := way / np.linalg.norm(way))
            way = way if parallel is None else parallel
            joint = replace(joint, screw=screw(joint.kind == "hinge", way, joint.centre))
        aligned[name] = joint
    return aligned


def _weld(reading: Reading, child: str, end: str, pose: Array) -> ClosureReading:
    """Weld a child to the end of a loop-closing joint, at the pose that the joint requires."""
    (body, F), (other, _) = map(reading.end_on, (child, end))
    at = np.eye(4) if other == GROUND else reading.bodies[other].pose
    return ClosureReading("weld", body, F, other, np.linalg.inv(at) @ pose)


def _walk(links: Mapping[str, BodyReading], joints: Mapping[str, GraphJoint]) -> Iterator[tuple[str, str, bool]]:
    """Yield each link, the joint that reaches it from the world, and whether the link is the joint's parent.

    Among the joints that lead to new links, the first in the file is used; joints that should close loops are used
    last. A link that is not reached by a joint floats.
    """
    touching, carried = defaultdict[str, list[tuple[bool, int, str]]](list), {j.child for j in joints.values()}
    for i, (name, joint) in enumerate(joints.items()):
        for side in {joint.parent, joint.child}:
            touching[side].append((joint.loop, i, name))
    reached, ahead = {WORLD}, sorted(touching[WORLD])
    afloat = iter([*(link for link in links if link not in carried), *links])
    while len(reached) <= len(links):
        step = None
        while ahead and step is None:
            joint = joints[name := heappop(ahead)[2]]
            back = joint.child in reached
            if not (back and joint.parent in reached):
                step = (joint.parent if back else joint.child), name, back
        if step is None:
            step = next(link for link in afloat if link not in reached), "", False
        reached.add(step[0])
        for each in touching[step[0]]:
            heappush(ahead, each)
        yield step
