"""States at which the loops of a tree are closed, and the velocities that its loops leave there.

Which rows state a loop is a choice (a weld, three points, another order); what they leave is none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import polynomial

from screwgauge.diagnosis.mechanics.closing import constraint_rows, frames, gaps
from screwgauge.diagnosis.mechanics.lines import size
from screwgauge.diagnosis.mechanics.tree import Motion, States, Tree, move, moved
from screwgauge.reference.rotations import Array
from screwgauge.reference.screws import acceleration_at

#: Newton's steps, and how far one goes at most [rad or m]; gaps that are rounding [rad or lengths of
#: the machine, or m where it is smaller].
STEPS, FAR, CLOSED = 40, 0.5, 1e-11
#: Singular values below this share of the largest are those of rows that follow from others.
DEPENDENT = 1e-8


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """All closures and couplings of a tree at states; rows first of the closures.

    Attributes:
        gap: What is open [m or rad]. Shape (n, m).
        rows: Its rate at unit velocities. Shape (n, m, n_freedom).
        bias: Second derivative of the gaps at zero accelerations, Jdot v; of a welded turn where it is closed. (n, m).
    """

    gap: Array
    rows: Array
    bias: Array


def equations(tree: Tree, states: States) -> Equations:
    """Of all closures and couplings."""
    motion = move(tree, replace(states, qdd=np.zeros_like(states.qdd)))
    open_, rates = gaps(tree, motion), constraint_rows(tree, motion)
    n, wide = len(states.q), len(tree.before)
    gap, rows, bias = [np.zeros((n, 0))], [np.zeros((n, 0, wide))], [np.zeros((n, 0))]
    for name in tree.reading.closures:
        gap.append(open_[name])
        rows.append(rates[name])
        bias.append(_acceleration(tree, motion, name)[:, -open_[name].shape[1] :])
    for coupling in tree.reading.couplings.values():
        p, row = coupling.polynomial, np.zeros((n, 1, wide))
        row[:, 0, tree.freedoms[coupling.joint]] = 1.0
        follows, second = np.full((n, 1), p[0]), np.zeros((n, 1))
        if coupling.of:
            lead, at = states.q[:, tree.places[coupling.of]], tree.freedoms[coupling.of]
            follows = polynomial.polyval(lead, p)
            row[:, 0, at] -= polynomial.polyval(lead, polynomial.polyder(p))
            second = polynomial.polyval(lead, polynomial.polyder(p, 2)) * states.qd[:, at] ** 2
        gap.append(states.q[:, tree.places[coupling.joint]] - follows)
        rows.append(row)
        bias.append(-second)
    return Equations(np.hstack(gap), np.concatenate(rows, axis=1), np.hstack(bias))


def _acceleration(tree: Tree, motion: Motion, name: str) -> Array:
    """Angular and linear acceleration of the second frame of a closure against the first. Shape (n, 6)."""
    closure, names = tree.reading.closures[name], list(tree.reading.bodies)
    out = np.zeros((len(motion.R), 6))
    ends = zip((-1.0, 1.0), (closure.first, closure.second), frames(tree, motion, closure), strict=True)
    for sign, body, (_, p) in ends:
        if body in tree.reading.bodies:
            twist, change = (each[:, names.index(body)] for each in (motion.twist, motion.acceleration))
            out += sign * np.concatenate([change[:, :3], acceleration_at(twist, change, p)], axis=1)
    return out


def closed(tree: Tree, states: States) -> tuple[States, Array]:
    """Closes the loops at states by Newton's method; velocities and accelerations then keep them closed.

    Returns:
        The states that could be closed; and which they are, shape (n,).
    """
    q, length, todo = states.q.copy(), max(size(tree.reading), 1.0), np.arange(len(states.q))
    for _ in range(STEPS):
        at = equations(tree, replace(states.at(todo), q=q[todo]))
        far = np.abs(at.gap).max(axis=1, initial=0.0) > 0.01 * CLOSED * length
        if not far.any():
            break
        todo = todo[far]
        step = -(np.linalg.pinv(at.rows[far], rcond=DEPENDENT) @ at.gap[far][..., None])[..., 0]
        step *= np.minimum(1.0, FAR / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300))
        q[todo] = moved(tree, q[todo], step)
    at = equations(tree, replace(states, q=q))
    fits = np.abs(at.gap).max(axis=1, initial=0.0) <= CLOSED * length
    there, rows = replace(states, q=q).at(fits), at.rows[fits]
    back = np.linalg.pinv(rows, rcond=DEPENDENT)
    there = replace(there, qd=there.qd - (back @ (rows @ there.qd[..., None]))[..., 0])
    rest = rows @ there.qdd[..., None] + equations(tree, there).bias[..., None]
    return replace(there, qdd=there.qdd - (back @ rest)[..., 0]), fits


def left(rows: Array, slides: Array, length: float) -> tuple[Array, Array]:
    """Velocities that rows leave.

    Args:
        rows: Shape (n, m, n_freedom).
        slides: Which velocities are linear. Shape (n_freedom,).
        length: What counts as 1 rad [m].

    Returns:
        What is left of each unit velocity, a projector, shape (n, n_freedom, n_freedom); and how well the rows tell,
        the smallest singular value over the largest, shape (n,).
    """
    _, s, V = np.linalg.svd(rows * np.where(slides, length, 1.0), full_matrices=True)
    s = s / np.maximum(s.max(axis=1, initial=0.0, keepdims=True), 1e-300)
    rank = (s > DEPENDENT).sum(axis=1)
    V = V * (np.arange(V.shape[1]) >= rank[:, None])[..., None]
    return np.swapaxes(V, 1, 2) @ V, np.where(s > DEPENDENT, s, 1.0).min(axis=1, initial=1.0)
