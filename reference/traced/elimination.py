"""Sparse elimination of small systems of scalars, in an order found once for all samples.

Pivots have to keep their size at every sample that the order is chosen at, home among them: one that is merely not
zero somewhere may be zero at another pose.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.trace import NotTraceableError
from screwgauge.reference.traced.vectors import Scalar, squares

#: Share of the largest entry of its column that a pivot must have, at every sample; sparsity chooses among these.
LARGE = 0.05
#: Below this, without dimension, a pivot is none.
SMALLEST = 1e-6

Entries = dict[tuple[int, int], Scalar]
"""(row, column) -> entry that is not structurally zero."""


class Factors:
    """``A = L U`` with rows and columns in the order of the pivots; rows without pivot are left over.

    Attributes:
        pivots: (row, column) in the order of elimination.
        spare: Rows without pivot: dependent on the others wherever the system is consistent.
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
        """Eliminates the columns of one stage after the other.

        Args:
            unit, size: Of each row and of each unknown; entries over these have no dimension.

        Raises:
            NotTraceableError: No pivot keeps its size.
        """
        self.left = {key: value for key, value in A.items() if not (isinstance(value, float) and value == 0.0)}
        self.lower: dict[int, list[tuple[int, Scalar]]] = {}
        self.upper: dict[int, list[tuple[int, Scalar]]] = {}
        self.pivots: list[tuple[int, int]] = []
        self.inverse: list[Scalar] = []
        self.spare, self.unit, self.size, self.smallest = list(range(len(unit))), unit, size, smallest
        self.sizes: dict[tuple[int, int], tuple[Scalar, Array]] = {}
        for stage in stages:
            open_columns = set(stage)
            while open_columns:
                row, column = self._choose(open_columns)
                self._eliminate(row, column)
                open_columns.remove(column)

    def _choose(self, columns: Collection[int]) -> tuple[int, int]:
        """Markowitz' choice among the entries that are large in their column at every sample."""
        active = [(key, self._size(key)) for key in self.left if key[0] in self.spare and key[1] in columns]
        largest, in_row, in_column = dict[int, Array](), dict[int, int](), dict[int, int]()
        for (row, column), size in active:
            largest[column] = np.maximum(largest.get(column, np.zeros(1)), size)
            in_row[row], in_column[column] = in_row.get(row, 0) + 1, in_column.get(column, 0) + 1
        best, found = (np.inf, 0.0), None
        for (row, column), size in active:
            with np.errstate(all="ignore"):
                share = float(np.min(size / largest[column]))
            if not (share >= LARGE and size.min() > self.smallest):
                continue
            rank = ((in_row[row] - 1) * (in_column[column] - 1), -share)
            if rank < best:
                best, found = rank, (row, column)
        if found is None:
            raise NotTraceableError("no pivot keeps its size over the motion", "closed loops", "use backend array")
        return found

    def _size(self, key: tuple[int, int]) -> Array:
        """Magnitude of an entry at the samples, without dimension."""
        known = self.sizes.get(key)
        if known is None or known[0] is not self.left[key]:
            x = self.left[key]
            value = np.abs(np.atleast_1d(np.asarray(getattr(x, "value", x), dtype=float)))
            self.sizes[key] = known = (x, value * (self.size[key[1]] / self.unit[key[0]]))
        return known[1]

    def _eliminate(self, row: int, column: int) -> None:
        pivot = self.left.pop((row, column))
        inverse = 1.0 / pivot
        self.spare.remove(row)
        across = [(c, x) for (r, c), x in self.left.items() if r == row]
        below = [(r, x) for (r, c), x in self.left.items() if c == column and r in self.spare]
        self.lower[len(self.pivots)] = multipliers = []
        for r, x in below:
            del self.left[r, column]
            multipliers.append((r, x * inverse))
            for c, y in across:
                self.left[r, c] = self.left.get((r, c), 0.0) - multipliers[-1][1] * y
        for c, _ in across:
            del self.left[row, c]
        self.upper[len(self.pivots)] = across
        self.pivots.append((row, column))
        self.inverse.append(inverse)

    def solve(self, b: Sequence[Scalar], count: int | None = None) -> dict[int, Scalar]:
        """Column -> unknown of ``A x = b``, the columns of the first `count` pivots alone, others being zero."""
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
        """Unknown of each row of ``A^T x = tau``, those of spare rows being given, zero by default."""
        open_tau, z = dict(tau), list[Scalar]()
        for k, (_, column) in enumerate(self.pivots):
            z.append(open_tau[column] * self.inverse[k])
            for c, y in self.upper[k]:
                open_tau[c] = open_tau[c] - y * z[k]
        x = dict.fromkeys(self.spare, 0.0) | dict(free or {})
        for k, (row, _) in reversed([*enumerate(self.pivots)]):
            x[row] = z[k] - sum((factor * x[r] for r, factor in self.lower[k]), start=0.0)
        return [x[row] for row in sorted(x)]


def solve(A: Sequence[Sequence[Scalar]], b: Iterable[Scalar]) -> tuple[Scalar, list[Scalar]]:
    """Solves a small square system. Returns the squares of its reciprocal pivots, summed up, and the unknowns."""
    n = len(A)
    entries = {(i, j): A[i][j] for i in range(n) for j in range(n)}
    factors = Factors(entries, [1.0] * n, [1.0] * n, [range(n)], 0.0)
    x = factors.solve(list(b))
    return squares(factors.inverse), [x[i] for i in range(n)]
