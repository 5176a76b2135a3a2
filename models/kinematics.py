"""Builds spanning trees of readings, draws random states, and displaces readings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.models.poses import matrix
from screwgauge.models.readings.reading import FREEDOMS, JointReading, Reading, slices
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, cross
from screwgauge.witness.constraints import closure_gaps, move_joints
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import (
    COORDINATES,
    FixedFrame,
    LoopConstraint,
    SpanningTree,
    TreeLink,
    TreeStates,
    coupled_column,
    stack_frames,
)

#: Largest distance of a randomly drawn coordinate from its home value [rad or m].
FAR = {"hinge": math.pi, "slide": 0.5}
#: Scale of the distance between the home pose and states near it [rad or machine lengths].
BESIDE = 0.05
_PASSIVE = ("armature", "damping", "friction", "stiffness", "rest")


@dataclass(frozen=True, eq=False, kw_only=True)
class ReadingTree(SpanningTree):
    """A reading as a tree with one link per joint, in joint order; frames of hinges and slides have world axes at the
    home pose.

    Attributes:
        reading: The reading itself.
        places, freedoms: Joint -> slice of its coordinates, see `witness.tree.COORDINATES`, and slice of its
            velocities. The coordinate of a hinge or slide is measured as in its file.
        frames: Index of each ball or free joint -> frame that the joint carries, at the home pose. Shape (4, 4).
    """

    reading: Reading
    places: Mapping[str, slice]
    freedoms: Mapping[str, slice]
    frames: Mapping[int, Array]


def tree_of(reading: Reading) -> ReadingTree:
    """Build the spanning tree of a reading."""
    number = {name: i for i, name in enumerate(reading.joints, 1)}
    places, freedoms = slices(reading.joints, COORDINATES), reading.freedoms
    columns = {name: (places[name].start, freedoms[name].start) for name in reading.joints}
    bodies, frames, poses = list(reading.bodies.values()), dict[int, Array](), {0: np.eye(4)}
    links, at = dict[int, TreeLink](), {GROUND: FixedFrame()}
    for name, body in reading.bodies.items():
        near = at.get(body.near, FixedFrame()).link
        for joint in body.joints:
            i, one = number[joint], reading.joints[joint]
            poses[i] = _carried_frame(one, body.pose)
            if FREEDOMS[one.kind] > 1:
                frames[i - 1] = poses[i]
            start = _fixed_frame(near, poses[near], poses[i])
            links[i] = TreeLink(one.kind, start, one.direction, places[joint].start, freedoms[joint].start, one.home)
            near = i
        at[name] = _fixed_frame(near, poses[near], body.pose)

    def end(body: str, T: Array) -> FixedFrame:
        return at.get(body, FixedFrame()).place(T[:3, :3], T[:3, 3])

    wide = [FREEDOMS[joint.kind] for joint in reading.joints.values()]
    return ReadingTree(
        links=tuple(links[i] for i in number.values()),
        freedom=reading.freedom,
        bodies=stack_frames([at[name] for name in reading.bodies]),
        mass=np.array([body.mass for body in bodies]),
        com=np.array([body.com for body in bodies]).reshape(-1, 3),
        inertia=np.array([body.inertia for body in bodies]).reshape(-1, 3, 3),
        closures={
            name: LoopConstraint(c.kind, end(c.first, c.first_frame), end(c.second, c.second_frame))
            for name, c in reading.closures.items()
        },
        couplings={name: coupled_column(columns, c.joint, c.function) for name, c in reading.couplings.items()},
        gravity=gravity_of(reading),
        weight=np.array([1.0 - body.gravcomp for body in bodies]),
        passive={name: np.repeat([getattr(j, name) for j in reading.joints.values()], wide) for name in _PASSIVE},
        length=size(reading),
        reading=reading,
        places=places,
        freedoms=freedoms,
        frames=frames,
    )


def _carried_frame(joint: JointReading, pose: Array) -> Array:
    """Return a joint's frame at the home pose, with world axes for a hinge or slide and body axes otherwise."""
    if FREEDOMS[joint.kind] == 1:
        return matrix(joint.centre, np.eye(3))
    return pose if joint.kind == "free" else matrix(joint.centre, pose[:3, :3])


def _fixed_frame(link: int, pose: Array, there: Array) -> FixedFrame:
    """Express a world pose relative to a link with a known pose."""
    R = pose[:3, :3].T
    return FixedFrame(link, R @ there[:3, :3], R @ (there[:3, 3] - pose[:3, 3]))


def gravity_of(reading: Reading) -> Array:
    """Return the gravity of a reading [m/s^2], or zero if the reading does not specify gravity. Shape (3,)."""
    return np.zeros(3) if reading.gravity is None else reading.gravity


def size(reading: Reading) -> float:
    """Return a characteristic length: the largest distance of a joint or body from the centroid of all points [m]."""
    points = [joint.centre for joint in reading.joints.values()]
    points += [body.centre for body in reading.bodies.values()]
    spread = np.linalg.norm(np.array(points) - np.mean(points, axis=0), axis=1).max()
    return float(spread) or 1.0


def length_of(reading: Reading) -> float:
    """Return twice the largest distance of a point from the centroid at the home pose [m]; 1 if all points coincide."""
    points = [body.centre for body in reading.bodies.values()]
    points += [body.pose[:3, 3] for body in reading.bodies.values()] + [np.zeros(3)]
    cloud = np.array([*points, *(joint.centre for joint in reading.joints.values())])
    return float(np.linalg.norm(cloud - cloud.mean(axis=0), axis=1).max()) * 2.0 or 1.0


def draw(reading: Reading, n: int, seed: int = 0) -> TreeStates:
    """Draw n random states within limits; velocities and accelerations are normally distributed (SI units)."""
    random = np.random.default_rng(seed)
    columns = [np.zeros((n, 0))]
    for joint in reading.joints.values():
        if joint.kind in FAR:
            far = FAR[joint.kind]
            low, high = np.clip(joint.limits, joint.home - far, joint.home + far)
            columns.append(low + (high - low) * random.random((n, 1)))
            continue
        quaternion = random.normal(size=(n, 4))
        columns += [random.uniform(-1.0, 1.0, (n, 3))] if joint.kind == "free" else []
        columns.append(quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True))
    wide = reading.freedom
    return TreeStates(np.hstack(columns), *random.normal(size=(2, n, wide)))


def home(reading: Reading) -> TreeStates:
    """Return the home pose as a state at rest."""
    rest = {"ball": [1.0, 0.0, 0.0, 0.0], "free": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]}
    q = [value for joint in reading.joints.values() for value in rest.get(joint.kind, [joint.home])]
    wide = reading.freedom
    return TreeStates(np.array([q], dtype=float).reshape(1, -1), np.zeros((1, wide)), np.zeros((1, wide)))


def near_home(tree: ReadingTree, n: int, units: Array, seed: int) -> TreeStates:
    """Draw n random states near the home pose, for loops that do not close everywhere.

    Args:
        units: Scale of each velocity. Shape (n_freedom,).
    """
    there, drawn = np.repeat(home(tree.reading).q, n, axis=0), draw(tree.reading, n, seed)
    step = BESIDE * units * np.random.default_rng(seed).normal(size=drawn.qd.shape)
    return replace(drawn, q=move_joints(tree, there, step))


def residual_at_home(tree: ReadingTree) -> dict[str, float]:
    """Compute the largest entry in the gap of each closure at the home pose [m, or rad for rotations of a weld]."""
    gaps = closure_gaps(move(tree, home(tree.reading)))
    return {name: float(np.abs(gap).max()) for name, gap in gaps.items()}


def displace_joint(joint: JointReading, T: Array) -> JointReading:
    """Displace a joint in the world frame.

    Args:
        T: Displacement. Shape (4, 4).
    """
    R, p = T[:3, :3], T[:3, 3]
    axis = R @ joint.screw[:3]
    return replace(joint, screw=np.append(axis, R @ joint.screw[3:] + cross(p, axis)), centre=R @ joint.centre + p)


def rehome(
    reading: Reading, q: Mapping[str, float] | Mapping[str, Array]
) -> tuple[Reading, dict[str, Array], dict[str, Array]]:
    """Move the home pose of a reading to different coordinates.

    Args:
        q: Joint -> new coordinates, see `ReadingTree`; all other joints keep their coordinates.

    Returns:
        The reading, and the displacements of the parent of each joint and of each body. Shape (4, 4) each.
    """
    if not q:
        still = np.eye(4)
        return reading, dict.fromkeys(reading.joints, still), dict.fromkeys(reading.bodies, still)
    tree, rest = tree_of(reading), home(reading)
    there = rest.q.copy()
    for name, value in q.items():
        there[0, tree.places[name]] = value
    old, new = (move(tree, replace(rest, q=q)).links for q in (rest.q, there))
    carried = [_displacement(*pair) for pair in zip(old.R[0], old.p[0], new.R[0], new.p[0], strict=True)]
    behind = dict(zip(reading.joints, carried[1:], strict=True))
    before = {name: carried[link.start.link] for name, link in zip(reading.joints, tree.links, strict=True)}
    joints = {name: displace_joint(joint, behind[name]) for name, joint in reading.joints.items()}
    counted = {name: float(there[0, tree.places[name]][0]) for name in q if FREEDOMS[joints[name].kind] == 1}
    joints |= {name: replace(joints[name], home=value) for name, value in counted.items()}
    after = {name: behind[body.joints[-1]] for name, body in reading.bodies.items()}
    bodies = {name: replace(body, pose=after[name] @ body.pose) for name, body in reading.bodies.items()}
    return replace(reading, joints=joints, bodies=bodies), before, after


def _displacement(R: Array, p: Array, new_R: Array, new_p: Array) -> Array:
    """Compute the displacement from one pose to another; return exactly the identity if the poses are equal."""
    if np.array_equal(R, new_R) and np.array_equal(p, new_p):
        return np.eye(4)
    turn = new_R @ R.T
    return matrix(new_p - turn @ p, turn)


def unmodelled_forces(reading: Reading) -> tuple[str, ...]:
    """List the forces of a reading that the dynamics of its tree omit."""
    density, viscosity = reading.medium
    fluid = (f"the medium (density {density:g} kg/m^3, viscosity {viscosity:g} Pa s)",)
    return fluid if density or viscosity else ()
