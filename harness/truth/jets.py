"""Power series in time, cut after the second order, of balls or of matrices of balls.

A jet is the list of its Taylor coefficients ``[x, x', x''/2]``, as many of them as are wanted. All derivatives of the
truth come from multiplying such series; no formula for a velocity or an acceleration is written down anywhere.
"""

from __future__ import annotations

from functools import reduce
from operator import add
from typing import Any

from flint import arb, arb_mat

Jet = list[arb]
MatrixJet = list[arb_mat]


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


def inverse(T: MatrixJet) -> MatrixJet:
    """Inverse of a series of homogeneous matrices: the rotation transposed, the origin moved back. (4, 4)."""
    rows = [coefficient.tolist() for coefficient in T]
    turned = [arb_mat([[r[i][j] for i in range(3)] for j in range(3)]) for r in rows]
    origin = [arb_mat([[r[i][3]] for i in range(3)]) for r in rows]
    back = mul(turned, origin)
    return [
        arb_mat([*([*row, -p[i, 0]] for i, row in enumerate(R.tolist())), [0, 0, 0, int(k == 0)]])
        for k, (R, p) in enumerate(zip(turned, back, strict=True))
    ]
