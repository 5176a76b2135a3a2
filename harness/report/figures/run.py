"""The pictures of a run: what engines say about a quantity, their curves over each other, the differences below."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import WIDTH, Curve, Spec, quantity, switched, thin, told
from screwgauge.report.figures.looks import CROSS, GREY, PLUS, SHAPES, Look, numbered
from screwgauge.report.figures.selection import drawable, select, short_labels
from screwgauge.report.formatting import file_name, missing, number, unit_text, words
from screwgauge.scene.figures import Figure
from screwgauge.solution import common_rows

if TYPE_CHECKING:
    from screwgauge.study.comparison import Comparison

MAX_CURVES = 12  # in a panel; more cannot be told apart
FLOOR = 1e-18  # where a difference of exactly zero is drawn if there is no other
SIGNS = ("stroke", "circle", CROSS, PLUS, *SHAPES[1:])  # of engines; the first is drawn as lines
HEIGHTS, LOWER = {1: 180, 2: 110, 3: 130}, 105  # of panels with curves, by panels in a line; of the others [pixels]
WIDE = 30.0  # ratio of largest to smallest condition number from which their axis is logarithmic
CURVE, PEAKS = {False: 120, True: 200}, {False: 120, True: 400}  # stretches drawn: still, and moving
MARKS = {False: 7, True: 12}  # marks of an engine on a curve

Pair = tuple[str, str]
Apart = tuple[Array, Array, NDArray[np.str_]]  # times [s], differences of a pair, and the components they are of


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

    @property
    def names(self) -> list[str]:
        """All components."""
        return [name for _, some in self.panels for name in some]


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
    labels = [_labels(names, subject.values[first]) for _, names in subject.panels]
    unit = unit_text(figure.unit)

    apart = {f"|{a} - {b}|": _apart(subject, (a, b)) for a, b in pairs}

    def build(moving: bool) -> Spec:
        upper = _curves(subject, labels, shown, f"{words(figure.quantity)} [{unit}]", moving)
        if not pairs:
            return upper
        lower = _differences(apart, tolerance, f"difference [{unit}]", moving)
        params = [*upper.pop("params"), *lower.pop("params"), *chart.zoom(["curves", "lower"], moving)]
        resolve = {"scale": dict.fromkeys(("color", "strokeDash", "stroke", "shape"), "independent")}
        return {"vconcat": [upper, lower], "spacing": 14, "resolve": resolve, "params": params}

    return chart.picture(name, figure.title, build, _warnings(subject, shown, sum(map(len, labels))))


def _curves(
    subject: _Subject, labels: Sequence[dict[str, str]], shown: Sequence[str], title: str, moving: bool
) -> Spec:
    """The first engine as lines, the others as sparse marks in the same colours."""
    columns, series = 3 if len(labels) % 3 == 0 else min(len(labels), 2), list[Curve]()
    stretches = CURVE[moving] if moving else CURVE[moving] // columns
    for (panel, _), drawn in zip(subject.panels, labels, strict=True):
        for component, curve in drawn.items():
            for k, engine in enumerate(shown):
                at, values = np.flatnonzero(subject.solved[engine]), subject.values[engine][component]
                kinds = {"line": thin(values[at], stretches)} if not k else {}
                kinds |= {"mark": sparse(len(at), k, len(shown), MARKS[moving])} if k or moving else {}
                said = {"panel": panel, "curve": curve, "engine": engine}
                series += [({**said, "kind": kind}, subject.t[at[i]], values[at[i]]) for kind, i in kinds.items()]
    looks = {curve: numbered(i) for i, curve in enumerate(dict.fromkeys(x for some in labels for x in some.values()))}
    engines = {engine: Look(GREY, shape=SIGNS[k % len(SIGNS)]) for k, engine in enumerate(shown)}
    first = {"test": {"field": "engine", "equal": shown[0]}, "value": 0.0}  # these marks are there to be asked
    lines = {**told("curve", looks, "color", "strokeDash"), **switched("engine", moving)}
    marks = {
        **told("curve", looks, "stroke", legend=False),
        **told("engine", engines, "shape"),
        **switched("engine", moving, first),
        **chart.hover(t="t [s]", v=title, curve="component", engine="engine"),
    }
    view = chart.timeline("curves", series, lines, marks, moving) | {"height": HEIGHTS[columns]}
    view["width"] = (WIDTH - (columns - 1) * chart.GAP) // columns
    view["encoding"]["y"] = quantity("v", title)
    if columns > 1:
        data = {key: view.pop(key) for key in ("data", "transform")}
        facet = {"field": "panel", "type": "nominal", "sort": None}
        view = {**data, "facet": facet, "columns": columns, "spec": view}
    return view | {"params": chart.switch("engine", shown, "curves", moving)}


def _differences(found: dict[str, Apart], tolerance: float | None, title: str, moving: bool) -> Spec:
    """The largest difference of each pair and where it is; grey lines for the tolerance and for zero."""
    numbers = np.concatenate([apart for _, apart, _ in found.values()])
    seen, zero = numbers[numbers > 0], bool((numbers == 0).any())
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (FLOOR, 10 * FLOOR)
    floor = max(10.0 ** (np.floor(np.log10(low)) - (1 if zero and len(seen) else 0)), 1e-300)
    ends = np.array([f(t) for f in (np.min, np.max) for t in [np.concatenate([t for t, _, _ in found.values()])]])
    top = 10.0 ** np.ceil(np.log10(1.5 * max(high, tolerance or 0.0)))
    looks, series = {pair: numbered(i + 1) for i, pair in enumerate(found)}, list[Curve]()
    for pair, columns in found.items():
        some = thin(columns[1], PEAKS[moving], lows=False)
        t, apart, names = (column[some] for column in columns)
        series.append(({"pair": pair, "kind": "line"}, t, np.maximum(apart, floor)))
        for name in dict.fromkeys(names) if moving else ():
            here = names == name
            series.append(({"pair": pair, "kind": "mark", "component": str(name)}, t[here], apart[here]))
    levels = [(f"tolerance {number(tolerance, 2)}", tolerance, (8, 4)), ("no difference at all", floor * zero, (1, 3))]
    for name, level, dash in levels:
        if level:
            looks[name] = Look(GREY, dash)
            series.append(({"pair": name, "kind": "line"}, ends, np.full(2, level)))
    asked = chart.hover(t="t [s]", v=title, component="where", pair="pair")
    view = _one(series, "pair", looks, asked, moving)
    return chart.logarithmic(view, title, floor / 10 if zero else floor, top)


def _condition(name: str, comparison: Comparison) -> Picture:
    """Condition number of each engine's closure along the path: the largest of each stretch of samples."""
    t, title = comparison.times, "condition number [1]"
    finite = {e: np.where(np.isfinite(s.condition), s.condition, np.nan) for e, s in comparison.solutions.items()}
    found = {engine: line for engine, line in finite.items() if not np.isnan(line).all()}
    low, high = np.nanmin([*found.values()]), np.nanmax([*found.values()])
    looks = {engine: numbered(i) for i, engine in enumerate(found)}

    def build(moving: bool) -> Spec:
        series = list[Curve]()
        for i, (engine, values) in enumerate(found.items()):
            at, said = thin(values, PEAKS[moving], lows=False), {"engine": engine}
            some = at[sparse(len(at), i + 1, len(found) + 1, MARKS[moving])]  # marks keep apart lines that coincide
            series += [({**said, "kind": kind}, t[i], values[i]) for kind, i in (("line", at), ("mark", some))]
        asked = chart.hover(t="t [s]", v=title, engine="engine") | told("engine", looks, "shape")
        view = chart.logarithmic(_one(series, "engine", looks, asked, moving), title, low, high, log=high > WIDE * low)
        return view | {"params": [*view["params"], *chart.zoom(["lower"], moving)]}

    return chart.picture(name, "Condition number of the closure along the path", build)


def _one(series: Sequence[Curve], field: str, looks: dict[str, Look], marks: Spec, moving: bool) -> Spec:
    """A panel of the whole width."""
    shaped = "shape" in marks
    lines = {**told(field, looks, "color", *(() if shaped else ("strokeDash",))), **switched(field, moving)}
    seen = switched(field, moving) if shaped else {"opacity": {"value": 0.0}}  # others are only asked
    marks = {**told(field, looks, "stroke", legend=False), **seen, **marks}
    view = chart.timeline("lower", series, lines, marks, moving)
    params = chart.switch(field, looks, "lower", moving)
    return view | {"width": WIDTH, "height": LOWER, "params": params}


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


def _apart(subject: _Subject, pair: Pair) -> Apart:
    """Largest difference over the components, NaN as soon as one side is no number. Shapes (n,)."""
    both = subject.solved[pair[0]] & subject.solved[pair[1]]
    first, second = (np.array([subject.values[engine][name][both] for name in subject.names]) for engine in pair)
    apart = np.abs(first - second)
    apart[~np.isfinite(apart)] = np.inf  # found before any number
    worst, largest = apart.argmax(axis=0), apart.max(axis=0)
    return subject.t[both], np.where(largest < np.inf, largest, np.nan), np.array(subject.names)[worst]


def sparse(n: int, slot: int, n_slots: int, marks: int = 9) -> NDArray[np.intp]:
    """About `marks` samples, staggered so that the marks of different engines do not hide each other."""
    if n <= 2 * marks:
        return np.arange(n)
    return np.unique(((np.arange(marks) + (slot + 0.5) / n_slots) * n / marks).astype(int))


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
