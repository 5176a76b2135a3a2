"""Arrays of MuJoCo's data, several copied at once: a copy costs its call more than its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from screwgauge.reference.rotations import Array


class DataBlock:
    """Arrays that lie near each other in one buffer, with what is between.

    Attributes:
        block: From the first of them to the end of the last. Shape (size,).
    """

    def __init__(self, *arrays: Array) -> None:
        begin = [array.__array_interface__["data"][0] // 8 for array in arrays]
        first = arrays[int(np.argmin(begin))]
        self.spans = [(at - min(begin), array.shape) for at, array in zip(begin, arrays, strict=True)]
        size = max(at + array.size for (at, _), array in zip(self.spans, arrays, strict=True))
        self.block = np.lib.stride_tricks.as_strided(first, (size,), (8,))

    def rows(self, n: int) -> Array:
        """Room for as many samples of it. Shape (n, size)."""
        return np.empty((n, len(self.block)))

    def parts(self, rows: Array) -> Iterator[Array]:
        """The arrays of such samples, as views. Shape (n, ...) each."""
        for at, shape in self.spans:
            yield rows[:, at : at + math.prod(shape)].reshape(len(rows), *shape)

    def filled(self, *values: Array) -> Array:
        """Samples of the given arrays. Shape (n, ...) each -> (n, size)."""
        found = self.rows(len(values[0]))
        found[:] = self.block
        for part, value in zip(self.parts(found), values, strict=True):
            part[:] = value
        return found
