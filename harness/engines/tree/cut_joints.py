"""Coordinates of joints that were cut to open a loop, read from the two frames that an engine gives.

A cut joint is in no engine's tree, so its angles come from the relative rotation of its two sides. This reading is
shared by all tree engines; the frames, their rates and accelerations are each engine's own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference import rotations
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.rotations import MIDDLE, NEXT, TURN, Array, cross, other_triple, within_half_turn

Flags = NDArray[np.bool_]

#: Angles read with a worse condition are no ground for the samples after them: poses closed to 1e-13 leave 1e-5 rad.
SURE = 1e8


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Coordinates of a cut joint at n poses.

    Attributes:
        q: Angles [rad], within a turn and the middle one of three within +-pi/2 unless a chart `near` others. (n, m).
        R: Orientation of its parent side in the world. Shape (n, 3, 3).
        inverse: Maps a relative angular velocity, in the parent side's axes, to rates. Shape (n, m, 3).
        axes: Current directions of its axes in the parent side's axes. Shape (n, m, 3).
    """

    q: Array
    R: Array
    inverse: Array
    axes: Array

    @property
    def condition(self) -> Array:
        """How much the reading of its rates loses, 1 at best. Shape (n,)."""
        if self.q.shape[1] < 3:
            return np.ones(len(self.q))
        size = np.linalg.norm(self.axes, axis=(1, 2)) * np.linalg.norm(self.inverse, axis=(1, 2)) / 3.0  # 3 at best
        return np.where(np.isnan(size) & np.isfinite(self.axes).all(axis=(1, 2)), np.inf, size)

    def rates(self, omega: Array) -> Array:
        """Coordinate rates for a relative angular velocity in world axes. Shape (n, 3, ...) -> (n, m, ...)."""
        return np.asarray(self.inverse @ (self.R.swapaxes(1, 2) @ omega))

    def bias(self, rates: Array, omega_parent: Array, omega: Array, beta: Array) -> Array:
        """Second derivatives for a relative angular acceleration in world axes.

        Args:
            rates: Coordinate rates. Shape (n, m).
            omega_parent: Angular velocity of the parent. Shape (n, 3).
            omega, beta: Angular velocity and acceleration of the child less those of the parent. Shape (n, 3).

        Returns:
            Shape (n, m).
        """
        own = np.zeros_like(omega)  # each axis is carried around by the rates before it
        for i, j in combinations(range(self.q.shape[1]), 2):
            own += cross(self.axes[:, i], self.axes[:, j]) * (rates[:, i] * rates[:, j])[:, None]
        local = (self.R.swapaxes(1, 2) @ (beta - cross(omega_parent, omega))[..., None])[..., 0] - own
        return np.asarray((self.inverse @ local[..., None])[..., 0])

    def near(self, angles: Array) -> Chart:
        """The same rotations by the triples of angles, and with the whole turns, that come nearest to others.

        Args:
            angles: Shape (n, m).
        """
        q, swapped = rotations.nearest_angles(self.q, angles)
        return self._swapped(swapped, q)

    def agreeing(self, i: int, angle: Array) -> Chart:
        """The same rotations by the triples whose angle `i` comes nearest to a given one. Shape (n,)."""
        if self.q.shape[1] < 3:
            return self
        two = other_triple(self.q)
        swapped = np.abs(within_half_turn(two[:, i] - angle)) < np.abs(within_half_turn(self.q[:, i] - angle))
        return self._swapped(swapped, np.where(swapped[:, None], two, self.q)) if swapped.any() else self

    def _swapped(self, where: Flags, q: Array) -> Chart:
        """With the second triples somewhere: their middle axis, and with it its rate, points the other way."""
        if not where.any():
            return replace(self, q=q)
        sign = np.where(where[:, None], MIDDLE, 1.0)[..., None]
        return replace(self, q=q, inverse=self.inverse * sign, axes=self.axes * sign)


def read_chart(joint: Joint, R_parent: Array, R_child: Array) -> Chart:
    """Angles of a cut R or S joint from the orientations of its bodies. Shapes (n, 3, 3)."""
    axes = rotations.triad(joint.axes)
    R = R_parent @ joint.parent_frame.R
    M = R.swapaxes(1, 2) @ (R_child @ joint.child_frame.R)
    angles = rotations.triad_angles(M, axes, few=len(joint.axes) < 3)
    turned, first = np.empty((len(R), 3, 3)), angles[:, :1]
    turned[:, 0], turned[:, 2] = axes[0], M @ axes[2]  # the last angle turns about the last axis
    turned[:, 1] = np.cos(first) * axes[1] + np.sin(first) * cross(axes[0], axes[1])
    m = len(joint.axes)
    duals = cross(turned[:, NEXT], turned[:, NEXT[NEXT]])
    volume = np.sum(turned[:, 0] * duals[:, 0], axis=1)[:, None, None]
    inverse = duals / np.where(volume == 0.0, np.nan, volume)
    return Chart(angles[:, :m], R, inverse[:, :m], turned[:, :m])


def follow(begin: Array, angles: Array, sure: Flags, t: Array | None = None, rates: Array | None = None) -> Array:
    """Angles followed from sample to sample: of all that mean the same, those nearest to what is predicted.

    Args:
        begin: Where to begin: the first sample is the one next to it. Shape (m,).
        angles: As `read_chart` reads them [rad]. Shape (n, m).
        sure: Whether the chart determines them; a sample at a lock is no ground for later ones. Shape (n,).
        t, rates: Times [s], shape (n,), and rates [rad/s], shape (n, m), by which each sample is predicted from the
            one before; without them it is the one before.

    Returns:
        Shape (n, m).
    """
    sure = sure & np.isfinite(angles).all(axis=1)
    if t is None or rates is None:
        t, rates = np.zeros(len(angles)), np.zeros_like(angles)
    at = np.concatenate([t[:1], t[sure]])  # nothing is predicted from the beginning
    half = 0.5 * np.diff(at)[:, None]
    x, r = np.vstack([begin, angles[sure]]), np.vstack([np.zeros_like(begin), rates[sure]])
    half[:1] = 0.0
    if len(begin) == 3:
        same = x[1:] - x[:-1] - half * (r[1:] + r[:-1])
        other = other_triple(x[1:]) - x[:-1] - half * (MIDDLE * r[1:] + r[:-1])
        # whether a sample goes on by its other triple does not depend on which triple the one before took
        change = np.abs(within_half_turn(other)).sum(axis=1) < np.abs(within_half_turn(same)).sum(axis=1)
        swapped = (np.cumsum(change) % 2 == 1)[:, None]
        x[1:], r[1:] = np.where(swapped, other_triple(x[1:]), x[1:]), np.where(swapped, MIDDLE * r[1:], r[1:])
    x[1:] -= TURN * np.cumsum(np.round((np.diff(x, axis=0) - half * (r[1:] + r[:-1])) / TURN), axis=0)
    out, last = np.empty_like(angles), np.cumsum(sure)[~sure]
    out[sure] = x[1:]
    out[~sure] = rotations.nearest_angles(angles[~sure], x[last] + (t[~sure] - at[last])[:, None] * r[last])[0]
    return out


def unwrapped(begin: Array, chart: Chart, given: bool) -> Array:
    """Angles at the samples of a given motion, without jumps of a turn. Shape (n, m).

    Args:
        begin: As in `follow`.
        given: Whether some of them are independent: those say which triple is meant. The other joints keep the one
            that is read, as poses in closed form do, which know of no way there.
    """
    if given:
        return follow(begin, chart.q, chart.condition < SURE)
    return np.asarray(np.unwrap(np.vstack([begin, chart.q]), axis=0)[1:])
