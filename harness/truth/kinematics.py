"""Velocities and accelerations of a certified pose, by power series in time.

The closing equations hold at every time, so every coefficient of their series is zero; solved order by order they
give the series of the joint coordinates. The bodies' motion is read off the series of their matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flint import arb, arb_mat

from screwgauge.truth.certify import Certifier, NotCertified, check_near
from screwgauge.truth.exact import Vector, solve
from screwgauge.truth.jets import Jet, MatrixJet
from screwgauge.truth.linkage import Linkage, error


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The motion at one time, in balls.

    Attributes:
        q: Series ``[q, q', q''/2]`` of each joint coordinate.
        partial: ``d q / d y``, (n_q, k).
        bodies: Series of the homogeneous matrix of each body, ground first.
    """

    q: list[Jet]
    partial: arb_mat
    bodies: list[MatrixJet]


def state(certifier: Certifier, y: Sequence[Jet], start: Sequence[float]) -> State:
    """Positions, velocities and accelerations for the series of the independent coordinates.

    Raises:
        NotCertified: A ball cannot be proved or is not finite.
    """
    linkage = certifier.linkage
    q0, J, rows = certifier.solve([x[0] for x in y], start)
    n, k = len(q0), len(y)
    unit = [[int(j == i) for j in range(k)] for i in range(k)]
    partial = _solve(J, arb_mat([*([[0] * k] * (n - k)), *unit]))
    q1 = (partial * arb_mat([[x[1]] for x in y])).entries()
    q: list[Jet] = [[a, b, arb(0)] for a, b in zip(q0, q1, strict=True)]
    left = [e for G in linkage.close(q, linkage.place(q)) for e in error(G[2])]
    left += [*(tie.error(q)[2] for tie in linkage.ties), *(-x[2] for x in y)]
    q2 = _solve(J, arb_mat([[-left[i]] for i in rows])).entries()
    q = [[a, b, c] for a, b, c in zip(q0, q1, q2, strict=True)]
    return State(q, partial, linkage.place(q))


def _solve(J: arb_mat, right: arb_mat) -> arb_mat:
    try:
        return solve(J, right)
    except ZeroDivisionError:
        raise NotCertified("the closing equations may be singular", "", "keep the motion away from this pose") from None


class LoopsOpen(NotCertified):
    """Redundant loops that do not close."""


def check_closed(linkage: Linkage, q: Sequence[Jet], bodies: Sequence[MatrixJet]) -> None:
    """Every coefficient of every closing error, couplings' too, must hold zero, those left out of the solution too.

    Raises:
        LoopsOpen: One does not.
    """
    ways = linkage.close(q, bodies)
    for G in ways:
        check_near(G[0])
    errors = [e for G in ways for coefficient in G for e in error(coefficient)]
    errors += [e for tie in linkage.ties for e in tie.error(q)]
    gap = max((float(e.abs_lower()) for e in errors), default=0.0)
    if gap:
        what = f"redundant loops stay open by {gap:.1g} (rad, m or their derivatives in time)"
        remedy = "give lengths and angles as expressions such as 'sqrt(2)', or with 15 digits at least"
        raise LoopsOpen(what, "", remedy)


def spin(T: MatrixJet, order: int) -> Vector:
    """Angular velocity (order 1) or acceleration (order 2) in world axes: axial part of ``R' R^T``, ``R'' R^T``."""
    a, b = T[order].tolist(), T[0].tolist()
    factor = arb(order) / 2  # the axial part halves, the second coefficient is half the second derivative

    def entry(i: int, j: int) -> arb:
        return a[i][0] * b[j][0] + a[i][1] * b[j][1] + a[i][2] * b[j][2]

    return [factor * (entry(i, j) - entry(j, i)) for i, j in ((2, 1), (0, 2), (1, 0))]


def point(T: arb_mat, r: Vector, w: int = 1) -> Vector:
    """A matrix applied to a point of the body (w = 1) or to a direction (w = 0)."""
    return [row[0] * r[0] + row[1] * r[1] + row[2] * r[2] + row[3] * w for row in T.tolist()[:3]]
