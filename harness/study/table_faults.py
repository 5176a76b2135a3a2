"""Faults in a table, found by applying transformations to the expected values until they match the table.

A column is explained by the fewest faults with which all its samples agree to their printed digits. More digits must
agree than the number of fitted sizes accounts for: two smooth series that just happen to match explain nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import product

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from screwgauge.problem import Rows, spread
from screwgauge.reference.rotations import Array
from screwgauge.study.transformations import FILTERS, NOISY, UNITS, Expected, Family, Fault, Key

MOST = 3  # largest number of faults in one column
EVIDENCE = 0.5  # decimal places that must agree in addition to one place for each fault and to the fitted sizes
FIRM = 3.0  # factor on the required places if a table has unexplained columns or too many faults
SEARCHED, TRIED = 200, 2  # number of samples in the coarse search; number of candidates of each class that are fitted
PROMISE = 0.1  # a fit starts if the mean square residual, relative to the column or unfiltered fit, is at most this
FITS, WIDE = 15, 1.5  # largest number of steps of a fit, and its range in steps of the grid
SECANT, ENOUGH = 1e-8, 1e-6  # step of numerical derivatives; relative gain at which a fit ends
UNEVEN = 0.2  # fraction of the last place of the largest number; no number is taken to be more precise than this
WINDOW = 10  # number of successive values in a window for finding the dimension of a signal, or in a mean
SPIKE, WAVY, FAINT = 6.0, 0.1, 0.3  # limits for noise: multiples of its rms, fractions of the signal
MEDIAN = 0.6745 * np.sqrt(20.0)  # median absolute third difference of white noise, relative to its rms
MODES = ((False, False), (True, False), (False, True), (True, True))  # flags: factor is fitted, offset is fitted

Mode = tuple[bool, bool]


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column of a table.

    Attributes:
        values: Values of the table. Shape (n,).
        expected: Expected values. Shape (n,).
        scale: Scale of the scaled error [unit].
        tolerance: Absolute tolerance of the expected values [unit].
        place: Unit in the last printed place of each value. Shape (n,).
    """

    component: str
    unit: str
    values: Array
    expected: Array
    scale: float
    tolerance: float
    place: Array


@dataclass(frozen=True, slots=True)
class Explanation:
    """Faults that turn the expected values into the values of a column.

    Attributes:
        left: Remaining scaled error.
        dimension: Number of independent values that could differ, at the precision of the explanation.
        digits: Number of digits of the difference that are explained.
    """

    faults: tuple[Fault, ...]
    left: float
    dimension: int = 0
    digits: float = 0.0

    def convinces(self, known: Container[Key] = (), least: float = 1.0) -> bool:
        """Return True if more digits agree than fitted sizes explain; sizes found in other columns count as known."""
        tried = sum(fault.kind != "noise" for fault in self.faults)
        fitted = sum(fault.fitted and fault.key not in known for fault in self.faults)
        # white noise alone shows that nothing else is wrong
        return not tried or (self.dimension - fitted) * self.digits >= least * (EVIDENCE + tried)


def explanations(columns: Sequence[Column], expected: Expected) -> list[Explanation | None]:
    """Explain columns with as few faults as possible, preferring faults that many columns share.

    Returns:
        The explanation of each column: without faults if it agrees, None if nothing explains it.
    """
    found = _find_explanations(columns, expected)
    votes = Counter(key for some in found for key in {f.key for e in some if e.convinces() for f in e.faults})

    def rank(one: Explanation) -> tuple[int, int, float]:
        return len(one.faults), -sum(votes[fault.key] for fault in one.faults), one.left

    best = [min((e for e in some if e.convinces(votes)), key=rank, default=None) for some in found]
    every = {fault.kind if fault.kind == "permutation" else fault.key for e in best if e for fault in e.faults}
    if None not in best and len(every) <= MOST:
        return best
    shared = {key for key, n in votes.items() if n > 1}

    def firm(one: Explanation) -> bool:
        fitted = sum(fault.fitted and fault.key not in shared for fault in one.faults)
        return not fitted or (fitted == 1 and one.convinces(shared, FIRM))

    return [one if one and firm(one) else None for one in best]


def _find_explanations(columns: Sequence[Column], expected: Expected) -> list[list[Explanation]]:
    """Return, for each column, all explanations with the smallest number of faults."""
    X = np.stack([column.values for column in columns], axis=1)
    every = np.arange(len(X))
    plain = [_explain(column, every, column.expected, (), MODES[0]) for column in columns]
    found = [[one] if one and not one.faults else [] for one in plain]
    limits = np.full((4, len(columns), 1), PROMISE) * np.mean(X**2, axis=0)[:, None]
    gain = limits  # limit for a filter, which must improve on the numbers without it
    for family in expected.families():
        fewest = [min((len(e.faults) for e in some if e.convinces()), default=MOST + 1) for some in found]
        if not any(family.cost < least for least in fewest):
            continue
        left = np.array([_squares(X, *family.apply(size, slice(None))) for size in family.grid])
        for k, (column, some) in enumerate(zip(columns, found, strict=True)):
            if family.cost < fewest[k]:
                limit = gain[:, k] if family.kind in FILTERS else limits[:, k]
                some += _of_family(column, expected, family, (left[:, :, k], limit))
        gain = gain if family.cost else PROMISE * left[0]
    return found


def _of_family(
    column: Column, expected: Expected, family: Family, squares: tuple[Array, Array]
) -> Iterator[Explanation]:
    """Yield explanations that use a family of transformations.

    After a convincing explanation, stop at the first candidate with more faults."""
    named = [
        (*faults, *([Fault("permutation", name)] * (name != column.component)))
        for faults, name in zip(expected.faults, expected.components, strict=True)
    ]
    enough = MOST + 1
    costs = np.array([len(each) for each in named]) + family.cost
    for place, base, mode in _candidates(*squares, costs):
        if costs[base] + sum(mode) > enough:
            break
        size = _fit_size(column.values, family, place, base, mode) if family.smooth else float(family.grid[place])
        rows, numbers = family.apply(size, np.array([base]))
        faults = (*named[base], *family.faults(size))
        explained = _explain(column, rows, numbers[:, 0], faults, mode, family.error)
        if explained and len(explained.faults) <= MOST:
            yield explained
            enough = min(enough, len(explained.faults)) if explained.convinces() else enough


def _candidates(left: Array, limit: Array, costs: Array) -> list[tuple[int, int, Mode]]:
    """Return grid index, base and mode of the best candidates for each number of faults, fewest faults first.

    Args:
        left: Mean squared residuals for each grid index, mode and base. Shape (m, 4, k).
        limit: Largest mean squared residual of a candidate. Shape (4, k) or (4, 1).
        costs: Number of faults of each base. Shape (k,).
    """
    at, best = left.argmin(axis=0), left.min(axis=0)
    found = []
    for (m, mode), cost in product(enumerate(MODES), np.unique(costs)):
        some = np.flatnonzero((costs == cost) & (best[m] <= limit[m]))
        for base in some[np.argsort(best[m, some])[:TRIED]] if cost + sum(mode) <= MOST + 1 else ():
            found.append((int(cost) + sum(mode), (int(at[m, base]), int(base), mode)))
    return [one for _, one in sorted(found, key=lambda pair: pair[0])]


def _squares(X: Array, rows: Rows, numbers: Array) -> Array:
    """Fit each base to each column at selected samples; return mean squared residuals, (4, n_column, n_base)."""
    some = spread(len(rows), SEARCHED)
    X, numbers, left = X[rows[some]], numbers[some], list[Array]()
    for scaled, shifted in MODES:
        a, b = (X - X.mean(axis=0), numbers - numbers.mean(axis=0)) if shifted else (X, numbers)
        own, theirs, both = (a**2).sum(axis=0)[:, None], (b**2).sum(axis=0), a.T @ b
        left.append(own - both**2 / np.where(theirs > 0.0, theirs, np.inf) if scaled else own - 2.0 * both + theirs)
    return np.array(left) / len(some)


def _line(x: Array, b: Array, mode: Mode, factor: float | None = None) -> tuple[float, float]:
    """Fit a factor and an offset by least squares, so that ``factor b + offset`` is close to x. Shapes (n,)."""
    scaled, shifted = mode
    x0, b0 = (x.mean(), b.mean()) if shifted else (0.0, 0.0)
    if factor is None:
        size = float(((b - b0) ** 2).sum())
        factor = float((x - x0) @ (b - b0)) / size if scaled and size > 0.0 else 1.0
    return factor, float(x0 - factor * b0)


def _fit_size(x: Array, family: Family, place: int, base: int, mode: Mode) -> float:
    """Refine a size from the grid so that it minimises the squared residuals, by the Gauss-Newton method."""
    start, step = float(family.grid[place]), float(np.gradient(family.grid)[place])
    large = np.abs(x).max() or 1.0

    def residuals(v: float) -> Array:
        rows, numbers = family.apply(start + step * v, np.array([base]))
        factor, offset = _line(x[rows], numbers[:, 0], mode)
        out = np.zeros(len(x))
        out[rows] = (x[rows] - factor * numbers[:, 0] - offset) / large
        return out

    v, rest, share = 0.0, residuals(0.0), 1.0
    for _ in range(FITS):
        if share == 1.0:
            beside = np.copysign(SECANT, -v)  # stay within the bounds
            slope = (residuals(v + beside) - rest) / beside
        size, before = float(slope @ slope), float(rest @ rest)
        way = float(np.clip(v - slope @ rest / size, -WIDE, WIDE)) - v if size > 0.0 else 0.0
        after = residuals(v + share * way)
        gain = before - float(after @ after)
        if gain <= 0.0:
            share *= 0.25
        else:
            v, rest, share = v + share * way, after, 1.0
        if abs(share * way) < SECANT or 0.0 < gain < ENOUGH * before:
            break
    return start + step * v


def _explain(
    column: Column, rows: Rows, b: Array, faults: tuple[Fault, ...], mode: Mode, error: float = 0.0
) -> Explanation | None:
    """Return an explanation that adds factor and offset, if the residual is within the column's precision or noise."""
    x, names = column.values[rows], {1.0: "", **{f: name for name, f in UNITS.get(column.unit, {}).items()}}
    free, _ = _line(x, b, mode)
    known = [sign * f for f in names for sign in (1.0, -1.0) if mode[0] and abs(free / (sign * f) - 1.0) < 0.02]
    for factor in (*known, *([free] * (free != 0.0))):
        _, offset = _line(x, b, mode, factor)
        fit = factor * b + offset
        left = np.abs(x - fit)
        # the fit is as precise as the largest numbers allow
        place = np.maximum(column.place[rows], UNEVEN * column.place.max())
        admitted = place + abs(factor) * (column.tolerance + error * column.scale)
        more = [Fault("offset", size=offset)] * mode[1]
        if mode[0] and factor in known:
            named = [Fault("unit", names[abs(factor)], abs(factor))] * (abs(factor) != 1.0)
            more += [*[Fault("sign", size=-1.0)] * (factor < 0.0), *named]
        elif mode[0]:
            more.append(Fault("factor", size=factor))
        if (left <= admitted).all():
            level = fine = max(_rms(left), float(admitted.min()))
        elif level := 0.0 if any(fault.kind in FILTERS for fault in faults) else _noise(x - fit, fit):
            more.append(Fault("noise", size=level))
            fine = level * float(np.sqrt(WINDOW / len(x)))  # means over windows must be this close to zero
        else:
            continue
        size = _rms(fit) or 1.0
        wrong = min(_rms(x - column.expected[rows]), size)
        digits = float(np.log10(max(wrong / fine, 1.0)))
        scaled = float(left.max()) / (abs(factor) * column.scale)
        return Explanation((*faults, *more), scaled, _dimension(fit / size, level / (wrong or 1.0)), digits)
    return None


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _noise(left: Array, fit: Array) -> float:
    """Return the rms of a residual if it is white noise, judged by third differences and window means; otherwise 0."""
    if len(left) < NOISY:
        return 0.0
    rms, size = _rms(left), _rms(fit)
    # use medians, because a jump in a smooth signal is not noise
    quick, wavy = (float(np.median(np.abs(np.diff(each, 3)))) / MEDIAN for each in (left, fit))
    means = left[: len(left) // WINDOW * WINDOW].reshape(-1, WINDOW).mean(axis=1) * np.sqrt(WINDOW)
    white = rms <= (1.0 + 5.0 / np.sqrt(len(left))) * quick and np.abs(left).max() <= SPIKE * rms
    white = white and _rms(means) <= (1.0 + 3.0 / np.sqrt(len(means))) * rms
    return rms if white and wavy <= WAVY * size and rms <= FAINT * size else 0.0


def _dimension(signal: Array, level: float) -> int:
    """Count the independent values of a signal at a given precision: the rank of a matrix of its windows."""
    signal = signal[spread(len(signal), SEARCHED)]
    width = min(WINDOW, (len(signal) + 1) // 2)
    step = max(1, len(signal) // (2 * width))
    windows = sliding_window_view(signal, (width - 1) * step + 1)[:, ::step]
    values = np.linalg.svd(windows, compute_uv=False)
    return int((values > level * sum(np.sqrt(windows.shape))).sum())


def last_place(values: Array) -> Array:
    """Return the unit in each number's last printed place, judging by decimals and significant figures. Shape (n,)."""
    some = [Decimal(repr(float(value))).normalize().as_tuple() for value in values[spread(len(values), 500)] if value]
    places = min((int(one.exponent) for one in some), default=-17)
    figures = max((len(one.digits) for one in some), default=17)
    if figures > 9 and np.array_equal(values, single := values.astype(np.float32)):
        return np.asarray(np.spacing(np.abs(single)), dtype=float)
    size = np.floor(np.log10(np.maximum(np.abs(values), 1e-300)))
    return np.asarray(np.maximum(10.0**places, 10.0 ** (size + 1 - figures)))
