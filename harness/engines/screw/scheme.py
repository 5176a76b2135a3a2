"""The paper's own scheme, one more method: velocities of each chain by eq. (26), joint angles by steps in time.

Every chain is driven on its own by the twist of the platform and nothing corrects its closure (eqs. 15-27). The
twist is that of eq. (60) as printed or the right one, the steps are explicit Euler's (eq. 27) or Runge-Kutta's.
Steps follow each other, so one step is kept cheap: all chains side by side as one stack of small matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.screw.twist import Drive, platform_screws
from screwgauge.reference import screws
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.graph import Edge, serial_chains
from screwgauge.reference.kinematics import positions
from screwgauge.reference.pose import Layout, place, unplace
from screwgauge.reference.rotations import Array, cross, skew

Bracket = Callable[[Array, Array], Array]
Index = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Chains:
    """The serial chains from ground to the platform side by side, shorter ones filled up with nothing.

    Attributes:
        columns: Column of each freedom among all joint coordinates; 0 where filled up. Shape (n_chain, m).
        used: False where filled up. Shape (n_chain, m).
        turns: 1 for a rotation, 0 for a slide and where filled up. Shape (n_chain, m, 1).
        axis: Its unit axis, zero where filled up. Shape (n_chain, m, 3).
        steps: Homogeneous matrix of each freedom and of what follows it, as a sum: times 1, sin q and 1 - cos q
            (Rodrigues' formula), and q of a slide. Shape (4, n_chain, m, 4, 4).
        idle: One on the diagonal where filled up. Shape (n_chain, m, m).
        start: Frame in which each chain begins. Shape (n_chain, 4, 4).
    """

    columns: Index
    used: NDArray[np.bool_]
    turns: Array
    axis: Array
    steps: Array
    idle: Array
    start: Array

    def gather(self, q: Array) -> Array:
        """Coordinates of all joints, shape (..., n_q), chain by chain, shape (..., n_chain, m)."""
        return np.where(self.used, q[..., self.columns], 0.0)

    def scatter(self, values: Array, n_q: int) -> Array:
        """The inverse of `gather`; zero for a coordinate that no chain has."""
        out = np.zeros((*values.shape[:-2], n_q))
        out[..., self.columns[self.used]] = values[..., self.used]
        return out

    def walk(self, theta: Array) -> tuple[Array, Array, Array]:
        """Unit screws of all freedoms and where each chain puts the platform, eq. (24) with its errors mended.

        Args:
            theta: Coordinates chain by chain. Shape (..., n_chain, m).

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
        """Eq. (26) for every chain, ``w = [S^T S]^-1 S^T V``, as printed.

        Args:
            S: Screws. Shape (..., n_chain, m, 6).
            V: What each chain has to give at its end. Shape (..., n_chain or 1, 6).

        Returns:
            Shape (..., n_chain, m).
        """
        return np.asarray(np.linalg.solve(S @ S.swapaxes(-1, -2) + self.idle, S @ V[..., None])[..., 0])


def chains(lay: Layout) -> Chains:
    """The chains of a parallel mechanism.

    Raises:
        DescriptionError: Some joint is in no serial chain from ground to the platform.
    """
    found = serial_chains(lay.mechanism)
    where = lay.mechanism.where or lay.mechanism.name
    if lay.mechanism.couplings:
        raise DescriptionError("has couplings", where, "the paper's scheme knows only chains")
    if sum(len(chain) for chain in found) != len(lay.mechanism.joints):
        what = "not every joint lies in a serial chain from ground to one platform"
        raise DescriptionError(what, where, "the paper's scheme needs that")
    if any(edge.reverse for chain in found for edge in chain):
        raise DescriptionError("a joint is declared from the platform to ground", where, "swap parent and child")
    freedoms = [list(_freedoms(lay, chain)) for chain in found]
    m = max(map(len, freedoms))
    rows = [[*row, *[_NOTHING] * (m - len(row))] for row in freedoms]
    columns, used, turns, axis, R, p = (np.array([[freedom[k] for freedom in row] for row in rows]) for k in range(6))
    turns = turns[..., None].astype(float)
    after, (K, slide) = homogeneous(R, p), np.zeros((2, *R.shape[:2], 4, 4))
    K[..., :3, :3], slide[..., :3, 3] = skew(axis) * turns[..., None], axis * (1.0 - turns)
    first = [chain[0].joint.parent_frame for chain in found]
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
    """Homogeneous matrices of rotations (..., 3, 3) and places (..., 3). Shape (..., 4, 4)."""
    T = np.broadcast_to(np.eye(4), (*p.shape[:-1], 4, 4)).copy()
    T[..., :3, :3], T[..., :3, 3] = R, p
    return T


_Freedom = tuple[int, bool, bool, Array, Array, Array]
_REST = np.eye(3), np.zeros(3)
_NOTHING: _Freedom = (0, False, False, np.zeros(3), *_REST)


def _freedoms(lay: Layout, chain: tuple[Edge, ...]) -> Iterator[_Freedom]:
    """(column, used, turns, axis, rotation after it, displacement after it) of each freedom."""
    for edge, following in zip(chain, [*chain[1:], None], strict=True):
        after = unplace(*_REST, edge.joint.child_frame)
        if following is not None:
            after = place(*after, following.joint.parent_frame)
        steps = [_REST] * (len(edge.joint.freedoms) - 1) + [after]
        for column, freedom, step in zip(lay.columns[edge.joint.name], edge.joint.freedoms, steps, strict=True):
            yield column, True, *freedom, *step


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """What the scheme arrives at, on its own time grid.

    Attributes:
        t: Time [s]. Shape (n,).
        q, w, beta: Joint coordinates [rad or m], velocities and accelerations. Shape (n, n_q).
        R, p: Where each chain puts the platform. Shapes (n, n_chain, 3, 3), (n, n_chain, 3).
    """

    t: Array
    q: Array
    w: Array
    beta: Array
    R: Array
    p: Array

    def rows(self, times: Array) -> tuple[Index, Index]:
        """Where the grid meets given times: rows of the trajectory, and of `times`."""
        last = len(self.t) - 1
        nearest = np.rint((times - self.t[0]) / (self.t[-1] - self.t[0]) * last).astype(np.intp).clip(0, last)
        met = np.flatnonzero(np.abs(self.t[nearest] - times) <= 1e-9 * max(1.0, abs(self.t[-1])))
        return nearest[met], met


def brackets(S: Array, w: Array, bracket: Bracket = screws.lie_bracket) -> Array:
    """Terms of ``w^T S_L w`` of eq. (44), for each freedom j: [V before j, S_j w_j]. Shape (..., m, 6)."""
    terms = S * w[..., None]
    return bracket(np.cumsum(terms, axis=-2) - terms, terms)


def chain_accelerations(
    side: Chains, S: Array, w: Array, A: Array, bracket: Bracket = screws.lie_bracket
) -> tuple[Array, Array]:
    """Joint accelerations of every chain by eqs. (44), (26), and the acceleration screws after each freedom.

    Args:
        S: Screws. Shape (n, n_chain, m, 6).
        w: Joint velocities. Shape (n, n_chain, m).
        A: Acceleration screw of the platform. Shape (n, 6).
        bracket: The Lie bracket of eq. (48).

    Returns:
        Shapes (n, n_chain, m), (n, n_chain, m, 6).
    """
    terms = brackets(S, w, bracket)
    beta = side.solve(S, A[:, None] - terms.sum(axis=-2))
    return beta, np.cumsum(S * beta[..., None] + terms, axis=-2)


#: Method -> its stages: the part of the step at which each looks, and its weight.
STAGES = {"euler": ((0.0, 1.0),), "rk4": ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6))}
#: Into how many parts a method divides its step.
PARTS = {"euler": 1, "rk4": 2}


def march(side: Chains, start: Array, V: Array, step: float, method: str) -> Array:
    """Steps in time: ``euler``, eq. (27), ``theta(n + 1) = theta(n) + dt w(n)``, or ``rk4``, classical, of order four.

    Args:
        start: Coordinates chain by chain. Shape (n_chain, m).
        V: Twist of the platform at the ends of all parts of the steps. Shape (parts n + 1, 6).

    Returns:
        Shape (n + 1, n_chain, m).
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
    lay: Layout,
    drive: Drive,
    step: float,
    duration: float,
    *,
    start: float = 0.0,
    twist: str = "right",
    method: str = "euler",
) -> Trajectory:
    """Runs the scheme of eqs. (15)-(27) over a trajectory, then eq. (44) for the accelerations.

    Args:
        duration: The last whole step within it ends the trajectory [s].
        start: Time of the first sample [s], at which the loops are closed.
        twist: ``right``; ``printed``, eq. (60); ``literal``, eq. (60) less what eqs. (22)-(23) subtract.
        method: ``euler``, eq. (27), or ``rk4``.

    Raises:
        ScrewgaugeError: An unknown name, no step, or a mechanism that is no set of serial chains to one platform.
    """
    if method not in PARTS:
        raise UnknownNameError("method", method, PARTS)
    if not 0.0 < step <= duration:
        raise DescriptionError(f"a step of {step:g} s in {duration:g} s", "step", "give one between 0 and the duration")
    parts, n = PARTS[method], int(duration / step * (1 + 1e-12))
    t = np.asarray(start + np.arange(parts * n + 1) * (step / parts), dtype=np.float64)
    motion = drive(t)
    V, A = platform_screws(lay, motion, t, twist)
    side = chains(lay)
    theta = march(side, side.gather(positions(lay, motion.y[:1], t[:1]).q[0]), V, step, method)
    S, R, p = side.walk(theta)
    w = side.solve(S, V[::parts, None])
    beta, _ = chain_accelerations(side, S, w, A[::parts])
    q, qd, qdd = (side.scatter(array, len(lay.mechanism.coordinates)) for array in (theta, w, beta))
    return Trajectory(t[::parts], q, qd, qdd, R, p)
