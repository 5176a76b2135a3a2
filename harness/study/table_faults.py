"""Faults of a table: transformations tried on the expected numbers until they are those of the table.

A column is explained by the fewest transformations after which all its samples agree to the digits that it carries.
More has to agree than was fitted: what two machines have in common by their smoothness alone is no explanation.
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

MOST = 3  # faults of one column
EVIDENCE = 0.5  # decimal places that agree beyond what was fitted, and beyond one more for each fault
FIRM = 3.0  # times as many where a table has columns that nothing explains, or more faults than one makes
SEARCHED, TRIED = 200, 2  # samples that the coarse search looks at; candidates of each class that are fitted
PROMISE = 0.1  # share of the squares of a column, or of those without a filter, that may be left where a fit begins
FITS, WIDE = 15, 1.5  # steps of a fit, and how far they may lead in steps of the grid
SECANT, ENOUGH = 1e-8, 1e-6  # step that gives a derivative; relative gain at which a fit ends
UNEVEN = 0.2  # of the last place of the largest number: no smaller number is read more closely
WINDOW = 10  # numbers in a row by which the dimension of a signal is counted, or whose mean is looked at
SPIKE, WAVY, FAINT = 6.0, 0.1, 0.3  # of noise: multiples of its rms, shares of the signal
MEDIAN = 0.6745 * np.sqrt(20.0)  # of the sizes of third differences of white noise, over its rms
MODES = ((False, False), (True, False), (False, True), (True, True))  # whether factor and offset are fitted

Mode = tuple[bool, bool]


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column of a table.

    Attributes:
        values: Shape (n,).
        expected: What they should be. Shape (n,).
        scale: S of the scaled error [unit].
        tolerance: Absolute, of the expected numbers [unit].
        place: Unit in the last place that is printed. Shape (n,).
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
    """Faults that make the expected numbers those of a column.

    Attributes:
        left: Scaled error that is left.
        dimension: How many independent numbers could differ, at the precision to which their difference is explained.
        digits: Digits of the difference that are explained.
    """

    faults: tuple[Fault, ...]
    left: float
    dimension: int = 0
    digits: float = 0.0

    def convinces(self, known: Container[Key] = (), least: float = 1.0) -> bool:
        """True if more of the difference agrees than was fitted, counting sizes that other columns show as known."""
        tried = sum(fault.kind != "noise" for fault in self.faults)
        fitted = sum(fault.fitted and fault.key not in known for fault in self.faults)
        # noise that is white shows that nothing else is wrong
        return not tried or (self.dimension - fitted) * self.digits >= least * (EVIDENCE + tried)


def explanations(columns: Sequence[Column], expected: Expected) -> list[Explanation | None]:
    """Explains columns, each by the fewest faults, among these by those that most columns share.

    Returns:
        For each column: no faults if it agrees, None if nothing explains it.
    """
    found = _found(columns, expected)
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


def _found(columns: Sequence[Column], expected: Expected) -> list[list[Explanation]]:
    """All explanations of each column by its fewest faults."""
    X = np.stack([column.values for column in columns], axis=1)
    every = np.arange(len(X))
    plain = [_explained(column, every, column.expected, (), MODES[0]) for column in columns]
    found = [[one] if one and not one.faults else [] for one in plain]
    limits = np.full((4, len(columns), 1), PROMISE) * np.mean(X**2, axis=0)[:, None]
    gain = limits  # of a filter: what it has to come near to, better than the numbers without it
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
    """Explanations with a transformation of this family, until one convinces and the next has more faults."""
    named = [
        (*faults, *([Fault("permutation", name)] * (name != column.component)))
        for faults, name in zip(expected.faults, expected.components, strict=True)
    ]
    enough = MOST + 1
    costs = np.array([len(each) for each in named]) + family.cost
    for place, base, mode in _candidates(*squares, costs):
        if costs[base] + sum(mode) > enough:
            break
        size = _fitted(column.values, family, place, base, mode) if family.smooth else float(family.grid[place])
        rows, numbers = family.apply(size, np.array([base]))
        faults = (*named[base], *family.faults(size))
        explained = _explained(column, rows, numbers[:, 0], faults, mode, family.error)
        if explained and len(explained.faults) <= MOST:
            yield explained
            enough = min(enough, len(explained.faults)) if explained.convinces() else enough


def _candidates(left: Array, limit: Array, costs: Array) -> list[tuple[int, int, Mode]]:
    """Place in the grid, base and mode with the least squares left of each number of faults, the fewest faults first.

    Args:
        left: Mean squares by place, mode and base. Shape (m, 4, k).
        limit: Of what is tried. Shape (4, k) or (4, 1).
        costs: Faults of each base. Shape (k,).
    """
    at, best = left.argmin(axis=0), left.min(axis=0)
    found = []
    for (m, mode), cost in product(enumerate(MODES), np.unique(costs)):
        some = np.flatnonzero((costs == cost) & (best[m] <= limit[m]))
        for base in some[np.argsort(best[m, some])[:TRIED]] if cost + sum(mode) <= MOST + 1 else ():
            found.append((int(cost) + sum(mode), (int(at[m, base]), int(base), mode)))
    return [one for _, one in sorted(found, key=lambda pair: pair[0])]


def _squares(X: Array, rows: Rows, numbers: Array) -> Array:
    """Mean squares that a fit of each base to each column leaves, at some samples. Shape (4, n_column, n_base)."""
    some = spread(len(rows), SEARCHED)
    X, numbers, left = X[rows[some]], numbers[some], list[Array]()
    for scaled, shifted in MODES:
        a, b = (X - X.mean(axis=0), numbers - numbers.mean(axis=0)) if shifted else (X, numbers)
        own, theirs, both = (a**2).sum(axis=0)[:, None], (b**2).sum(axis=0), a.T @ b
        left.append(own - both**2 / np.where(theirs > 0.0, theirs, np.inf) if scaled else own - 2.0 * both + theirs)
    return np.array(left) / len(some)


def _line(x: Array, b: Array, mode: Mode, factor: float | None = None) -> tuple[float, float]:
    """Factor and offset from b to x by least squares. Shape (n,)."""
    scaled, shifted = mode
    x0, b0 = (x.mean(), b.mean()) if shifted else (0.0, 0.0)
    if factor is None:
        size = float(((b - b0) ** 2).sum())
        factor = float((x - x0) @ (b - b0)) / size if scaled and size > 0.0 else 1.0
    return factor, float(x0 - factor * b0)


def _fitted(x: Array, family: Family, place: int, base: int, mode: Mode) -> float:
    """Return the size next to one of the grid that leaves least squares, by Gauss and Newton's method."""
    start, step = float(family.grid[place]), float(np.gradient(family.grid)[place])
    large = np.abs(x).max() or 1.0

    def left(v: float) -> Array:
        rows, numbers = family.apply(start + step * v, np.array([base]))
        factor, offset = _line(x[rows], numbers[:, 0], mode)
        out = np.zeros(len(x))
        out[rows] = (x[rows] - factor * numbers[:, 0] - offset) / large
        return out

    v, rest, share = 0.0, left(0.0), 1.0
    for _ in range(FITS):
        if share == 1.0:
            beside = np.copysign(SECANT, -v)  # within the bounds
            slope = (left(v + beside) - rest) / beside
        size, before = float(slope @ slope), float(rest @ rest)
        way = float(np.clip(v - slope @ rest / size, -WIDE, WIDE)) - v if size > 0.0 else 0.0
        after = left(v + share * way)
        gain = before - float(after @ after)
        if gain <= 0.0:
            share *= 0.25
        else:
            v, rest, share = v + share * way, after, 1.0
        if abs(share * way) < SECANT or 0.0 < gain < ENOUGH * before:
            break
    return start + step * v


def _explained(
    column: Column, rows: Rows, b: Array, faults: tuple[Fault, ...], mode: Mode, error: float = 0.0
) -> Explanation | None:
    """Faults with factor and offset, if what they leave is within what the column carries, or is noise."""
    x, names = column.values[rows], {1.0: "", **{f: name for name, f in UNITS.get(column.unit, {}).items()}}
    free, _ = _line(x, b, mode)
    known = [sign * f for f in names for sign in (1.0, -1.0) if mode[0] and abs(free / (sign * f) - 1.0) < 0.02]
    for factor in (*known, *([free] * (free != 0.0))):
        _, offset = _line(x, b, mode, factor)
        fit = factor * b + offset
        left = np.abs(x - fit)
        # the fit is as good as the largest numbers allow
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
            fine = level * float(np.sqrt(WINDOW / len(x)))  # its means are that near to zero
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
    """The rms of what is left if that is white noise: no larger than third differences say; 0 if it is not."""
    if len(left) < NOISY:
        return 0.0
    rms, size = _rms(left), _rms(fit)
    # by medians, as one jump in what is smooth is no noise; those of white noise are as large as its rms
    quick, wavy = (float(np.median(np.abs(np.diff(each, 3)))) / MEDIAN for each in (left, fit))
    means = left[: len(left) // WINDOW * WINDOW].reshape(-1, WINDOW).mean(axis=1) * np.sqrt(WINDOW)
    white = rms <= (1.0 + 5.0 / np.sqrt(len(left))) * quick and np.abs(left).max() <= SPIKE * rms
    white = white and _rms(means) <= (1.0 + 3.0 / np.sqrt(len(means))) * rms
    return rms if white and wavy <= WAVY * size and rms <= FAINT * size else 0.0


def _dimension(signal: Array, level: float) -> int:
    """Count the numbers that a signal needs at a precision: the rank of windows of it."""
    signal = signal[spread(len(signal), SEARCHED)]
    width = min(WINDOW, (len(signal) + 1) // 2)
    step = max(1, len(signal) // (2 * width))
    windows = sliding_window_view(signal, (width - 1) * step + 1)[:, ::step]
    values = np.linalg.svd(windows, compute_uv=False)
    return int((values > level * sum(np.sqrt(windows.shape))).sum())


def last_place(values: Array) -> Array:
    """The unit in the last place that numbers were printed to, by decimals or by figures. Shape (n,)."""
    some = [Decimal(repr(float(value))).normalize().as_tuple() for value in values[spread(len(values), 500)] if value]
    places = min((int(one.exponent) for one in some), default=-17)
    figures = max((len(one.digits) for one in some), default=17)
    if figures > 9 and np.array_equal(values, single := values.astype(np.float32)):
        return np.asarray(np.spacing(np.abs(single)), dtype=float)
    size = np.floor(np.log10(np.maximum(np.abs(values), 1e-300)))
    return np.asarray(np.maximum(10.0**places, 10.0 ** (size + 1 - figures)))
