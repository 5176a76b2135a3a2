"""Positions, velocities and accelerations of all joints and bodies (sections 3 and 4 of the paper).

The loops of any graph stand for the chains of the paper: ``G w = 0`` says for every loop what ``S w = V``
(eq. 15) says for two chains that carry the same body.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference import linear, screws
from screwgauge.reference.chains import closed_form
from screwgauge.reference.closed.continuation import OPEN, newton, velocity_map
from screwgauge.reference.closed.following import Follower
from screwgauge.reference.closed.loops import LoopEquations, Rates, loop_equations
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.pose import Layout, Pose, constraint_matrix
from screwgauge.reference.rotations import Array

Bracket = Callable[[Array, Array], Array]
"""Takes two twists, shape (..., 6), and returns a third."""


@dataclass(frozen=True, slots=True, eq=False)
class Velocities:
    """Velocities of a closed mechanism.

    Attributes:
        pose: The pose they belong to.
        K: Velocity map, dq/dy. Shape (n, n_q, n_independent).
        A: The equations that were solved, without dimension, see `LoopEquations.matrix`. Shape (n, m + k, n_unknown).
        w: Joint velocities [rad/s or m/s]. Shape (n, n_q).
        V: Twist of each body at O, eq. (4). Shape (n, n_body + 1, 6).
        system: Whose equations these are.
        orientation: Condition number of the orientation coordinates of each cut joint. Shape (n, n_cut).
    """

    pose: Pose
    K: Array
    A: Array
    w: Array
    V: Array
    system: LoopEquations
    orientation: Array

    def rows(self, rows: NDArray[np.intp]) -> Velocities:
        """The same for some of the samples."""
        arrays = self.K[rows], self.A[rows], self.w[rows], self.V[rows]
        return Velocities(self.pose.rows(rows), *arrays, self.system, self.orientation[rows])


def closure_system(lay: Layout, at: Pose) -> Array:
    """What must vanish over the selection of y: ``[G; E] w = [0; yd]``. Shape (n, 6 n_cut + n_coupling + k, n_q)."""
    selection = np.eye(at.q.shape[1], dtype=at.q.dtype)[lay.mechanism.independent_columns]
    E = np.broadcast_to(selection, (len(at.q), *selection.shape))
    return np.concatenate([constraint_matrix(lay, at), E], axis=1)


def positions(lay: Layout, y: Array, t: Array, rates: Rates | None = None, *, path: Follower | None = None) -> Pose:
    """Poses on the branch of the home pose: in closed form where that is this branch, else followed from home.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).
        t: Times [s]. Shape (n,).
        rates: Derivatives, by which the motion is followed where the straight way between samples is singular.
        path: What has followed the samples before these, such as `home_equations(lay).follower()`; home by default.

    Raises:
        ClosureError: A loop cannot close, or there is no way but over a singular pose.
    """
    system = home_equations(lay)
    start = _closed_form(lay, system.fixed, y)
    if start is None:
        return system.follow(path or system.follower(), y, t, rates)
    z, _, error = newton(
        system.evaluate, (start / system.size)[:, system.unknown], y / system.size[lay.mechanism.independent_columns]
    )
    if not (error < OPEN).all():
        raise ClosureError("the closed form leaves loops open", lay.mechanism.name, "check the geometry")
    return system.fill(z, start)


def _closed_form(lay: Layout, fixed: tuple[int, ...], y: Array) -> Array | None:
    """Joint coordinates in closed form, where no other coordinate of the joint that is driven ever moves.

    Then the branch of home has no end but where a leg locks or has no length, and all of it is what the form gives.
    """
    chosen = set(lay.mechanism.independent_columns)
    driver = next((columns for columns in lay.columns.values() if chosen <= set(columns)), [])
    return closed_form(lay, y) if set(driver) - chosen <= set(fixed) else None


def _system(lay: Layout, at: Pose) -> LoopEquations:
    """The loop equations at poses; what never moves on the home branch is fixed only on that branch."""
    system = home_equations(lay)
    fixed = list(system.fixed)
    return system if (at.q[:, fixed] == lay.mechanism.home[fixed]).all() else loop_equations(lay)


def velocities(lay: Layout, at: Pose, yd: Array) -> Velocities:
    """Velocities from the closed loops and those given of y. `yd`: shape (n, k) [rad/s or m/s].

    The tree's follow from the reciprocal wrenches of the cut joints, those of a cut joint from its own two bodies.
    """
    system = _system(lay, at)
    A = system.matrix(at)
    K = np.zeros((len(at.q), at.q.shape[1], yd.shape[1]), dtype=at.q.dtype)
    found = velocity_map(A, yd.shape[1]) / system.size[lay.mechanism.independent_columns]
    K[:, system.unknown] = found * system.size[system.unknown][:, None]
    rows, orientation = system.cut_rows(at)
    K[:, lay.cut_columns] = rows @ K
    w = (K @ yd[..., None])[..., 0]
    # twists follow from the tree alone: in gimbal lock the velocities of a cut joint are not numbers
    tree = lay.tree_columns
    V = np.einsum("bi,ni,nix->nbx", lay.path[:, tree], w[:, tree], at.S[:, tree])
    return Velocities(at, K, A, w, V, system, orientation)


def lie_matrix(S: Array) -> Array:
    """Brackets of all pairs of screws, eq. (48): entry (i, j) is [S_i, S_j] for i < j, else zero.

    Args:
        S: Screw matrix. Shape (n, 6, m).

    Returns:
        Shape (n, m, m, 6).
    """
    columns = S.swapaxes(1, 2)
    i, j = np.triu_indices(columns.shape[1], 1)
    S_L = np.zeros((len(S), columns.shape[1], columns.shape[1], 6))
    S_L[:, i, j] = screws.lie_bracket(columns[:, i], columns[:, j])
    return S_L


def chain_acceleration(S: Array, w: Array, beta: Array) -> Array:
    """Acceleration screw of the end of a serial chain, eq. (44): ``S beta + w^T S_L w``. Shape (n, 6)."""
    return np.asarray(np.einsum("nxi,ni->nx", S, beta) + np.einsum("ni,nijx,nj->nx", w, lie_matrix(S), w))


def _biases(lay: Layout, rate: Velocities, bracket: Bracket) -> tuple[Array, Array]:
    """The terms ``w^T S_L w`` of eq. (44), of every body, and of every cut joint: its child by
    the tree less its child across the joint.

    Summed along the chain: sum over i < j of [S_i w_i, S_j w_j] = sum over j of [V before j, S_j w_j].

    Returns:
        Shapes (n, n_body + 1, 6) and (n, n_cut, 6).
    """
    index = lay.mechanism.body_index
    terms = rate.pose.S * rate.w[..., None]
    body = np.zeros_like(rate.V)
    for edge in lay.tree.edges:
        sign = -1.0 if edge.reverse else 1.0
        columns = lay.columns[edge.joint.name]
        far = _bias_across(
            terms, columns[::-1] if edge.reverse else columns, rate.V[:, index[edge.near]], sign, bracket
        )
        body[:, index[edge.far]] = body[:, index[edge.near]] + far
    loop = np.zeros((len(terms), len(lay.tree.cuts), 6), dtype=terms.dtype)
    for c, joint in enumerate(lay.tree.cuts):
        parent, child = index[joint.parent], index[joint.child]
        via = body[:, parent] + _bias_across(terms, lay.columns[joint.name], rate.V[:, parent], 1.0, bracket)
        loop[:, c] = body[:, child] - via
    return body, loop


def _bias_across(terms: Array, columns: list[int], V: Array, sign: float, bracket: Bracket) -> Array:
    bias = np.zeros_like(V)
    for column in columns:
        term = sign * terms[:, column]
        bias = bias + bracket(V, term)
        V = V + term
    return bias


def accelerations(lay: Layout, rate: Velocities, ydd: Array, bracket: Bracket | None = None) -> tuple[Array, Array]:
    """Joint accelerations and acceleration screws of all bodies, eqs. (44), (48).

    Args:
        rate: Velocities of the closed mechanism.
        ydd: Second derivatives of the independent coordinates. Shape (n, k).
        bracket: In place of the Lie bracket, to see what a part of it does.

    Returns:
        Joint accelerations [rad/s^2 or m/s^2], shape (n, n_q), and screws, shape (n, n_body + 1, 6).
    """
    body, loop = _biases(lay, rate, bracket or screws.lie_bracket)
    system, at = rate.system, rate.pose
    columns = lay.mechanism.independent_columns
    readers = system.readers(at)[0]
    goal = ydd.copy()
    for k, column in enumerate(columns):
        if column not in system.unknown:
            place = lay.cut_columns.index(column)
            goal[:, k] -= np.sum(readers[:, place] * loop[:, system.cut.owner[place]], axis=1)
    right = np.concatenate([-system.bias(at, rate.w, rate.V, body), goal / system.size[columns]], axis=1)
    beta = np.zeros_like(at.q)
    beta[:, system.unknown] = linear.solve(rate.A, right[..., None])[..., 0] * system.size[system.unknown]
    A = np.einsum("bi,ni,nix->nbx", lay.path, beta, at.S) + body
    (parents, _, _), (children, _, _) = lay.sides
    own = loop + (A - body)[:, children] - (A - body)[:, parents]
    beta[:, lay.cut_columns] = np.sum(readers * own[:, system.cut.owner], axis=2)
    return beta, A
