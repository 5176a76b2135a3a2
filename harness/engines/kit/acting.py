"""Applied forces except gravity: loads, springs, dampers, motors, and the rotors, damping and friction of joints.

`forces_at_joints` and `wrenches_on_bodies` compute them for many samples or for one state. `acting` sums them into
wrenches on bodies and forces along joint coordinates; tree engines use their own conversion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from screwgauge.engines.kit.poses import JointReading
from screwgauge.reference.applied import Applied, JointSpring, Load, PointSpring
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.resistance import LOSSES, REST, Resistance, resistances
from screwgauge.reference.rotations import Array, cross, times

BodyMotion = Callable[[int], tuple[Array, Array, Array]]
"""Index of a body, 0 for ground -> R, p and twist (angular velocity, then velocity of the origin).

Shapes (..., 3, 3), (..., 3), (..., 6).
"""

Coordinate = Callable[[str], tuple[Array | float, Array | float]]
"""Joint coordinate -> its value and rate. Shape (...)."""

LoadPoint = Callable[[Load], Array]
"""Load -> point of the body at which it acts [m]. Shape (3,)."""


def forces_at_joints(
    applied: Applied, resist: Sequence[Resistance], t: Array | float, read: Coordinate
) -> Iterator[tuple[str, Array, Array]]:
    """Yield the forces of motors, of springs and dampers at joints, and of damping and dry friction.

    Args:
        t: Times [s]. Shape (...).
        resist: Damping and dry friction of the joints; engines include rotors themselves.

    Yields:
        Coordinate, the force along it [N or N m], and its power, excluding the change in stored energy [W].
    """
    for motor in applied.motors:
        force = motor.force(t)
        yield motor.coordinate, force, np.asarray(force * read(motor.coordinate)[1])
    for one in resist:
        moved = np.asarray(read(one.coordinate)[1])
        resisted = resistance_force(one, moved)
        yield one.coordinate, -resisted, -resisted * moved
    for spring in applied.springs:
        if isinstance(spring, JointSpring):
            value, rate = read(spring.coordinate)
            yield spring.coordinate, -spring.pull(value, rate), np.asarray(-spring.damping * rate**2)


def wrenches_on_bodies(
    applied: Applied, index: Mapping[str, int], load_point: LoadPoint, t: Array | float, body: BodyMotion
) -> Iterator[tuple[int, Array, Array, Array]]:
    """Yield the wrenches that loads, and springs and dampers between body points, exert on the bodies.

    Args:
        index: Body -> its index, 0 for ground.
        t: Times [s]. Shape (...).

    Yields:
        Index of the body, the force, and the moment about the body's origin, both (..., 3); their power, excluding the
        change in stored energy [W], (...).
    """
    for load in applied.loads:
        i, now = index[load.body], load.at(t)
        R, _, V = body(i)
        force, torque = (times(R, x) if load.axes == "body" else x for x in (now.force, now.torque))
        moment = torque + cross(times(R, load_point(load)), force)
        yield i, force, moment, _dot(force, V[..., 3:]) + _dot(moment, V[..., :3])
    for spring in applied.springs:
        if isinstance(spring, PointSpring):
            yield from _pull(spring, t, [(index[name], *body(index[name]), point) for name, point in spring.ends])


def resistance_force(one: Resistance, rate: Array, acceleration: Array | float = 0.0) -> Array:
    """Return the force needed to overcome a rotor, damper or dry friction along its coordinate [N or N m]. (...)."""
    if one.what == "friction":
        return one.amount * np.sign(rate) * (np.abs(rate) > REST)
    return one.amount * np.asarray(rate if one.what == "damping" else acceleration)


def _pull(
    spring: PointSpring, t: Array | float, ends: list[tuple[int, Array, Array, Array, Array]]
) -> Iterator[tuple[int, Array, Array, Array]]:
    """Yield the wrenches of a point spring on its two bodies, see `wrenches_on_bodies`."""
    arms = [times(R, point) for _, R, _, _, point in ends]
    first, second = (p + arm for (_, _, p, _, _), arm in zip(ends, arms, strict=True))
    u, v = (V[..., 3:] + cross(V[..., :3], arm) for (_, _, _, V, _), arm in zip(ends, arms, strict=True))
    length = np.sqrt(_dot(second - first, second - first))
    if not np.all(length > 0.0):
        raise spring.no_direction(f" at t = {np.ravel(t)[np.argmin(length)]:g} s")
    line = (second - first) / length[..., None]
    rate = _dot(line, v - u)
    force = spring.pull(length, rate)[..., None] * line
    power = -spring.damping * rate * rate
    for (i, *_), arm, pull, input_power in zip(ends, arms, (force, -force), (power, 0.0 * power), strict=True):
        yield i, pull, cross(arm, pull), input_power


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a[..., None, :] @ b[..., None])[..., 0, 0])


def acting(applied: Applied, t: Array, joints: JointReading, V: Array) -> tuple[Array, Array]:
    """Return wrenches on bodies and forces along joints, excluding gravity and rotors; no force appears in both.

    Args:
        t: Times [s]. Shape (n,).
        joints: Body poses with their joint coordinates.
        V: Twist of each body: angular velocity, then velocity of its origin. Shape (n, n_body + 1, 6).

    Returns:
        Wrenches of loads and point springs on each body: force, then moment about the body's origin, shape
        (n, n_body + 1, 6); forces of motors, springs, dampers and friction along the coordinates [N or N m], (n, n_q).

    Raises:
        SingularPoseError: The two ends of a spring coincide.
    """
    mechanism, wrenches = joints.mechanism, np.zeros_like(V)
    point, index = partial(load_point, mechanism), mechanism.body_index
    exerted = wrenches_on_bodies(applied, index, point, t, lambda i: (joints.R[:, i], joints.p[:, i], V[:, i]))
    for i, force, moment, _ in exerted:
        wrenches[:, i, :3] += force
        wrenches[:, i, 3:] += moment
    return wrenches, along_joints(applied, t, joints, V)


def along_joints(applied: Applied, t: Array, joints: JointReading, V: Array) -> Array:
    """Return the forces of motors, springs, dampers and friction along joints [N or N m], see `acting`. (n, n_q)."""
    mechanism, q, qd = joints.mechanism, joints.q, joints.rates(V)
    column, out = {name: i for i, name in enumerate(mechanism.coordinates)}, np.zeros_like(q)
    losses = resistances(mechanism.joints, LOSSES)
    exerted = forces_at_joints(applied, losses, t, lambda name: (q[:, column[name]], qd[:, column[name]]))
    for name, force, _ in exerted:
        out[:, column[name]] += force
    return out


def resistance(joints: tuple[Joint, ...], qd: Array, qdd: Array) -> Array:
    """Return the force of each rotor, damper and dry friction along its coordinate [N or N m].

    Args:
        qd, qdd: Rates and accelerations of all joint coordinates. Shape (n, n_q).

    Returns:
        Shape (n, n_resistance).
    """
    each = [resistance_force(one, qd[:, one.column], qdd[:, one.column]) for one in resistances(joints)]
    return np.stack(each, axis=1) if each else np.zeros((len(qd), 0))


def load_point(mechanism: Mechanism, load: Load) -> Array:
    """Return the point of the body at which a load acts [m]. Shape (3,).

    The default is the centre of mass or, for ground, the origin.
    """
    if load.point is not None:
        return load.point
    i = mechanism.body_index[load.body]
    return np.asarray(mechanism.mass_centres[i - 1]) if i else np.zeros(3)
