"""Traces of scalar computations: expressions recorded by operator overloading, and sparse elimination of systems.

Folding uses only structure: zeros, ones, signs and constants. Expressions that merely agree in value are never merged,
because they may agree in one assembly mode and differ in another. Likewise, a pivot must be large at every sample that
is used to choose the elimination order, including home. If no pivot is large enough, several traces may be made, each
for the samples at which its pivots are large, see `Trace.kept`. `program` makes programs from traces.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array

Scalar = Any
"""A float, an array over samples, or a `Node`."""

#: Function -> NumPy implementation.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "atan2": np.arctan2,
    "max": np.maximum,
}
#: Operation -> NumPy implementation.
OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    **FUNCTIONS,
}

#: Default limit of operations: tracing takes about 20 ms per thousand; larger programs are not faster than arrays.
MOST = 100_000


class NotTraceableError(ScrewgaugeError):
    """Raised for a mechanism or request that straight-line programs do not cover; the array solver handles it."""


class Node:
    """A value of a trace.

    Attributes:
        args: Operands: nodes and floats.
        index: Position in the order of creation.
    """

    __slots__ = ("args", "index", "op", "trace")

    def __init__(self, trace: Trace, op: str, args: tuple[Scalar, ...]) -> None:
        self.trace, self.op, self.args, self.index = trace, op, args, len(trace.nodes)

    @property
    def value(self) -> Array:
        """Value of the node at the samples of the trace, used only to choose pivots. Shape (n,)."""
        return self.trace.value(self.index)

    # if the second operand is an array, NumPy calls back for each element

    def __add__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.add(self, other)

    __radd__ = __add__

    def __sub__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.sub(self, other)

    def __rsub__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.sub(other, self)

    def __mul__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.mul(self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.div(self, other)

    def __rtruediv__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self.trace.div(other, self)

    def __neg__(self) -> Scalar:
        return self.trace.neg(self)


def apply(name: str, *x: Scalar) -> Scalar:
    """Apply a function, given by its name, see `FUNCTIONS`."""
    for value in x:
        if isinstance(value, Node):
            return value.trace.function(name, *x)
    applied = FUNCTIONS[name](*x)
    return applied if np.ndim(applied) else float(applied)


def _order(a: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
    """Order two operands, at least one of which is a node: numbers come first, nodes are in order of creation."""
    return (b, a) if not isinstance(b, Node) or (isinstance(a, Node) and b.index < a.index) else (a, b)


def _negate(x: Scalar) -> bool:
    return isinstance(x, Node) and x.op == "neg"


class Trace:
    """The graph of all values computed from inputs.

    Attributes:
        most: Largest number of recorded operations, including operations that no output needs.
        kept: Flags of samples at which the pivots chosen so far are large, shape (n,); None if the trace must cover all
            samples.
    """

    def __init__(self, most: int = MOST) -> None:
        self.most = most
        self.kept: NDArray[np.bool_] | None = None
        self.nodes: list[Node] = []
        self.inputs: list[Array] = []
        self._values: list[Array] = []
        self._known: dict[tuple[Any, ...], Node] = {}

    def input(self, value: Array) -> Node:
        """Add an input, given its values at the samples of the trace, shape (n,)."""
        self.inputs.append(np.asarray(value, dtype=float))
        return self._make("input", len(self.inputs) - 1)

    @property
    def count(self) -> int:
        """Number of samples of the trace."""
        return len(self.inputs[0])

    def value(self, index: int) -> Array:
        """Evaluate a node and all preceding nodes."""
        with np.errstate(all="ignore"):
            for node in self.nodes[len(self._values) : index + 1]:
                operands = [self._values[x.index] if isinstance(x, Node) else x for x in node.args]
                known = self.inputs[node.args[0]] if node.op == "input" else OPERATIONS[node.op](*operands)
                self._values.append(known)
        return self._values[index]

    def _make(self, op: str, *args: Scalar) -> Node:
        key = (op, *args)
        if key not in self._known:
            if len(self.nodes) == self.most:
                raise NotTraceableError(f"it takes more than {self.most} operations", "tracing", "use backend array")
            self._known[key] = node = Node(self, op, args)
            self.nodes.append(node)
        return self._known[key]

    def function(self, name: str, *x: Scalar) -> Node:
        """Return the node that results from applying an entry of `FUNCTIONS`."""
        return self._make(name, *x)

    def neg(self, a: Scalar) -> Scalar:
        if not isinstance(a, Node):
            return -a
        return a.args[0] if a.op == "neg" else self._make("neg", a)

    def add(self, a: Scalar, b: Scalar) -> Scalar:
        if a is b:
            return self.mul(2.0, a)
        a, b = _order(a, b)
        if not isinstance(a, Node) and a == 0.0:
            return b
        if _negate(b):
            return self.sub(a, b.args[0])
        return self.sub(b, a.args[0]) if _negate(a) else self._make("add", a, b)

    def sub(self, a: Scalar, b: Scalar) -> Scalar:
        if a is b:
            return 0.0
        if not isinstance(b, Node) and b == 0.0:
            return a
        if not isinstance(a, Node) and a == 0.0:
            return self.neg(b)
        if _negate(b):
            return self.add(a, b.args[0])
        if _negate(a):
            return self.neg(self.add(a.args[0], b))
        opposite = self._known.get(("sub", b, a))
        return self._make("sub", a, b) if opposite is None else self.neg(opposite)

    def mul(self, a: Scalar, b: Scalar) -> Scalar:
        a, b = _order(a, b)
        if _negate(b):
            return self.neg(self.mul(a, b.args[0]))
        if isinstance(a, Node):
            return self.neg(self.mul(a.args[0], b)) if a.op == "neg" else self._make("mul", a, b)
        if a <= 0.0:
            return self.neg(self.mul(-a, b)) if a else 0.0
        if a == 1.0:
            return b
        if b.op == "mul" and not isinstance(b.args[0], Node):
            return self.mul(a * b.args[0], b.args[1])
        return self._make("mul", a, b)

    def div(self, a: Scalar, b: Scalar) -> Scalar:
        if not isinstance(b, Node):
            return self.mul(1.0 / b, a)
        if not isinstance(a, Node) and a == 0.0:
            return 0.0
        if _negate(b):
            return self.neg(self.div(a, b.args[0]))
        if _negate(a):
            return self.neg(self.div(a.args[0], b))
        return self._make("div", a, b)


#: Smallest ratio of a pivot to the largest entry of its column at every sample; sparsity decides among candidates.
LARGE = 0.05
#: Dimensionless magnitude below which an entry cannot be a pivot.
SMALLEST = 1e-6


class Factors:
    """Factorisation ``A = L U`` in pivot order of rows and columns; rows without a pivot remain.

    Attributes:
        pivots: Pairs (row, column) in the order of elimination.
        spare: Rows without a pivot, which depend on the other rows wherever the system is consistent.
        inverse: Reciprocals of the pivots.
    """

    def __init__(
        self,
        A: Mapping[tuple[int, int], Scalar],
        unit: Sequence[float],
        size: Sequence[float],
        stages: Sequence[Collection[int]],
        smallest: float = SMALLEST,
    ) -> None:
        """Eliminate the columns stage by stage.

        Args:
            unit, size: Unit of each row and scale of each unknown, which make entries dimensionless.
            stages: Columns to eliminate in each stage.

        Raises:
            NotTraceableError: No entry is large enough for a pivot at the samples.
        """
        self.trace = next((x.trace for x in A.values() if isinstance(x, Node)), None)
        self.left = {key: value for key, value in A.items() if not (isinstance(value, float) and value == 0.0)}
        self.lower: dict[int, list[tuple[int, Scalar]]] = {}
        self.upper: dict[int, list[tuple[int, Scalar]]] = {}
        self.pivots: list[tuple[int, int]] = []
        self.inverse: list[Scalar] = []
        self.spare, self.unit, self.size, self.smallest = dict.fromkeys(range(len(unit))), unit, size, smallest
        self.shares: dict[int, dict[int, float]] = {}  # ratios of unchanged columns
        for stage in stages:
            open_columns = set(stage)
            while open_columns:
                row, column = self._choose(open_columns)
                self._eliminate(row, column)
                open_columns.remove(column)

    def _choose(self, columns: Collection[int]) -> tuple[int, int]:
        """Choose a pivot by Markowitz's criterion among entries that are large in their column at every sample."""
        active = [key for key in self.left if key[1] in columns]
        in_row, in_column = (Counter(key[k] for key in active) for k in (0, 1))
        rows: dict[int, list[int]] = {}
        for row, column in active:
            if column not in self.shares:
                rows.setdefault(column, []).append(row)
        self.shares |= {column: self._large(some, column) for column, some in rows.items()}
        best, pivot = (np.inf, 0.0), None
        for row, column in active:
            share = self.shares[column].get(row)
            if share is not None:
                rank = ((in_row[row] - 1) * (in_column[column] - 1), -share)
                if rank < best:
                    best, pivot = rank, (row, column)
        return pivot or self._where_most(active)

    def _where_most(self, active: Sequence[tuple[int, int]]) -> tuple[int, int]:
        """Choose the entry that is large in its column at the most samples; the trace is invalid at all other samples.

        Raises:
            NotTraceableError: No such entry exists, or the trace must be valid at all samples.
        """
        trace, best, pivot = self.trace, 0, None
        if trace is not None and trace.kept is not None:
            samples = trace.kept
            for column in dict.fromkeys(column for _, column in active):
                rows = [row for row, c in active if c == column]
                for row, large in zip(rows, samples & self._shares(rows, column)[1], strict=True):
                    if np.count_nonzero(large) > best:
                        best, pivot, trace.kept = int(np.count_nonzero(large)), (row, column), large
        if pivot is None:
            raise NotTraceableError("no pivot stays large over the motion", "closed loops", "use backend array")
        self.shares = {}
        return pivot

    def _large(self, rows: Sequence[int], column: int) -> dict[int, float]:
        """Return row -> smallest ratio to the column's largest entry, for entries that are large at every sample."""
        shares, large = self._shares(rows, column)
        if self.trace is not None and self.trace.kept is not None:
            shares, large = shares[:, self.trace.kept], large[:, self.trace.kept]
        return {row: float(x.min()) for row, x, fits in zip(rows, shares, large, strict=True) if fits.all()}

    def _shares(self, rows: Sequence[int], column: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return ratios of entries to the column's largest entry, and flags of large ratios. Shape (len(rows), n)."""
        values = [np.asarray(getattr(self.left[row, column], "value", self.left[row, column])) for row in rows]
        lead = np.ones(self.trace.count if self.trace else 1)
        scales = [self.size[column] / self.unit[row] for row in rows]
        sizes = np.stack([np.abs(x * lead * scale) for x, scale in zip(values, scales, strict=True)])
        with np.errstate(all="ignore"):
            shares = sizes / sizes.max(axis=0)
            return shares, (shares >= LARGE) & (sizes > self.smallest)

    def _eliminate(self, row: int, column: int) -> None:
        pivot = self.left.pop((row, column))
        inverse = 1.0 / pivot
        del self.spare[row]
        across = [(c, x) for (r, c), x in self.left.items() if r == row]
        below = [(r, x) for (r, c), x in self.left.items() if c == column]
        self.lower[len(self.pivots)] = multipliers = []
        for r, x in below:
            del self.left[r, column]
            multipliers.append((r, x * inverse))
            for c, y in across:
                self.left[r, c] = self.left.get((r, c), 0.0) - multipliers[-1][1] * y
        for c, _ in across:
            del self.left[row, c]
            self.shares.pop(c, None)
        self.upper[len(self.pivots)] = across
        self.pivots.append((row, column))
        self.inverse.append(inverse)

    def solve(self, b: Sequence[Scalar], count: int | None = None) -> dict[int, Scalar]:
        """Solve ``A x = b`` for the columns of the first `count` pivots, by column; all other unknowns are zero."""
        b, x = list(b), dict[int, Scalar]()
        pivots = self.pivots[:count]
        for k, (row, _) in enumerate(pivots):
            for r, factor in self.lower[k]:
                b[r] = b[r] - factor * b[row]
        for k, (row, column) in reversed([*enumerate(pivots)]):
            known = ((c, y) for c, y in self.upper[k] if c in x)
            x[column] = (b[row] - sum((y * x[c] for c, y in known), start=0.0)) * self.inverse[k]
        return x

    def solve_transposed(self, tau: Mapping[int, Scalar], free: Mapping[int, Scalar] | None = None) -> list[Scalar]:
        """Solve ``A^T x = tau`` for the unknown of each row; unknowns of spare rows are given, or zero by default."""
        open_tau, z = dict(tau), list[Scalar]()
        for k, (_, column) in enumerate(self.pivots):
            z.append(open_tau[column] * self.inverse[k])
            for c, y in self.upper[k]:
                open_tau[c] = open_tau[c] - y * z[k]
        x = dict.fromkeys(self.spare, 0.0) | dict(free or {})
        for k, (row, _) in reversed([*enumerate(self.pivots)]):
            x[row] = z[k] - sum((factor * x[r] for r, factor in self.lower[k]), start=0.0)
        return [x[row] for row in sorted(x)]
