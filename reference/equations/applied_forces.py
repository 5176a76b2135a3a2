"""Computes wrenches, power and stored energy of loads, springs, dampers and motors; `applied` defines their data."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.applied import Applied, JointSpring, Load, Motor, PointSpring, Spring
from screwgauge.reference.equations.kinematics import zeros
from screwgauge.reference.equations.recursion import wrench
from screwgauge.reference.equations.screws import Array, dot, scale, times, velocity_at
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.resistance import LOSSES, REST, Resistance, resistances

if TYPE_CHECKING:
    from screwgauge.reference.equations.dynamics import Dynamics


def wrenches_on_bodies(at: Dynamics) -> Array:
    """Return the wrenches of loads, eq. (55), and point springs on each body, see `recursion.wrench`. (..., b, 6)."""
    W = zeros(at.q, len(at.mechanism.body_index), 6)
    for load in at.applied.loads:
        if body := at.mechanism.body_index[load.body]:  # the ground does not need a force balance
            f, m = load_vectors(at, load)
            W[..., body, :] = W[..., body, :] + wrench(at.pose, body, place(at, load), f, m)
    for spring in (one for one in at.applied.springs if isinstance(one, PointSpring)):
        (i, a), (j, b) = ends(at, spring)
        pull = scale(tension(at, spring) / distance(at, spring), b - a)
        for body, (_, arm), f in zip((i, j), spring.ends, (pull, -pull), strict=True):
            W[..., body, :] = W[..., body, :] + wrench(at.pose, body, arm, f, 0.0 * f)
    return W


def forces_along(at: Dynamics) -> Array:
    """Return forces of joint springs, motors, damping and friction, plus `Dynamics.given_forces`. Shape (..., n_q)."""
    along, coordinates = zeros(at.q, at.q.shape[-1]), at.mechanism.coordinates
    for spring in (one for one in at.applied.springs if isinstance(one, JointSpring)):
        c = coordinates.index(spring.coordinate)
        along[..., c] = along[..., c] - tension(at, spring)
    for motor in at.applied.motors:
        c = coordinates.index(motor.coordinate)
        along[..., c] = along[..., c] + motor_force(at, motor)
    for one in resistances(at.mechanism.joints, LOSSES):
        along[..., one.column] = along[..., one.column] - resisting_force(at, one)
    return along if at.given_forces is None else along + at.given_forces


def place(at: Dynamics, load: Load) -> Array:
    """Return the body point at which a load acts; by default, it is the centre of mass. Shape (3,)."""
    return at.mechanism.body(load.body).com if load.point is None else load.point


def load_vectors(at: Dynamics, load: Load) -> tuple[Array, Array]:
    """Return force and torque of a load at the time of the motion, in world axes. Shape (..., 3) each."""
    now = load.at(at.t, at.ops.cos, at.ops.sin)
    f, m = np.asarray(now.force), np.asarray(now.torque)
    if load.axes == "world":
        return f, m
    R = at.pose.R[..., at.mechanism.body_index[load.body], :, :]
    return times(R, f), times(R, m)


def load_power(at: Dynamics, load: Load) -> Any:
    """Return the power of a load. Shape (...)."""
    body, (f, m) = at.mechanism.body_index[load.body], load_vectors(at, load)
    V = at.V[..., body, :]
    moved = velocity_at(V, point(at, body, place(at, load)))
    return dot(f, moved) + dot(m, V[..., :3])


def point(at: Dynamics, body: int, arm: Array) -> Array:
    """Return the world position of a body point. Shape (..., 3)."""
    return at.pose.p[..., body, :] + times(at.pose.R[..., body, :, :], arm)


def ends(at: Dynamics, spring: PointSpring) -> list[tuple[int, Array]]:
    """Return the body at each end of a spring, and the world position of the end point, shape (..., 3)."""
    index = at.mechanism.body_index
    return [(index[body], point(at, index[body], arm)) for body, arm in spring.ends]


def distance(at: Dynamics, spring: PointSpring) -> Any:
    """Return the length of a spring between two points [m]. Shape (...)."""
    (_, a), (_, b) = ends(at, spring)
    return at.ops.sqrt(dot(b - a, b - a))


def spring_length(at: Dynamics, spring: Spring) -> Any:
    """Return the length of a point spring, or the coordinate of a joint spring [m or rad]. Shape (...)."""
    return distance(at, spring) if isinstance(spring, PointSpring) else at.joint_coordinate(spring.coordinate)


def stretch(at: Dynamics, spring: Spring) -> Any:
    """Return the elongation of a spring, ``q - q0`` or ``l - l0`` [rad or m]. Shape (...)."""
    return spring_length(at, spring) - spring.rest


def stretch_rate(at: Dynamics, spring: Spring) -> Any:
    """Return the rate of change of a spring's length, which its damper resists. Shape (...)."""
    if isinstance(spring, PointSpring):
        (i, a), (j, b) = ends(at, spring)
        apart = velocity_at(at.V[..., j, :], b) - velocity_at(at.V[..., i, :], a)
        return dot(b - a, apart) / distance(at, spring)
    return at.joint_rate(spring.coordinate)


def tension(at: Dynamics, spring: Spring) -> Any:
    """Return the tension ``k (l - l0) + c ld``, or the force of a joint spring against its coordinate. Shape (...)."""
    return spring.pull(spring_length(at, spring), stretch_rate(at, spring))


def resisting_force(at: Dynamics, one: Resistance) -> Any:
    """Return the force by which a rotor, damper or dry friction resists motion of its coordinate. Shape (...)."""
    if one.what == "rotor":
        return one.amount * at.joint_acceleration[..., one.column]
    rate = at.joint_rate(one.coordinate)
    return one.amount * (rate if one.what == "damping" else sign(at, rate))


def sign(at: Dynamics, rate: Any) -> Any:
    """Return the sign of a rate for any scalar type: -1, 0 (for rates up to `REST`) or 1. Shape (...)."""
    size = at.ops.sqrt(rate * rate)
    moves = -at.ops.maximum(-at.ops.maximum((size / REST - 1.0) / linear.EPS, 0.0), -1.0)
    return moves * rate / at.ops.maximum(size, REST)


def motor_force(at: Dynamics, motor: Motor) -> Any:
    """Return the force of a motor at the time of the motion."""
    return motor.force(at.t, at.ops.cos, at.ops.sin)


def check_applied(mechanism: Mechanism, applied: Applied) -> None:
    """Reject springs on bodies or coordinates that the mechanism lacks.

    Raises:
        UnknownNameError: A spring refers to a missing body or coordinate.
    """
    for spring in applied.springs:
        if isinstance(spring, JointSpring) and spring.coordinate not in mechanism.coordinates:
            raise UnknownNameError("coordinate", spring.coordinate, mechanism.coordinates, "spring")
        for body, _ in spring.ends if isinstance(spring, PointSpring) else ():
            if body not in mechanism.body_index:
                raise UnknownNameError("body", body, mechanism.body_index, "spring")
