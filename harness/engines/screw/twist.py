"""The platform's twist, the input of the paper's scheme: the right one, and eq. (60) as printed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from screwgauge.reference.chains import closed_form
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.graph import output_body
from screwgauge.reference.kinematics import accelerations, chain_acceleration, positions, velocities
from screwgauge.reference.pose import Layout, pose, tree_pose
from screwgauge.reference.rotations import Array

TWISTS = ("right", "printed", "literal")
CLOSED = 1e-9  # rad, m: a loop that the driving joint alone closes is closed to rounding, about 1e-15


class Driven(Protocol):
    """The independent coordinates [rad or m] and their derivatives. Shape (n, k) each."""

    @property
    def y(self) -> Array: ...
    @property
    def yd(self) -> Array: ...
    @property
    def ydd(self) -> Array: ...


Drive = Callable[[Array], Driven]
"""Takes times [s], shape (n,)."""


def platform_screws(lay: Layout, motion: Driven, t: Array, twist: str = "right") -> tuple[Array, Array]:
    """Twist and acceleration screw of the platform at O, the input of the scheme. Shape (n, 6) each.

    The right ones follow from the joint that carries the independent coordinates, its other angles at rest, where
    that closes the loops (c = 0 in the paper's mechanism); else from the closed mechanism.

    Raises:
        UnknownNameError: There is no such twist.
    """
    if twist not in TWISTS:
        raise UnknownNameError("twist", twist, TWISTS)
    if twist != "right":
        V, A = fixed_axes(motion)
        com = lay.mechanism.body(output_body(lay.mechanism)).com
        return (subtracted(V, com), A) if twist == "literal" else (V, A)
    alone = _driver_alone(lay, motion)
    if alone is not None:
        return alone
    rate = velocities(lay, positions(lay, motion.y, t), motion.yd)
    platform = lay.mechanism.body_index[output_body(lay.mechanism)]
    return rate.V[:, platform], accelerations(lay, rate, motion.ydd)[1][:, platform]


def _driver_alone(lay: Layout, motion: Driven) -> tuple[Array, Array] | None:
    """From the joint with the independent coordinates; None where that leaves a loop open."""
    q = closed_form(lay, motion.y)
    if q is None or np.abs(pose(lay, q[:: max(1, len(q) // 16)]).residual).max() > CLOSED:
        return None
    chosen = lay.mechanism.independent_columns
    columns = next(columns for columns in lay.columns.values() if set(chosen) <= set(columns))
    S = tree_pose(lay, q)[2][:, columns].swapaxes(1, 2)
    w, beta = np.zeros((2, len(q), len(columns)))
    at = [columns.index(column) for column in chosen]
    w[:, at], beta[:, at] = motion.yd, motion.ydd
    return (S @ w[..., None])[..., 0], chain_acceleration(S, w, beta)


def fixed_axes(motion: Driven) -> tuple[Array, Array]:
    """Eq. (60) in structure: first and second derivatives of y as components about fixed axes. Shapes (n, 6)."""
    to_six = ((0, 0), (0, 6 - motion.y.shape[1]))
    return np.pad(motion.yd, to_six), np.pad(motion.ydd, to_six)


def subtracted(V: Array, r_P: Array) -> Array:
    """Eqs. (22)-(23) as printed: ``V - [0; w x r_P]``. Shape (..., 6)."""
    return np.concatenate([V[..., :3], V[..., 3:] - np.cross(V[..., :3], r_P)], axis=-1)
