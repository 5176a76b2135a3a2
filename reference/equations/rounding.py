"""Conditioning: dimensionless amplification of rounding errors by the equations at a pose.

A row that closes a loop changes with the coordinates in proportion to the length of the loop, not of the mechanism; the
length of the mechanism only determines the rounding errors of body poses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.equations.closure import Closed
from screwgauge.reference.equations.cut_joint import CutJoint
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.forward import Forward
from screwgauge.reference.equations.kinematics import length, pose
from screwgauge.reference.equations.screws import Array, times, transpose
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import widest


@dataclass(frozen=True, slots=True, eq=False)
class Extent:
    """Lengths and coordinates of the loops.

    Attributes:
        loops: Largest distance between joint points around each loop at home [m], see `Layout.loop`. Shape (n_cut,).
        size: Unit of each joint coordinate: 1 for angles, the length of its shortest loop for distances. Shape (n_q,).
        owner: First loop of each joint coordinate; 0 if it is not in a loop. Shape (n_q,).
        stretch: Length of the mechanism divided by the length of its shortest loop.
    """

    loops: Array
    size: Array
    owner: NDArray[np.intp]
    stretch: float


def extent(lay: Layout) -> Extent:
    """Measure the loops; compute the result once per layout."""
    if "extent" not in lay.kept:
        lay.kept["extent"] = _extent(lay)
    kept: Extent = lay.kept["extent"]
    return kept


def _extent(lay: Layout) -> Extent:
    mechanism, L, around = lay.mechanism, length(lay), lay.loop != 0.0
    if not len(around):
        return Extent(np.zeros(0), np.where(lay.turns, 1.0, L), np.zeros(len(lay.turns), dtype=np.intp), 1.0)
    at, index, loops = pose(lay, mechanism.home[None]), mechanism.body_index, []
    for loop in around:
        joints = [joint for joint in mechanism.joints if loop[lay.columns[joint.name]].any()]
        ends = [(index[body], frame.p) for joint in joints for body, frame in joint.sides]
        loops.append(widest([at.p[0, body] + at.R[0, body] @ point for body, point in ends]) or L)
    shortest = np.where(around, np.array(loops)[:, None], np.inf).min(axis=0)
    size = np.where(lay.turns, 1.0, np.where(np.isfinite(shortest), shortest, L))
    return Extent(np.array(loops), size, np.argmax(around, axis=0), L / min(loops))


def gain(at: Closed, *, whole: bool = False) -> Any:
    """Return the squared norm of the inverse of M for the worst loop, scaled with the length of each loop. Shape (...).

    Args:
        whole: Include coordinates at rest, which matter for constraint forces.
    """
    loops, by = at.loops, extent(at.loops.lay)
    lengths = by.loops[[j for j, _ in enumerate(loops.cuts) for _ in range(*loops.ends[j : j + 2])]]
    of_cuts = [length if unit == "N" else 1.0 for length, (_, unit) in zip(lengths, loops.names, strict=True)]
    chosen = [*loops.couplings.columns, *loops.y_columns]
    squares = at.system.response(np.concatenate([of_cuts, by.size[chosen]]), whole=whole)
    columns = loops.columns[: squares.shape[-1]]
    if not at.system.exact:
        K = at.K[..., columns] * by.size[loops.y_columns][:, None]
        squares = squares + (K * K).sum(-2)
    squares = squares * by.size[columns] ** -2.0
    owners = by.owner[columns]
    return reduce(at.ops.maximum, [squares[..., owners == loop].sum(-1) for loop in dict.fromkeys(owners.tolist())])


def drive_gain(at: Dynamics) -> Any:
    """Return the squared norm of the map to actuator forces; coordinates are in their units. Shape (...)."""
    drives = len(at.mechanism.actuator_names)
    m = min(drives, len(at.driven)) if at.surplus else drives
    squares = at.drive.response(np.ones(m)).sum(-1)
    return at.ops.sqrt(squares) if at.surplus else squares


def idle_gain(at: Forward) -> Any:
    """Return the squared inertia of the bodies that idle coordinates move, relative to the resisting inertia.

    The result is the value of the worst coordinate times the condition of all coordinates, a cheap substitute for
    `idle_rounding`. Shape (...).
    """
    mechanism, L, m = at.mechanism, at.loops.length, len(at.idle)
    whole = mechanism.masses * L**2 + np.trace(mechanism.inertias, axis1=1, axis2=2)
    (v, w), sizes = (part[..., [*at.idle], :, :] for part in at.partial_motion), at.idle_sizes
    moved = (v * v).sum(-1) / L**2 + (w * w).sum(-1)
    share = (moved * whole).sum(-1) / (sizes * sizes)
    worst = reduce(at.ops.maximum, [share[..., j] for j in range(m)]) * at.idle_masses.response(np.ones(m)).sum(-1)
    return worst * worst


def idle_rounding(at: Forward) -> Array:
    """Return dimensionless acceleration errors of idle coordinates, divided by eps; only for floats. Shape (n, m).

    The errors are sums of magnitudes of terms that cancel: a freely spinning rod loads its bearings 1000 times more
    than its axis.
    """
    loops, system, idle = at.loops, at.system, [*at.idle]
    columns, unit = loops.columns[: loops.moving], loops.sizes[loops.y_columns]
    K = np.abs(at.K[..., columns] / loops.sizes[columns]) * unit[:, None]
    rates = K + K @ transpose(np.abs(system.inverse) @ np.abs(system.A[..., : loops.moving]))
    along = times(rates, np.abs(at.tau[..., : loops.moving]) * loops.sizes[columns])
    N = np.abs(at.neutral) * unit[idle] / unit[:, None]
    turned = np.abs(at.steering.inverse).sum(-1)[..., None] * rates.max(-1)[..., None, idle]
    summed = times(transpose(N), along) + times(transpose(turned), np.abs(at.generalized_force * unit)[..., at.driven])
    d = at.idle_sizes * unit[idle]
    return np.asarray(times(np.abs(at.idle_masses.inverse), summed / d) / d)


def chart_condition(cut: CutJoint) -> Any:
    """Return the condition number of a cut joint's angles: 1 at best, infinite in gimbal lock. Shape (...)."""
    if cut.at.joint.angles < 3:
        return 1.0
    cosine = cut.values[1][1]
    return np.sqrt((1.0 + 2.0 / (cosine * cosine)) / 3.0)


def chart_conditions(at: Closed) -> Array:
    """Return the condition numbers of the angles of each cut joint; only for floats. Shape (n, n_cut)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        conditions = [chart_condition(cut) + np.zeros(len(at.q)) for cut in at.cuts]
    return np.stack(conditions, axis=1) if conditions else np.zeros((len(at.q), 0))


def chart_gain(at: Closed) -> Any:
    """Return the sum of squared condition numbers of the angles of cut joints, each 1 at best. Shape (...)."""
    middle = [cut.values[1][1] for cut in at.cuts if cut.at.joint.angles == 3]
    return sum((1.0 / (c * c) for c in middle), start=0.0)


def squares(x: Array, sizes: Array) -> Any:
    """Return the sum of squared ratios of values to given sizes. Shape (..., m) -> (...)."""
    scaled = x * (1.0 / sizes)
    return (scaled * scaled).sum(-1)
