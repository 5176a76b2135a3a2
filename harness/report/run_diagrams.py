"""What engines say about one quantity: their curves over each other, the differences below."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.report.figures.axes import linear, log
from screwgauge.report.figures.curves import bin_maxima, sparse, thin
from screwgauge.report.figures.data import Axis, Diagram, Guide, Legend, Look, Panel, Row, Series
from screwgauge.report.figures.looks import COLOURS, DASHES, GREY
from screwgauge.report.figures.selection import select, short_labels
from screwgauge.report.formatting import missing, number, unit_text
from screwgauge.scene.figures import Figure
from screwgauge.solution import common_rows

if TYPE_CHECKING:
    from screwgauge.study.comparison import Comparison

MAX_CURVES = 12  # in a panel; more cannot be told apart
FLOOR = 1e-18  # where a difference of exactly zero is drawn if there is no other
MARKERS = ("o", "x", "+", "s", "^", "D")
TOLERANCE, ZERO, INK = Look(GREY, (8.0, 3.0), 1.6), Look(GREY, (1.0, 2.0), 1.0), "#333333"
UPPER, LOWER, WIDTHS = 165.0, 115.0, {1: 576.0, 2: 720.0, 3: 864.0}
WIDE = 30.0  # ratio of largest to smallest condition number from which their axis is logarithmic

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


def quantity_diagram(figure: Figure, comparison: Comparison) -> Diagram:
    """The diagram of one figure that a scene asks for."""
    subject, (pairs, tolerance) = _subject(figure, comparison), _compared(figure, comparison)
    first, *others = subject.values
    shown = [first, *(engine for engine in others if {(first, engine), (engine, first)} & {*pairs})]
    unit, time = unit_text(figure.unit), linear("t [s]", [subject.t], 6, 0.02)
    quiet = replace(time, label="", ticks=tuple((at, "") for at, _ in time.ticks))
    labels = dict.fromkeys(label for part in subject.parts for label in part.drawn.values())
    looks = {label: _component(i) for i, label in enumerate(labels)}
    drawn = [subject.column(engine, name) for part in subject.parts for name in part.drawn for engine in shown]
    up = linear(f"{figure.quantity.replace('_', ' ')} [{unit}]", drawn)
    panels = []
    for part in subject.parts:
        series = tuple(_curves(subject, part, shown, looks, up.high - up.low))
        panels.append(Panel(quiet if pairs else time, up, series, (part.title,) if part.title else ()))
    rows = [Row(tuple(panels), UPPER)]
    if pairs:
        rows.append(_differences(subject, pairs, tolerance, time, f"difference [{unit}]"))
    engines = {engine: _mark(k, INK) if k else Look(INK, width=1.4) for k, engine in enumerate(shown)}
    width, warnings = WIDTHS[min(len(panels), 3)], tuple(_warnings(subject, shown))
    return Diagram(figure.title, tuple(rows), width, warnings=warnings, legends=(looks, engines))


def condition_diagram(comparison: Comparison) -> Diagram:
    """Condition number of each engine's closure along the path: the largest of each stretch of samples."""
    finite = {e: np.where(np.isfinite(s.condition), s.condition, np.nan) for e, s in comparison.solutions.items()}
    lines = {engine: line for engine, line in finite.items() if not np.isnan(line).all()}
    series, legend = [], {}
    for i, (engine, line) in enumerate(lines.items()):
        t, peak = bin_maxima(comparison.times, line)
        at = sparse(len(t), i, len(lines))  # marks keep lines apart that coincide
        mark = _mark(i + 1, _pair(i).colour)
        legend[engine] = replace(mark, dash=())
        series += [Series(t, peak, Look(mark.colour)), Series(t[at], peak[at], mark)]
    numbers = np.concatenate([line[np.isfinite(line)] for line in lines.values()])
    axis = log if numbers.max() > WIDE * numbers.min() else linear
    panel = Panel(linear("t [s]", [comparison.times], 6, 0.02), axis("condition number [1]", [numbers]), tuple(series))
    title = "Condition number of the closure along the path"
    return Diagram(title, (Row((panel,), UPPER),), WIDTHS[1], legends=(legend,))


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


def _curves(subject: _Subject, part: _Part, shown: Sequence[str], looks: Legend, height: float) -> Iterable[Series]:
    """The first engine as lines, the others as sparse marks in the same colours."""
    for name, label in part.drawn.items():
        for k, engine in enumerate(shown):
            solved = subject.solved[engine]
            t, v = subject.t[solved], subject.column(engine, name)[solved]
            if k:
                at = sparse(len(t), k - 1, len(shown) - 1)
                yield Series(t[at], v[at], _mark(k, looks[label].colour))
            else:
                yield Series(*thin(t, v, height), looks[label])


def _differences(subject: _Subject, pairs: Sequence[Pair], tolerance: float | None, time: Axis, label: str) -> Row:
    """The largest difference of each pair in each panel; grey lines for the tolerance and for zero."""
    peaks = [[_peaks(subject, part, pair) for pair in pairs] for part in subject.parts]
    numbers = np.concatenate([peak for panel in peaks for _, peak in panel])
    seen, zero = numbers[numbers > 0], bool((numbers == 0).any())
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (FLOOR, 10 * FLOOR)
    floor = max(10.0 ** (np.floor(np.log10(low)) - (1 if zero and len(seen) else 0)), 1e-300)
    up = log(label, [np.array([floor / 10 if zero else floor, 1.5 * max(high, tolerance or 0.0)])])
    legend = {f"|{a} - {b}|": _pair(i) for i, (a, b) in enumerate(pairs)}
    panels, looks = [], list(legend.values())
    guides = [*([Guide(tolerance, TOLERANCE)] if tolerance else []), *([Guide(floor, ZERO)] if zero else [])]
    legend |= {f"tolerance {number(tolerance, 2)}": TOLERANCE} if tolerance else {}
    legend |= {"no difference at all": ZERO} if zero else {}
    for panel in peaks:
        series = [Series(t, np.maximum(peak, floor), look) for (t, peak), look in zip(panel, looks, strict=True)]
        panels.append(Panel(time, up, tuple(series), guides=tuple(guides)))
    return Row(tuple(panels), LOWER, legend)


def _peaks(subject: _Subject, part: _Part, pair: Pair) -> tuple[Array, Array]:
    """Largest difference over the components and over stretches of time; NaN as soon as one side is no number."""
    first, second = pair
    differences = [np.abs(subject.column(first, name) - subject.column(second, name)) for name in part.names]
    largest, both = np.max(differences, axis=0), subject.solved[first] & subject.solved[second]
    return bin_maxima(subject.t[both], np.where(np.isfinite(largest), largest, np.nan)[both])


def _component(i: int) -> Look:
    """Colour and dash of a component, the same in every panel of a diagram."""
    turn, i = divmod(i, len(COLOURS))
    return Look(COLOURS[i], DASHES[turn % len(DASHES)], 1.4)


def _mark(k: int, colour: str) -> Look:
    """Marks of the k-th engine after the first."""
    marker = MARKERS[(k - 1) % len(MARKERS)]
    return Look(colour, None, 1.1, marker, "none", 5.5 if marker in "ox+" else 4.7)


def _pair(i: int) -> Look:
    """Colour and dash of a pair of engines."""
    return Look(COLOURS[i % len(COLOURS) - 1], DASHES[i % len(DASHES)])


def _compared(figure: Figure, comparison: Comparison) -> tuple[list[tuple[str, str]], float | None]:
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
