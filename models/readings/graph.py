"""Readings of files that state links and joints as a graph, as SDF and USD do: a tree of it, and what closes its loops.

A joint of any kind closes a loop: it carries a copy of its child without mass, which is welded to the child.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from screwgauge.models.kinematics import moved
from screwgauge.models.matter import NOTHING
from screwgauge.models.poses import screw
from screwgauge.models.readings.assemble import Assembly, assemble
from screwgauge.models.readings.reading import BodyReading, ClosureReading, JointReading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array

#: The world, where a joint names it in place of a link.
WORLD = ""
#: Mass, centre of mass and inertia of nothing.
EMPTY = (NOTHING.mass, NOTHING.com, NOTHING.inertia)


@dataclass(frozen=True, slots=True, eq=False)
class GraphJoint:
    """A joint between two links, or a link and the world.

    Attributes:
        parent, child: Links; `WORLD` for the world.
        freedoms: Name -> hinge, slide or ball, from the parent outwards, where the parent has it; none if it is fixed.
        step: Displacement in the world that takes the child into the joint. Shape (4, 4).
        loop: Whether the file asks for it as one that closes a loop.
    """

    parent: str
    child: str
    freedoms: Mapping[str, JointReading]
    step: Array = field(default_factory=lambda: np.eye(4))
    loop: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """What a `Reading` holds of links and joints.

    Attributes:
        floating: Links that no joint keeps to the world.
    """

    assembly: Assembly
    joints: Mapping[str, JointReading]
    closures: Mapping[str, ClosureReading]
    floating: tuple[str, ...] = ()


def graph_of_links(
    links: Mapping[str, BodyReading], joints: Mapping[str, GraphJoint], where: str, *, rounding: float = 0.0
) -> Graph:
    """Chooses a tree, in the order of the file and without joints that are to close loops as far as that can be.

    Args:
        links: Their matter and poses; whatever no joint keeps to the world floats.
        where: The file, to blame.
        rounding: Gaps of loops and angles between axes up to this are none [m or rad].

    Raises:
        ModelFileError: A body that moves has the name of the ground.
    """
    shift, tree, moving = {WORLD: np.eye(4)}, dict[str, BodyReading](), dict[str, JointReading]()
    used, floating = set[str](), list[str]()
    for link, name, back in _reached(links, joints):
        if not name:
            floating.append(link)
            freedoms = {f"{link}_free": JointReading("free", np.zeros(6), links[link].pose[:3, 3])}
            near, shift[link] = WORLD, np.eye(4)
        else:
            joint = joints[name]
            near, step = (joint.child, np.linalg.inv(joint.step)) if back else (joint.parent, joint.step)
            shift[link] = shift[near] @ step
            freedoms = _placed(joint, shift[joint.parent])
            if back:
                freedoms = {n: replace(freedoms[n], screw=-freedoms[n].screw) for n in reversed(freedoms)}
        used.add(name)
        tree[link] = replace(links[link], near=near, joints=tuple(freedoms), pose=shift[link] @ links[link].pose)
        moving |= freedoms
    welds = dict[str, tuple[str, str, Array]]()
    for name, joint in ((name, joint) for name, joint in joints.items() if name not in used):
        here = links[joint.child].pose if joint.child else np.eye(4)
        pose, closed = shift[joint.parent] @ joint.step @ here, shift[joint.child] @ here
        pose = closed if np.abs(pose - closed).max() <= rounding else pose
        freedoms, end = _placed(joint, shift[joint.parent]), joint.parent
        if freedoms:
            end = f"{joint.child or GROUND}.{name}"
            copy = BodyReading(*EMPTY, joint.parent, tuple(freedoms), pose, copy_of=joint.child or GROUND)
            tree[end], moving = copy, moving | freedoms
        welds[f"{name}.loop"] = joint.child, end, pose
    assembly = assemble(tree, where)
    closures = {name: _weld(assembly, *ends) for name, ends in welds.items()}
    return Graph(assembly, _aligned(moving, rounding), closures, tuple(floating))


def _aligned(joints: Mapping[str, JointReading], rounding: float) -> dict[str, JointReading]:
    """Joints with one direction for all that are parallel but for rounding: loops hang on that."""
    known, found = list[Array](), dict[str, JointReading]()
    for name, joint in joints.items():
        way = joint.direction
        if rounding and way.any():
            near = (sign * other for other in known for sign in (1.0, -1.0))
            way = next((other for other in near if np.abs(other - way).max() <= rounding), way)
            known += [way] if way is joint.direction or not known else []
            joint = replace(joint, screw=screw(joint.kind == "hinge", way, joint.centre))
        found[name] = joint
    return found


def _placed(joint: GraphJoint, T: Array) -> dict[str, JointReading]:
    """Freedoms of a joint whose parent is displaced. T: shape (4, 4)."""
    return {name: moved(freedom, T) for name, freedom in joint.freedoms.items()}


def _weld(assembly: Assembly, child: str, end: str, pose: Array) -> ClosureReading:
    """Weld of a child to the end of the joint that closes a loop with it, where the child would then be."""
    frames = []
    for link, T in ((child, None), (end, pose)):
        body, F = assembly.places[link] if link else (GROUND, np.eye(4))
        at = np.eye(4) if body == GROUND else assembly.bodies[body].pose
        frames.append((body, F if T is None else np.linalg.inv(at) @ T))
    return ClosureReading("weld", *frames[0], *frames[1])


def _reached(links: Mapping[str, BodyReading], joints: Mapping[str, GraphJoint]) -> Iterator[tuple[str, str, bool]]:
    """Each link, the joint by which it is reached from the world, and whether it is the parent there.

    A link that none reaches floats, and has no joint.
    """
    reached = {WORLD}
    while len(reached) <= len(links):
        step = next(_steps(joints, reached), None)
        if step is None:
            rest, carried = [link for link in links if link not in reached], {j.child for j in joints.values()}
            step = next((link for link in rest if link not in carried), rest[0]), "", False
        reached.add(step[0])
        yield step


def _steps(joints: Mapping[str, GraphJoint], reached: set[str]) -> Iterator[tuple[str, str, bool]]:
    """Joints by which a further link is reached, those that are to close loops last."""
    for wanted in (False, True):
        for name, joint in joints.items():
            back = joint.child in reached
            if joint.loop == wanted and (joint.parent in reached) != back:
                yield (joint.parent if back else joint.child), name, back
