"""Coordinates that are constant on the assembly mode of home, and the loop equations in which they are fixed."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.closed.loops import LoopEquations, loop_equations
from screwgauge.reference.closed.newton import newton, velocity_map
from screwgauge.reference.equations.kinematics import pose
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.graph import Layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array

#: How far a pose of the trial walk lies from home [rad or lengths of the mechanism], and how many there are.
AWAY, TRIALS = 0.15, 4
#: Far above what rounding makes of a coordinate that stands still; who is found by mistake costs time only.
STILL = 1e-7
#: Trial poses above this condition number say nothing: rounding moves coordinates that stand still.
CLEAR = 1e4

_known: WeakKeyDictionary[Mechanism, tuple[int, ...]] = WeakKeyDictionary()


def home_equations(lay: Layout) -> LoopEquations:
    """The loop equations of a layout, coordinates that never move being fixed. Worked out once a mechanism."""
    if lay.mechanism not in _known:
        _known[lay.mechanism] = resting_columns(lay)
    return loop_equations(lay, _known[lay.mechanism])


def resting_columns(lay: Layout) -> tuple[int, ...]:
    """Tree coordinates that keep their home value on the branch of the home pose, such as c of the symmetric leg.

    Coordinates are analytic in y. One that rests at several poses in general position, in value and in every first
    derivative, rests on the whole branch; the loops then close to rounding with it fixed, which is tested too.
    """
    free = loop_equations(lay)
    # in single precision no trial would come to rest
    trials = _trials(free) if lay.path.dtype == np.float64 and lay.cuts and _may_rest(free) else None
    if trials is None:
        return ()
    z, y, matrix = trials
    home = lay.mechanism.home[free.unknown] / free.size[free.unknown]
    slack = 16 * linear.EPS * linear.condition(matrix).max()
    rests = np.abs(z - home).max(axis=0) <= slack
    rests &= np.abs(velocity_map(matrix, y.shape[1])).max(axis=(0, 2)) <= slack
    chosen = {*lay.mechanism.independent_columns, *lay.mechanism.coupling_rows.columns}
    fixed = tuple(c for c, still in zip(free.unknown, rests, strict=True) if still and c not in chosen)
    if not fixed:
        return ()
    system = loop_equations(lay, fixed)
    start = z[:, [free.unknown.index(c) for c in system.unknown]]
    error = newton(system.evaluate, start, y)[2]
    return fixed if (error <= 64 * linear.EPS).all() else ()


def _may_rest(system: LoopEquations) -> bool:
    """Whether at home, to first order, anything stands still that is not chosen: of most mechanisms nothing does."""
    columns = system.lay.mechanism.independent_columns
    A = system.matrix(pose(system.lay, system.lay.mechanism.home[None]))
    still = np.abs(velocity_map(A, len(columns))[0]).max(axis=1) <= STILL
    return any(rests and c not in columns for c, rests in zip(system.unknown, still, strict=True))


def _trials(system: LoopEquations) -> tuple[Array, Array, Array] | None:
    """Closed poses in general position near home: unknowns, y and matrices, or None where there are too few."""
    home = system.lay.mechanism.home / system.size
    columns = system.lay.mechanism.independent_columns
    k = np.arange(len(columns))
    closed, path = [], system.continuation(strict=True)
    for i in range(TRIALS):
        y = home[columns] + AWAY * np.cos(1.0 + 2.3 * i + 1.7 * (1 + i) * k)
        try:
            path.restart(begun=True)  # straight on or not at all: ways round singular poses take seconds
            found = path.follow(y[None], np.zeros(1))
        except ClosureError:
            continue
        if linear.condition(found.matrix)[0] < CLEAR:
            closed.append((found.z[0], y, found.matrix[0]))
    if len(closed) < TRIALS // 2:
        return None
    z, y, matrix = (np.stack(parts) for parts in zip(*closed, strict=True))
    return z, y, matrix
