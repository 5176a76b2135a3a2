"""The pictures of a run: what engines say about a quantity, their curves over each other, the differences below."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.report.figures.page import Plot, arrange, linear_scale, log_scale, panels, saved
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
class _Part:
    """The components of one panel, and the labels of those that are drawn."""

    title: str
    names: list[str]
    drawn: dict[str, str]


@dataclass(frozen=True, slots=True, eq=False)
class _Subject:
    """A quantity as every engine has it.

    Attributes:
        t: Time [s]. Shape (n,).
        values: Engine -> component -> values, NaN at samples that it did not solve. Shape (n,).
        solved: Engine -> whether it solved a sample. Shape (n,).
    """

    t: Array
    values: dict[str, dict[str, Array]]
    solved: dict[str, NDArray[np.bool_]]
    parts: list[_Part]

    def column(self, engine: str, name: str) -> Array:
        """NaN for a component that the engine lacks. Shape (n,)."""
        return self.values[engine].get(name, np.full(len(self.t), np.nan))


@styled
def make_plots(comparison: Comparison) -> list[Plot]:
    """All pictures of the report, in order."""
    figures = drawable(tuple(comparison.scene.figures), comparison.solutions)
    plots = [_quantity(f"{i:02d}-{file_name(figure.title)}", figure, comparison) for i, figure in enumerate(figures, 1)]
    if any(np.isfinite(s.condition).any() for s in comparison.solutions.values()):
        plots.append(_condition(f"{len(plots) + 1:02d}-condition", comparison))
    return plots


def _quantity(name: str, figure: Figure, comparison: Comparison) -> Plot:
    subject, (pairs, tolerance) = _subject(figure, comparison), _compared(figure, comparison)
    first, *others = subject.values
    shown = [first, *(engine for engine in others if {(first, engine), (engine, first)} & {*pairs})]
    labels = dict.fromkeys(label for part in subject.parts for label in part.drawn.values())
    looks = {label: _line(i) for i, label in enumerate(labels)}
    columns, unit = len(subject.parts), unit_text(figure.unit)
    heights = [UPPER, LOWER] if pairs else [UPPER]
    page = panels(WIDTHS[min(columns, 3)], heights, columns, sharex=True, sharey="row")
    for ax, part in zip(page.axes, subject.parts, strict=False):
        ax.set_title(part.title)
        _curves(ax, subject, part, shown, looks)
    for ax in page.rows[-1]:
        ax.set_xlabel("t [s]")
    linear_scale(page.axes[0].yaxis)
    page.axes[0].set_ylabel(f"{figure.quantity.replace('_', ' ')} [{unit}]")
    below = {}
    if pairs:
        below = _differences(page.rows[1], subject, pairs, tolerance)
        page.rows[1][0].set_ylabel(f"difference [{unit}]")
    engines = {engine: _mark(k, INK) if k else {"color": INK, "linewidth": 1.4} for k, engine in enumerate(shown)}
    arrange(page, figure.title, warnings=[*_warnings(subject, shown)], above=[looks, engines], below=below)
    return saved(page, name, figure.title)


def _condition(name: str, comparison: Comparison) -> Plot:
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
    if np.nanmax([*lines.values()]) > WIDE * np.nanmin([*lines.values()]):
        ax.set_yscale("log")
        log_scale(ax.yaxis)
    else:
        linear_scale(ax.yaxis)
    ax.set(xlabel="t [s]", ylabel="condition number [1]")
    title = "Condition number of the closure along the path"
    arrange(page, title, above=[looks])
    return saved(page, name, title)


def _subject(figure: Figure, comparison: Comparison) -> _Subject:
    # an engine that solved only some samples comes last: the first one is drawn as lines
    order = sorted(comparison.solutions.items(), key=lambda item: item[1].rows is not None)
    solutions = {engine: solution for engine, solution in order if figure.quantity in solution.values}
    values = {engine: solution.values[figure.quantity] for engine, solution in solutions.items()}
    columns = {engine: dict(zip(v.components, v.array.T, strict=True)) for engine, v in values.items()}
    n, first = len(comparison.times), next(iter(values))
    solved = {engine: np.isin(np.arange(n), common_rows(n, solution)) for engine, solution in solutions.items()}
    parts = [_part(title, select(values[first], figure.unit, p), columns[first]) for title, p in figure.panels]
    return _Subject(comparison.times, columns, solved, parts)


def _part(title: str, names: list[str], columns: dict[str, Array]) -> _Part:
    """Of too many components, the ones that move most are drawn."""
    chosen, labels = names, dict(zip(names, short_labels(names), strict=True))
    if len(names) > MAX_CURVES:
        span = {name: float(np.ptp(np.nan_to_num(columns[name]))) for name in names}
        chosen = sorted(names, key=lambda name: -span[name])[:MAX_CURVES]
    return _Part(title, names, {name: label for name, label in labels.items() if name in chosen})


def _curves(ax: Axes, subject: _Subject, part: _Part, shown: Sequence[str], looks: Mapping[str, Look]) -> None:
    """The first engine as lines, the others as sparse marks in the same colours."""
    for name, label in part.drawn.items():
        for k, engine in enumerate(shown):
            at, look = np.flatnonzero(subject.solved[engine]), looks[label]
            if k:
                at, look = at[sparse(len(at), k - 1, len(shown) - 1)], _mark(k, look["color"])
            elif len(at) == 1:
                look = {**look, "marker": "."}
            ax.plot(subject.t[at], subject.column(engine, name)[at], **look)


def _differences(
    axes: Sequence[Axes], subject: _Subject, pairs: Sequence[Pair], tolerance: float | None
) -> dict[str, Look]:
    """The largest difference of each pair in each panel; grey lines for the tolerance and for zero.

    Returns:
        The legend.
    """
    peaks = [[_peaks(subject, part, pair) for pair in pairs] for part in subject.parts]
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
    axes[0].set(yscale="log", ylim=(floor / 10 if zero else floor, top))
    log_scale(axes[0].yaxis)
    return legend


def _peaks(subject: _Subject, part: _Part, pair: Pair) -> tuple[Array, Array]:
    """Largest difference over the components and over stretches of time; NaN as soon as one side is no number."""
    first, second = pair
    differences = [np.abs(subject.column(first, name) - subject.column(second, name)) for name in part.names]
    largest, both = np.max(differences, axis=0), subject.solved[first] & subject.solved[second]
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


def _warnings(subject: _Subject, shown: Sequence[str]) -> Iterable[str]:
    """What the curves do not show."""
    others = [engine for engine in subject.values if engine not in shown]
    if others:  # joint forces of an open tree, for one, differ from cut to cut
        yield f"Not comparable with {shown[0]} here, so without curves: {', '.join(others)}."
    names = [name for part in subject.parts for name in part.names]
    kept = sum(len(part.drawn) for part in subject.parts)
    if kept < len(names):
        yield f"Curves: the {kept} of {len(names)} components that move most. Differences: all {len(names)}."
    for engine, solved in subject.solved.items():
        known = np.all([np.isfinite(subject.column(engine, name)) for name in names], axis=0)
        bad = subject.t[solved & ~known]
        if len(bad):
            span = f"t = {number(bad[0])} s" + (f" to {number(bad[-1])} s" if len(bad) > 1 else "")
            yield f"Gap: {engine} has no number at {len(bad)} of {solved.sum()} samples ({span})."
