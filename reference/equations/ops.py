"""Scalar types: elementary functions and linear solvers for float arrays and for nodes of a trace.

Only this module depends on the scalar type.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.equations.screws import Array, times, transpose
from screwgauge.reference.traced.trace import Factors, apply

Block = tuple[slice, Sequence[int], Array]
"""Rows, columns and entries, shape (..., r, c), of a part of a matrix."""


class System(Protocol):
    """A linear system ``A x = b`` with full column rank, m >= n, and consistent right-hand sides.

    The first columns belong to moving unknowns; the remaining columns, of unknowns at rest, only affect the transposed
    system.

    Attributes:
        exact: True if `response` is exact.
        A: Dimensionless matrix; only for floats. Shape (..., m, n).
        inverse: Inverse for moving unknowns; only for floats. Shape (..., moving, m).
        condition, whole_condition: Condition numbers for moving and for all unknowns; only for floats. Shape (...).
    """

    exact: bool
    condition: Any
    whole_condition: Any
    A: Array
    inverse: Array

    def solve(self, b: Array) -> Array:
        """Solve for the moving unknowns. Shape (..., m) -> (..., moving)."""

    def solve_transposed(self, tau: Array) -> Array:
        """Return a solution x of ``A^T x = tau``. Shape (..., n) -> (..., m)."""

    def null(self) -> Array:
        """Return rows that span all x with ``A^T x = 0``. Shape (..., m - n, m)."""

    def response(self, unit: Array, *, whole: bool = False) -> Array:
        """Return each unknown's sum of squared responses to an error of `unit[i]` in each row i. (m,) -> (..., n).

        Only moving unknowns count unless `whole` is True. The result is exact for floats; for other types, it is
        estimated from pivots and accurate within a factor of two once the response to the given coordinates is added.
        """


@dataclass(frozen=True)
class Ops:
    """Functions of one scalar type.

    Attributes:
        system: Function that builds a `System` from blocks, units of the rows, scales of the unknowns, number of moving
            unknowns, and leading shape.
    """

    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    sqrt: Callable[[Any], Any]
    atan2: Callable[[Any, Any], Any]
    maximum: Callable[[Any, Any], Any]
    system: Callable[[Sequence[Block], Array, Array, int, tuple[int, ...]], Any]

    def square(self, A: Array) -> System:
        """Wrap a small, dimensionless square system. Shape (..., n, n)."""
        n = A.shape[-1]
        one = np.ones(n, dtype=float if A.dtype == object else A.dtype)
        made: System = self.system([(slice(0, n), range(n), A)], one, one, n, A.shape[:-2])
        return made


class Dense:
    """A linear system with float entries, solved sample by sample.

    Attributes:
        A: Dimensionless matrix. Shape (..., m, n).
    """

    exact = True

    def __init__(
        self, blocks: Sequence[Block], unit: Array, size: Array, moving: int, lead: tuple[int, ...] = ()
    ) -> None:
        lead = np.broadcast_shapes(lead, *(block.shape[:-2] for _, _, block in blocks))
        dtype = np.result_type(unit, *(block for _, _, block in blocks))
        self.A = np.zeros((*lead, len(unit), len(size)), dtype=dtype)
        for rows, columns, block in blocks:
            self.A[..., rows, list(columns)] = block
        self.unit, self.size, self.moving = unit, size, moving
        self.A *= size / unit[:, None]

    @cached_property
    def _inverted(self) -> tuple[Array, Array]:
        return linear.invert(self.A[..., : self.moving])

    @property
    def inverse(self) -> Array:
        """Dimensionless inverse for moving unknowns. Shape (..., moving, m)."""
        return self._inverted[0]

    @property
    def condition(self) -> Array:
        """Condition number for moving unknowns. Shape (...)."""
        return self._inverted[1]

    @cached_property
    def _whole(self) -> tuple[Array, Array]:
        return self._inverted if self.moving == len(self.size) else linear.invert(self.A)

    @property
    def whole(self) -> Array:
        """Inverse for all unknowns. Shape (..., n, m)."""
        return self._whole[0]

    @property
    def whole_condition(self) -> Array:
        """Condition number for all unknowns. Shape (...)."""
        return self._whole[1]

    def solve(self, b: Array) -> Array:
        return times(self.inverse, b / self.unit) * self.size[: self.moving]

    def solve_transposed(self, tau: Array) -> Array:
        return times(transpose(self.whole), tau * self.size) / self.unit

    def null(self) -> Array:
        m, n = self.A.shape[-2:]
        if m == n:
            return np.zeros((*self.A.shape[:-2], 0, m), dtype=self.A.dtype)
        return transpose(np.linalg.qr(self.A, mode="complete")[0][..., n:]) / self.unit

    def response(self, unit: Array, *, whole: bool = False) -> Array:
        back = self.whole if whole else self.inverse
        return np.asarray(((back * (unit / self.unit)) ** 2).sum(-1) * self.size[: back.shape[-2]] ** 2)


class Sparse:
    """A linear system of objects, solved by elimination in an order that is chosen once, see `Factors`."""

    exact = False

    def __init__(
        self, blocks: Sequence[Block], unit: Array, size: Array, moving: int, lead: tuple[int, ...] = ()
    ) -> None:
        entries = {
            (row, column): block[i, k]
            for rows, columns, block in blocks
            for i, row in enumerate(range(rows.start, rows.stop))
            for k, column in enumerate(columns)
            if not is_zero(block[i, k])
        }
        stages = [range(moving), range(moving, len(size))]
        self.factors, self.moving = Factors(entries, unit.tolist(), size.tolist(), stages), moving

    def solve(self, b: Array) -> Array:
        x = self.factors.solve([*b], self.moving)
        return _objects(x[i] for i in range(self.moving))

    def solve_transposed(self, tau: Array) -> Array:
        return _objects(self.factors.solve_transposed(dict(enumerate(tau))))

    def null(self) -> Array:
        zero = dict.fromkeys(range(len(self.factors.pivots)), 0.0)
        rows = [_objects(self.factors.solve_transposed(zero, {row: 1.0})) for row in self.factors.spare]
        return np.array(rows, dtype=object).reshape(len(rows), len(self.factors.unit))

    def response(self, unit: Array, *, whole: bool = False) -> Array:
        pairs = [*zip(self.factors.pivots, self.factors.inverse, strict=True)]
        by_column = {column: x * x * unit[row] ** 2 for (row, column), x in pairs[: None if whole else self.moving]}
        return _objects(by_column[column] for column in sorted(by_column))


def _objects(values: Any) -> Array:
    return np.array([*values], dtype=object)


def is_zero(x: Any) -> bool:
    """Return True if a number is structurally zero for all inputs of a trace."""
    return isinstance(x, float | int) and x == 0.0


def is_absent(x: Array) -> bool:
    """Return True if all entries are zero, structurally or at every sample."""
    return all(map(is_zero, x.flat)) if x.dtype == object else not x.any()


def vectorize(function: Callable[..., Any], arguments: int = 1) -> Callable[..., Any]:
    """Vectorise a function of single objects."""
    applied: Callable[..., Any] = np.frompyfunc(function, arguments, 1)
    return applied


NUMPY = Ops(np.sin, np.cos, np.sqrt, np.arctan2, np.maximum, Dense)
TRACE = Ops(
    vectorize(partial(apply, "sin")),
    vectorize(partial(apply, "cos")),
    vectorize(partial(apply, "sqrt")),
    vectorize(partial(apply, "atan2"), 2),
    vectorize(partial(apply, "max"), 2),
    Sparse,
)
