"""Certified closed poses, and their velocities and accelerations, in balls.

Any guess may serve as the start, because the start is not trusted. Newton's method in high precision is followed by an
interval Newton step: if Krawczyk's operator maps a small box into its own interior, the box contains exactly one
solution of the loop equations, and the image encloses this solution. The equations hold at every time, so every
coefficient of their power series is zero. Solving them order by order yields the series of the joint coordinates; the
motion of the bodies then follows from the series of their matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import arb, arb_mat, ctx

from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array
from screwgauge.truth.exact import Jet, MatrixJet, Vector, identity, solve
from screwgauge.truth.linkage import Linkage, error

NEWTON = 40  # largest number of steps; four suffice from a start in double precision, poor starts need more


class NotCertified(ScrewgaugeError):
    """Raised for a pose or forces whose enclosure cannot be proved."""


def _singular() -> NotCertified:
    return NotCertified("the closing equations are singular", "", "keep the motion away from this pose")


def independent_rows(J: Array, n: int) -> list[int]:
    """Select n independent rows of dimensionless J, preferably the last (selection) rows; all rows if J has only n.

    A mechanism with redundant constraints has more closing equations than coordinates. Rows that are not selected are
    only checked: they must hold within the enclosures.
    """
    if len(J) == n:
        return list(range(n))
    rest = J.copy()
    chosen: list[int] = []
    order = list(range(len(J)))[::-1]
    for _ in range(n):
        size = np.linalg.norm(rest, axis=1)
        size[chosen] = -1.0
        best = max(order, key=lambda i: size[i] * (1.0 + 1e-9 * i))
        if size[best] < 1e-9:
            raise _singular()
        chosen.append(best)
        unit = rest[best] / size[best]
        rest = rest - np.outer(rest @ unit, unit)
    return sorted(chosen)


def check_near(G: arb_mat) -> None:
    """Reject a loop whose closing error is a rotation by more than a right angle."""
    if not G[0, 0] + G[1, 1] + G[2, 2] > 1:
        raise NotCertified("a loop is far from closed", "", "check the motion")


class Certifier:
    """Solver that encloses the joint coordinates of a linkage for given independent coordinates."""

    def __init__(self, linkage: Linkage) -> None:
        self.linkage = linkage
        units = np.array([linkage.length if unit == "m" else 1.0 for unit in linkage.mechanism.units])
        self.n, self.columns = len(units), units
        closing = np.tile(np.repeat([1.0, linkage.length], 3), len(linkage.cuts))
        tied = units[[tie.column for tie in linkage.ties]]
        self.rows = np.concatenate([closing, tied, units[linkage.mechanism.independent_columns]])

    def solve(self, y: Sequence[arb], start: Sequence[float]) -> tuple[list[arb], arb_mat, list[int]]:
        """Enclose the joint coordinates.

        Args:
            y: Independent coordinates.
            start: An unverified guess of all joint coordinates.

        Returns:
            Balls of the coordinates, the square Jacobian of the chosen rows over these balls, and the chosen rows.

        Raises:
            NotCertified: No box could be verified.
        """
        J = floats(self.linkage.jacobian([arb(x) for x in start]))
        rows = independent_rows(J * self.columns / self.rows[:, None], self.n)
        for J_start in (J, None):  # None is tried only if the first attempt fails
            try:
                return *self._verify(*self._newton(start, y, rows, J_start), y, rows), rows
            except NotCertified as error:
                reason = error
            except (np.linalg.LinAlgError, ZeroDivisionError):
                reason = _singular()
        raise reason

    def _newton(
        self, start: Sequence[float], y: Sequence[arb], rows: Sequence[int], J: Array | None
    ) -> tuple[list[arb], arb_mat]:
        """Run Newton's method; return a pose and an approximate inverse of its Jacobian.

        Args:
            J: Jacobian at the start in doubles, used in all steps. If None, every step computes a Jacobian in full
                precision, because doubles have too few digits near a singular pose.
        """
        m = [arb(x) for x in start]
        fixed = None if J is None else arb_mat(np.linalg.inv(J[rows]).tolist())
        last = 1e3  # larger steps do not converge [rad or m]
        for _ in range(NEWTON):
            Y = _midpoints(self._square(m, rows).inv()) if fixed is None else fixed
            d = (Y * self._error(m, y, rows)).entries()
            size = max(float(x.abs_upper()) for x in d)
            if fixed is not None and not size < last:  # converged down to rounding, or diverged
                break
            m = [(x - dx).mid() for x, dx in zip(m, d, strict=True)]
            last = size / 2
            if size < 2.0 ** (40 - ctx.prec):
                break
        return m, Y

    def _square(self, q: Sequence[arb], rows: Sequence[int]) -> arb_mat:
        """Return the Jacobian of the selected rows. Shape (n, n)."""
        table = self.linkage.jacobian(q).tolist()
        return arb_mat([table[i] for i in rows])

    def _error(self, q: Sequence[arb], y: Sequence[arb], rows: Sequence[int]) -> arb_mat:
        """Return the selected rows of the errors of loops, of couplings, and of ``q - y``. Shape (n_q, 1)."""
        jets = [[x] for x in q]
        errors: list[arb] = []
        for (G,) in self.linkage.close(jets, self.linkage.place(jets)):
            check_near(G)
            errors += error(G)
        errors += [tie.error(jets)[0] for tie in self.linkage.ties]
        chosen = self.linkage.mechanism.independent_columns
        errors += [q[column] - goal for column, goal in zip(chosen, y, strict=True)]
        return arb_mat([[errors[i]] for i in rows])

    def _verify(self, m: list[arb], Y: arb_mat, y: Sequence[arb], rows: Sequence[int]) -> tuple[list[arb], arb_mat]:
        d = Y * self._error(m, y, rows)
        r = max((x.abs_upper() for x in d.entries()), key=float) * 5 / 4 + arb(2) ** (8 - ctx.prec)
        for _ in range(3):
            radius = float(r)
            box = [arb(x, radius) for x in m]
            J = self._square(box, rows)
            offset = arb_mat([[arb(0, radius)] for _ in m])
            step = (identity(self.n) - Y * J) * offset - d
            image = [x + dx for x, dx in zip(m, step.entries(), strict=True)]
            if all(b.contains_interior(k) for b, k in zip(box, image, strict=True)):
                return image, self._square(image, rows)
            r = r * 64
        raise NotCertified("Krawczyk's test failed", "", "keep the motion away from singular poses")


def floats(M: arb_mat) -> Array:
    """Return the midpoints as doubles."""
    return np.array([[float(x.mid()) for x in row] for row in M.tolist()])


def _midpoints(M: arb_mat) -> arb_mat:
    return arb_mat([[x.mid() for x in row] for row in M.tolist()])


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Motion at one instant, in balls.

    Attributes:
        q: Series ``[q, q', q''/2]`` of each joint coordinate.
        partial: ``d q / d y``, (n_q, k).
        bodies: Series of the homogeneous matrix of each body, ground first.
    """

    q: list[Jet]
    partial: arb_mat
    bodies: list[MatrixJet]


def state(certifier: Certifier, y: Sequence[Jet], start: Sequence[float]) -> State:
    """Compute positions, velocities and accelerations from the series of independent coordinates.

    Raises:
        NotCertified: The pose cannot be enclosed, or the closing equations may be singular.
    """
    linkage = certifier.linkage
    q0, J, rows = certifier.solve([x[0] for x in y], start)
    n, k = len(q0), len(y)
    unit = [[int(j == i) for j in range(k)] for i in range(k)]
    partial = _solve(J, arb_mat([*([[0] * k] * (n - k)), *unit]))
    q1 = (partial * arb_mat([[x[1]] for x in y])).entries()
    q: list[Jet] = [[a, b, arb(0)] for a, b in zip(q0, q1, strict=True)]
    remainder = [e for G in linkage.close(q, linkage.place(q)) for e in error(G[2])]
    remainder += [*(tie.error(q)[2] for tie in linkage.ties), *(-x[2] for x in y)]
    q2 = _solve(J, arb_mat([[-remainder[i]] for i in rows])).entries()
    q = [[a, b, c] for a, b, c in zip(q0, q1, q2, strict=True)]
    return State(q, partial, linkage.place(q))


def _solve(J: arb_mat, right: arb_mat) -> arb_mat:
    try:
        return solve(J, right)
    except ZeroDivisionError:
        raise NotCertified("the closing equations may be singular", "", "keep the motion away from this pose") from None


class LoopsOpen(NotCertified):
    """Raised when redundant loops do not close."""


#: Remedy for rounded decimals of redundant loops.
EXPRESSIONS = "write lengths and angles as expressions such as 'sqrt(2)', or with at least 15 digits"


def redundant_rows(linkage: Linkage) -> int:
    """Return the number of closing rows, including couplings, beyond those needed to determine the coordinates."""
    mechanism = linkage.mechanism
    rows = 6 * len(linkage.cuts) + len(linkage.ties) + len(mechanism.independent_columns)
    return rows - len(mechanism.coordinates)


def coarse_decimals(linkage: Linkage, reason: str) -> LoopsOpen:
    """Build the error for a motion that exact decimals determine, but that cannot be enclosed with rounded decimals.

    Args:
        reason: Why the motion could not be enclosed.
    """
    what = (
        f"{redundant_rows(linkage)} redundant closing equations do not hold because the decimals are rounded too "
        f"coarsely to enclose the motion here ({reason})"
    )
    return LoopsOpen(what, "", "write lengths and angles as expressions such as 'sqrt(2)'")


def check_closed(linkage: Linkage, q: Sequence[Jet], bodies: Sequence[MatrixJet]) -> None:
    """Require the enclosure of every closing error, including couplings and unused rows, to contain zero.

    Raises:
        LoopsOpen: The enclosure of a closing error does not contain zero.
        NotCertified: A loop is far from closed.
    """
    ways = linkage.close(q, bodies)
    for G in ways:
        check_near(G[0])
    errors = [e for G in ways for coefficient in G for e in error(coefficient)]
    errors += [e for tie in linkage.ties for e in tie.error(q)]
    gap = max((float(e.abs_lower()) for e in errors), default=0.0)
    if gap:
        size = f"{gap:.1g} (rad, m or their derivatives in time)"
        what = f"{redundant_rows(linkage)} redundant closing equations are violated by at least {size}"
        raise LoopsOpen(what, "", EXPRESSIONS)


def spin(T: MatrixJet, order: int) -> Vector:
    """Return angular velocity (order 1) or acceleration (2) in world axes: axial part of ``R' R^T``, ``R'' R^T``."""
    a, b = T[order].tolist(), T[0].tolist()
    factor = arb(order) / 2  # the axial part has a factor 1/2, and the second coefficient is half the derivative

    def entry(i: int, j: int) -> arb:
        return a[i][0] * b[j][0] + a[i][1] * b[j][1] + a[i][2] * b[j][2]

    return [factor * (entry(i, j) - entry(j, i)) for i, j in ((2, 1), (0, 2), (1, 0))]


def point(T: arb_mat, r: Vector, w: int = 1) -> Vector:
    """Apply a matrix to a body's point (w = 1) or direction (w = 0)."""
    return [row[0] * r[0] + row[1] * r[1] + row[2] * r[2] + row[3] * w for row in T.tolist()[:3]]
