"""Loads, springs, dampers and motors: what they exert, and what of it is stored or lost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from screwgauge.reference.applied import JointSpring, Load, Motor, PointSpring
from screwgauge.reference.equations.kinematics import zeros
from screwgauge.reference.equations.screws import Array, couple, dot, force, scale, times, velocity_at

if TYPE_CHECKING:
    from screwgauge.reference.equations.dynamics import Dynamics


class Exerted(NamedTuple):
    """What acts besides inertia, gravity and constraints.

    Attributes:
        wrenches: On each body. Shape (..., b, 6).
        along: Along each joint coordinate [N or N m]. Shape (..., n_q).
    """

    wrenches: Array
    along: Array


def exerted(at: Dynamics) -> Exerted:
    """What loads, springs, dampers and motors exert."""
    W, along = zeros(at.q, len(at.mechanism.body_index), 6), zeros(at.q, at.q.shape[-1])
    coordinates = at.mechanism.coordinates
    for load in at.applied.loads:
        if body := at.mechanism.body_index[load.body]:  # the ground needs no balance
            W[..., body, :] = W[..., body, :] + load_wrench(at, load)
    for spring in at.applied.springs:
        if isinstance(spring, PointSpring):
            (i, a), (j, b) = ((body, point(at, body, arm)) for body, arm in _ends(at, spring))
            pull = scale(tension(at, spring), line(at, spring)[0])
            W[..., i, :] = W[..., i, :] + force(pull, a)
            W[..., j, :] = W[..., j, :] - force(pull, b)
        else:
            c = coordinates.index(spring.coordinate)
            along[..., c] = along[..., c] - joint_spring(at, spring)
    for motor in at.applied.motors:
        c = coordinates.index(motor.coordinate)
        along[..., c] = along[..., c] + motor_force(at, motor)
    return Exerted(W, along)


def load_wrench(at: Dynamics, load: Load) -> Array:
    """Wrench of a load, as in eq. (55); force and torque keep their directions in the world. Shape (..., 6)."""
    arm = at.mechanism.body(load.body).com if load.point is None else load.point
    acting = force(np.asarray(load.force), point(at, at.mechanism.body_index[load.body], arm))
    return acting + couple(np.asarray(load.torque))


def point(at: Dynamics, body: int, arm: Array) -> Array:
    """World position of a point of a body. Shape (..., 3)."""
    return at.pose.p[..., body, :] + times(at.pose.R[..., body, :, :], arm)


def joint_spring(at: Dynamics, spring: JointSpring) -> Any:
    """Force of a spring and damper against its joint coordinate, ``k (q - q0) + c qd``."""
    c = at.mechanism.coordinates.index(spring.coordinate)
    cut = c in at.loops.owner
    q, v = (at.joint_position, at.joint_velocity) if cut else (at.q, at.w)
    return spring.stiffness * (q[..., c] - spring.rest) + spring.damping * v[..., c]


def _ends(at: Dynamics, spring: PointSpring) -> list[tuple[int, Array]]:
    return [(at.mechanism.body_index[body], arm) for body, arm in spring.ends]


def line(at: Dynamics, spring: PointSpring) -> tuple[Array, Any, Any]:
    """Unit vector from the first point of a spring to the second, their distance and its rate."""
    (i, a), (j, b) = ((body, point(at, body, arm)) for body, arm in _ends(at, spring))
    length = at.ops.sqrt(dot(b - a, b - a))
    unit = scale(1.0 / length, b - a)
    return unit, length, dot(unit, velocity_at(at.V[..., j, :], b) - velocity_at(at.V[..., i, :], a))


def tension(at: Dynamics, spring: PointSpring) -> Any:
    """Pull of a spring and damper between two points, ``k (l - l0) + c ld``."""
    _, length, rate = line(at, spring)
    return spring.stiffness * (length - spring.rest) + spring.damping * rate


def motor_force(at: Dynamics, motor: Motor) -> Any:
    """Force of a motor at its time: a polynomial and harmonics."""
    found: Any = 0.0
    for coefficient in motor.polynomial[::-1].tolist():
        found = found * at.t + coefficient
    for omega, c, s in motor.harmonics.tolist():
        found = found + c * at.ops.cos(omega * at.t) + s * at.ops.sin(omega * at.t)
    return found
