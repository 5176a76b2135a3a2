"""The tree of a reading as arrays, states of it, and how it then moves: all samples at once.

Twists are [angular; linear at the world origin] in world axes, and poses products of exponentials of the screws at home
(Lynch, Park: Modern Robotics, eqs. 4.14, 5.11). Nothing here is shared with the solver or with an engine: it is a
witness of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.models.placement import quaternion_rotation
from screwgauge.models.readings.reading import FREEDOMS, Reading, slices
from screwgauge.reference.equations.screws import lie_bracket
from screwgauge.reference.rotations import Array, cross, skew

#: Kind of a joint -> its coordinates. A hinge or slide counts as its file does. Those of ``ball`` and ``free`` are of
#: the frame that the joint carries, in that frame at home: of a free joint first the position of its origin, then the
#: quaternion (w, x, y, z). Home is (0, 0, 0,) 1, 0, 0, 0.
COORDINATES = {"hinge": 1, "slide": 1, "ball": 4, "free": 7}
#: Where nothing limits it, a coordinate is drawn so far from home [rad or m].
FAR = {"hinge": math.pi, "slide": 0.5}


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """Samples of motion, joints in the order of the reading.

    Attributes:
        q: Coordinates, see `COORDINATES` [rad or m]. Shape (n, n_coordinate).
        qd, qdd: Velocities, see `reading.FREEDOMS`, and their derivatives. Shape (n, n_freedom).
    """

    q: Array
    qd: Array
    qdd: Array

    def at(self, which: slice | NDArray[Any]) -> States:
        """Some of them."""
        return States(self.q[which], self.qd[which], self.qdd[which])


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """A reading as arrays.

    Attributes:
        reading: It.
        places, freedoms: Joint -> its coordinates and its velocities.
        single: Joints of one freedom by number, their screws at home, shape (k, 6), and points on them, shape (k, 3).
        frames: Number of each ball or free joint -> the frame that it carries, at home. Shape (4, 4).
        levels: Numbers of the joints that as many joints are before, each with the number of the one before it.
        last: Number of the last joint of each body.
        moves: Which velocities move which body. Shape (n_body, n_freedom).
        before: Which velocities are of joints before that of another velocity. Shape (n_freedom, n_freedom).
        mass, com, inertia, pose, weight: Of all bodies, as in the reading; `weight` is the share left by `gravcomp`.
    """

    reading: Reading
    places: dict[str, slice]
    freedoms: dict[str, slice]
    single: tuple[Array, Array, Array]
    frames: dict[int, Array]
    levels: tuple[tuple[Array, Array], ...]
    last: Array
    moves: Array
    before: Array
    mass: Array
    com: Array
    inertia: Array
    pose: Array
    weight: Array


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A tree in motion.

    Attributes:
        R, p: Poses of the bodies. Shapes (n, n_body, 3, 3), (n, n_body, 3).
        screws: Twist of each velocity at unit rate. Shape (n, n_freedom, 6).
        twist, acceleration: Of the bodies; `acceleration` is the derivative of the twist. Shape (n, n_body, 6).
    """

    R: Array
    p: Array
    screws: Array
    twist: Array
    acceleration: Array


def plant(reading: Reading) -> Tree:
    """The tree of a reading."""
    names = list(reading.joints)
    number = {name: i for i, name in enumerate(names)}
    joints, bodies = list(reading.joints.values()), list(reading.bodies.values())
    chain: dict[str, list[int]] = {}  # all joints between the ground and a body
    prior: dict[int, int] = {}
    for name, body in reading.bodies.items():
        chain[name] = [*chain.get(body.near, ()), *(number[joint] for joint in body.joints)]
        prior |= dict(zip(chain[name], [-1, *chain[name]], strict=False))
    moves, before = np.zeros((len(bodies), len(joints))), np.zeros((len(joints), len(joints)))
    for row, line, body in zip(moves, chain.values(), bodies, strict=True):
        row[line] = 1.0
        for k in range(len(line) - len(body.joints), len(line)):
            before[line[k], line[:k]] = 1.0
    wide = np.repeat(np.arange(len(joints)), [FREEDOMS[joint.kind] for joint in joints])
    single = [i for i, joint in enumerate(joints) if FREEDOMS[joint.kind] == 1]
    return Tree(
        reading,
        slices(reading.joints, COORDINATES),
        reading.freedoms,
        (
            np.array(single, dtype=int),
            np.array([joints[i].screw for i in single]).reshape(-1, 6),
            np.array([joints[i].centre for i in single]).reshape(-1, 3),
        ),
        {number[name]: frame for name, frame in _carried(reading)},
        _levels(prior),
        np.array([chain[name][-1] for name in reading.bodies], dtype=int),
        moves[:, wide],
        before[np.ix_(wide, wide)],
        np.array([body.mass for body in bodies]),
        np.array([body.com for body in bodies]).reshape(-1, 3),
        np.array([body.inertia for body in bodies]).reshape(-1, 3, 3),
        np.array([body.pose for body in bodies]).reshape(-1, 4, 4),
        np.array([1.0 - body.gravcomp for body in bodies]),
    )


def _carried(reading: Reading) -> Iterator[tuple[str, Array]]:
    """Ball and free joints, and the frame that each carries: axes of the body, about the ball or the body's origin."""
    for body in reading.bodies.values():
        for name in body.joints:
            frame, joint = body.pose.copy(), reading.joints[name]
            if joint.kind == "ball":
                frame[:3, 3] = joint.centre
            if joint.kind in ("ball", "free"):
                yield name, frame


def _levels(prior: dict[int, int]) -> tuple[tuple[Array, Array], ...]:
    """See `Tree.levels`. `prior`: joint -> the one before it, which comes first; -1 for none."""
    depth, levels = {-1: -1}, dict[int, list[int]]()
    for i, before in prior.items():
        depth[i] = depth[before] + 1
        levels.setdefault(depth[i], []).append(i)
    return tuple((np.array(level), np.array([prior[i] for i in level])) for level in levels.values())


def draw(reading: Reading, n: int, seed: int = 0) -> States:
    """So many random states within the limits; velocities and accelerations are normal [rad/s or m/s, per s]."""
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
    return States(np.hstack(columns), *random.normal(size=(2, n, wide)))


def home(reading: Reading) -> States:
    """One state: at rest at home."""
    rest = {"ball": [1.0, 0.0, 0.0, 0.0], "free": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]}
    q = [value for joint in reading.joints.values() for value in rest.get(joint.kind, [joint.home])]
    wide = reading.freedom
    return States(np.array([q], dtype=float).reshape(1, -1), np.zeros((1, wide)), np.zeros((1, wide)))


def moved(tree: Tree, q: Array, step: Array) -> Array:
    """Coordinates after each joint has gone a way along its velocities.

    Args:
        step: [rad or m]. Shape (n, n_freedom).
    """
    out = q.copy()
    for name, place in tree.places.items():
        part = step[:, tree.freedoms[name]]
        if part.shape[1] == 1:
            out[:, place] += part
            continue
        w, turn = q[:, place][:, -4:], part[:, :3]
        half = 0.5 * np.linalg.norm(turn, axis=1, keepdims=True)
        v = 0.5 * turn * np.sinc(half / np.pi)
        real = w[:, :1] * np.cos(half) - np.sum(w[:, 1:] * v, axis=1, keepdims=True)
        out[:, place.stop - 4 : place.stop] = np.hstack(
            [real, w[:, :1] * v + np.cos(half) * w[:, 1:] + cross(w[:, 1:], v)]
        )
        if part.shape[1] == 6:
            out[:, place.start : place.start + 3] += (quaternion_rotation(w) @ part[:, 3:, None])[..., 0]
    return out


def move(tree: Tree, states: States) -> Motion:
    """Poses, twists and accelerations of all bodies."""
    inner, outer = displacements(tree, states.q)
    screws = _screws(tree, inner, outer)
    rates = screws * states.qd[..., None]
    gained = screws * states.qdd[..., None] + lie_bracket(tree.before @ rates, rates)
    R, p = outer[0][:, tree.last], outer[1][:, tree.last]
    home_R, home_p = tree.pose[:, :3, :3], tree.pose[:, :3, 3]
    return Motion(R @ home_R, (R @ home_p[:, :, None])[..., 0] + p, screws, tree.moves @ rates, tree.moves @ gained)


def displacements(tree: Tree, q: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """How what is before and what is behind each joint is displaced from home.

    Returns:
        Rotations and translations of both. Shapes (n, n_joint, 3, 3), (n, n_joint, 3).
    """
    R, p = _steps(tree, q)
    inner_R, inner_p = np.broadcast_to(np.eye(3), R.shape).copy(), np.zeros_like(p)
    for level, prior in tree.levels:
        if prior[0] >= 0:
            inner_R[:, level], inner_p[:, level] = R[:, prior], p[:, prior]
            p[:, level] = (inner_R[:, level] @ p[:, level, :, None])[..., 0] + inner_p[:, level]
            R[:, level] = inner_R[:, level] @ R[:, level]
    return (inner_R, inner_p), (R, p)


def _steps(tree: Tree, q: Array) -> tuple[Array, Array]:
    """Exponential of each joint's screw times its coordinate. Shapes (n, n_joint, 3, 3), (n, n_joint, 3)."""
    joints = list(tree.reading.joints.values())
    R, p = np.empty((len(q), len(joints), 3, 3)), np.empty((len(q), len(joints), 3))
    numbers, screws, centres = tree.single
    places = list(tree.places.values())
    angle = q[:, [places[i].start for i in numbers]] - np.array([joints[i].home for i in numbers])
    w, K = screws[:, :3], skew(screws[:, :3])
    turn = angle[..., None, None]
    # 1 - cos as 2 sin^2 of the half angle: no cancellation at small angles
    R[:, numbers] = np.eye(3) + np.sin(turn) * K + 2.0 * np.sin(0.5 * turn) ** 2 * (K @ K)
    slides = np.where(np.any(w, axis=1, keepdims=True), 0.0, screws[:, 3:])
    p[:, numbers] = centres - (R[:, numbers] @ centres[:, :, None])[..., 0] + angle[..., None] * slides
    for i, frame in tree.frames.items():
        own = q[:, places[i]]
        step = frame[:3, :3] @ quaternion_rotation(own[:, -4:]) @ frame[:3, :3].T
        R[:, i] = step
        p[:, i] = frame[:3, 3] - step @ frame[:3, 3] + own[:, :-4] @ frame[:3, : own.shape[1] - 4].T
    return R, p


def _screws(tree: Tree, inner: tuple[Array, Array], outer: tuple[Array, Array]) -> Array:
    """Twists of unit velocities, see `Motion.screws`.

    Args:
        inner, outer: Displacements from home of what is before and of what is behind each joint.
    """
    numbers, at_home, _ = tree.single
    starts = [part.start for part in tree.freedoms.values()]
    screws = np.empty((len(inner[0]), len(tree.before), 6))
    R, p = (each[:, numbers] for each in inner)
    columns = [starts[i] for i in numbers]
    w = (R @ at_home[:, :3, None])[..., 0]
    screws[:, columns] = np.concatenate([w, (R @ at_home[:, 3:, None])[..., 0] + cross(p, w)], axis=-1)
    for i, frame in tree.frames.items():
        axes = outer[0][:, i] @ frame[:3, :3]  # of the body; its columns are the axes
        origin = outer[0][:, i] @ frame[:3, 3] + outer[1][:, i]
        turns = np.swapaxes(axes, 1, 2)
        screws[:, starts[i] : starts[i] + 3] = np.concatenate([turns, cross(origin[:, None], turns)], axis=-1)
        if tree.reading.joints[list(tree.freedoms)[i]].kind == "free":
            screws[:, starts[i] + 3 : starts[i] + 6] = np.concatenate([np.zeros_like(turns), turns], axis=-1)
    return screws
