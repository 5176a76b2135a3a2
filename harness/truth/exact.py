"""Number types of the engine `truth`: balls (arb) read from text, their matrices, and power series in time (jets).

Decimals become exact rationals, and expressions become enclosures. A jet is the list of its Taylor coefficients ``[x,
x', x''/2]``, up to the requested order. All derivatives follow from products of such series; the code
contains no formulas for velocities or accelerations.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from functools import cache, reduce
from operator import add
from typing import Any

from flint import arb, arb_mat, ctx, fmpq

from screwgauge.problem import GivenMotion

Vector = list[arb]

_OPERATIONS: dict[type, Callable[[arb, arb], arb]] = {
    getattr(ast, name): getattr(operator, function)
    for name, function in (("Add", "add"), ("Sub", "sub"), ("Mult", "mul"), ("Div", "truediv"), ("Pow", "pow"))
}
_FUNCTIONS: dict[str, Callable[..., arb]] = {
    name: getattr(arb, name) for name in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan")
}
_FUNCTIONS["atan2"] = arb.atan2


#: A decimal with at least this number of digits counts as possibly rounded.
LONG = 15
#: Rounding of a computed double relative to its value: four units in the last place.
ROUNDED = 2.0**-50


def number(value: Any) -> arb:
    """Enclose an entry's value in a ball of the working precision.

    Args:
        value: A checked entry of a description: an int or a string. Floats and balls are converted exactly.
    """
    if isinstance(value, (float, arb)):
        return arb(value)
    text = str(value).strip()
    return _evaluate(ast.parse(text, mode="eval").body, text)


def _evaluate(node: ast.expr, text: str) -> arb:
    match node:
        case ast.Constant(value=int() as value):
            return arb(value)
        case ast.Constant():  # use the source text, because the parser has already rounded the value
            exact = Fraction((ast.get_source_segment(text, node) or "").replace("_", ""))
            return arb(fmpq(exact.numerator, exact.denominator))
        case ast.Name(id="pi"):
            return arb.pi()
        case ast.Name(id="deg"):
            return arb.pi() / 180
        case ast.UnaryOp(op=op, operand=operand):
            inner = _evaluate(operand, text)
            return -inner if isinstance(op, ast.USub) else inner
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATIONS[type(op)](_evaluate(left, text), _evaluate(right, text))
        case ast.Call(func=ast.Name(id=name), args=given):
            return _FUNCTIONS[name](*(_evaluate(argument, text) for argument in given))
    raise ValueError(f"'{text}' cannot be read as a number")


def widen_decimals(value: Any) -> Any:
    """Widen decimals of at least `LONG` digits in a table to balls that contain all numbers that round to them.

    The radius is half a unit of the last digit, or the rounding of the vector's largest double if this is larger.
    """
    if isinstance(value, Mapping):
        return {key: widen_decimals(entry) for key, entry in value.items()}
    if not isinstance(value, list):
        return widen_decimals([value])[0]
    if any(isinstance(entry, (list, Mapping)) for entry in value):
        return [widen_decimals(entry) for entry in value]
    rounding = max((abs(number(entry)).upper() for entry in value), key=float) * ROUNDED if value else arb(0)
    return [_widen(entry, rounding) for entry in value]


def _widen(value: Any, rounding: arb) -> Any:
    try:
        _, digits, exponent = Decimal(str(value)).as_tuple()
    except InvalidOperation:  # an expression
        return value
    if len(digits) < LONG or not isinstance(exponent, int):
        return value
    return number(value) + arb(0, max(rounding, arb(10) ** exponent / 2, key=float))


def vector(values: Any) -> Vector:
    """Convert a list of numbers to balls."""
    return [number(value) for value in values]


def unit_vector(values: Any) -> Vector:
    """Convert a vector to balls, and normalise it because its decimals may be rounded."""
    return normalize(vector(values))


def normalize(v: Vector) -> Vector:
    norm = dot(v, v).sqrt()
    return [x / norm for x in v]


def rotation_matrix(value: Any) -> arb_mat:
    """Read ``{axis, angle}``, ``{matrix}`` or a list of them, multiplied left to right. Shape (3, 3)."""
    result = identity(3)
    for step in value if isinstance(value, list) else [value]:
        if "matrix" in step:
            result = result * _orthonormal(step["matrix"])
        else:
            angle = number(step["angle"])
            A = skew(unit_vector(step["axis"]))
            result = result * (identity(3) + A * angle.sin() + (A * A) * (1 - angle.cos()))
    return result


def _orthonormal(rows: Any) -> arb_mat:
    """Orthonormalise a matrix with the Gram-Schmidt method, because its decimals may be rounded."""
    first = unit_vector(rows[0])
    second = vector(rows[1])
    along = dot(first, second)
    second = normalize(difference(second, [along * x for x in first]))
    return arb_mat([first, second, cross(first, second)])


def placement(table: Mapping[str, Any]) -> arb_mat:
    """Convert a frame ``{position, rotation}`` to a homogeneous matrix. Shape (4, 4)."""
    return rigid(rotation_matrix(table.get("rotation", [])), vector(table.get("position", [0, 0, 0])))


def rigid(R: arb_mat, p: Vector) -> arb_mat:
    """Build the homogeneous transform from a rotation and an origin. Shape (4, 4)."""
    rows = R.tolist()
    return arb_mat([*([*rows[i], p[i]] for i in range(3)), [0, 0, 0, 1]])


def inverse(T: arb_mat) -> arb_mat:
    """Invert a homogeneous matrix with an orthonormal rotation. Shape (4, 4)."""
    r = T.tolist()
    columns = [[r[0][j], r[1][j], r[2][j]] for j in range(3)]
    p = [r[0][3], r[1][3], r[2][3]]
    return arb_mat([*([*c, -dot(c, p)] for c in columns), [0, 0, 0, 1]])


@cache
def identity(n: int) -> arb_mat:
    return arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


def solve(A: arb_mat, b: arb_mat) -> arb_mat:
    """Enclose the solution of ``A x = b``.

    Elimination is ten times as fast as preconditioning, but its balls are wider. If they lose more than three eighths
    of the digits, or if elimination fails, preconditioning is used.

    Raises:
        ZeroDivisionError: A may be singular.
    """
    try:
        x = A.solve(b, algorithm="lu")
        if all(ball.rel_one_accuracy_bits() > 5 * ctx.prec // 8 for ball in x.entries()):
            return x
    except ZeroDivisionError:
        pass
    return A.solve(b, algorithm="precond")


def skew(v: Vector) -> arb_mat:
    """Return the matrix of the cross product. Shape (3, 3)."""
    x, y, z = v
    return arb_mat([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def dot(a: Vector, b: Vector) -> arb:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def difference(a: Vector, b: Vector) -> Vector:
    return [x - y for x, y in zip(a, b, strict=True)]


def cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


Jet = list[arb]
MatrixJet = list[arb_mat]
Terms = Sequence[tuple[list[arb], list[list[arb]]]]
"""Polynomial of each coordinate, lowest power first, and its harmonics [omega, cos, sin]."""


def mul(a: list[Any], b: list[Any]) -> list[Any]:
    """Multiply two series of equal length."""
    return [reduce(add, (a[i] * b[k - i] for i in range(k + 1))) for k in range(len(a))]


def sin_cos(q: Jet) -> tuple[Jet, Jet]:
    """Return sine and cosine of a series."""
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
    """Invert a series of homogeneous matrices by transposing the rotation. (4, 4)."""
    rows = [coefficient.tolist() for coefficient in T]
    turned = [arb_mat([[r[i][j] for i in range(3)] for j in range(3)]) for r in rows]
    origin = [arb_mat([[r[i][3]] for i in range(3)]) for r in rows]
    back = mul(turned, origin)
    return [
        arb_mat([*([*row, -p[i, 0]] for i, row in enumerate(R.tolist())), [0, 0, 0, int(k == 0)]])
        for k, (R, p) in enumerate(zip(turned, back, strict=True))
    ]


def read_terms(tables: Mapping[str, Any], labels: Sequence[str]) -> Terms:
    """Read validated ``[motion.LABEL]`` tables without rounding their numbers."""
    terms = []
    for label in labels:
        table = tables[label]
        polynomial = vector(table.get("polynomial", [0]))
        polynomial[0] += number(table.get("offset", 0))
        terms.append((polynomial, [vector(row) for row in table.get("harmonics", [])]))
    return terms


def drive(terms: Terms, t: float) -> list[Jet]:
    """Return the series ``[y, y', y''/2]`` of each coordinate at time t, which is treated as exact."""
    return [_jet(polynomial, harmonics, arb(t)) for polynomial, harmonics in terms]


def _jet(polynomial: list[arb], harmonics: list[list[arb]], t: arb) -> Jet:
    y = [arb(0), arb(0), arb(0)]
    for coefficient in reversed(polynomial):  # Horner on the series t + 1 dt
        y = [y[0] * t + coefficient, y[1] * t + y[0], y[2] * t + y[1]]
    for omega, c, s in harmonics:
        sin, cos = sin_cos([omega * t, omega, arb(0)])
        y = [y[k] + c * cos[k] + s * sin[k] for k in range(3)]
    return y


def samples(motion: GivenMotion, i: int) -> list[Jet]:
    """Return the series of each coordinate at one sample, whose numbers are treated as exact."""
    columns = zip(motion.y[i].tolist(), motion.yd[i].tolist(), motion.ydd[i].tolist(), strict=True)
    return [[arb(y), arb(yd), arb(ydd) / 2] for y, yd, ydd in columns]
