"""What engines say about one quantity: their curves over each other, the differences below."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.report.figures.axes import linear, log
from screwgauge.report.figures.curves import bin_maxima, envelope, sparse, thin
from screwgauge.report.figures.data import Axis, Diagram, Guide, Legend, Look, Panel, Row, Series
from screwgauge.report.figures.looks import COLOURS, DASHES, GREY
from screwgauge.report.figures.selection import select, short_labels
from screwgauge.report.formatting import missing, number, unit_text
from screwgauge.scene.figures import Figure
from screwgauge.solution import Values, common_rows
from screwgauge.study.results import Results

MAX_CURVES = 12  # in a panel; more cannot be told apart
FLOOR = 1e-18  # where a difference of exactly zero is drawn if there is no other
MARKERS = ("o", "x", "+", "s", "^", "D")
TOLERANCE, ZERO, INK = Look(GREY, (8.0, 3.0), 1.6), Look(GREY, (1.0, 2.0), 1.0), "#333333"
UPPER, LOWER, WIDTHS = 165.0, 115.0, {1: 576.0, 2: 720.0, 3: 864.0}
WIDE = 30.0  # ratio of largest to smallest condition number from which their axis is logarithmic

Line = tuple[Array, Array]  # times and values, shapes (n,) and (n,) or (n, n_component)


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """The components of one panel: all of them as columns of the quantity; those drawn, with their names."""

    label: str
    columns: list[int]
    drawn: dict[int, str]


def comparison(figure: Figure, results: Results) -> Diagram:
    """The diagram of one figure that a scene asks for."""
    # an engine that solved only some samples comes last: the first one is drawn as lines
    order = sorted(results.solutions.items(), key=lambda item: item[1].rows is not None)
    solutions = {engine: s for engine, s in order if figure.quantity in s.values}
    t, n, first = results.times, len(results.times), next(iter(solutions))
    model = solutions[first].values[figure.quantity]
    parts = [_part(label, patterns, figure.unit, model) for label, patterns in figure.panels]
    arrays = {e: _aligned(s.values[figure.quantity], model.components) for e, s in solutions.items()}
    rows = {e: common_rows(n, s) for e, s in solutions.items()}
    curves = {e: (t[rows[e]], array[rows[e]]) for e, array in arrays.items()}
    pairs, tolerance = _compared(figure, results)
    shown = {e: curves[e] for e in arrays if e == first or {(first, e), (e, first)} & {*pairs}}

    time, unit = linear("t [s]", [t], 6, 0.02), unit_text(figure.unit)
    quiet = replace(time, label="", ticks=tuple((at, "") for at, _ in time.ticks))
    drawn = [array[:, list(part.drawn)] for part in parts for _, array in shown.values()]
    up = linear(f"{figure.quantity.replace('_', ' ')} [{unit}]", drawn)
    names = dict.fromkeys(name for part in parts for name in part.drawn.values())
    looks = {name: _line(i) for i, name in enumerate(names)}
    panels = []
    for part in parts:
        series = tuple(_series(part, list(shown.values()), looks, up.high - up.low))
        panels.append(Panel(quiet if pairs else time, up, series, (part.label,) if part.label else ()))
    drawing = [Row(tuple(panels), UPPER)]
    if pairs:
        lines: dict[tuple[str, str], list[Line]] = {}
        for a, b in pairs:
            at = common_rows(n, solutions[a], solutions[b])
            gaps = (envelope(arrays[a][:, part.columns], arrays[b][:, part.columns]) for part in parts)
            lines[a, b] = [bin_maxima(t[at], gap[at]) for gap in gaps]
        drawing.append(_differences(lines, tolerance, time, f"difference [{unit}]"))
    engines = {e: _mark(k, INK) if k else Look(INK, width=1.4) for k, e in enumerate(shown)}
    warnings = (*_incomparable(first, [e for e in arrays if e not in shown]), *_left_out(parts), *_gaps(curves, parts))
    return Diagram(
        figure.title, tuple(drawing), WIDTHS[min(len(parts), 3)], warnings=warnings, legends=(looks, engines)
    )


def condition(results: Results) -> Diagram:
    """Condition number of each engine's closure along the path: the largest of each stretch of samples."""
    finite = {e: np.where(np.isfinite(s.condition), s.condition, np.nan) for e, s in results.solutions.items()}
    lines = {engine: line for engine, line in finite.items() if not np.isnan(line).all()}
    series, legend = [], {}
    for i, (engine, line) in enumerate(lines.items()):
        t, peak = bin_maxima(results.times, line)
        at = sparse(len(t), i, len(lines))  # marks keep lines apart that coincide
        mark = _mark(i + 1, _pair(i).colour)
        legend[engine] = replace(mark, dash=())
        series += [Series(t, peak, Look(mark.colour)), Series(t[at], peak[at], mark)]
    numbers = np.concatenate([line[np.isfinite(line)] for line in lines.values()])
    axis = log if numbers.max() > WIDE * numbers.min() else linear
    panel = Panel(linear("t [s]", [results.times], 6, 0.02), axis("condition number [1]", [numbers]), tuple(series))
    title = "Condition number of the closure along the path"
    return Diagram(title, (Row((panel,), UPPER),), WIDTHS[1], legends=(legend,))


def _part(label: str, patterns: tuple[str, ...], unit: str, values: Values) -> _Part:
    """The components that match; of too many, the ones that move most are drawn."""
    columns = select(values, unit, patterns)
    names = short_labels([values.components[i] for i in columns])
    span = np.ptp(np.nan_to_num(values.array[:, columns]), axis=0)
    chosen = sorted(np.argsort(-span, kind="stable")[:MAX_CURVES].tolist())
    return _Part(label, columns, {columns[i]: names[i] for i in chosen})


def _series(part: _Part, engines: Sequence[Line], looks: Legend, height: float) -> Iterable[Series]:
    """The first engine as lines, the others as sparse marks in the same colours."""
    for column, name in part.drawn.items():
        for k, (t, array) in enumerate(engines):
            if k:
                at = sparse(len(t), k - 1, len(engines) - 1)
                yield Series(t[at], array[at, column], _mark(k, looks[name].colour))
            else:
                yield Series(*thin(t, array[:, column], height), looks[name])


def _differences(
    lines: Mapping[tuple[str, str], Sequence[Line]], tolerance: float | None, time: Axis, label: str
) -> Row:
    """The largest difference of each pair in each panel; grey lines for the tolerance and for zero."""
    numbers = np.concatenate([peak for panels in lines.values() for _, peak in panels])
    seen, zero = numbers[numbers > 0], bool((numbers == 0).any())
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (FLOOR, 10 * FLOOR)
    floor = max(10.0 ** (np.floor(np.log10(low)) - (1 if zero and len(seen) else 0)), 1e-300)
    up = log(label, [np.array([floor / 10 if zero else floor, 1.5 * max(high, tolerance or 0.0)])])
    looks = [_pair(i) for i in range(len(lines))]
    legend = {f"|{a} - {b}|": look for (a, b), look in zip(lines, looks, strict=True)}
    guides = []
    if tolerance:
        guides.append(Guide(tolerance, TOLERANCE))
        legend[f"tolerance {number(tolerance, 2)}"] = TOLERANCE
    if zero:
        guides.append(Guide(floor, ZERO))
        legend["no difference at all"] = ZERO
    panels = []
    for part in zip(*lines.values(), strict=True):
        series = [Series(t, np.maximum(peak, floor), look) for (t, peak), look in zip(part, looks, strict=True)]
        panels.append(Panel(time, up, tuple(series), guides=tuple(guides)))
    return Row(tuple(panels), LOWER, legend)


def _line(i: int) -> Look:
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


def _compared(figure: Figure, results: Results) -> tuple[list[tuple[str, str]], float | None]:
    """Pairs of engines that were compared in the figure's quantity; the tolerance if all have the same."""
    table = results.errors
    rows = table[(table["quantity"] == figure.quantity) & (table["unit"] == figure.unit)]
    limits = {number(limit, 4) for limit in rows["tolerance"] * rows["scale"] if not missing(limit)}
    return list(dict.fromkeys(zip(rows["a"], rows["b"], strict=True))), float(limits.pop()) if len(
        limits
    ) == 1 else None


def _aligned(values: Values, components: Sequence[str]) -> Array:
    """Columns in the order of the first engine; NaN for a component that this one lacks."""
    if values.components == tuple(components):
        return values.array
    place = {name: i for i, name in enumerate(values.components)}
    nothing = np.full(len(values.array), np.nan)
    return np.column_stack([values.array[:, place[n]] if n in place else nothing for n in components])


def _incomparable(first: str, others: Sequence[str]) -> list[str]:
    """Joint forces of an open tree, for one, differ from cut to cut."""
    return [f"Not comparable with {first} here, so without curves: {', '.join(others)}."] if others else []


def _left_out(parts: Sequence[_Part]) -> list[str]:
    kept, total = sum(len(part.drawn) for part in parts), sum(len(part.columns) for part in parts)
    words = f"Curves: the {kept} of {total} components that move most. Differences: all {total}."
    return [words] if kept < total else []


def _gaps(curves: Mapping[str, Line], parts: Sequence[_Part]) -> Iterable[str]:
    """A sentence for each engine that has gaps in this figure."""
    columns = [i for part in parts for i in part.columns]
    for engine, (t, array) in curves.items():
        bad = np.flatnonzero(~np.isfinite(array[:, columns]).all(axis=1))
        if len(bad):
            span = f"t = {number(t[bad[0]])} s" + (f" to {number(t[bad[-1]])} s" if len(bad) > 1 else "")
            yield f"Gap: {engine} has no number at {len(bad)} of {len(t)} samples ({span})."
