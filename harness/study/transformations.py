"""Transformations that turn correct numbers into a faulty table: units, delays, filters, and missing terms."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from screwgauge.problem import Rows
from screwgauge.reference.rotations import Array

#: Unit of a component -> unit that a table may have instead -> factor.
UNITS = {
    "rad": {"degrees": 180.0 / np.pi, "turns": 0.5 / np.pi},
    "rad/s": {"degrees/s": 180.0 / np.pi, "rpm": 30.0 / np.pi},
    "rad/s^2": {"degrees/s^2": 180.0 / np.pi},
    "m": {"mm": 1e3, "cm": 1e2, "inches": 1.0 / 0.0254},
    "m/s": {"mm/s": 1e3, "cm/s": 1e2},
    "m/s^2": {"mm/s^2": 1e3, "g": 1.0 / 9.80665, "g of 9.81 m/s^2": 1.0 / 9.81},
    "N": {"kN": 1e-3, "mN": 1e3, "kgf": 1.0 / 9.80665, "kg by 9.81 m/s^2": 1.0 / 9.81, "lbf": 1.0 / 4.4482216152605},
    "N m": {"N mm": 1e3, "N cm": 1e2, "kN m": 1e-3, "kgf m": 1.0 / 9.80665, "N m per degree": np.pi / 180.0},
}
REACH, STEPS = 0.15, 122  # longest shift relative to the duration; number of shifts in the coarse search
LOWEST, HIGHEST, CUTS = 0.002, 0.8, 32  # range and number of cut-offs of a filter, relative to half the sampling rate
WIDEST = 100  # largest number of samples in a mean
LEAST, DEGREE = 16, 5  # smallest number of samples for interpolation, and its degree
NOISY = 30  # smallest number of samples to detect filters and noise
FILTERS = ("filter", "mean")
FITTED = ("factor", "offset", "shift", *FILTERS)  # kinds of faults with a fitted size
ORDERS = {"exponential": 0, **{f"Butterworth, order {order}": order for order in (1, 2, 4)}}

Bases = Rows | slice
"""Indices of columns of expected numbers."""

Key = tuple[str, str, str]
"""Kind of a fault, its object, and its rounded size."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Transformation that makes numbers wrong.

    Attributes:
        kind: ``sign``, ``unit``, ``factor`` (other than a unit), ``offset``, ``permutation``, ``shift``, ``held``
            (interpolation with constant ends), ``filter``, ``mean``, ``missing``, ``reversed``, ``side`` (reaction on
            the other body) or ``noise``.
        of: Unit, component to which the numbers belong, filter, kind of mean, or name of what is missing or reversed.
        size: Factor, offset [unit], delay [s], cut-off [Hz], number of samples in a mean, or rms of noise [unit].
    """

    kind: str
    of: str = ""
    size: float = 1.0

    @property
    def key(self) -> Key:
        """Key that equal faults share, even if their fitted sizes differ by rounding."""
        return self.kind, self.of, "" if self.kind == "noise" else f"{self.size:.2e}"

    @property
    def fitted(self) -> bool:
        """True if the size is fitted."""
        return self.kind in FITTED


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """Faults of one kind and any size, as a transformation of expected values.

    Attributes:
        kind, of: Fields of the fault; empty for the identity.
        grid: Sizes that the coarse search tries. Shape (m,).
        apply: Function of a size and columns; returns rows and the new numbers in these rows, shape (n_row, n_base).
        error: Scaled error due to the transformation.
        smooth: True if the size is continuous.
        more: Accompanying faults.
    """

    kind: str
    of: str
    grid: Array
    apply: Callable[[float, Bases], tuple[Rows, Array]]
    error: float = 0.0
    smooth: bool = False
    more: tuple[Fault, ...] = ()

    def faults(self, size: float) -> tuple[Fault, ...]:
        """Return the fault with its accompanying faults; none for the identity."""
        return (Fault(self.kind, self.of, size), *self.more) if self.kind else ()

    @property
    def cost(self) -> int:
        """Number of faults that the family represents."""
        return len(self.faults(1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """Expected columns of a quantity, and their values under faults of the whole table.

    Attributes:
        components, faults: Component and faults of each column. Length k.
        t: Times [s]. Shape (n,).
        arrays: Values of the columns. Shape (n, k).
        moved: The columns at shifted times, see `shifts`.
    """

    components: Sequence[str]
    faults: Sequence[tuple[Fault, ...]]
    t: Array
    arrays: Array
    moved: Family | None

    def families(self) -> Iterator[Family]:
        """Yield transformations of all numbers, starting with the identity."""
        every = np.arange(len(self.t))
        yield Family("", "", np.zeros(1), lambda size, bases: (every, self.arrays[:, bases]))
        if self.moved:
            yield self.moved
            yield replace(self.moved, more=(Fault("held"),), apply=self._interpolate, error=0.0)
        if len(self.t) >= NOISY and (step := even_step(self.t)):
            yield from _filters(self.arrays, 0.5 / step)

    def _interpolate(self, delay: float, bases: Bases) -> tuple[Rows, Array]:
        """Return numbers of a delayed table, interpolated as by `np.interp`, with constant values beyond the ends."""
        numbers, at = self.arrays[:, bases], np.clip(self.t - delay, self.t[0], self.t[-1])
        after = np.clip(np.searchsorted(self.t, at), 1, len(self.t) - 1)
        share = (at - self.t[after - 1]) / (self.t[after] - self.t[after - 1])
        return np.arange(len(at)), numbers[after - 1] + share[:, None] * (numbers[after] - numbers[after - 1])


def even_step(t: Array) -> float:
    """Return the step between times [s]; 0 if it varies. Shape (n,)."""
    steps = np.diff(t)
    return float(steps.mean()) if len(steps) and np.ptp(steps) < 1e-6 * steps.mean() else 0.0


def shifts(t: Array, dense: Array, numbers: Array) -> Family | None:
    """Return the family of delayed tables; None if there are too few known values for interpolation.

    Args:
        t: Times of the table [s]. Shape (n,).
        dense: Times of the known values [s]. Shape (m,).
        numbers: Known values. Shape (m, k).
    """
    from scipy.interpolate import BSpline, make_interp_spline

    if len(dense) < LEAST:
        return None
    spline, half = (make_interp_spline(dense[::k], numbers[::k], k=DEGREE) for k in (1, 2))
    inside = dense[1::2] < dense[::2][-1]
    left = np.abs(half(dense[1::2][inside]) - numbers[1::2][inside]).max() / (np.abs(numbers).max() or 1.0)

    def shift(delay: float, bases: Bases) -> tuple[Rows, Array]:
        rows = np.flatnonzero((t - delay >= dense[0]) & (t - delay <= dense[-1]))
        return rows, np.asarray(BSpline.construct_fast(spline.t, spline.c[:, bases], DEGREE)(t[rows] - delay))

    grid = np.linspace(-REACH, REACH, STEPS) * (dense[-1] - dense[0])  # excludes zero
    return Family("shift", "", grid, shift, float(left) / 2.0**DEGREE, smooth=True)


def _filters(arrays: Array, half: float) -> Iterator[Family]:
    """Yield filters for evenly sampled numbers; `half`: half the sampling rate [Hz]."""
    from scipy.signal import butter, filtfilt, lfilter, lfilter_zi

    every = np.arange(len(arrays))
    for after, name in enumerate(("mean of preceding samples", "mean of surrounding samples")):

        def mean(count: float, bases: Bases, after: int = after) -> tuple[Rows, Array]:
            m, sums = int(count), np.cumsum(np.pad(arrays[:, bases], ((1, 0), (0, 0))), axis=0)
            return every[m - 1 :] - after * (m // 2), (sums[m:] - sums[:-m]) / m

        counts = np.arange(2.0 + after, np.clip(len(every) // 10, 4, WIDEST), 1 + after)
        yield Family("mean", name, counts, mean)
    for (name, order), way in product(ORDERS.items(), ("forwards and backwards", "from its first value", "from zero")):

        def apply_filter(cutoff: float, bases: Bases, order: int = order, way: str = way) -> tuple[Rows, Array]:
            numbers, w = arrays[:, bases], min(cutoff / half, HIGHEST)
            last = np.exp(-np.pi * w)
            b, a = butter(order, w) if order else (np.array([1.0 - last]), np.array([1.0, -last]))
            if way == "forwards and backwards":
                return every, filtfilt(b, a, numbers, axis=0)
            start = lfilter_zi(b, a)[:, None] * numbers[:1] * (way != "from zero")
            return every, lfilter(b, a, numbers, axis=0, zi=start)[0]

        cutoffs = half * np.geomspace(LOWEST, HIGHEST, CUTS)
        yield Family("filter", f"{name}, {way}", cutoffs, apply_filter, smooth=True)
