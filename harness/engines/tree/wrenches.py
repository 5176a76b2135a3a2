"""What springs, dampers and motors exert on the bodies of an engine's open tree, from its poses and rates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.applied import Applied, JointSpring, PointSpring
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.rotations import Array, rotation

Sides = Callable[[Joint], tuple[int, int]]
"""Joint -> rows of its parent and its child among the bodies."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyStates:
    """Motion of n samples; body 0 is ground.

    Attributes:
        t: Times [s]. Shape (n,).
        R, p: Orientation and origin of each body. Shapes (n, b, 3, 3), (n, b, 3).
        V: Angular velocity and velocity of the origin. Shape (n, b, 6).
        q, v: Joint coordinates in the order of the joints, and their rates. Shape (n, n_q).
    """

    t: Array
    R: Array
    p: Array
    V: Array
    q: Array
    v: Array


def applied_wrenches(
    joints: Sequence[Joint], applied: Applied, state: BodyStates, index: Mapping[str, int], sides: Sides
) -> Array:
    """Force and moment about its origin on each body. Shape (n, b, 6)."""
    out = np.zeros_like(state.V)
    columns = {name: i for i, name in enumerate(name for joint in joints for name in joint.coordinates)}
    tau = np.zeros_like(state.q)
    for motor in applied.motors:
        tau[:, columns[motor.coordinate]] += [motor.force(float(t)) for t in state.t]
    for spring in applied.springs:
        if isinstance(spring, JointSpring):
            i = columns[spring.coordinate]
            tau[:, i] -= spring.pull(state.q[:, i], state.v[:, i])
        else:
            _pull(spring, state, index, out)
    for joint in joints:
        own = [columns[name] for name in joint.coordinates]
        if tau[:, own].any():
            _turn(joint, state, sides(joint), own, tau[:, own], out)
    return out


def _pull(spring: PointSpring, state: BodyStates, index: Mapping[str, int], out: Array) -> None:
    """Adds the force of a spring between two points."""
    ends = [(index[body], point) for body, point in spring.ends]
    arms = [(state.R[:, i] @ point) for i, point in ends]
    at = [state.p[:, i] + arm for (i, _), arm in zip(ends, arms, strict=True)]
    speed = [state.V[:, i, 3:] + np.cross(state.V[:, i, :3], arm) for (i, _), arm in zip(ends, arms, strict=True)]
    length = np.linalg.norm(at[1] - at[0], axis=1)
    if not (length > 0.0).all():
        raise spring.no_direction(f" at t = {state.t[np.argmin(length)]:g} s")
    along = (at[1] - at[0]) / length[:, None]
    rate = np.sum(along * (speed[1] - speed[0]), axis=1)
    force = spring.pull(length, rate)[:, None] * along
    for (i, _), arm, f in zip(ends, arms, (force, -force), strict=True):
        out[:, i] += np.concatenate([f, np.cross(arm, f)], axis=1)


def _turn(joint: Joint, state: BodyStates, sides: tuple[int, int], own: list[int], tau: Array, out: Array) -> None:
    """Adds what forces along the coordinates of a joint exert on its two bodies, at the joint's point of the child."""
    parent, child = sides
    turned = state.R[:, parent] @ joint.parent_frame.R
    axes = []
    for k, (turns, axis) in enumerate(joint.freedoms):
        axes.append(turned @ axis)
        if turns:
            turned = turned @ rotation(axis, state.q[:, own[k]])
    turning = [k for k, (turns, _) in enumerate(joint.freedoms) if turns]
    sliding = [k for k, (turns, _) in enumerate(joint.freedoms) if not turns]
    moment, force = (_smallest([axes[k] for k in some], tau[:, some]) for some in (turning, sliding))
    point = state.p[:, child] + state.R[:, child] @ joint.child_frame.p
    for i, sign in ((child, 1.0), (parent, -1.0)):  # a positive force moves the child along its coordinate
        arm = point - state.p[:, i]
        out[:, i] += sign * np.concatenate([force, moment + np.cross(arm, force)], axis=1)


def _smallest(axes: Sequence[Array], amounts: Array) -> Array:
    """The smallest vector with given components along axes: it has no power on any other motion. Shape (n, 3)."""
    if not axes:
        return np.zeros((len(amounts), 3))
    rows = np.stack(axes, axis=1)
    return np.asarray((np.linalg.pinv(rows) @ amounts[..., None])[..., 0])
