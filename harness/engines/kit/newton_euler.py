"""Newton-Euler equations for engines that supply only the motion of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from screwgauge.engines.kit.poses import shifted
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array, cross, times


class Matter(NamedTuple):
    """Mass properties of the bodies, excluding ground.

    Attributes:
        masses: Masses [kg]. Shape (n_body,).
        com: Centres of mass in the body frames [m]. Shape (n_body, 3).
        inertias: Inertia tensors about the centres of mass, in body axes [kg m^2]. Shape (n_body, 3, 3).
    """

    masses: Array
    com: Array
    inertias: Array


def matter_of(mechanism: Mechanism) -> Matter:
    """Read the mass properties of a mechanism's bodies."""
    return Matter(mechanism.masses, mechanism.mass_centres, mechanism.inertias)


def required_wrenches(matter: Matter, R: Array, V: Array, A: Array, g: Array) -> Array:
    """Return the wrench that each body requires in addition to gravity.

    Args:
        R: Orientations, ground first. Shape (n, n_body + 1, 3, 3).
        V, A: Twist and acceleration of each body, without gravity: angular part, then linear part at its origin.
            Shape (n, n_body + 1, 6).
        g: Gravity [m/s^2]. Shape (3,).

    Returns:
        Force, and moment about the origin of the body, zero for ground. Shape (n, n_body + 1, 6).
    """
    R, w, b, out = R[:, 1:], V[:, 1:, :3], A[:, 1:, :3], np.zeros_like(A)
    arm = times(R, matter.com)
    force = matter.masses[:, None] * (shifted(V[:, 1:], A[:, 1:], arm) - g)
    back = R.swapaxes(-1, -2)
    inner_w, inner_b = times(back, w), times(back, b)
    spin = cross(inner_w, (matter.inertias @ inner_w[..., None])[..., 0])
    moment = times(R, (matter.inertias @ inner_b[..., None])[..., 0] + spin)
    out[:, 1:, :3], out[:, 1:, 3:] = force, moment + cross(arm, force)
    return out


def summed_inwards(parents: Sequence[int], p: Array, wrenches: Array) -> Array:
    """Sum the required wrenches along a tree, inwards from its tips.

    Args:
        parents: Index of each body's parent, 0 for ground; ground itself has no entry. Length n_body.
        p: Origins of the bodies, ground first. Shape (n, n_body + 1, 3).
        wrenches: Wrench required by each body: force, then moment about its origin. Shape (n, n_body + 1, 6).

    Returns:
        Summed wrenches about the origin of each body, zero for ground. Shape (n, n_body + 1, 6).
    """
    out = np.array(wrenches)

    def depth(body: int) -> int:
        return 1 + depth(parents[body - 1]) if body else 0

    for body in sorted(range(1, len(parents) + 1), key=depth, reverse=True):
        if carrier := parents[body - 1]:  # the parent provides the wrench that the body requires
            out[:, carrier, :3] += out[:, body, :3]
            out[:, carrier, 3:] += out[:, body, 3:] + cross(p[:, body] - p[:, carrier], out[:, body, :3])
    out[:, 0] = 0.0
    return out
