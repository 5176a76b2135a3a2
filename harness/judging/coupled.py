"""Couplings as the judge reads them: equations between joint coordinates, and forces along two of them.

Written down from the meaning of the description's entries and not from `screwgauge.reference.couplings`, by which the
engines close theirs.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.polynomial.polynomial import polyval

from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.rotations import Array, rotation


def coupled(mechanism: Mechanism) -> tuple[str, ...]:
    """The coupled coordinate of each coupling."""
    return tuple(coupling.coordinate for coupling in mechanism.couplings)


def coupling_residual(mechanism: Mechanism, joints: Array, order: int) -> Array:
    """How far coordinates, velocities (order 1) or accelerations are from what the couplings make of the others.

    Args:
        joints: All joint coordinates and two derivatives. Shape (3, n, n_q).

    Returns:
        One column for each coupling [rad or m, per s, per s^2]. Shape (n, n_coupling).
    """
    out = np.empty((joints.shape[1], len(mechanism.couplings)))
    for k, coupling in enumerate(mechanism.couplings):
        p, column = coupling.polynomial, mechanism.coordinates.index(coupling.coordinate)
        q, v, a = joints[:, :, mechanism.coordinates.index(coupling.of)] if coupling.of else np.zeros((3, len(out)))
        slope = _slope(p)
        if order == 0:
            wanted = polyval(q, p)
        elif order == 1:
            wanted = polyval(q, slope) * v
        else:
            wanted = polyval(q, slope) * a + polyval(q, _slope(slope)) * v**2
        out[:, k] = joints[order, :, column] - wanted
    return out


def _slope(polynomial: Array) -> Array:
    """Coefficients of the derivative, lowest first, and a zero, which keeps those of a constant from being none."""
    return np.append(polynomial[1:] * np.arange(1, len(polynomial)), 0.0)


def coupling_shares(mechanism: Mechanism, q: Array) -> Iterator[tuple[str, str, list[tuple[str, Array]]]]:
    """For each coupling its name and unit as a reaction, and how much of it acts along which coordinates.

    It has no power: 1 along its own coordinate, minus the polynomial's slope along the other. Shapes (n,).
    """
    units = dict(zip(mechanism.coordinates, mechanism.units, strict=True))
    for one in mechanism.couplings:
        shares = [(one.coordinate, np.ones(len(q)))]
        if one.of:
            slope = polyval(q[:, mechanism.coordinates.index(one.of)], _slope(one.polynomial))
            shares.append((one.of, np.negative(slope, dtype=float)))
        yield f"{one.name}.coupling", "N m" if units[one.coordinate] == "rad" else "N", shares


def force_along(joint: Joint, name: str, near: Array, q: Array) -> tuple[Array, Array]:
    """Force and moment of a unit force along a coordinate of a joint: no power on its other coordinates. (n, 3) each.

    Args:
        near: World axes of the joint's frame on its parent. Shape (n, 3, 3).
        q: Coordinates of the joint. Shape (n, n_freedom).
    """
    i, axes = joint.coordinates.index(name), []
    for (turns, axis), angle in zip(joint.freedoms, q.T, strict=True):
        axes.append(near @ axis)
        if turns:
            near = near @ rotation(axis, angle)
    turning = joint.freedoms[i][0]
    alike = [k for k, (turns, _) in enumerate(joint.freedoms) if turns == turning]
    one = np.linalg.pinv(np.stack([axes[k] for k in alike], axis=1))[:, :, alike.index(i)]
    return (np.zeros_like(one), one) if turning else (one, np.zeros_like(one))
