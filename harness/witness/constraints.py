"""Loop constraints of a tree: residuals of closures and couplings, their rates, and the admissible motions.

A loop can be expressed by different rows (a weld, three points, a different order); the admissible motions do not
depend on this choice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from screwgauge.reference import linear
from screwgauge.reference.rotations import Array, cross, quaternion_rotation, rotation_vector
from screwgauge.witness.joints import MechanismTree
from screwgauge.witness.kinematics import TreeMotion, move
from screwgauge.witness.tree import FREEDOMS, Coupled, SpanningTree, TreeStates

#: Number of Newton steps; largest step [rad or m]; and gap that counts as rounding [rad, or machine lengths of at least
#: 1 m].
STEPS, FAR, CLOSED = 40, 0.5, 1e-11
#: Singular values below this fraction of the largest belong to redundant rows.
DEPENDENT = 1e-8
#: Singular values between these fractions of the largest indicate a singular pose, which is known only to about the
#: square root of rounding.
UNCLEAR = 1e-11, 1e-5


def closure_gaps(motion: TreeMotion[SpanningTree], order: int = 0) -> dict[str, Array]:
    """Return the displacement of each closure's second frame from its first, or its derivative, in world axes.

    Args:
        order: Order of the derivative, up to 2; derivatives of a weld's rotation are valid only if the weld is closed.

    Returns:
        Closure -> displacement, shape (n, 3), for points; rotation vector, then displacement, shape (n, 6), for welds.
    """
    ends, m = motion.closures, len(motion.tree.closures)
    first, second = ends.part(slice(m)), ends.part(slice(m, None))
    linear = getattr(second, "pva"[order]) - getattr(first, "pva"[order])
    if order:
        angular = getattr(second, "Rwb"[order]) - getattr(first, "Rwb"[order])
    else:
        angular = rotation_vector(second.R @ first.R.swapaxes(2, 3))
    whole = np.concatenate([angular, linear], axis=2)
    return {
        name: whole[:, i] if closure.kind == "weld" else linear[:, i]
        for i, (name, closure) in enumerate(motion.tree.closures.items())
    }


def coupling_gaps(motion: TreeMotion[SpanningTree], order: int = 0) -> Array:
    """Return the errors of all couplings, or derivatives of these errors. Shape (n, n_coupling)."""
    states, couplings = motion.states, motion.tree.couplings
    out = np.empty((len(states.q), len(couplings)))
    for k, one in enumerate(couplings.values()):
        column, velocity, *_ = one
        here = states.q[:, column], states.qd[:, velocity], states.qdd[:, velocity]
        out[:, k] = here[order] - _leads(one, states)[order]
    return out


def _leads(one: Coupled, states: TreeStates) -> tuple[Array, Array, Array]:
    """Return the value that a coupling prescribes for its coordinate, and two derivatives. Shape (n,) each."""
    _, _, constant, leads = one
    total, rate, change = (np.full(len(states.q), x) for x in (constant, 0.0, 0.0))
    for column, velocity, p in leads:
        q, v, a = states.q[:, column], states.qd[:, velocity], states.qdd[:, velocity]
        value, slope, bend = (np.asarray(polynomial.polyval(q, polynomial.polyder(p, k)), float) for k in range(3))
        total, rate, change = total + value, rate + slope * v, change + slope * a + bend * v**2
    return total, rate, change


def closure_rows(motion: TreeMotion[SpanningTree]) -> dict[str, Array]:
    """Return the velocity of each closure's second frame relative to the first, in world axes, per unit velocity.

    Returns:
        Closure -> shape (n, 3, n_freedom) for points, (n, 6, n_freedom) for welds.
    """
    m = len(motion.tree.closures)
    J = motion.jacobian(motion.tree.ends, motion.closures.p)
    rows = J[:, m:] - J[:, :m]
    return {
        name: rows[:, i] if closure.kind == "weld" else rows[:, i, 3:]
        for i, (name, closure) in enumerate(motion.tree.closures.items())
    }


def coupling_rows(motion: TreeMotion[SpanningTree]) -> Array:
    """Return the rates of the couplings' errors per unit velocity. Shape (n, n_coupling, n_freedom)."""
    tree, q = motion.tree, motion.states.q
    rows = np.zeros((len(q), len(tree.couplings), tree.freedom))
    for k, (_, own, _, leads) in enumerate(tree.couplings.values()):
        rows[:, k, own] = 1.0
        for column, velocity, p in leads:
            rows[:, k, velocity] -= polynomial.polyval(q[:, column], polynomial.polyder(p))
    return rows


def gaps_and_rows(tree: SpanningTree, states: TreeStates) -> tuple[Array, Array]:
    """Return all gaps [m or rad], shape (n, m), and their rates per unit velocity, (n, m, n_freedom)."""
    motion = move(tree, states)
    return residual(motion), constraint_rows(motion)


def gap_bias(tree: SpanningTree, states: TreeStates) -> Array:
    """Return the second derivative of all gaps at zero accelerations, Jdot v, assuming closed welds. Shape (n, m)."""
    return residual(move(tree, replace(states, qdd=np.zeros_like(states.qdd))), 2)


def residual(motion: TreeMotion[SpanningTree], order: int = 0) -> Array:
    """Return all gaps, or derivatives of them, in one array. Shape (n, m)."""
    return np.hstack([*closure_gaps(motion, order).values(), coupling_gaps(motion, order)])


def constraint_rows(motion: TreeMotion[SpanningTree]) -> Array:
    """Return the rates of all gaps per unit velocity. Shape (n, m, n_freedom)."""
    return np.concatenate([*closure_rows(motion).values(), coupling_rows(motion)], axis=1)


def move_joints(tree: SpanningTree, q: Array, step: Array) -> Array:
    """Move every joint by a step along its velocities.

    Args:
        step: Step [rad or m]. Shape (n, n_freedom).
    """
    out = q.copy()
    for link in tree.links:
        start, part = link.coordinate, step[:, link.velocity : link.velocity + FREEDOMS[link.kind]]
        if part.shape[1] == 1:
            out[:, start] += part[:, 0]
            continue
        start += 3 * (link.kind == "free")
        w, turn = q[:, start : start + 4], part[:, :3]
        half = 0.5 * np.linalg.norm(turn, axis=1, keepdims=True)
        v = 0.5 * turn * np.sinc(half / np.pi)
        real = w[:, :1] * np.cos(half) - np.sum(w[:, 1:] * v, axis=1, keepdims=True)
        out[:, start : start + 4] = np.hstack([real, w[:, :1] * v + np.cos(half) * w[:, 1:] + cross(w[:, 1:], v)])
        if link.kind == "free":
            out[:, start - 3 : start] += (quaternion_rotation(w) @ part[:, 3:, None])[..., 0]
    return out


def close_loops(tree: SpanningTree, states: TreeStates) -> tuple[TreeStates, NDArray[np.bool_]]:
    """Close the loops with Newton's method; correct velocities and accelerations so that the loops stay closed.

    Returns:
        The states that could be closed, and flags that mark them among the given states, shape (n,).
    """
    q, length, todo = states.q.copy(), max(tree.length, 1.0), np.arange(len(states.q))
    for _ in range(STEPS):
        gap, rows = gaps_and_rows(tree, replace(states.at(todo), q=q[todo]))
        far = np.abs(gap).max(axis=1, initial=0.0) > 0.01 * CLOSED * length
        if not far.any():
            break
        todo = todo[far]
        q[todo] = move_joints(tree, q[todo], newton_step(rows[far], gap[far]))
    gap, rows = gaps_and_rows(tree, replace(states, q=q))
    fits = np.abs(gap).max(axis=1, initial=0.0) <= CLOSED * length
    there, rows = replace(states, q=q).at(fits), rows[fits]
    back = np.linalg.pinv(rows, rcond=DEPENDENT)
    there = replace(there, qd=there.qd - (back @ (rows @ there.qd[..., None]))[..., 0])
    rest = rows @ there.qdd[..., None] + gap_bias(tree, there)[..., None]
    return replace(there, qdd=there.qdd - (back @ rest)[..., 0]), fits


def newton_step(rows: Array, gap: Array) -> Array:
    """Return the shortest step that closes gaps, limited to `FAR`. (n, m, n_freedom), (n, m) -> (n, n_freedom)."""
    step = -(np.linalg.pinv(rows, rcond=DEPENDENT) @ gap[..., None])[..., 0]
    return np.asarray(step * np.minimum(1.0, FAR / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300)))


def is_rank_clear(rows: Array) -> NDArray[np.bool_]:
    """Flag states in which the rank of the rows is clear; shape (n, m, n_freedom) -> (n,).

    Near a singular pose, Newton's method reaches only half the digits, and some singular values are neither clearly
    zero nor clearly nonzero.
    """
    s = np.linalg.svd(rows, compute_uv=False)
    s = s / np.maximum(s.max(axis=1, initial=0.0, keepdims=True), 1e-300)
    return np.asarray(~((s > UNCLEAR[0]) & (s < UNCLEAR[1])).any(axis=1))


def admissible_projector(rows: Array, slides: Array, length: float) -> tuple[Array, Array]:
    """Return the projector onto the velocities that the rows allow.

    Args:
        rows: Shape (n, m, n_freedom).
        slides: Flags of linear velocities. Shape (n_freedom,).
        length: Length equivalent to 1 rad [m].

    Returns:
        The projection of each unit velocity, shape (n, n_freedom, n_freedom); and the conditioning of the rows: the
        smallest nonzero singular value divided by the largest, shape (n,).
    """
    _, s, V = np.linalg.svd(rows * np.where(slides, length, 1.0), full_matrices=True)
    s = s / np.maximum(s.max(axis=1, initial=0.0, keepdims=True), 1e-300)
    rank = (s > DEPENDENT).sum(axis=1)
    V = V * (np.arange(V.shape[1]) >= rank[:, None])[..., None]
    return np.swapaxes(V, 1, 2) @ V, np.where(s > DEPENDENT, s, 1.0).min(axis=1, initial=1.0)


@dataclass(frozen=True, eq=False)
class AdmissibleMotion:
    """Admissible motions of a mechanism with closed loops at n poses, with dimensionless equations.

    Attributes:
        motion: Motion of the tree at the poses.
        equations: Rates of the gaps per unit velocity, followed by the rows that select y. Shape (n, m + k, n_freedom).
        gap_size: Unit of each gap, 1 rad or the machine's length. Shape (m,).
        size: Unit of each velocity, 1 rad or the machine's length [m]. Shape (n_freedom,).
        columns: Columns of the independent velocities.
    """

    motion: TreeMotion[MechanismTree]
    equations: Array
    gap_size: Array
    size: Array
    columns: list[int]

    def joints(self, y: Array, gaps: Array | None = None) -> Array:
        """Compute derivatives of all coordinates from derivatives of the independent coordinates.

        Args:
            y: Derivatives of the independent coordinates. Shape (n, k) or (n, k, m).
            gaps: Gap derivatives at zero coordinate derivatives, see `residual`; zero by default. Shape (n, m).

        Returns:
            Shape (n, n_freedom) or (n, n_freedom, m).
        """
        single, m = y.ndim == 2, len(self.gap_size)
        y = y[..., None] if single else y
        right = np.zeros((len(y), self.equations.shape[1], y.shape[2]))
        right[:, m:] = y / self.size[self.columns, None]
        if gaps is not None:
            right[:, :m] = -(gaps / self.gap_size)[..., None]
        solution = linear.solve(self.equations, right) * self.size[:, None]
        return np.asarray(solution[..., 0] if single else solution)

    @cached_property
    def partial(self) -> Array:
        """Velocities of all coordinates per unit velocity of y. Shape (n, n_freedom, k)."""
        return self.joints(np.tile(np.eye(len(self.columns)), (len(self.equations), 1, 1)))

    @cached_property
    def bodies(self) -> Array:
        """Angular velocities, then velocities of centres of mass, per unit velocity of y. Shape (n, n_body, 6, k)."""
        J = self.motion.jacobian(self.motion.tree.bodies, self.motion.com.p)[:, :, [3, 4, 5, 0, 1, 2]]
        return np.asarray(J @ self.partial[:, None])


def admissible_motion(motion: TreeMotion[MechanismTree]) -> AdmissibleMotion:
    """Compute the motions that a mechanism's loops allow at the poses of a given motion."""
    tree, length, columns = motion.tree, motion.tree.length, motion.tree.mechanism.independent_columns
    size = np.array([1.0 if unit == "rad" else length for unit in tree.mechanism.units])
    gap_size = [np.array([1.0] * 3 + [length] * 3)[-3 * (1 + (c.kind == "weld")) :] for c in tree.closures.values()]
    gaps = np.concatenate([*gap_size, [size[velocity] for _, velocity, *_ in tree.couplings.values()], np.zeros(0)])
    rows = constraint_rows(motion) / gaps[:, None] * size
    chosen = np.broadcast_to(np.eye(len(size))[columns], (len(rows), len(columns), len(size)))
    return AdmissibleMotion(motion, np.concatenate([rows, chosen], axis=1), gaps, size, columns)
