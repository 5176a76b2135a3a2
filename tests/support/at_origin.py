"""The paper's equations with screws and wrenches at O in world axes, to be compared with, and to be broken."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from screwgauge.reference.equations import closure, forward, joint_types, kinematics, recursion
from screwgauge.reference.equations.closure import Motion
from screwgauge.reference.equations.cut_joint import CutJoint
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.kinematics import TreePose, twists, walk
from screwgauge.reference.equations.recursion import BodyAccelerations, FrameMotion, Turning
from screwgauge.reference.equations.screws import (
    Array,
    couple,
    cross,
    force,
    join,
    lie_bracket,
    power,
    scale,
    times,
    transpose,
    velocity_at,
)

Bracket = Callable[[Array, Array], Array]


def acceleration_at(V: Array, A: Array, r: Array) -> Array:
    return velocity_at(A, r) + cross(V[..., :3], velocity_at(V, r))


def acceleration_screws(pose: TreePose, w: Array, beta: Array, bracket: Bracket = lie_bracket) -> Array:
    V, bias = twists(pose, w), 0.0 * twists(pose, w)
    for edge, near, far, columns, sign, *_ in walk(pose.lay):
        before, bias[..., far, :] = V[..., near, :], bias[..., near, :]
        for c in columns[::-1] if edge.reverse else columns:
            term = scale(sign * w[..., c], pose.S[..., c, :])
            bias[..., far, :] = bias[..., far, :] + bracket(before, term)
            before = before + term
    return bias + twists(pose, beta)


def inertia(at: Dynamics, V: Array, A: Array, g: Array) -> Array:
    """Wrenches that bodies need for a motion and against gravity, eqs. (51)-(55). Shape (..., b, 6)."""
    R, V, A = at.pose.R[..., 1:, :, :], V[..., 1:, :], A[..., 1:, :]
    F = at.mechanism.masses[:, None] * (acceleration_at(V, A, at.com) - g)
    w, beta = (times(transpose(R), X[..., :3]) for X in (V, A))  # in the axes of the body, eq. (52)
    J = np.array([body.inertia for body in at.mechanism.bodies])
    needs = force(F, at.com) + couple(times(R, times(J, beta) + cross(w, times(J, w))))
    return np.concatenate([0.0 * needs[..., :1, :], needs], axis=-2)


def along_tree(at: Dynamics, wrenches: Array) -> Array:
    return np.asarray(power(transpose(at.loops.lay.path) @ wrenches, at.pose.S))


def replace_bracket(monkeypatch: pytest.MonkeyPatch, bracket: Bracket) -> None:
    """Lets all accelerations follow from eq. (44) under another bracket, those of cut joints included."""

    def body_accelerations(pose: TreePose, w: Array, beta: Array) -> BodyAccelerations:
        V, A = twists(pose, w), acceleration_screws(pose, w, beta, bracket)
        every = slice(None)
        vectors = (V[..., :3], A[..., :3], acceleration_at(V, A, pose.p))
        own = [np.moveaxis(pose.to_body(vector, every), -2, 0) for vector in vectors]
        return BodyAccelerations(pose, [FrameMotion(Turning(w, b), a) for w, b, a in zip(*own, strict=True)])

    def relative(self: CutJoint, V: Array, moved: BodyAccelerations) -> Array:
        parent, child = (_screw(V, moved, body) for body in (self.parent, self.child))
        return child - parent - bracket(V[..., self.parent, :], V[..., self.child, :])

    def linear(self: CutJoint, V: Array, moved: BodyAccelerations) -> Array:
        return velocity_at(relative(self, V, moved), self.at.p_child)

    for module in (closure, forward):
        monkeypatch.setattr(module, "body_accelerations", body_accelerations)
    monkeypatch.setattr(CutJoint, "_angular", lambda *of: relative(*of)[..., :3])
    monkeypatch.setattr(CutJoint, "_linear", linear)
    monkeypatch.setattr(kinematics, "lie_bracket", bracket)


def _screw(V: Array, moved: BodyAccelerations, body: int) -> Array:
    V, p, b = V[..., body, :], moved.pose.p[..., body, :], moved.angular(body)
    return join(b, moved.linear(body, np.zeros(3)) - cross(b, p) - cross(V[..., :3], velocity_at(V, p)))


def without_brackets(monkeypatch: pytest.MonkeyPatch) -> None:
    replace_bracket(monkeypatch, lambda X, Y: np.zeros_like(Y))
    for kind, entry in joint_types.TYPES.items():
        monkeypatch.setitem(joint_types.TYPES, kind, replace(entry, own=None))


def opposite(X: Array, Y: Array) -> Any:
    return -lie_bracket(X, Y)
