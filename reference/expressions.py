"""Reads numbers, vectors and rotations of a description, given as decimals or expressions."""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from screwgauge.reference.errors import DescriptionError, quote
from screwgauge.reference.files import check_count
from screwgauge.reference.rotations import Array, rotation

_BINARY: dict[type, Callable[[float, float], float]] = {
    getattr(ast, name): getattr(operator, function)
    for name, function in (("Add", "add"), ("Sub", "sub"), ("Mult", "mul"), ("Div", "truediv"), ("Pow", "pow"))
}
_CONSTANTS = {"pi": math.pi, "deg": math.pi / 180}
#: Name -> function and number of arguments.
_FUNCTIONS = {name: (getattr(math, name), 1) for name in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan")}
_FUNCTIONS["atan2"] = math.atan2, 2
#: Decimals that `float` and Python's grammar read identically; `float` takes a tenth of the time.
_DECIMAL = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?(e[+-]?[0-9]+)?", re.ASCII)
#: Largest accepted number: products of three such numbers stay finite.
LARGEST = 1e100
_REASONS = {ZeroDivisionError: "division by zero", OverflowError: "not finite", RecursionError: "too deeply nested"}


def _evaluate(node: ast.expr) -> float:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return float(value)
        case ast.Name(id=name) if name in _CONSTANTS:
            return _CONSTANTS[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_evaluate(operand)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _evaluate(operand)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](_evaluate(left), _evaluate(right))
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in _FUNCTIONS:
            function, count = _FUNCTIONS[name]
            if len(given) == count:
                return float(function(*map(_evaluate, given)))
    raise ValueError("only numbers, pi, deg, + - * / **, sqrt and trigonometric functions are allowed")


@lru_cache(maxsize=4096)
def _parse(text: str) -> float:
    """Parse an expression; cache the result because descriptions repeat numbers that are slow to parse."""
    if _DECIMAL.fullmatch(text):
        return float(text)
    with warnings.catch_warnings():  # Python's parser warns about "1if"
        warnings.simplefilter("ignore")
        return _evaluate(ast.parse(text, mode="eval").body)


def number(value: Any, where: str) -> float:
    """Read a finite number, given as a number or as a string such as ``"3*sqrt(3)/10"``.

    Raises:
        DescriptionError: The value is not a finite number, or is too large.
    """
    check_count(len(value) if isinstance(value, str) else 0, "characters", where)
    try:
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            raise ValueError("not a number")
        result = _parse(value.strip()) if isinstance(value, str) else float(value)
        if not (isinstance(result, float) and math.isfinite(result)):
            raise ValueError("not a finite real number")
        if abs(result) > LARGEST:
            raise ValueError(f"larger than {LARGEST:g}")
    except (ValueError, SyntaxError, ArithmeticError, TypeError, RecursionError, MemoryError) as error:
        reason = error.args[0] if type(error) is ValueError else _REASONS.get(type(error), "not an expression")
        what = f"{quote(value)} cannot be read as a number ({reason})"
        raise DescriptionError(what, where, 'write 0.5 or "3*sqrt(3)/10"') from None
    return result


def vector(value: Any, where: str, size: int = 3) -> Array:
    """Read a list of `size` numbers. Shape (size,)."""
    if not isinstance(value, list) or len(value) != size:
        count = f"{size} number{'s' * (size > 1)}"
        remedy = f"write {count} in brackets, such as {[*range(size)]}"
        raise DescriptionError(f"{quote(value)} is not a list of {count}", where, remedy)
    return np.array([number(item, where) for item in value])


def unit_vector(value: Any, where: str) -> Array:
    """Read a unit vector; expressions such as ``"1/sqrt(2)"`` achieve the required accuracy.

    Raises:
        DescriptionError: The norm differs from 1 by more than 1e-12.
    """
    axis = vector(value, where)
    norm = float(np.linalg.norm(axis))
    if norm == 0.0:
        raise DescriptionError("the axis is zero", where, "write a unit vector")
    if abs(norm - 1.0) > 1e-12:
        raise DescriptionError(f"axis {axis.tolist()} has norm {norm:.15g}, not 1", where, "divide by its norm")
    return axis / norm


def rotation_matrix(value: Any, where: str) -> Array:
    """Read ``{axis, angle}``, ``{matrix}``, or a list of rotations, multiplied from left to right. Shape (3, 3)."""
    result = np.eye(3)
    for step in value if isinstance(value, list) else [value]:
        if isinstance(step, dict) and set(step) == {"matrix"}:
            result = result @ _orthonormal(step["matrix"], where)
        elif isinstance(step, dict) and set(step) == {"axis", "angle"}:
            axis = unit_vector(step["axis"], where)
            result = result @ rotation(axis, np.array(number(step["angle"], where)))
        else:
            remedy = "write {axis = [0, 0, 1], angle = 'pi/2'}"
            raise DescriptionError(f"rotation {quote(step)} is not valid", where, remedy)
    # cos("pi/2") evaluates to 2e-16; restore intended zeros
    return np.where(np.abs(result) < 4e-16, 0.0, result)


def _orthonormal(rows: Any, where: str) -> Array:
    if not isinstance(rows, list) or len(rows) != 3:
        raise DescriptionError(f"{quote(rows)} is not a matrix", where, "write three rows of three numbers")
    R = np.array([vector(row, where) for row in rows])
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-12 or np.linalg.det(R) < 0.0:
        raise DescriptionError(f"{R.tolist()} is not a rotation", where, "use orthonormal, right-handed rows")
    return R
