"""Functions of time for motions, motors and loads: polynomials with harmonics, or samples from a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.rotations import Array

Wave = Callable[[Any], Any]
"""Sine or cosine for any scalar type."""


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A function of time: a polynomial plus harmonics.

    Attributes:
        polynomial: Coefficients, lowest first [unit of the value, per s^k]. Shape (m,).
        harmonics: Rows [omega, cos, sin] [rad/s, unit of the value]. Shape (k, 3).
    """

    polynomial: Array
    harmonics: Array

    @classmethod
    def of(cls, value: float) -> Course:
        """Build a constant function."""
        return cls(np.array([float(value)]), np.zeros((0, 3)))

    @property
    def constant(self) -> bool:
        """True if the value does not change with time."""
        return not self.polynomial[1:].any() and not len(self.harmonics)

    @property
    def nothing(self) -> bool:
        """True if the value is zero at all times."""
        return not (self.polynomial.any() or self.harmonics[:, 1:].any())

    def __call__(self, t: Any, cos: Wave = np.cos, sin: Wave = np.sin) -> Any:
        """Evaluate the function at times [s], which may be of any scalar type."""
        total: Any = 0.0
        for coefficient in self.polynomial[::-1].tolist():
            total = total * t + coefficient
        for omega, c, s in self.harmonics.tolist():
            total = total + c * cos(omega * t) + s * sin(omega * t)
        return total

    def times(self, factor: float) -> Course:
        """Multiply by a factor."""
        return Course(factor * self.polynomial, self.harmonics * [1.0, factor, factor])

    def plain(self) -> list[Any]:
        """Return plain values that can be compared and written to a file."""
        return [self.polynomial.tolist(), self.harmonics.tolist()]


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """A quantity that is known only at certain times.

    Attributes:
        t: Increasing times [s]. Shape (n,).
        values: Values at these times. Shape (n,).
        file: File from which the samples were read.
    """

    t: Array
    values: Array
    file: str

    #: Samples count as varying with time.
    constant = False

    @property
    def nothing(self) -> bool:
        """True if the value is zero at all times."""
        return not self.values.any()

    def __call__(self, t: Any, cos: Wave = np.cos, sin: Wave = np.sin) -> Any:
        """Return the values at times [s] that agree with sample times up to rounding of decimals. Shape (...).

        Raises:
            DescriptionError: The file lacks a sample at one of these times.
        """
        asked = np.atleast_1d(np.asarray(t, dtype=float))
        known, rows = same_times(asked, self.t)
        if len(known) < len(asked):
            missing = asked[np.setdiff1d(np.arange(len(asked)), known)[0]]
            what, remedy = f"has no sample at t = {missing:g} s", "use times in the file: samples are not interpolated"
            raise DescriptionError(what, self.file, remedy)
        return self.values[rows].reshape(np.shape(t))

    def times(self, factor: float) -> Samples:
        """Multiply by a factor."""
        return Samples(self.t, factor * self.values, self.file)

    def plain(self) -> list[Any]:
        """Return plain values that can be compared and written to a file."""
        return [self.t.tolist(), self.values.tolist()]


Places = NDArray[np.intp]
"""Indices into an array."""


def same_times(t: Array, others: Array) -> tuple[Places, Places]:
    """Match the times of two lists; times that differ only by rounding of decimals count as equal.

    Args:
        t: Times in any order. Shape (n,).
        others: Increasing times. Shape (m,).

    Returns:
        Indices into both lists for each time of `t` that `others` contains.
    """
    right = np.searchsorted(others, t).clip(max=len(others) - 1)
    left = (right - 1).clip(min=0)
    nearest = np.where(np.abs(others[left] - t) < np.abs(others[right] - t), left, right)
    rows = np.flatnonzero(np.isclose(others[nearest], t, rtol=1e-12, atol=1e-15))
    return rows, nearest[rows]
