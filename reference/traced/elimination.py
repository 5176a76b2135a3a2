"""Sparse elimination of small systems of scalars, in an order found once for all samples.

Pivots have to keep their size at every sample that the order is chosen at, home among them: one that is merely not
zero somewhere may be zero at another pose. Where none does, a trace may be one of several, each for the samples at
which its pivots are large, see `Trace.kept`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.trace import Node, NotTraceableError, Scalar

#: Share of the largest entry of its column that a pivot must have, at every sample; sparsity chooses among these.
LARGE = 0.05
#: Below this, without dimension, a pivot is none.
SMALLEST = 1e-6


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
        self.trace = next((x.trace for x in A.values() if isinstance(x, Node)), None)
        self.left = {key: value for key, value in A.items() if not (isinstance(value, float) and value == 0.0)}
        self.lower: dict[int, list[tuple[int, Scalar]]] = {}
        self.upper: dict[int, list[tuple[int, Scalar]]] = {}
        self.pivots: list[tuple[int, int]] = []
        self.inverse: list[Scalar] = []
        self.spare, self.unit, self.size, self.smallest = dict.fromkeys(range(len(unit))), unit, size, smallest
        self.shares: dict[int, dict[int, float]] = {}  # of columns that have not changed since
        for stage in stages:
            open_columns = set(stage)
            while open_columns:
                row, column = self._choose(open_columns)
                self._eliminate(row, column)
                open_columns.remove(column)

    def _choose(self, columns: Collection[int]) -> tuple[int, int]:
        """Markowitz' choice among the entries that are large in their column at every sample."""
        active = [key for key in self.left if key[1] in columns]
        in_row, in_column = (Counter(key[k] for key in active) for k in (0, 1))
        rows: dict[int, list[int]] = {}
        for row, column in active:
            if column not in self.shares:
                rows.setdefault(column, []).append(row)
        self.shares |= {column: self._large(some, column) for column, some in rows.items()}
        best, found = (np.inf, 0.0), None
        for row, column in active:
            share = self.shares[column].get(row)
            if share is not None:
                rank = ((in_row[row] - 1) * (in_column[column] - 1), -share)
                if rank < best:
                    best, found = rank, (row, column)
        return found or self._where_most(active)

    def _where_most(self, active: Sequence[tuple[int, int]]) -> tuple[int, int]:
        """The entry that is large in its column at most of the samples; the trace is of no use at the others.

        Raises:
            NotTraceableError: There is none, or the trace has to be of use at all samples.
        """
        trace, best, found = self.trace, 0, None
        if trace is not None and trace.kept is not None:
            samples = trace.kept
            for column in dict.fromkeys(column for _, column in active):
                rows = [row for row, c in active if c == column]
                for row, large in zip(rows, samples & self._shares(rows, column)[1], strict=True):
                    if np.count_nonzero(large) > best:
                        best, found, trace.kept = int(np.count_nonzero(large)), (row, column), large
        if found is None:
            raise NotTraceableError("no pivot keeps its size over the motion", "closed loops", "use backend array")
        self.shares = {}
        return found

    def _large(self, rows: Sequence[int], column: int) -> dict[int, float]:
        """Row -> least share of the largest entry of a column, of those that are large at every sample."""
        shares, large = self._shares(rows, column)
        if self.trace is not None and self.trace.kept is not None:
            shares, large = shares[:, self.trace.kept], large[:, self.trace.kept]
        return {row: float(x.min()) for row, x, fits in zip(rows, shares, large, strict=True) if fits.all()}

    def _shares(self, rows: Sequence[int], column: int) -> tuple[Array, NDArray[np.bool_]]:
        """Shares of some entries in the largest of their column, and whether they are large. Shape (len(rows), n)."""
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
