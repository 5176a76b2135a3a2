"""Chains of hinges and slides as joints of a description: R, P, and U, S, C, F where axes meet exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.models.importing.parts import SAME, Part, Pin
from screwgauge.models.readings.reading import JointReading
from screwgauge.reference.mechanism import KINDS, Frame, Joint
from screwgauge.reference.rotations import Array, rotation

#: Cosine between axes that are orthogonal; descriptions are held to 1e-12.
RIGHT = 1e-13
#: Entries of unit vectors and rotations that rounding leaves of zero.
NOTHING = 4e-16
#: A limit where a joint has one on the other side only [rad, m].
FAR, FREE = 1e10, (-np.inf, np.inf)
#: Sine of a spherical joint's second angle at home above which its axes say little; at one they lie in a plane.
STEEP = 0.8


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """A hinge or slide at home, in the world: unit direction and a point of it. Shapes (3,)."""

    name: str
    turns: bool
    direction: Array
    point: Array
    home: float
    limits: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Neighbouring freedoms of a chain that make one joint; `point` is where all its axes meet."""

    kind: str
    axes: tuple[Axis, ...]
    point: Array


def axis_of(name: str, joint: JointReading) -> Axis:
    """A hinge or slide."""
    turns = joint.kind == "hinge"
    direction = joint.screw[:3] if turns else joint.screw[3:]
    return Axis(name, turns, direction, joint.centre, joint.home, joint.limits)


def groups(axes: Sequence[Axis], driven: frozenset[str], coupled: frozenset[str], length: float) -> list[Group]:
    """Freedoms of a chain as joints. Driven ones stay alone, and coupled ones do not become part of S and F."""
    out, i = list[Group](), 0
    while i < len(axes):
        for n, recognise in ((6, _free), (3, _spherical), (2, _pair)):
            part = tuple(axes[i : i + n])
            names = {axis.name for axis in part}
            whole = len(part) == n and not names & (driven if n == 2 else driven | coupled)
            if whole and (found := recognise(part, length)):
                out.append(found)
                break
        else:
            n, axis = 1, axes[i]
            out.append(Group("R" if axis.turns else "P", (axis,), axis.point))
        i += n
    return out


def _free(axes: tuple[Axis, ...], length: float) -> Group | None:
    slides, hinges = axes[:3], axes[3:]
    if [axis.turns for axis in axes] != list(KINDS["F"]) or not (ball := _spherical(hinges, length)):
        return None
    E = np.array([axis.direction for axis in slides])
    right = np.abs(E @ E.T - np.eye(3)).max() < RIGHT and np.linalg.det(E) > 0.0
    return Group("F", axes, ball.point) if right else None


def _spherical(axes: tuple[Axis, ...], length: float) -> Group | None:
    if not all(axis.turns for axis in axes):
        return None
    E, _ = at_zero(axes)
    point = _meet(axes, length)
    orthogonal = np.abs(E @ E.T - np.eye(3)).max() < RIGHT
    if not orthogonal or point is None:
        return None
    return Group("S", axes, point) if abs(np.sin(axes[1].home)) < STEEP else _from_home(axes, point)


def _from_home(axes: tuple[Axis, ...], point: Array) -> Group:
    """A spherical joint whose angles count from home: its own axes are next to a plane there (gimbal lock)."""
    names = [f"{axis.name}.from-home" for axis in axes]
    return Group("S", tuple(Axis(n, True, e, point, 0.0, FREE) for n, e in zip(names, np.eye(3), strict=True)), point)


def _pair(axes: tuple[Axis, ...], length: float) -> Group | None:
    first, second = axes
    if first.turns and second.turns:
        point = _meet(axes, length)
        square = abs(float(first.direction @ second.direction)) < RIGHT
        return Group("U", axes, point) if square and point is not None else None
    same = np.abs(first.direction - second.direction).max() < RIGHT
    if first.turns == second.turns or not same:
        return None
    hinge, slide = (first, second) if first.turns else (second, first)
    return Group("C", (hinge, slide), hinge.point)


def _meet(axes: tuple[Axis, ...], length: float) -> Array | None:
    """The point in which hinges meet, None if they do not."""
    N = [np.eye(3) - np.outer(axis.direction, axis.direction) for axis in axes]
    point = np.linalg.solve(
        sum(N, np.zeros((3, 3))), sum((n @ a.point for n, a in zip(N, axes, strict=True)), np.zeros(3))
    )
    off = max(float(np.linalg.norm(n @ (point - a.point))) for n, a in zip(N, axes, strict=True))
    # where one of the points given is the one, it is exact
    exact = [a.point for a in axes if np.linalg.norm(a.point - point) < SAME * length]
    return np.asarray([*exact, point][0]) if off < 1e-14 * length else None


def at_zero(axes: Sequence[Axis]) -> tuple[Array, Array]:
    """Axes before the freedoms after them turned, in axes of the joint's child at home, and the whole rotation.

    Of the serial product of rotations, the last axis is as the child sees it, and each one before it as seen
    from behind those after it.
    """
    E, P = np.empty((len(axes), 3)), np.eye(3)
    for i in reversed(range(len(axes))):
        E[i] = P @ axes[i].direction
        if axes[i].turns:
            P = rotation(_unit(E[i]), np.array(axes[i].home)) @ P
    return E, P


def _unit(v: Array) -> Array:
    clean = np.where(np.abs(v) < NOTHING, 0.0, v)
    return np.asarray(clean / np.linalg.norm(clean))


def _tidy(R: Array) -> Array:
    """A rotation without what rounding leaves of zeros and ones."""
    near = np.round(R)
    return np.where(np.abs(R - near) < 2.0 * NOTHING, near, R) + 0.0


def frame(part: Part, R: Array, point: Array, length: float) -> Frame:
    """A frame of the world in a part."""
    p = part.pose[:3, :3].T @ (point - part.pose[:3, 3])
    return Frame(np.where(np.abs(p) < NOTHING * length, 0.0, p) + 0.0, _tidy(part.pose[:3, :3].T @ R))


def joint(group: Group, name: str, near: Part, far: Part, length: float) -> Joint:
    """A joint of a description; its coordinates and their values are those of the freedoms."""
    R = far.pose[:3, :3]
    E, P = at_zero([replace(axis, direction=R.T @ axis.direction) for axis in group.axes])
    near_R, far_R = R @ P.T, R
    slid = sum((axis.home * axis.direction for axis in group.axes if not axis.turns), np.zeros(3))
    if group.kind == "F":  # slides along the axes of the frame in the parent
        D = np.array([axis.direction for axis in group.axes[:3]]).T
        E, far_R, near_R = E[3:] @ near_R.T @ D, R @ near_R.T @ D, D
    elif group.kind == "C":
        E = E[:1]
    return Joint(
        name=name,
        kind=group.kind,
        parent=near.name,
        child=far.name,
        axes=np.array([_unit(e) for e in E]),
        coordinates=tuple(axis.name for axis in group.axes),
        home=np.array([axis.home for axis in group.axes]),
        limits=np.array([bounds(axis.limits) for axis in group.axes]),
        parent_frame=frame(near, near_R, group.point - slid, length),
        child_frame=frame(far, far_R, group.point, length),
    )


def bounds(limits: tuple[float, float]) -> tuple[float, float]:
    """Limits as a description has them: both finite, or none."""
    low, high = limits
    if not low < high or np.isinf(limits).all():
        return -np.inf, np.inf
    return max(low, -FAR), min(high, FAR)


def ball(name: str, kind: str, near: Part, far: Part, point: Array) -> Group:
    """A ball (S) or free joint (F), its angles zero at home; a free one has the axes of its parent."""
    R = (near if kind == "F" else far).pose[:3, :3]
    home = near.pose[:3, :3].T @ (point - near.pose[:3, 3])
    slides = [Axis(f"{name}.{x}", False, R[:, i], point, float(home[i]), FREE) for i, x in enumerate("xyz")]
    turns = [Axis(f"{name}.q{i + 1}", True, R[:, i], point, 0.0, FREE) for i in range(3)]
    return Group(kind, tuple(slides + turns if kind == "F" else turns), point)


def pinned(pin: Pin, first: Part, second: Part) -> Group:
    """An S joint where two parts have a point in common, or an R joint where they have two of an axis."""
    if len(pin.points) == 1:
        return ball(pin.name, "S", first, second, pin.points[0])
    along = pin.points[1] - pin.points[0]
    middle = 0.5 * (pin.points[0] + pin.points[1])
    axis = Axis(pin.name, True, along / np.linalg.norm(along), middle, 0.0, FREE)
    return Group("R", (axis,), middle)
