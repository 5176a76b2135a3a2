"""Conditioning: dimensionless amplification of rounding errors by the equations at a pose.

A row that closes a loop changes with the coordinates in proportion to the length of the loop, not to that of the
mechanism, which only determines the rounding errors of body poses.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np

from screwgauge.reference.equations.closure import Closed
from screwgauge.reference.equations.cut_joint import CutJoint
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.forward import Forward
from screwgauge.reference.equations.kinematics import length, pose
from screwgauge.reference.equations.screws import Array, times, transpose
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import widest


def loop_lengths(lay: Layout) -> Array:
    """Return the largest distance between joint points around each loop at home [m], see `Layout.loop`. (n_cut,)."""
    if "loop lengths" not in lay.kept:
        at, mechanism, L = pose(lay, lay.mechanism.home[None]), lay.mechanism, length(lay)
        index, lengths = mechanism.body_index, list[float]()
        for loop in lay.loop:
            joints = [joint for joint in mechanism.joints if loop[lay.columns[joint.name]].any()]
            ends = [(index[body], frame.p) for joint in joints for body, frame in joint.sides]
            lengths.append(widest([at.p[0, body] + at.R[0, body] @ point for body, point in ends]) or L)
        lay.kept["loop lengths"] = np.array(lengths)
    kept: Array = lay.kept["loop lengths"]
    return kept


def stretch(lay: Layout) -> float:
    """Return the length of the mechanism divided by the length of its shortest loop, or 1 if there is no loop."""
    L = length(lay)
    return L / float(loop_lengths(lay).min(initial=np.inf if lay.cuts else L))


def loop_sizes(lay: Layout) -> Array:
    """Return the scale of each joint coordinate: 1 for angles, its shortest loop's length for distances. (n_q,)."""
    shortest = np.where(lay.loop != 0.0, loop_lengths(lay)[:, None], np.inf).min(axis=0, initial=np.inf)
    return np.where(lay.turns, 1.0, np.where(np.isfinite(shortest), shortest, length(lay)))


def gain(at: Closed, *, whole: bool = False) -> Any:
    """Return the squared norm of the inverse of M for the worst loop, scaled by the length of each loop. Shape (...).

    Args:
        whole: Include coordinates at rest, which matter for constraint forces.
    """
    loops, size = at.loops, loop_sizes(at.loops.lay)
    lengths = loop_lengths(loops.lay)[[j for j, _ in enumerate(loops.cuts) for _ in range(*loops.ends[j : j + 2])]]
    of_cuts = [length if unit == "N" else 1.0 for length, (_, unit) in zip(lengths, loops.names, strict=True)]
    chosen = [*loops.couplings.columns, *loops.y_columns]
    squares = at.system.response(np.concatenate([of_cuts, size[chosen]]), whole=whole)
    columns = loops.columns[: squares.shape[-1]]
    if not at.system.exact:
        K = at.K[..., columns] * size[loops.y_columns][:, None]
        squares = squares + (K * K).sum(-2)
    squares = squares * size[columns] ** -2.0
    owners = np.argmax(loops.lay.loop != 0.0, axis=0)[columns] if loops.cuts else np.zeros(len(columns), dtype=np.intp)
    return reduce(at.ops.maximum, [squares[..., owners == loop].sum(-1) for loop in dict.fromkeys(owners.tolist())])


def drive_gain(at: Dynamics) -> Any:
    """Return the squared norm of the map to actuator forces, in the units of the coordinates. Shape (...)."""
    drives = len(at.mechanism.actuator_names)
    m = min(drives, len(at.driven)) if at.surplus else drives
    squares = at.drive.response(np.ones(m)).sum(-1)
    return at.ops.sqrt(squares) if at.surplus else squares


def idle_gain(at: Forward) -> Any:
    """Return the squared inertia of the bodies that idle coordinates move, relative to the resisting inertia.

    The value of the worst coordinate is multiplied by the conditioning of all coordinates, as a cheap substitute for
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

    The errors are sums of magnitudes of terms that cancel; for example, a freely spinning rod loads its bearings 1000
    times more than its axis.
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
