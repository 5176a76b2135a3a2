"""The pictures of a run: what engines say about a quantity, their curves over each other, the differences below."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Picture
from screwgauge.report.figures.page import arrange, linear_scale, log_scale, panels, saved
from screwgauge.report.figures.selection import drawable, select, short_labels
from screwgauge.report.figures.style import COLOURS, DASHES, GREY, INK, Look, styled
from screwgauge.report.formatting import file_name, missing, number, unit_text
from screwgauge.scene.figures import Figure
from screwgauge.solution import common_rows

if TYPE_CHECKING:
    from screwgauge.study.comparison import Comparison

MAX_CURVES = 12  # in a panel; more cannot be told apart
FLOOR = 1e-18  # where a difference of exactly zero is drawn if there is no other
MARKERS = ("o", "x", "+", "s", "^", "D")
TOLERANCE: Look = {"color": GREY, "linestyle": (0, (8, 3)), "linewidth": 1.6}
ZERO: Look = {"color": GREY, "linestyle": (0, (1, 2)), "linewidth": 1.0}
UPPER, LOWER, WIDTHS = 165.0, 115.0, {1: 576.0, 2: 720.0, 3: 864.0}
WIDE = 30.0  # ratio of largest to smallest condition number from which their axis is logarithmic
BINS = 250  # stretches of time of which the largest difference is drawn

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True, eq=False)
class _Subject:
    """A quantity as every engine has it.

    Attributes:
        t: Time [s]. Shape (n,).
        values: Engine -> component -> values, NaN where it has none. Shape (n,).
        solved: Engine -> whether it solved a sample. Shape (n,).
        panels: Titles and components.
    """

    t: Array
    values: dict[str, dict[str, Array]]
    solved: dict[str, NDArray[np.bool_]]
    panels: list[tuple[str, list[str]]]


@styled
def make_plots(comparison: Comparison) -> list[Picture]:
    """All pictures of the report, in order."""
    figures = drawable(tuple(comparison.scene.figures), comparison.solutions)
    plots = [_quantity(f"{i:02d}-{file_name(figure.title)}", figure, comparison) for i, figure in enumerate(figures, 1)]
    if any(np.isfinite(s.condition).any() for s in comparison.solutions.values()):
        plots.append(_condition(f"{len(plots) + 1:02d}-condition", comparison))
    return plots


def _quantity(name: str, figure: Figure, comparison: Comparison) -> Picture:
    subject, (pairs, tolerance) = _subject(figure, comparison), _compared(figure, comparison)
    first, *others = subject.values
    shown = [first, *(engine for engine in others if {(first, engine), (engine, first)} & {*pairs})]
    drawn = [_labels(names, subject.values[first]) for _, names in subject.panels]
    looks = {label: _line(i) for i, label in enumerate(dict.fromkeys(x for some in drawn for x in some.values()))}
    columns, unit = len(drawn), unit_text(figure.unit)
    heights = [UPPER, LOWER] if pairs else [UPPER]
    page = panels(WIDTHS[min(columns, 3)], heights, columns, sharex=True, sharey=True)
    for ax, (title, _), labels in zip(page.axes, subject.panels, drawn, strict=False):
        ax.set_title(title)
        _curves(ax, subject, {component: looks[label] for component, label in labels.items()}, shown)
    for ax in page.rows[-1]:
        ax.set_xlabel("t [s]")
    linear_scale(page.axes[0].yaxis)
    page.axes[0].set_ylabel(f"{figure.quantity.replace('_', ' ')} [{unit}]")
    below = {}
    if pairs:
        below = _differences(page.rows[1], subject, pairs, tolerance)
        page.rows[1][0].set_ylabel(f"difference [{unit}]")
    engines = {engine: _mark(k, INK) if k else {"color": INK, "linewidth": 1.4} for k, engine in enumerate(shown)}
    arrange(
        page,
        figure.title,
        warnings=[*_warnings(subject, shown, sum(map(len, drawn)))],
        above=[looks, engines],
        below=below,
    )
    return saved(page, name)


def _condition(name: str, comparison: Comparison) -> Picture:
    """Condition number of each engine's closure along the path: the largest of each stretch of samples."""
    finite = {e: np.where(np.isfinite(s.condition), s.condition, np.nan) for e, s in comparison.solutions.items()}
    lines = {engine: line for engine, line in finite.items() if not np.isnan(line).all()}
    page, looks = panels(WIDTHS[1], [UPPER]), {}
    (ax,) = page.axes
    for i, (engine, line) in enumerate(lines.items()):
        look = {**_mark(i + 1, _pair(i)["color"]), "linestyle": "-"}
        t, peak = bin_maxima(comparison.times, line)
        ax.plot(t, peak, markevery=sparse(len(t), i, len(lines)), **look)  # marks keep apart lines that coincide
        looks[engine] = look
    wide = np.nanmax([*lines.values()]) > WIDE * np.nanmin([*lines.values()])
    (log_scale if wide else linear_scale)(ax.yaxis)
    ax.set(xlabel="t [s]", ylabel="condition number [1]")
    arrange(page, "Condition number of the closure along the path", above=[looks])
    return saved(page, name)


def _subject(figure: Figure, comparison: Comparison) -> _Subject:
    # an engine that solved only some samples comes last: the first one is drawn as lines
    order = sorted(comparison.solutions.items(), key=lambda item: item[1].rows is not None)
    solutions = {engine: solution for engine, solution in order if figure.quantity in solution.values}
    found = {engine: solution.values[figure.quantity] for engine, solution in solutions.items()}
    shown = [(title, select(next(iter(found.values())), figure.unit, patterns)) for title, patterns in figure.panels]
    n = len(comparison.times)
    nothing = dict.fromkeys((name for _, names in shown for name in names), np.full(n, np.nan))
    values = {engine: nothing | dict(zip(v.components, v.array.T, strict=True)) for engine, v in found.items()}
    solved = {engine: np.isin(np.arange(n), common_rows(n, solution)) for engine, solution in solutions.items()}
    return _Subject(comparison.times, values, solved, shown)


def _labels(names: list[str], columns: Mapping[str, Array]) -> dict[str, str]:
    """Component -> label of those that are drawn; of too many, the ones that move most."""
    moving = sorted(names, key=lambda name: -float(np.ptp(np.nan_to_num(columns[name]))))[:MAX_CURVES]
    return {name: label for name, label in zip(names, short_labels(names), strict=True) if name in moving}


def _curves(ax: Axes, subject: _Subject, looks: Mapping[str, Look], shown: Sequence[str]) -> None:
    """The first engine as lines, the others as sparse marks in the same colours."""
    for name, look in looks.items():
        for k, engine in enumerate(shown):
            at, how = np.flatnonzero(subject.solved[engine]), look
            if k:
                at, how = at[sparse(len(at), k - 1, len(shown) - 1)], _mark(k, look["color"])
            elif len(at) == 1:
                how = {**look, "marker": "."}
            ax.plot(subject.t[at], subject.values[engine][name][at], **how)


def _differences(
    axes: Sequence[Axes], subject: _Subject, pairs: Sequence[Pair], tolerance: float | None
) -> dict[str, Look]:
    """The largest difference of each pair in each panel; grey lines for the tolerance and for zero.

    Returns:
        The legend.
    """
    peaks = [[_peaks(subject, names, pair) for pair in pairs] for _, names in subject.panels]
    numbers = np.concatenate([peak for panel in peaks for _, peak in panel])
    seen, zero = numbers[numbers > 0], bool((numbers == 0).any())
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (FLOOR, 10 * FLOOR)
    floor = max(10.0 ** (np.floor(np.log10(low)) - (1 if zero and len(seen) else 0)), 1e-300)
    legend = {f"|{a} - {b}|": _pair(i) for i, (a, b) in enumerate(pairs)}
    looks = list(legend.values())
    legend |= {f"tolerance {number(tolerance, 2)}": TOLERANCE} if tolerance else {}
    legend |= {"no difference at all": ZERO} if zero else {}
    for ax, panel in zip(axes, peaks, strict=True):
        for (t, peak), look in zip(panel, looks, strict=True):
            ax.plot(t, np.maximum(peak, floor), **(look if len(t) > 1 else {**look, "marker": "."}))
        for at, look in ((tolerance, TOLERANCE), (floor if zero else None, ZERO)):
            if at:
                ax.axhline(at, **look)
    top = 10.0 ** np.ceil(np.log10(1.5 * max(high, tolerance or 0.0)))
    axes[0].set_ylim(floor / 10 if zero else floor, top)
    log_scale(axes[0].yaxis)
    return legend


def _peaks(subject: _Subject, names: Sequence[str], pair: Pair) -> tuple[Array, Array]:
    """Largest difference over the components and over stretches of time; NaN as soon as one side is no number."""
    first, second = (subject.values[engine] for engine in pair)
    largest = np.max([np.abs(first[name] - second[name]) for name in names], axis=0)
    both = subject.solved[pair[0]] & subject.solved[pair[1]]
    return bin_maxima(subject.t[both], np.where(np.isfinite(largest), largest, np.nan)[both])


def bin_maxima(t: Array, v: Array, bins: int = BINS) -> tuple[Array, Array]:
    """The largest value of each of `bins` stretches, at its own time; NaN only where a stretch has no number.

    Args:
        t: Time [s]. Shape (n,).
        v: Values, at least 0 where they are numbers. Shape (n,).

    Returns:
        Times and maxima. Shapes (min(n, bins),).
    """
    if len(t) <= bins:
        return t, v
    stretch = np.arange(len(t)) * bins // len(t)
    falling = np.lexsort((np.where(np.isnan(v), 1.0, -v), stretch))  # within each stretch
    at = falling[np.searchsorted(stretch, np.arange(bins))]
    return t[at], v[at]


def sparse(n: int, slot: int, n_slots: int, marks: int = 9) -> NDArray[np.intp]:
    """About `marks` samples, staggered so that the marks of different engines do not hide each other."""
    if n <= 2 * marks:
        return np.arange(n)
    return np.unique(((np.arange(marks) + (slot + 0.5) / n_slots) * n / marks).astype(int))


def _line(i: int) -> Look:
    """Colour and dash of a component, the same in every panel of a diagram."""
    turn, i = divmod(i, len(COLOURS))
    return {"color": COLOURS[i], "linestyle": DASHES[turn % len(DASHES)], "linewidth": 1.4}


def _mark(k: int, colour: str) -> Look:
    """Marks of the k-th engine after the first."""
    marker = MARKERS[(k - 1) % len(MARKERS)]
    size = 5.5 if marker in "ox+" else 4.7
    return {"color": colour, "linestyle": "", "marker": marker, "markersize": size, "markerfacecolor": "none"}


def _pair(i: int) -> Look:
    """Colour and dash of a pair of engines."""
    return {"color": COLOURS[i % len(COLOURS) - 1], "linestyle": DASHES[i % len(DASHES)]}


def _compared(figure: Figure, comparison: Comparison) -> tuple[list[Pair], float | None]:
    """Pairs of engines that were compared in the figure's quantity; the tolerance if all have the same."""
    table = comparison.errors
    rows = table[(table["quantity"] == figure.quantity) & (table["unit"] == figure.unit)]
    limits = {number(limit, 4) for limit in rows["tolerance"] * rows["scale"] if not missing(limit)}
    pairs = list(dict.fromkeys(zip(rows["a"], rows["b"], strict=True)))
    return pairs, float(limits.pop()) if len(limits) == 1 else None


def _warnings(subject: _Subject, shown: Sequence[str], drawn: int) -> Iterable[str]:
    """What the curves, so many of them, do not show."""
    others = [engine for engine in subject.values if engine not in shown]
    if others:  # joint forces of an open tree, for one, differ from cut to cut
        yield f"Not comparable with {shown[0]} here, so without curves: {', '.join(others)}."
    names = [name for _, some in subject.panels for name in some]
    if drawn < len(names):
        yield f"Curves: the {drawn} of {len(names)} components that move most. Differences: all {len(names)}."
    for engine, solved in subject.solved.items():
        known = np.all([np.isfinite(subject.values[engine][name]) for name in names], axis=0)
        bad = subject.t[solved & ~known]
        if len(bad):
            span = f"t = {number(bad[0])} s" + (f" to {number(bad[-1])} s" if len(bad) > 1 else "")
            yield f"Gap: {engine} has no number at {len(bad)} of {solved.sum()} samples ({span})."
