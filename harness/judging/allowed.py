"""Motions that close the loops, found by walking the mechanism with one joint velocity at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.judging.answer import Answer
from screwgauge.judging.coupled import coupled, coupling_residual
from screwgauge.judging.kinetics import Motions, unit_motions, walk
from screwgauge.problem import GivenMotion
from screwgauge.reference import linear
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, eq=False)
class Allowed:
    """The motions that the closed loops allow at n poses, equations being without dimension.

    Attributes:
        units: Motions while each joint coordinate in turn has the velocity 1, the loops open.
        closing: What velocities of the joints make of the closure residuals and of those of the couplings, below it the
            selection of y. Shape (n, m + k, n_q).
        size: Unit of each joint coordinate: 1 rad, or the mechanism's length [m]. Shape (n_q,).
        columns: The independent ones.
    """

    units: Sequence[Motions]
    closing: Array
    size: Array
    columns: list[int]

    def joints(self, y: Array, gaps: Array | None = None) -> Array:
        """Derivatives of all joint coordinates from those of the independent ones.

        Args:
            y: Shape (n, k) or (n, k, m).
            gaps: What `residuals` would be without them; none by default. Shape (n, m).

        Returns:
            Shape (n, n_q) or (n, n_q, m).
        """
        single = y.ndim == 2
        y = y[..., None] if single else y
        right, m = np.zeros((len(y), self.closing.shape[1], y.shape[2])), self.closing.shape[1] - y.shape[1]
        right[:, m:] = y / self.size[self.columns, None]
        if gaps is not None:
            right[:, :m] = -gaps[..., None]
        found = linear.solve(self.closing, right) * self.size[:, None]
        return np.asarray(found[..., 0] if single else found)

    @cached_property
    def partial(self) -> tuple[Array, Array]:
        """Velocities per velocity of y.

        Returns:
            Those of the joints, shape (n, n_q, k), and those of the centres of mass over the angular velocities, shape
            (n, n_body, 6, k).
        """
        joints = self.joints(np.tile(np.eye(len(self.columns)), (len(self.closing), 1, 1)))
        return joints, np.einsum("inbx,nij->nbxj", np.stack([each.velocities for each in self.units]), joints)


def residuals(mechanism: Mechanism, motions: Motions, joints: Array, order: int, length: float) -> Array:
    """What joint coordinates or derivatives leave open of the loops and couplings, over 1 rad or a length.

    Args:
        motions: What these make of the mechanism.
        joints: Joint coordinates and two derivatives. Shape (3, n, n_q).

    Returns:
        Six columns for each cut joint, then one for each coupling. Shape (n, m).
    """
    gaps = (motions.closure_residual(order) / np.array([1.0, length])[:, None]).reshape(joints.shape[1], -1)
    turns = [mechanism.units[column] == "rad" for column in mechanism.columns(coupled(mechanism))]
    couplings = coupling_residual(mechanism, joints, order) / np.where(turns, 1.0, length)
    return np.concatenate([gaps, couplings], axis=1)


def allowed_motions(answer: Answer) -> Allowed:
    """The motions allowed at the poses of an answer."""
    mechanism, length, (n, n_q) = answer.mechanism, answer.scales["m"], answer.q.shape
    motions = list(unit_motions(mechanism, answer.tree, answer.q, range(n_q)))
    size = np.array([1.0 if unit == "rad" else length for unit in mechanism.units])
    open_by = [residuals(mechanism, each, _alone(answer.q, i), 1, length) for i, each in enumerate(motions)]
    chosen = np.tile(np.eye(n_q)[mechanism.independent_columns], (n, 1, 1)) / size[mechanism.independent_columns, None]
    closing = np.concatenate([np.stack(open_by, axis=2), chosen], axis=1) * size
    return Allowed(motions, closing, size, mechanism.independent_columns)


def _alone(q: Array, column: int) -> Array:
    """Joint coordinates and two derivatives while one column has the velocity 1. Shape (n, n_q) -> (3, n, n_q)."""
    joints = np.stack([q, np.zeros_like(q), np.zeros_like(q)])
    joints[1, :, column] = 1.0
    return joints


def completed(answer: Answer, allowed: Allowed, asked: GivenMotion) -> Answer:
    """The answer with the joint velocities and accelerations that it lacks, as its poses and the motion have them."""
    joints = answer.joints.copy()
    if not answer.has("joint_velocity"):
        joints[1] = allowed.joints(asked.yd)
    if not answer.has("joint_acceleration"):
        joints[2] = 0.0
        motions = walk(answer.mechanism, answer.tree, *joints)
        gaps = residuals(answer.mechanism, motions, joints, 2, answer.scales["m"])
        joints[2] = allowed.joints(asked.ydd, gaps)
    return answer.moving(joints)
