"""Anchors: closed poses, each with a ball in which exactly one solution lies near the prediction.

Within the ball, the Jacobian J of the loop equations changes by less than one half, ``|J_a^+ J - 1| <= 1/2``, so that
Newton's method converges from a prediction to the only solution there (Deuflhard, Newton Methods for Nonlinear
Problems, 2011, sections 3.1 and 5.1), and its correction is at most a fifth of the distance to any other solution.
Testing only the end points does not suffice, because a kinked branch keeps the sign of det J; therefore, the ball also
bounds the second derivative.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.closed.newton import CLOSED
from screwgauge.reference.rotations import TURN, Array

Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]

#: Largest allowed change of the Jacobian between an anchor and a sample in its ball, and the target fraction of that
#: change.
CHANGE, MARGIN = 0.5, 0.8
#: Longest paths from an anchor in y [rad or mechanism lengths] and in the unknowns: half a turn would be ambiguous.
STEP, FARTHEST = 1.0, 2.0
#: Largest correction of a prediction by Newton's method, as a fraction of the distance to any other solution.
NEAR = 0.2
#: ``|J^-1|`` above which rounding of the residual rotates J by an eighth, so that meeting branches are
#: indistinguishable.
FLOOR = 6e6
#: Step of the central differences used for the Jacobian.
DIFFERENCE = 5e-6
#: Exponents p of the norms ``|s^-p U^T dJ V s^(p-1)|`` of a change dJ; it suffices that one norm is small. p = 1 gives
#: the norm of ``J^-1 dJ``, p = 0 the norm of ``dJ J^-1``. Near a pose where a leg locks, p = 1/2 takes tens of steps,
#: but p = 1 takes hundreds.
NORMS = np.array([0.0, 0.5, 1.0])
TINY = 1e-100  # smallest singular value whose powers stay finite
#: Angle [rad] or distance [mechanism lengths] by which two predictions of one pose may always differ.
SAME = 1e-3
#: Number of distances computed at a time.
BLOCK = 2**18


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """A closed pose and properties of its neighbourhood; all quantities are dimensionless.

    Attributes:
        z, y: Unknowns and independent coordinates. Shapes (n_z,), (k,).
        K: Velocity map dz/dy. Shape (n_z, k).
        W: Metric of the ball, ``dy^T W dy <= 1``. Shape (k, k).
        beta: ``|J^-1|``, the amplification of a residual.
        faint: Largest beta on the path to this anchor since beta last rose above `FLOOR`; 0 if beta is below `FLOOR`.
        U, s, Vt: Singular value decomposition of the full Jacobian, including coordinates at rest.
        power: Index of the metric in `NORMS`.
        weight: Matrix that maps a correction of the unknowns to the resulting change of J, using J's rate along the
            motion; the norm of that change is the correction relative to the distance to other solutions.
            Shape (n, n_z).
    """

    z: Array
    y: Array
    K: Array
    W: Array
    beta: float
    faint: float
    U: Array
    s: Array
    Vt: Array
    power: float
    weight: Array

    def steady(self, K: Array) -> Array:
        """Replace the velocity map of a nearby pose by this anchor's if they differ only by rounding. Shape (n_z, k).

        Near a crossing of two smooth branches, K is dominated by rounding and could divert the path to the second
        branch. At a fold, K changes by more than rounding.
        """
        explained = CLOSED * self.beta**2 * float(np.linalg.norm(self.K))
        return self.K if np.linalg.norm(K - self.K) <= explained else K

    def change(self, J: Array) -> Array:
        """Compute ``J_a^+ J - 1`` in the norm of the anchor. Shape (..., m, n) -> (..., n, n)."""
        turned = self.U.T @ J @ self.Vt.T - np.diag(self.s)
        return np.asarray(self.s[:, None] ** -self.power * turned * self.s ** (self.power - 1.0))


def offsets(K: Array) -> tuple[Array, Array]:
    """Return forward and backward steps along the columns of a velocity map, and the divisors for central differences.

    Returns:
        Shapes (2 k, n_z), (k,).
    """
    far = np.maximum(np.linalg.norm(K, axis=0), TINY)
    step = DIFFERENCE * (K / far).T
    return np.concatenate([step, -step]), 2.0 * DIFFERENCE / far


def measure(
    z: Array, y: Array, residual: Array, J: Array, full: Array, slope: Array, base: Anchor | None = None
) -> Anchor:
    """Build an anchor from a nearly closed pose: compute its velocity map and how the Jacobian changes along it.

    Args:
        z, y: Unknowns and independent coordinates of the pose. Shapes (n_z,), (k,).
        residual: Residual at the pose, which is removed by a correction of z. Shape (m,).
        J, full: Jacobian with respect to the unknowns, whose last k rows select y; and the same with columns appended
            for coordinates at rest, because a pose where one of these may begin to move is singular. Shapes (m, n_z),
            (m, n).
        slope: Derivative of the full Jacobian with respect to y. Shape (k, m, n).
        base: Anchor from which the pose was reached.
    """
    k, n_z = len(y), len(z)
    U, s, Vt = np.linalg.svd(full, full_matrices=False)
    s = np.maximum(s, TINY)
    u, c, v = (U, s, Vt) if full.shape == J.shape else np.linalg.svd(J, full_matrices=False)
    c = np.maximum(c, TINY)
    back = (v.T / c) @ u.T
    beta, faint = float(1.0 / c[-1]), base.faint if base else 0.0
    K = base.steady(back[:, -k:]) if base else back[:, -k:]
    turned, second = U.T @ slope @ Vt.T, (back @ (slope[..., :n_z] @ K)).swapaxes(0, 1)
    balls, weights = _balls(s, turned, Vt[:, :n_z], second, K)
    chosen = int(np.argmin(np.linalg.slogdet(balls)[1]))  # a long ball may be narrow across, e.g. where a leg locks
    W, power, weight = balls[chosen], float(NORMS[chosen]), weights[chosen]
    moved = z - back @ residual
    return Anchor(moved, y, K, W, beta, max(faint, beta) if beta > FLOOR else 0.0, U, s, Vt, power, weight)


def _balls(s: Array, turned: Array, Vt: Array, second: Array, K: Array) -> tuple[Array, Array]:
    """Return the metrics of the balls in each of `NORMS`, and the weights of corrections, see `Anchor`.

    Args:
        turned: Derivative of J with respect to y in the basis of J's singular vectors. Shape (k, n, n).
        second: Second derivative of the unknowns with respect to y, up to sign. Shape (n_z, k, k).

    Returns:
        Shapes (3, k, k), (3, n, n_z).
    """
    k, p = K.shape[1], NORMS[:, None]
    D = (s**-p)[:, None, :, None] * turned * (s ** (p - 1.0))[:, None, None, :]
    change = _gram(D.reshape(len(NORMS), k, -1))
    weight = (s ** (1.0 - p))[:, :, None] * Vt
    weight = weight * _steepness(change, weight @ K)[:, None, None]
    curvature = _curvature((weight @ second.reshape(len(second), -1)).reshape(*weight.shape[:2], k, k))
    W = change / (MARGIN * CHANGE) ** 2 + curvature / (2.0 * NEAR * MARGIN)
    return W + K.T @ K / FARTHEST**2 + np.eye(k) / STEP**2, weight


def _gram(D: Array) -> Array:
    """Return M in ``|sum_i D_i dy_i| <= sqrt(dy^T M dy)`` (Frobenius norm). Shape (..., k, n^2) -> (..., k, k)."""
    return np.asarray(D @ D.swapaxes(-1, -2))


def _steepness(change: Array, L: Array) -> Array:
    """Return the change of J per unit path length of the unknowns, averaged over all directions. Shape (...).

    Args:
        change: Metric of the change of J in y. Shape (..., k, k).
        L: Map from dy to the path of the unknowns, in the norm that corresponds to the norm of J. Shape (..., n, k).
    """
    return np.asarray(np.sqrt(np.trace(change, axis1=-2, axis2=-1) / np.maximum((L * L).sum((-2, -1)), TINY)))


def _curvature(second: Array) -> Array:
    """Return M in ``|second(dy, dy)| <= dy^T M dy``, the error of linear predictions. (..., n, k, k) -> (..., k, k).

    The second derivative of z with respect to y is ``-J^+ (dJ/dy K)``, weighted. Its components along an orthonormal
    basis are quadratic forms; each is bounded by the form with the absolute values of its eigenvalues.
    """
    *lead, n, k, _ = second.shape
    _, sizes, forms = np.linalg.svd(second.reshape(*lead, n, -1), full_matrices=False)
    forms = forms.reshape(*forms.shape[:-1], k, k)
    e, E = np.linalg.eigh(0.5 * (forms + forms.swapaxes(-2, -1)))
    bounds = (E * np.abs(e)[..., None, :]) @ E.swapaxes(-2, -1)
    return np.asarray((sizes[..., None, None] * bounds).sum(-3))


class Anchors:
    """A growing table of anchors that can be searched by independent coordinates.

    Attributes:
        turning: True for independent coordinates whose full turn leads back to the same pose. Shape (k,).
    """

    def __init__(self, k: int, n_z: int, angles: Flags) -> None:
        """Create an empty table; `angles` is True for unknowns that are angles, shape (n_z,)."""
        self.rows, self.angles, self.turning = list[Anchor](), angles, np.zeros(k, dtype=bool)
        kinds = [("y", float, (k,)), ("z", float, (n_z,)), ("K", float, (n_z, k)), ("W", float, (k, k)), ("sheet", int)]
        self.table = np.zeros(64, dtype=kinds)
        self.links = dict[tuple[int, int], bool]()
        self.lookups = dict[int, _Lookup]()

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, i: int) -> Anchor:
        return self.rows[i]

    @property
    def sheets(self) -> int:
        """Number of sheets, i.e. sets of anchors that lie on one branch wherever their balls overlap."""
        return int(self.table["sheet"][: len(self)].max()) + 1

    def sheet_of(self, sheet: int) -> Indices:
        """Return the numbers of the anchors of a sheet, see `sheets`."""
        return np.flatnonzero(self.table["sheet"][: len(self)] == sheet)

    def add(self, anchor: Anchor, sheet: int) -> int:
        """Store an anchor and return its number."""
        i = len(self)
        if i == len(self.table):
            self.table = np.concatenate([self.table, np.zeros_like(self.table)])
        self.rows.append(anchor)
        self.table[i] = (anchor.y, anchor.z, anchor.K, anchor.W, sheet)
        return i

    def move(self, i: int, sheet: int) -> None:
        """Move an anchor to the given sheet."""
        for changed in (int(self.table["sheet"][i]), sheet):
            self.lookups.pop(changed, None)
        self.table["sheet"][i] = sheet

    def shrink(self, i: int) -> None:
        """Halve the radius of the ball of an anchor whose prediction failed."""
        self.table["W"][i] *= 4.0

    def turn(self, i: int) -> None:
        """Record that a full turn of independent coordinate i leads back to the same pose."""
        self.turning[i] = True
        self.lookups.clear()
        self.links.clear()

    # predictions

    def difference(self, y: Array, origin: Array) -> Array:
        """Return the difference between y and an origin, modulo full turns. Shapes (..., k)."""
        way = y - origin
        return way - TURN * np.rint(way / TURN) * self.turning if self.turning.any() else way

    def distance(self, y: Array, a: Indices | int) -> Array:
        """Return the distances of y from anchors, 1 at the edge of a ball. Shapes (..., k), (...) -> (...)."""
        way, W = self.difference(y, self.table["y"][a]), self.table["W"][a]
        return np.asarray(np.sqrt((np.matmul(way[..., None, :], W)[..., 0, :] * way).sum(-1)))

    def distances(self, y: Array, a: Indices) -> Array:
        """Return the distances of points from the anchor of their sample. Shapes (n, ..., k), (n,) -> (n, ...)."""
        squared = np.empty(y.shape[:-1])
        for rows, i in _groups(a):
            way = self.difference(y[rows], self.table["y"][i])
            squared[rows] = ((way @ self.table["W"][i]) * way).sum(-1)
        return np.sqrt(squared)

    def predict(self, y: Array, a: Indices) -> Array:
        """Predict unknowns to first order, with y modulo full turns. Shapes (n, k), (n,) -> (n, n_z)."""
        z = np.empty((len(y), len(self.angles)))
        for rows, i in _groups(a):
            z[rows] = self.table["z"][i] + self.difference(y[rows], self.table["y"][i]) @ self.table["K"][i].T
        return z

    def corrections(self, z: Array, a: Indices) -> Array:
        """Divide corrections of unknowns by the distance to other solutions. Shape (n, n_z) -> (n,).

        The result is inf if a correction exceeds 1.
        """
        norm = np.empty(len(z))
        for rows, i in _groups(a):
            norm[rows] = np.linalg.norm(z[rows] @ self[i].weight.T, axis=1)
        return np.where(np.abs(z).max(axis=1, initial=0.0) < 1.0, norm, np.inf)

    def on_one_branch(self, a: int, b: int) -> bool:
        """Return True if anchors with intersecting balls lie on one branch, i.e. if predictions agree half-way."""
        if (a, b) not in self.links:
            way = self.difference(self[b].y, self[a].y)
            middle, pair = (self[a].y + 0.5 * way)[None], (np.array([a]), np.array([b]))
            ours, theirs = (self.predict(middle, one)[0] for one in pair)
            gap = ours - theirs
            gap = np.where(self.angles, gap - TURN * np.rint(gap / TURN), gap)
            bend = np.abs((self[a].K - self[b].K) @ way).max(initial=0.0)  # several times the first-order error
            self.links[a, b] = self.links[b, a] = bool(np.abs(gap).max(initial=0.0) <= max(bend, SAME))
        return self.links[a, b]

    # lookup

    def cover(self, y: Array, sheet: int) -> tuple[Indices, Flags]:
        """Find the nearest anchors of a sheet, and whether y lies in their balls. Shape (n, k) -> (n,), (n,).

        If y lies outside the ball of the nearest anchor, choose among the nearest eight anchors by `distance`.
        """
        look = self.lookups.get(sheet)
        if look is None or look.count != len(self):
            look = self.lookups[sheet] = _Lookup(self, sheet)
        nearest = look.nearest(y, 1)[:, 0]
        inside = self.distances(y, nearest) <= 1.0
        outside = np.flatnonzero(~inside)
        if outside.size and len(look.rows) > 1:
            some = look.nearest(y[outside], min(8, len(look.rows)))
            far = self.distance(y[outside][:, None], some)
            best = np.argmin(far, axis=1)
            pick = np.arange(len(outside)), best
            nearest[outside], inside[outside] = some[pick], far[pick] <= 1.0
        return nearest, inside


def _groups(a: Indices) -> Iterator[tuple[Indices, int]]:
    """Yield the rows of samples that share an anchor, and that anchor."""
    if len(a) == 1:
        yield np.zeros(1, dtype=np.intp), int(a[0])
        return
    order = np.argsort(a, kind="stable")
    ends = np.flatnonzero(np.diff(a[order])) + 1
    for rows in np.split(order, ends) if len(a) else ():
        yield rows, int(a[rows[0]])


class _Lookup:
    """Search table over the anchors of a sheet; a periodic coordinate is represented on the unit circle.

    Attributes:
        count: Number of all anchors at the time of construction.
    """

    def __init__(self, anchors: Anchors, sheet: int) -> None:
        self.count, self.rows, self.turning = len(anchors), anchors.sheet_of(sheet), anchors.turning
        self.points = self._points(anchors.table["y"][self.rows])
        self.squares = (self.points * self.points).sum(-1)

    def _points(self, y: Array) -> Array:
        if not self.turning.any():
            return y
        angles = y[:, self.turning]
        return np.concatenate([y[:, ~self.turning], np.cos(angles), np.sin(angles)], axis=1)

    def nearest(self, y: Array, m: int) -> Indices:
        """Return the m nearest anchors for each y. Shape (n, k) -> (n, m)."""
        places = np.empty((len(y), m), dtype=np.intp)
        some = max(1, BLOCK // len(self.rows))
        for first in range(0, len(y), some):
            far = self.squares - 2.0 * self._points(y[first : first + some]) @ self.points.T
            pick = np.argmin(far, axis=1)[:, None] if m == 1 else np.argpartition(far, m - 1, axis=1)[:, :m]
            places[first : first + some] = pick
        return np.asarray(self.rows[places])
