"""Joint types; each entry of `TYPES` defines the mechanics of one kind of joint.

A joint transmits the wrenches that have zero power on its screws (eq. 8). These close the loop of a cut joint and are
the components of its reaction. Their directions are orthonormal and act at the joint's point on the child, so that a
component is also the power of the joint's total wrench on the unit twist that it forbids. Wrenches dual to the screws
of a joint yield its rates and transmit its forces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from screwgauge.reference.couplings import Coupling, component_name
from screwgauge.reference.equations.screws import (
    Array,
    couple,
    cross,
    dot,
    force,
    join,
    scale,
    stack,
    times,
    transpose,
)
from screwgauge.reference.mechanism import KINDS, Frame, Joint, by_role
from screwgauge.reference.rotations import across, nearest_angles, sequence_angles

Value = tuple[Any, Any]
"""Sine and cosine of an angle, or displacement of a slide and None."""


@dataclass(frozen=True, eq=False)
class JointPose:
    """Frames of a joint on its parent and on its child, in world axes. Shapes (..., 3, 3), (..., 3).

    Attributes:
        world: World orientation of the axes in which the frames are expressed; None for world axes.
    """

    joint: Joint
    R_parent: Array
    p_parent: Array
    R_child: Array
    p_child: Array
    world: Array | None = None

    @cached_property
    def type(self) -> JointType:
        return TYPES[self.joint.kind]

    @cached_property
    def first(self) -> Array:
        """First axis of the joint, carried by the parent."""
        return times(self.R_parent, self.joint.axes[0])

    @cached_property
    def last(self) -> Array:
        """Last axis of the joint, carried by the child."""
        return times(self.R_child, self.joint.axes[-1])

    @cached_property
    def slides(self) -> list[Array]:
        """Sliding directions, which do not depend on the angles before them."""
        return [times(self.R_parent, axis) for turns, axis in self.joint.freedoms if not turns]


@lru_cache(maxsize=4096)
def is_identity(frame: Frame) -> bool:
    """Return True if a frame coincides with the frame of its body; cache the result."""
    return frame.is_identity


def locate(R: Array, p: Array, frame: Frame) -> tuple[Array, Array]:
    """Return the pose of a body-fixed frame."""
    return (R, p) if is_identity(frame) else (R @ frame.R, p + times(R, frame.p))


def locate_body(R: Array, p: Array, frame: Frame) -> tuple[Array, Array]:
    """Return the pose of a body, given the pose of a frame fixed to it."""
    if is_identity(frame):
        return R, p
    R = R @ frame.R.T
    return R, p - times(R, frame.p)


# Directions of constraint wrenches, (..., m, 3) in world axes.


def _none(at: JointPose) -> Array:
    return np.zeros((0, 3), dtype=at.joint.axes.dtype)


def _world(at: JointPose) -> Array:
    return _unit(at.joint.axes.dtype) if at.world is None else at.world


@lru_cache
def _unit(dtype: np.dtype[Any]) -> Array:
    return np.eye(3, dtype=dtype)


def _child(at: JointPose) -> Array:
    """Return the axes of the joint's child frame."""
    return transpose(at.R_child)


def _across(at: JointPose) -> Array:
    """Return two directions orthogonal to the joint axis on the child."""
    return np.asarray(_directions_across(at.joint)[1] @ transpose(at.R_child))


def _normal(at: JointPose) -> Array:
    """Return the common normal of the two axes."""
    return cross(at.first, at.last)[..., None, :]


def _along(at: JointPose) -> Array:
    """Return the joint axis on the child."""
    return times(at.R_child, _named_axis(at.joint)[1])[..., None, :]


@lru_cache(maxsize=4096)
def _directions_across(joint: Joint) -> tuple[Sequence[str], Array]:
    """Return the labels and directions of two axes orthogonal to the joint's first axis."""
    return across(joint.axes[0])


@lru_cache(maxsize=4096)
def _named_axis(joint: Joint) -> tuple[str, Array]:
    """Return the label (x, y or z; empty if oblique in the joint frame) and the direction of the joint axis."""
    axis = joint.axes[0]
    named = np.flatnonzero(axis)
    return ("xyz"[named[0]], np.eye(3, dtype=axis.dtype)[named[0]]) if len(named) == 1 else ("", axis)


# Small rotations between the two sides of a cut joint that is not closed, (..., 3) in world axes.


def _tilt(at: JointPose) -> Array:
    """Return the misalignment of two axes that should be parallel."""
    return cross(at.first, at.last)


def _turn(at: JointPose) -> Array:
    """Return the rotation between two frames that should be parallel."""
    M = at.R_child @ transpose(at.R_parent)
    twice = M - transpose(M)
    return np.asarray(0.5 * np.stack([twice[..., 2, 1], twice[..., 0, 2], twice[..., 1, 0]], axis=-1))


def _skew(at: JointPose) -> Array:
    """Return the residual of two axes that should be perpendicular."""
    return -scale(dot(at.first, at.last), cross(at.first, at.last))


# Angles about the first axes of an orthogonal triad from ``M = Rot(x, q1) Rot(y, q2) Rot(z, q3)``.

Angles = Callable[[Array, Any, Callable[[Any], Any]], list[Value]]
"""M, the sign of cos q2, and the square-root function -> sines and cosines."""


def _no_angle(M: Array, fold: Any, sqrt: Callable[[Any], Any]) -> list[Value]:
    return []


def _one_angle(M: Array, fold: Any, sqrt: Callable[[Any], Any]) -> list[Value]:
    return [(M[..., 2, 1], M[..., 2, 2])]


def _two_angles(M: Array, fold: Any, sqrt: Callable[[Any], Any]) -> list[Value]:
    return [(M[..., 2, 1], M[..., 1, 1]), (M[..., 0, 2], M[..., 0, 0])]


def _three_angles(M: Array, fold: Any, sqrt: Callable[[Any], Any]) -> list[Value]:
    c = fold * sqrt(M[..., 1, 2] * M[..., 1, 2] + M[..., 2, 2] * M[..., 2, 2])
    k = 1.0 / c
    return [(-k * M[..., 1, 2], k * M[..., 2, 2]), (M[..., 0, 2], c), (-k * M[..., 0, 1], k * M[..., 0, 0])]


def _power_on_normal(at: JointPose, w: Array) -> Any:
    """Return the power of ``[S1 w1, S2 w2] = S w1 w2`` on the common normal, which is the axis of S."""
    normal = cross(at.first, at.last)
    return dot(normal, normal) * (w[..., 0] * w[..., 1])


@dataclass(frozen=True)
class JointType:
    """Mechanics of one kind of joint.

    Attributes:
        forces, moments: Directions of the constraint forces and moments.
        open: Function that returns the small rotation between the two sides of a cut joint that is not closed.
        angles: Function that returns the angles of the cut joint.
        own: Function of the rates that returns the power of the Lie brackets of the joint's screws on the last
            constraint wrench, for eq. (48); the power on all other wrenches is zero. None if every power is zero.
    """

    forces: Callable[[JointPose], Array]
    moments: Callable[[JointPose], Array]
    open: Callable[[JointPose], Array] | None
    angles: Angles
    own: Callable[[JointPose, Array], Any] | None = None


TYPES = {
    "R": JointType(_world, _across, _tilt, _one_angle),
    "P": JointType(_across, _child, _turn, _no_angle),
    "U": JointType(_world, _normal, _skew, _two_angles, own=_power_on_normal),
    "S": JointType(_world, _none, None, _three_angles),
    "C": JointType(_across, _across, _tilt, _one_angle),
    "E": JointType(_along, _across, _tilt, _one_angle),
    "F": JointType(_none, _none, None, _no_angle),
    "fixed": JointType(_world, _across, _tilt, _one_angle),
}


def components(joint: Joint) -> list[tuple[str, str]]:
    """Return the label and unit of each constraint wrench, e.g. ``fx`` and N, ``m1`` and N m."""
    kind, directions, axis = TYPES[joint.kind], _directions_across(joint)[0], _named_axis(joint)[0]
    labels: dict[Any, Sequence[str]] = {_world: "xyz", _child: "xyz", _across: directions, _normal: [""], _none: ""}
    labels[_along] = [axis]
    forces = [(f"f{label}", "N") for label in labels[kind.forces]]
    return forces + [(f"m{label}", "N m") for label in labels[kind.moments]]


def reaction_names(joints: Sequence[Joint], couplings: Sequence[Coupling]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units of reaction components, e.g. ``leg1.base.fx`` and N, by joint role; couplings are last."""
    pairs = [(f"{joint.name}.{label}", unit) for joint in by_role(joints) for label, unit in components(joint)]
    turns = {name: turn for joint in joints for name, turn in zip(joint.coordinates, KINDS[joint.kind], strict=True)}
    pairs += [(component_name(one), "N m" if turns[one.coordinate] else "N") for one in couplings]
    return tuple(name for name, _ in pairs), tuple(unit for _, unit in pairs)


@lru_cache(maxsize=4096)
def triad(joint: Joint) -> tuple[Array, float]:
    """Return right-handed orthonormal axes that begin with a joint's first two axes, or its only axis.

    Returns:
        The three axes, shape (3, 3), and -1 if the joint's third axis is opposite to the third of these axes, else 1.
    """
    first, axes = joint.axes[0], joint.axes
    second = axes[1] if len(axes) > 1 else np.linalg.svd(axes)[2][1]
    third = cross(first, second)
    return np.stack([first, second, third]), -1.0 if len(axes) > 2 and third @ axes[2] < 0.0 else 1.0


def constraint_wrenches(at: JointPose) -> Array:
    """Return the wrenches by which the parent constrains the child, eq. (8). Shape (..., m, 6)."""
    return stack(force(at.type.forces(at), at.p_child[..., None, :]), couple(at.type.moments(at)))


def reaction_components(at: JointPose, f: Array, m: Array) -> Array:
    """Return the components of a force and of a moment about the joint's point on the child. Shape (..., m)."""
    return join(times(at.type.forces(at), f), times(at.type.moments(at), m))


def closure_residual(at: JointPose) -> Array:
    """Return a cut joint's residual along each wrench [m or rad]; its rate is the wrench's power. Shape (..., m)."""
    kind, shift = at.type, at.p_child - at.p_parent
    for e in at.slides:
        shift = shift - scale(dot(e, shift), e)
    distances = times(kind.forces(at), shift)
    return distances if kind.open is None else join(distances, times(kind.moments(at), kind.open(at)))


def dual_wrenches(at: JointPose, S: Array) -> Array:
    """Return wrenches with unit power on one screw of a joint and zero power on its other screws.

    Args:
        S: Unit screws of the joint. Shape (..., f, 6).

    Returns:
        Shape (..., f, 6).
    """
    turns = np.array(KINDS[at.joint.kind])
    axes = S[..., turns, :3]
    if at.joint.angles == 3:  # no orthogonal triad
        faces = cross(axes[..., [1, 2, 0], :], axes[..., [2, 0, 1], :])
        axes = faces / np.asarray(dot(axes[..., 0, :], faces[..., 0, :]))[..., None, None]
    duals = stack(couple(axes), force(S[..., ~turns, 3:], at.p_child[..., None, :]))
    order = np.argsort(~turns, kind="stable")  # order of the dual wrenches: angles, then slides
    return duals[..., np.argsort(order), :]


def cut_coordinates(at: JointPose, fold: Any, sqrt: Callable[[Any], Any]) -> list[Value]:
    """Solve eqs. (19)-(24) for the coordinates of a cut joint, given the frames on both sides.

    Args:
        fold: Sign of the cosine of a spherical joint's middle angle, which selects one of two equivalent angle triples.
    """
    M, hand = _rotation(at)
    sides = zip(at.type.angles(M, fold, sqrt), (1.0, 1.0, hand), strict=False)
    angles = ((side * sine, cosine) for (sine, cosine), side in sides)
    shifts = ((dot(e, at.p_child - at.p_parent), None) for e in at.slides)
    return [next(angles if turns else shifts) for turns in KINDS[at.joint.kind]]


#: Condition number above which angles do not predict later samples: poses closed to 1e-13 leave errors of 1e-5 rad.
SURE = 1e8


def read_coordinates(at: JointPose, near: Array | None = None) -> Array:
    """Read the coordinates of a cut joint as floats; unlike `cut_coordinates`, it also works in gimbal lock.

    Args:
        near: Angles; the closest equivalent angles of either triple are returned. Without `near`, angles are within
            half a turn. Shape (n, f).

    Returns:
        Shape (n, f).
    """
    M, hand = _rotation(at)
    turns, angles = np.array(KINDS[at.joint.kind]), sequence_angles(M, at.joint.angles, hand)
    q = np.empty((len(M), len(turns)), dtype=M.dtype)
    q[:, turns] = angles if near is None else nearest_angles(angles, near[:, turns])[0]
    for i, e in zip(np.flatnonzero(~turns), at.slides, strict=True):
        q[:, i] = dot(e, at.p_child - at.p_parent)
    return q


def _rotation(at: JointPose) -> tuple[Array, float]:
    """Return the rotation of the child frame relative to the parent frame in `triad` axes, and the sign of `triad`."""
    A, hand = triad(at.joint)
    return A @ (transpose(at.R_parent) @ at.R_child) @ A.T, hand
