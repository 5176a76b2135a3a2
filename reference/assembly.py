"""Closed poses of a mechanism, on the branch that its home pose is on, and which coordinates never move on it."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from screwgauge.reference import linear, passive
from screwgauge.reference.closing import Closing, make_closing
from screwgauge.reference.continuation import OPEN, Corrector, follow, newton, partial_rates
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.pose import Layout, Pose, tree_pose, whole_pose
from screwgauge.reference.rotations import Array

#: How far a pose of the trial walk lies from home [rad or lengths of the mechanism], and how many there are.
AWAY, TRIALS = 0.15, 4
#: Trial poses above this condition number say nothing: rounding moves coordinates that stand still.
CLEAR = 1e4

_known: WeakKeyDictionary[Mechanism, tuple[int, ...]] = WeakKeyDictionary()


def closing(lay: Layout) -> Closing:
    """The closing equations of a layout, coordinates that never move being held. Worked out once a mechanism."""
    if lay.mechanism not in _known:
        _known[lay.mechanism] = held_columns(lay)
    return make_closing(lay, _known[lay.mechanism])


def held_columns(lay: Layout) -> tuple[int, ...]:
    """Tree coordinates that keep their home value on the branch of the home pose, such as c of the symmetric leg.

    Coordinates are analytic in y. One that rests at several poses in general position, in value and in every first
    derivative, rests on the whole branch; the loops then close to rounding with it held, which is tested too.
    """
    free = make_closing(lay)
    found = _trials(free)
    if lay.path.dtype != np.float64 or not lay.tree.cuts or found is None:
        return ()
    z, y, matrix = found
    home = lay.mechanism.home[free.unknown] / free.size[free.unknown]
    slack = 16 * linear.EPS * linear.condition(matrix).max()
    rests = np.abs(z - home).max(axis=0) <= slack
    rests &= np.abs(partial_rates(matrix, y.shape[1])).max(axis=(0, 2)) <= slack
    chosen = {*lay.mechanism.independent_columns}
    held = tuple(c for c, still in zip(free.unknown, rests, strict=True) if still and c not in chosen)
    if not held:
        return ()
    fixed = make_closing(lay, held)
    start = z[:, [free.unknown.index(c) for c in fixed.unknown]]
    _, _, error = newton(fixed.evaluate, start, y)
    return held if (error <= 64 * linear.EPS).all() else ()


def _trials(system: Closing) -> tuple[Array, Array, Array] | None:
    """Closed poses in general position near home: unknowns, y and matrices, or None where there are too few."""
    home = system.lay.mechanism.home / system.size
    columns = system.lay.mechanism.independent_columns
    k = np.arange(len(columns))
    found = []
    for i in range(TRIALS):
        y = home[columns] + AWAY * np.cos(1.0 + 2.3 * i + 1.7 * (1 + i) * k)
        try:
            start = follow(corrector(system), home, home[columns], y[None], np.zeros(1))
        except ClosureError:
            continue
        z, matrix, error = newton(system.evaluate, start[:, system.unknown], y[None])
        if error[0] < OPEN and linear.condition(matrix)[0] < CLEAR:
            found.append((z[0], y, matrix[0]))
    if len(found) < TRIALS // 2:
        return None
    z, y, matrix = (np.stack(parts) for parts in zip(*found, strict=True))
    return z, y, matrix


def corrector(system: Closing) -> Corrector:
    """Newton's method for one pose, all joint coordinates without dimension, cut ones read near the prediction."""

    def correct(q: Array, y: Array) -> tuple[Array, Array] | None:
        z, matrix, error = newton(system.evaluate, q[None, system.unknown], y[None])
        if not error[0] < OPEN:
            return None
        K = np.zeros((len(q), len(y)))  # cut coordinates are not predicted: near a chart lock they run away
        K[system.unknown] = partial_rates(matrix, len(y))[0]
        return _read(system, z, q[None] * system.size)[0][0] / system.size, K

    return correct


def fill(system: Closing, z: Array, guess: Array) -> Pose:
    """The pose of given unknowns.

    Args:
        z: Unknowns without dimension. Shape (n, n_unknown).
        guess: Joint coordinates, of which those of cut joints say which of equal angles is meant. Shape (n, n_q).
    """
    return whole_pose(system.lay, *_read(system, z, guess))


def _read(system: Closing, z: Array, guess: Array) -> tuple[Array, Array, Array, Array]:
    """All joint coordinates, and what `tree_pose` gives."""
    q, held = guess.copy(), list(system.held)
    q[:, held] = system.lay.mechanism.home[held]
    q[:, system.unknown] = z * system.size[system.unknown]
    R, p, S = tree_pose(system.lay, q)
    return passive.read(system.lay, system.cut, R, p, q), R, p, S
