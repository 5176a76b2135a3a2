"""The paper's own scheme as an additional method: velocities of each chain from eq. (26), joint angles by time steps.

The twist of the platform drives every chain separately, and nothing corrects closure errors (eqs. 15-27). The twist
follows eq. (60), as printed or corrected; the steps use explicit Euler (eq. 27) or Runge-Kutta. Since steps are
sequential, each step is kept cheap by stacking all chains as small matrices.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.problem import GivenMotion
from screwgauge.reference.closed.assembly_mode import closed_form_positions, positions
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.equations.joint_types import locate, locate_body
from screwgauge.reference.equations.kinematics import gaps, pose
from screwgauge.reference.equations.screws import lie_bracket
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.graph import Edge, Layout, output_body, serial_chains
from screwgauge.reference.rotations import Array, cross, skew

TWISTS = ("right", "printed", "literal")
CLOSED = 1e-9  # [rad, m]: if the driving joint alone closes the loops, it closes them to rounding, about 1e-15
#: Method -> its stages, each with fraction of the step and weight.
STAGES = {"euler": ((0.0, 1.0),), "rk4": ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6))}
#: Method -> number of parts in a step.
PARTS = {"euler": 1, "rk4": 2}


@dataclass(frozen=True, slots=True, eq=False)
class Chains:
    """Serial chains from ground to the platform, stacked; shorter chains are padded.

    Attributes:
        columns: Column of each degree of freedom among all joint coordinates; 0 for padding. Shape (n_chain, m).
        used: False for padding. Shape (n_chain, m).
        turns: 1 for a rotation, 0 for a slide and for padding. Shape (n_chain, m, 1).
        axis: Unit axis of each degree of freedom, zero for padding. Shape (n_chain, m, 3).
        steps: Homogeneous matrix of each degree of freedom and of the fixed transform after it, as coefficients of 1,
            sin q and 1 - cos q (Rodrigues' formula), and of q for a slide. Shape (4, n_chain, m, 4, 4).
        idle: Matrix with ones on the diagonal for padding. Shape (n_chain, m, m).
        start: Frame in which each chain begins. Shape (n_chain, 4, 4).
    """

    columns: NDArray[np.intp]
    used: NDArray[np.bool_]
    turns: Array
    axis: Array
    steps: Array
    idle: Array
    start: Array

    def gather(self, q: Array) -> Array:
        """Arrange the coordinates of all joints, shape (..., n_q), by chain, shape (..., n_chain, m)."""
        return np.where(self.used, q[..., self.columns], 0.0)

    def scatter(self, values: Array, n_q: int) -> Array:
        """Invert `gather`; coordinates that do not belong to a chain are zero."""
        out = np.zeros((*values.shape[:-2], n_q))
        out[..., self.columns[self.used]] = values[..., self.used]
        return out

    def walk(self, theta: Array) -> tuple[Array, Array, Array]:
        """Compute unit screws of all degrees of freedom, and the platform's pose from each chain; corrected eq. (24).

        Args:
            theta: Coordinates by chain. Shape (..., n_chain, m).

        Returns:
            Screws, shape (..., n_chain, m, 6), and the platform's R (..., n_chain, 3, 3) and p (..., n_chain, 3).
        """
        q, m = theta[..., None, None], theta.shape[-1]
        still, sine, cosine, slide = self.steps
        step = still + np.sin(q) * sine + 2.0 * np.sin(0.5 * q) ** 2 * cosine + q * slide
        G = np.empty((*theta.shape[:-1], m + 1, 4, 4))
        G[..., 0, :, :] = self.start
        for j in range(m):
            np.matmul(G[..., j, :, :], step[..., j, :, :], out=G[..., j + 1, :, :])
        R, p = G[..., :3, :3], G[..., :3, 3]
        e = (R[..., :m, :, :] @ self.axis[..., None])[..., 0]
        S = np.concatenate([self.turns * e, np.where(self.turns, cross(p[..., :m, :], e), e)], axis=-1)
        return S, R[..., m, :, :], p[..., m, :]

    def solve(self, S: Array, V: Array) -> Array:
        """Solve eq. (26) for every chain, ``w = [S^T S]^-1 S^T V``, as printed.

        Args:
            S: Screws. Shape (..., n_chain, m, 6).
            V: Twist required at the end of each chain. Shape (..., n_chain or 1, 6).

        Returns:
            Coordinate rates w. Shape (..., n_chain, m).
        """
        return np.asarray(np.linalg.solve(S @ S.swapaxes(-1, -2) + self.idle, S @ V[..., None])[..., 0])


def chains(lay: Layout) -> Chains:
    """Return the chains of a parallel mechanism.

    Raises:
        DescriptionError: The mechanism has couplings, or a joint is not in a serial chain from ground to the platform.
    """
    series = serial_chains(lay.mechanism)
    where = lay.mechanism.where or lay.mechanism.name
    if lay.mechanism.couplings:
        raise DescriptionError("has couplings", where, "remove them: the paper's scheme supports only chains")
    if sum(len(chain) for chain in series) != len(lay.mechanism.joints):
        what = "not every joint lies in a serial chain from ground to one platform"
        raise DescriptionError(what, where, "use a mechanism of such chains, which the paper's scheme requires")
    if any(edge.reverse for chain in series for edge in chain):
        raise DescriptionError("a joint is declared from the platform to ground", where, "swap parent and child")
    freedoms = [list(_freedoms(lay, chain)) for chain in series]
    m = max(map(len, freedoms))
    rows = [[*row, *[_NOTHING] * (m - len(row))] for row in freedoms]
    columns, used, turns, axis, R, p = (np.array([[freedom[k] for freedom in row] for row in rows]) for k in range(6))
    turns = turns[..., None].astype(float)
    after, (K, slide) = homogeneous(R, p), np.zeros((2, *R.shape[:2], 4, 4))
    K[..., :3, :3], slide[..., :3, 3] = skew(axis) * turns[..., None], axis * (1.0 - turns)
    first = [chain[0].joint.parent_frame for chain in series]
    return Chains(
        columns=columns,
        used=used,
        turns=turns,
        axis=axis,
        steps=np.stack([after, K @ after, K @ K @ after, slide]),
        idle=(~used)[..., None] * np.eye(m),
        start=homogeneous(np.stack([frame.R for frame in first]), np.stack([frame.p for frame in first])),
    )


def homogeneous(R: Array, p: Array) -> Array:
    """Return homogeneous matrices for rotations (..., 3, 3) and positions (..., 3). Shape (..., 4, 4)."""
    T = np.broadcast_to(np.eye(4), (*p.shape[:-1], 4, 4)).copy()
    T[..., :3, :3], T[..., :3, 3] = R, p
    return T


_Freedom = tuple[int, bool, bool, Array, Array, Array]
_REST = np.eye(3), np.zeros(3)
_NOTHING: _Freedom = (0, False, False, np.zeros(3), *_REST)


def _freedoms(lay: Layout, chain: tuple[Edge, ...]) -> Iterator[_Freedom]:
    """Yield (column, used, turns, axis, rotation after it, displacement after it) for each degree of freedom."""
    for edge, following in zip(chain, [*chain[1:], None], strict=True):
        after = locate_body(*_REST, edge.joint.child_frame)
        if following is not None:
            after = locate(*after, following.joint.parent_frame)
        steps = [_REST] * (len(edge.joint.freedoms) - 1) + [after]
        for column, freedom, step in zip(lay.columns[edge.joint.name], edge.joint.freedoms, steps, strict=True):
            yield column, True, *freedom, *step


def march(side: Chains, start: Array, V: Array, step: float, method: str) -> Array:
    """Step in time by ``euler``, eq. (27), ``theta(n + 1) = theta(n) + dt w(n)``, or classical ``rk4`` of order four.

    Args:
        start: Coordinates by chain. Shape (n_chain, m).
        V: Twist of the platform at the ends of all parts of the steps. Shape (parts n + 1, 6).

    Returns:
        Coordinates at the ends of the steps. Shape (n + 1, n_chain, m).
    """
    parts = PARTS[method]
    theta = np.empty(((len(V) - 1) // parts + 1, *start.shape))
    theta[0] = start
    for i in range(len(theta) - 1):
        w, way = np.zeros_like(start), np.zeros_like(start)
        for part, weight in STAGES[method]:
            w = side.solve(side.walk(theta[i] + part * step * w)[0], V[parts * i + round(parts * part)])
            way += weight * step * w
        theta[i + 1] = theta[i] + way
    return theta


def integrate(
    lay: Layout, motion: GivenMotion, *, twist: str = "right", method: str = "euler"
) -> tuple[Array, Array, Array]:
    """Run the scheme of eqs. (15)-(27) over a motion, then eq. (44) for the accelerations.

    Args:
        motion: Motion at evenly spaced times, which are the ends of all parts of the steps. The loops are closed at the
            first sample.
        twist: ``right``; ``printed``, eq. (60); ``literal``, eq. (60) minus the terms of eqs. (22)-(23).
        method: ``euler``, eq. (27), or ``rk4``.

    Returns:
        Joint coordinates [rad or m], velocities and accelerations at the ends of the steps. Shape (n, n_q) each.

    Raises:
        ScrewgaugeError: A name is unknown, a step is incomplete, or the mechanism is not a set of chains to a platform.
    """
    if method not in PARTS:
        raise UnknownNameError("method", method, PARTS)
    parts = PARTS[method]
    steps, rest = divmod(len(motion) - 1, parts)
    if rest or not steps:
        what, remedy = (
            f"{len(motion)} samples do not make whole steps of {method}",
            f"pass {parts} samples for each step, plus one",
        )
        raise DescriptionError(what, "motion", remedy)
    V, A = platform_screws(lay, motion, twist)
    side = chains(lay)
    step = float(motion.t[-1] - motion.t[0]) / steps
    theta = march(side, side.gather(positions(lay, motion.y[:1], motion.t[:1])[0]), V, step, method)
    S = side.walk(theta)[0]
    w = side.solve(S, V[::parts, None])
    beta = side.solve(S, A[::parts, None] - _bias(S * w[..., None]))
    q, qd, qdd = (side.scatter(array, len(lay.mechanism.coordinates)) for array in (theta, w, beta))
    return q, qd, qdd


def _bias(terms: Array) -> Array:
    """Compute ``w^T S_L w`` in eq. (44), the sum of [V before j, S_j w_j] over S_j w_j. (..., m, 6) -> (..., 6)."""
    return np.asarray(lie_bracket(np.cumsum(terms, axis=-2) - terms, terms).sum(axis=-2))


def platform_screws(lay: Layout, motion: GivenMotion, twist: str = "right") -> tuple[Array, Array]:
    """Return the twist and the acceleration screw of the platform at O, the input of the scheme. Shape (n, 6) each.

    The ``right`` screws are those of the joint with the independent coordinates, with its other angles held fixed, if
    the loops close at these poses (c = 0 in the paper's mechanism), and otherwise those of the closed mechanism.

    Raises:
        UnknownNameError: The twist is unknown.
    """
    if twist not in TWISTS:
        raise UnknownNameError("twist", twist, TWISTS)
    if twist != "right":
        V, A = fixed_axes(motion)
        com = lay.mechanism.body(output_body(lay.mechanism)).com
        return (subtract_origin(V, com), A) if twist == "literal" else (V, A)
    alone = _driver_alone(lay, motion)
    if alone is not None:
        return alone
    at = motion_at(lay, positions(lay, motion.y, motion.t), motion.yd, motion.ydd)
    platform = lay.mechanism.body_index[output_body(lay.mechanism)]
    return at.V[:, platform], at.A[:, platform]


def _driver_alone(lay: Layout, motion: GivenMotion) -> tuple[Array, Array] | None:
    """Solve only the joint with the independent coordinates; return None if that leaves a loop open."""
    q = closed_form_positions(lay, motion.y)
    if q is None or np.abs(gaps(lay, q[:: max(1, len(q) // 16)])).max() > CLOSED:
        return None
    chosen = lay.mechanism.independent_columns
    columns = next(columns for columns in lay.columns.values() if set(chosen) <= set(columns))
    S = pose(lay, q).S[:, columns]
    w, beta = np.zeros((2, len(q), len(columns)))
    at = [columns.index(column) for column in chosen]
    w[:, at], beta[:, at] = motion.yd, motion.ydd
    return (S * w[..., None]).sum(1), (S * beta[..., None]).sum(1) + _bias(S * w[..., None])


def fixed_axes(motion: GivenMotion) -> tuple[Array, Array]:
    """Return derivatives of y as components about fixed axes, as in eq. (60). Shapes (n, 6)."""
    to_six = ((0, 0), (0, 6 - motion.y.shape[1]))
    return np.pad(motion.yd, to_six), np.pad(motion.ydd, to_six)


def subtract_origin(V: Array, r_P: Array) -> Array:
    """Subtract the origin's velocity as eqs. (22)-(23) are printed: ``V - [0; w x r_P]``. Shape (..., 6)."""
    return np.concatenate([V[..., :3], V[..., 3:] - np.cross(V[..., :3], r_P)], axis=-1)
