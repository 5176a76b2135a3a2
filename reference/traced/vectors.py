"""Vectors and matrices of three, whose numbers are floats, arrays over samples, or nodes of a trace.

Zeros and ones of a description are floats, and fold where numbers are nodes; nothing here looks at values.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from screwgauge.reference.rotations import Array

Scalar = Any
"""A float, an array over samples, or a `trace.Node`."""
Vector = tuple[Scalar, Scalar, Scalar]
Matrix = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)
EYE: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


#: Function -> what computes it on arrays.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "atan2": np.arctan2,
    "max": np.maximum,
}


def apply(name: str, *x: Scalar) -> Scalar:
    """A function by its name, see `FUNCTIONS`."""
    for value in x:
        if hasattr(value, "op"):  # a node
            return value.trace.function(name, *x)
    found = FUNCTIONS[name](*x)
    return found if np.ndim(found) else float(found)


def sqrt(x: Scalar) -> Scalar:
    return apply("sqrt", x)


def vector(values: Array | Sequence[float]) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z


def matrix(rows: Array | Sequence[Sequence[float]]) -> Matrix:
    x, y, z = (vector(row) for row in rows)
    return x, y, z


def add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def sub(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(s: Scalar, a: Vector) -> Vector:
    return s * a[0], s * a[1], s * a[2]


def dot(a: Vector, b: Vector) -> Scalar:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def transpose(M: Matrix) -> Matrix:
    return tuple(zip(*M, strict=True))  # type: ignore[return-value]


def turn(M: Matrix, v: Vector) -> Vector:
    """``M v``."""
    return dot(M[0], v), dot(M[1], v), dot(M[2], v)


def turn_back(M: Matrix, v: Vector) -> Vector:
    """``M^T v``."""
    return turn(transpose(M), v)


def product(A: Matrix, B: Matrix) -> Matrix:
    """``A B``."""
    columns = transpose(B)
    return tuple(turn(columns, row) for row in A)  # type: ignore[return-value]


def rotation(axis: Vector, s: Scalar, c: Scalar) -> Matrix:
    """Rotation about a constant unit axis, by the sine and cosine of its angle."""

    def entry(i: int, j: int) -> Scalar:
        e = axis[i] * axis[j]
        if i == j:
            return e + c * (1.0 - e)
        third = axis[3 - i - j] * (1.0 if (j - i) % 3 == 2 else -1.0)
        return (e * (1.0 - c) if e else 0.0) + third * s

    return tuple(tuple(entry(i, j) for j in range(3)) for i in range(3))  # type: ignore[return-value]


def squares(values: Sequence[Scalar]) -> Scalar:
    """Sum of squares: unlike a maximum it costs no comparison, and NaN stays NaN."""
    return sum((v * v for v in values), start=0.0)
