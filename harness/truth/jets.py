"""Power series in time, cut after the second order, of balls or of matrices of balls; those of the given motion.

A jet is the list of its Taylor coefficients ``[x, x', x''/2]``, as many of them as are wanted. All derivatives of the
truth come from multiplying such series; no formula for a velocity or an acceleration is written down anywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import add
from typing import Any

from flint import arb, arb_mat

from screwgauge.problem import GivenMotion
from screwgauge.truth.exact import number, vector

Jet = list[arb]
MatrixJet = list[arb_mat]
Terms = Sequence[tuple[list[arb], list[list[arb]]]]
"""For each coordinate the polynomial, lowest coefficient first, and the harmonics [omega, cos, sin]."""


def mul(a: list[Any], b: list[Any]) -> list[Any]:
    """Product of two series of equal length."""
    return [reduce(add, (a[i] * b[k - i] for i in range(k + 1))) for k in range(len(a))]


def sin_cos(q: Jet) -> tuple[Jet, Jet]:
    """Sine and cosine of a series."""
    s, c = q[0].sin_cos()
    sin, cos = [s], [c]
    if len(q) > 1:
        sin.append(c * q[1])
        cos.append(-(s * q[1]))
    if len(q) > 2:
        half = q[1] * q[1] / 2
        sin.append(c * q[2] - s * half)
        cos.append(-(s * q[2] + c * half))
    return sin, cos


def inverse_jet(T: MatrixJet) -> MatrixJet:
    """Inverse of a series of homogeneous matrices: the rotation transposed, the origin moved back. (4, 4)."""
    rows = [coefficient.tolist() for coefficient in T]
    turned = [arb_mat([[r[i][j] for i in range(3)] for j in range(3)]) for r in rows]
    origin = [arb_mat([[r[i][3]] for i in range(3)]) for r in rows]
    back = mul(turned, origin)
    return [
        arb_mat([*([*row, -p[i, 0]] for i, row in enumerate(R.tolist())), [0, 0, 0, int(k == 0)]])
        for k, (R, p) in enumerate(zip(turned, back, strict=True))
    ]


def read_terms(tables: Mapping[str, Any], labels: Sequence[str]) -> Terms:
    """Reads ``[motion.LABEL]`` tables, already checked, without rounding their numbers."""
    terms = []
    for label in labels:
        table = tables[label]
        polynomial = vector(table.get("polynomial", [0]))
        polynomial[0] += number(table.get("offset", 0))
        terms.append((polynomial, [vector(row) for row in table.get("harmonics", [])]))
    return terms


def drive(terms: Terms, t: float) -> list[Jet]:
    """Series ``[y, y', y''/2]`` of each coordinate at a time, a double taken exactly."""
    return [_one(polynomial, harmonics, arb(t)) for polynomial, harmonics in terms]


def _one(polynomial: list[arb], harmonics: list[list[arb]], t: arb) -> Jet:
    y = [arb(0), arb(0), arb(0)]
    for coefficient in reversed(polynomial):  # Horner on the series t + 1 dt
        y = [y[0] * t + coefficient, y[1] * t + y[0], y[2] * t + y[1]]
    for omega, c, s in harmonics:
        sin, cos = sin_cos([omega * t, omega, arb(0)])
        y = [y[k] + c * cos[k] + s * sin[k] for k in range(3)]
    return y


def samples(motion: GivenMotion, i: int) -> list[Jet]:
    """Series of each coordinate at one sample whose doubles are taken exactly."""
    columns = zip(motion.y[i].tolist(), motion.yd[i].tolist(), motion.ydd[i].tolist(), strict=True)
    return [[arb(y), arb(yd), arb(ydd) / 2] for y, yd, ydd in columns]
