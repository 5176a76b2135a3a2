"""Positions, rates and accelerations of all joints and bodies (sections 3 and 4 of the paper).

The loops of any graph stand for the chains of the paper: ``G w = 0`` says for every loop what ``S w = V``
(eq. 15) says for two chains that carry the same body. `chain_rates` is eq. (15) for one chain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference import linear, screws
from screwgauge.reference.chains import closed_form
from screwgauge.reference.continuation import OPEN, check_closed, corrector, follow, newton, partial_rates
from screwgauge.reference.pose import Layout, Pose, loop_matrix, pose
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Joint rates of a closed mechanism.

    Attributes:
        pose: The pose they belong to.
        K: Partial rates, d q / d y. Shape (n, n_q, n_independent).
        A: Loop screws over the selection of the independent coordinates. Shape (n, 6 n_cut + n_independent, n_q).
        w: Joint rates [rad/s or m/s]. Shape (n, n_q).
        V: Twist of each body at O, eq. (4). Shape (n, n_body + 1, 6).
    """

    pose: Pose
    K: Array
    A: Array
    w: Array
    V: Array


def closure_system(lay: Layout, at: Pose) -> Array:
    """Loop screws over the selection of y: ``[G; E] w = [0; yd]``. Shape (n, 6 n_cut + k, n_q)."""
    selection = np.eye(at.q.shape[1], dtype=at.q.dtype)[lay.mechanism.independent_columns]
    E = np.broadcast_to(selection, (len(at.q), *selection.shape))
    return np.concatenate([loop_matrix(lay, at), E], axis=1)


def positions(lay: Layout, y: Array, t: Array) -> Pose:
    """Poses for the independent coordinates: closed form where the chains allow it, Newton's method otherwise.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).
        t: Times, for messages [s]. Shape (n,).

    Raises:
        ClosureError: A loop cannot close.
    """
    columns = lay.mechanism.independent_columns

    def evaluate(q: Array, goal: Array) -> tuple[Array, Array]:
        at = pose(lay, q)
        return np.concatenate([at.gap.reshape(len(q), -1), q[:, columns] - goal], axis=1), closure_system(
            lay, at
        )

    start = closed_form(lay, y)
    if start is not None:
        q, _, error = newton(evaluate, start, y)
        # from farther away Newton's method may end on another branch, or nowhere
        if (error < OPEN).all() and np.abs(q - start).max(initial=0.0) < 0.3:
            return pose(lay, q)
    home = lay.mechanism.home
    start = follow(corrector(evaluate), home, home[columns], y, t)
    q, _, error = newton(evaluate, start, y)
    check_closed(error, y, t)
    return pose(lay, q)


def rates(lay: Layout, at: Pose, yd: Array) -> Rates:
    """Joint rates from the closed loops and the given rates of y. `yd`: shape (n, k) [rad/s or m/s]."""
    A = closure_system(lay, at)
    K = partial_rates(A, yd.shape[1])
    w = (K @ yd[..., None])[..., 0]
    V = np.einsum("bi,ni,nix->nbx", lay.path, w, at.S)
    return Rates(at, K, A, w, V)


def chain_rates(S: Array, V: Array) -> tuple[Array, Array]:
    """Rates of a serial chain from the twist of its end, eqs. (15), (25), (26), and what is left over.

    A twist outside the range of `S` has no rates; its residual says so, the least-squares answer does not.

    Args:
        S: Screw matrix. Shape (n, 6, m).
        V: Twist of the end body at O. Shape (n, 6).

    Returns:
        Rates, shape (n, m), and the residual ``|S w - V|``, shape (n,) [rad/s and m/s].
    """
    w = (np.linalg.pinv(S) @ V[..., None])[..., 0]
    return w, np.linalg.norm((S @ w[..., None])[..., 0] - V, axis=-1)


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


def _biases(lay: Layout, rate: Rates) -> tuple[Array, Array]:
    """The terms ``w^T S_L w`` of eq. (44), of every body and around every loop.

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
            terms, columns[::-1] if edge.reverse else columns, rate.V[:, index[edge.near]], sign
        )
        body[:, index[edge.far]] = body[:, index[edge.near]] + far
    loop = np.zeros((len(terms), len(lay.tree.cuts), 6), dtype=terms.dtype)
    for c, joint in enumerate(lay.tree.cuts):
        parent, child = index[joint.parent], index[joint.child]
        via = body[:, parent] + _bias_across(terms, lay.columns[joint.name], rate.V[:, parent], 1.0)
        loop[:, c] = via - body[:, child]
    return body, loop


def _bias_across(terms: Array, columns: list[int], V: Array, sign: float) -> Array:
    bias = np.zeros_like(V)
    for column in columns:
        term = sign * terms[:, column]
        bias = bias + screws.lie_bracket(V, term)
        V = V + term
    return bias


def accelerations(lay: Layout, rate: Rates, ydd: Array) -> tuple[Array, Array]:
    """Joint accelerations and acceleration screws of all bodies, eqs. (44), (48).

    Args:
        rate: Rates of the closed mechanism.
        ydd: Second derivatives of the independent coordinates. Shape (n, k).

    Returns:
        Joint accelerations [rad/s^2 or m/s^2], shape (n, n_q), and screws, shape (n, n_body + 1, 6).
    """
    body, loop = _biases(lay, rate)
    right = np.concatenate([-loop.reshape(len(ydd), -1), ydd], axis=1)
    beta = linear.solve(rate.A, right[..., None])[..., 0]
    return beta, np.einsum("bi,ni,nix->nbx", lay.path, beta, rate.pose.S) + body
