"""Checks of the arrays that a compiled solver reads at every call, and of the buffers that it fills."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import accumulate
from numbers import Integral
from operator import attrgetter
from typing import Any

import numpy as np

from screwgauge.problem import Rows
from screwgauge.reference.errors import DescriptionError, UnknownNameError, quote
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import columns

#: Largest number of samples.
MOST = 10**9
_WRITEABLE = attrgetter("flags.writeable")


class Buffers(Mapping[str, Array]):
    """Arrays that a solver fills, one of shape (n, n_component) per quantity; created by `Solver.buffers`.

    Only one call at a time may use them. Pickling or copying yields a dict of the arrays.

    Attributes:
        n: Number of samples.
        owner: The solver that fills the arrays.
        known: The owner's private data.
    """

    def __init__(self, owner: object, counts: Mapping[str, int], n: int, given: Mapping[str, Array]) -> None:
        """Check the given arrays and allocate the missing ones.

        Args:
            counts: Quantity -> number of components.

        Raises:
            DescriptionError: An array is not a plain, writeable array of shape (n, count), or two elements share
                memory; or n is not a valid number of samples.
            UnknownNameError: The solver does not compute a quantity in `given`.
        """
        if not isinstance(n, Integral) or not 0 <= n <= MOST:
            raise DescriptionError(
                f"the number of samples is {quote(n)}", "buffers", f"use an integer from 0 to {MOST}"
            )
        if not isinstance(given, Mapping):
            raise DescriptionError(
                f"expected a mapping, got {type(given).__name__}", "buffers", "pass quantity -> array"
            )
        for name, array in given.items():
            where = f"buffers, {name}"
            if name not in counts:
                raise UnknownNameError("quantity", name, counts, "buffers")
            check_array(array, (int(n), counts[name]), where)
            if not array.flags.behaved:
                raise DescriptionError(
                    "the array is read-only or not aligned", where, "pass a writeable, aligned array"
                )
        _check_apart(given)
        free = {name: count for name, count in counts.items() if name not in given}
        made = split_columns(columns(int(n), sum(free.values())), free) | dict(given)
        self._arrays: dict[str, Array] = {name: made[name] for name in counts}
        self.owner: object = owner
        self.n: int = int(n)
        self.known: dict[Any, Any] = {}

    def __getitem__(self, quantity: str) -> Array:
        return self._arrays[quantity]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (self._arrays,)

    @property
    def writeable(self) -> bool:
        """True if all arrays are still writeable."""
        return all(map(_WRITEABLE, self._arrays.values()))


def split_columns(array: Array, counts: Mapping[str, int]) -> dict[str, Array]:
    """Split an array into named blocks of columns; `counts` maps each name to its number of columns."""
    ends = accumulate(counts.values())
    return {name: array[:, end - count : end] for (name, count), end in zip(counts.items(), ends, strict=True)}


def check_array(array: Array, shape: tuple[int | None, ...], where: str) -> None:
    """Reject anything but a plain float64 array of the given shape, in which None matches any length.

    Raises:
        DescriptionError: The array is not a plain NumPy array, not of float64, or not of the given shape.
    """
    if type(array) is not np.ndarray:
        kind = "None" if array is None else type(array).__name__
        raise DescriptionError(
            f"expected a plain numpy.ndarray, got {kind}", where, "convert it to an array of float64"
        )
    if array.dtype != np.float64:
        raise DescriptionError(f"expected an array of float64, got {array.dtype}", where, "convert it")
    if array.ndim != len(shape) or any(m not in (n, None) for n, m in zip(array.shape, shape, strict=True)):
        wanted = str(shape).replace("None", "n")
        raise DescriptionError(f"expected shape {wanted}, got {array.shape}", where, "pass one row per sample")


def check_finite(array: Array, where: str) -> None:
    """Reject rows with non-finite numbers.

    Raises:
        DescriptionError: A row contains a non-finite number; the message names the first such row.
    """
    if not np.isfinite(array).all():
        row = int(np.isfinite(array).all(axis=1).argmin())
        raise DescriptionError(f"row {row} contains a non-finite number", where, "pass finite numbers")


def _check_apart(arrays: Mapping[str, Array]) -> None:
    """Reject arrays with elements that share memory.

    Raises:
        DescriptionError: Two elements share memory.
    """
    places = np.sort(np.concatenate([np.zeros(0, dtype=np.intp), *map(_addresses, arrays.values())]))
    if (np.diff(places) < np.dtype(float).itemsize).any():
        where = f"buffers, {', '.join(arrays)}"
        raise DescriptionError("two elements share memory", where, "pass arrays without overlap")


def _addresses(array: Array) -> Rows:
    """Return the address of each element of an array. Shape (n m,)."""
    (n, m), (down, across) = array.shape, array.strides
    return np.asarray(array.ctypes.data + np.add.outer(np.arange(n) * down, np.arange(m) * across).ravel())
