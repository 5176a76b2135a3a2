"""Pictures of a run: component values of all engines, with their differences below."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from screwgauge.judging.residual import Residual
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import CROSS, GREY, PLUS, SHAPES, Curve, Look, Spec, numbered_look, thin
from screwgauge.report.figures.contour import contour_picture
from screwgauge.report.figures.drawings import Drawing, named_drawings, short_labels
from screwgauge.solution import common_rows
from screwgauge.study.comparison import Comparison
from screwgauge.study.formatting import is_empty, number, unit_text, words

MAX_CURVES = 12  # largest number in a panel; more curves cannot be distinguished
FLOOR = 1e-18  # value at which a zero difference is drawn if all are zero
SIGNS = ("stroke", "circle", CROSS, PLUS, *SHAPES[1:])  # marks of engines; the first engine is drawn as lines
HEIGHTS = {1: 180, 2: 110, 3: 130}  # number of panels in a line -> height of panels with curves [pixels]
WIDE = 30.0  # ratio of largest to smallest condition number above which the axis is logarithmic
CURVE, PEAKS = {False: 120, True: 200}, {False: 120, True: 400}  # number of intervals drawn: still, and interactive
MARKS = {False: 7, True: 12}  # number of marks of an engine on a curve

Pair = tuple[str, str]
Apart = tuple[Array, Array, NDArray[np.object_]]  # times [s], largest differences of a pair, and their components


@dataclass(frozen=True, slots=True, eq=False)
class _Subject:
    """Values of a quantity from every engine.

    Attributes:
        t: Time [s]. Shape (n,).
        values: Engine -> component -> values, NaN if missing. Shape (n,).
        solved: Engine -> True for samples that the engine solved. Shape (n,).
    """

    drawing: Drawing
    t: Array
    values: dict[str, dict[str, Array]]
    solved: dict[str, NDArray[np.bool_]]

    def components(self, *engines: str) -> list[str]:
        """Return the components that all given engines have (tables may lack some), or all components if none do."""
        known = [{name for name, v in self.values[engine].items() if np.isfinite(v).any()} for engine in engines]
        names = self.drawing.names
        return [name for name in names if all(name in each for each in known)] or names


def make_plots(comparison: Comparison) -> list[Picture]:
    """Draw all pictures of the report, in order."""
    plots = [_quantity(name, drawing, comparison) for name, drawing in named_drawings(comparison).items()]
    if any(np.isfinite(s.condition).any() for s in comparison.solutions.values()):
        plots.append(_condition(f"{len(plots) + 1:02d}-condition", comparison))
    return plots


def _quantity(name: str, drawing: Drawing, comparison: Comparison) -> Picture:
    if (grid := comparison.scene.grid) is not None and drawing.contour:
        subject, (component,) = _subject(drawing, comparison), drawing.names
        engine, values = next(iter(subject.values.items()))
        picture = contour_picture(name, drawing.title, grid, (engine, component, drawing.unit), values[component])
        return replace(picture, of=drawing.quantity)
    return _draw(name, _subject(drawing, comparison), *_compared_pairs(drawing, comparison))


def pair_picture(name: str, title: str, worst: Residual, curve: Array) -> Picture:
    """Draw one component as computed by two engines, and the difference.

    Args:
        curve: Times [s] and both values. Shape (n, 3).
    """
    values = {engine: {worst.component: v} for engine, v in zip((worst.a, worst.b), curve.T[1:], strict=True)}
    everywhere = dict.fromkeys(values, np.ones(len(curve), dtype=bool))
    drawing = Drawing(title, worst.quantity, worst.unit, (("", (worst.component,)),))
    subject = _Subject(drawing, curve[:, 0], values, everywhere)
    tolerance = abs(worst.values[0] - worst.values[1]) * worst.tolerance / worst.error
    return _draw(name, subject, [(worst.a, worst.b)], tolerance if np.isfinite(tolerance) else None)


def _draw(name: str, subject: _Subject, pairs: list[Pair], tolerance: float | None) -> Picture:
    drawing, (first, *others) = subject.drawing, subject.values
    shown = [first, *(engine for engine in others if {(first, engine), (engine, first)} & {*pairs})]
    labels = [_labels(names, subject.values[first]) for _, names in drawing.panels]
    unit = unit_text(drawing.unit)

    apart = {f"|{a} - {b}|": _largest_difference(subject, (a, b)) for a, b in pairs}

    def build(moving: bool) -> Spec:
        views = ["curves", "lower"] if pairs else ["curves"]
        upper = _curves(subject, labels, shown, f"{words(drawing.quantity)} [{unit}]", moving) | {"views": views}
        drawn = chart.fill_template("curves", **upper)
        if not pairs:
            return drawn
        lower = chart.fill_template("differences", **_differences(apart, tolerance, f"difference [{unit}]", moving))
        params = [*drawn.pop("params"), *lower.pop("params")]
        resolve = {"scale": dict.fromkeys(("color", "strokeDash", "shape"), "independent")}
        return {"vconcat": [drawn, lower], "spacing": 14, "resolve": resolve, "params": params}

    notes = [*filter(None, [drawing.note]), *_warnings(subject, shown, sum(map(len, labels)))]
    return replace(chart.picture(name, drawing.title, build, notes), of=drawing.quantity)


def _curves(
    subject: _Subject, labels: Sequence[dict[str, str]], shown: Sequence[str], title: str, moving: bool
) -> Spec:
    """Draw the first engine as lines, and the other engines as sparse marks in the same colours."""
    grid, series = chart.columns(len(labels)), list[Curve]()
    looks = {
        curve: numbered_look(i) for i, curve in enumerate(dict.fromkeys(x for some in labels for x in some.values()))
    }
    stretches = CURVE[moving] // (1 if moving else grid["columns"])
    for (panel, _), drawn in zip(subject.drawing.panels, labels, strict=True):
        for component, curve in drawn.items():
            for k, engine in enumerate(shown):
                at, values = np.flatnonzero(subject.solved[engine]), subject.values[engine][component]
                kinds = {"line": thin(values[at], stretches)} if not k else {}
                if k or moving:
                    kinds["mark" if k else "asked"] = sparse_samples(len(at), k, len(shown), MARKS[moving])
                fields = {"panel": panel, "curve": curve, "engine": engine, "colour": looks[curve].colour}
                series += [({**fields, "kind": kind}, subject.t[at[i]], values[at[i]]) for kind, i in kinds.items()]
    engines = {engine: Look(GREY, shape=SIGNS[k % len(SIGNS)]) for k, engine in enumerate(shown)}
    scales = chart.ways("curve", looks) | chart.ways("engine", engines)
    more = {**scales, **grid, "height": HEIGHTS[grid["columns"]], "title": title, "y_scale": _constant_scale(series)}
    return {**chart.curves(series, moving, linear=True), **more}


def _constant_scale(series: Iterable[Curve]) -> Spec:
    """Build the scale for curves that are constant up to rounding, whose tick labels would otherwise all be equal."""
    known = np.concatenate([v[np.isfinite(v)] for _, _, v in series] or [np.zeros(0)])
    largest = float(np.abs(known).max(initial=0.0))
    if not known.size or float(np.ptp(known)) > 1e-5 * largest:
        return {}
    half = 0.5 * largest or 1.0
    return {"domain": [float(known.mean()) - half, float(known.mean()) + half]}


def _differences(apart_by_pair: dict[str, Apart], tolerance: float | None, title: str, moving: bool) -> Spec:
    """Draw each pair's largest difference with its component, and grey lines at the tolerance and at zero."""
    numbers, times = (np.concatenate([columns[k] for columns in apart_by_pair.values()]) for k in (1, 0))
    seen, zero = numbers[numbers > 0], bool((numbers == 0).any())
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (FLOOR, 10 * FLOOR)
    floor = max(10.0 ** (np.floor(np.log10(low)) - (1 if zero and len(seen) else 0)), 1e-300)
    looks, series = {pair: numbered_look(i + 1) for i, pair in enumerate(apart_by_pair)}, list[Curve]()
    for pair, (t, apart, names) in apart_by_pair.items():
        some = thin(apart, PEAKS[moving], lows=False)
        series.append(({"pair": pair, "kind": "line"}, t[some], np.maximum(apart[some], floor)))
        for name in dict.fromkeys(names[some]) if moving else ():
            here = some[names[some] == name]
            series.append(({"pair": pair, "kind": "asked", "component": str(name)}, t[here], apart[here]))
    levels = [("no difference at all", floor * zero, (1, 3))]
    levels += [(f"tolerance {number(tolerance, 2)}", tolerance, (8, 4))] if tolerance else []
    for name, level, dash in levels:
        if level and len(times):
            looks[name] = Look(GREY, dash)
            ends = np.array([times.min(), times.max()])
            series.append(({"pair": name, "kind": "line"}, ends, np.full(2, level)))
    return _dual_panel(
        series, looks, title, (floor / 10 if zero else floor, 1.5 * max(high, tolerance or 0.0), 1.1 * high), moving
    )


def _dual_panel(
    series: Sequence[Curve],
    looks: dict[str, Look],
    title: str,
    ends: tuple[float, float, float],
    moving: bool,
    **more: object,
) -> Spec:
    """Build the template values of a panel with an axis that can be switched between logarithmic and linear.

    A Vega-Lite scale cannot change its type, so the panel plots logarithms and labels them as powers of ten.

    Args:
        ends: Both ends of the logarithmic axis, and the upper end of the linear axis, which starts at 0.
    """
    low, high = np.floor(np.log10(ends[0])), np.ceil(np.log10(ends[1]))
    values: Spec = {"low": f"axis == 'log' ? {low:g} : 0", "high": f"axis == 'log' ? {high:g} : {ends[2]:g}"}
    values |= {"title": title, "label": f"{title}: ", "axis": "log", "marked": 0.0, **more}
    return {**chart.curves(series, moving), **chart.ways("pair", looks), **values}


def _condition(name: str, comparison: Comparison) -> Picture:
    """Draw the condition number of each engine's closure along the path, as the maximum over each interval."""
    t, title = comparison.times, "condition number [1]"
    finite = {e: np.where(np.isfinite(s.condition), s.condition, np.nan) for e, s in comparison.solutions.items()}
    lines = {engine: line for engine, line in finite.items() if not np.isnan(line).all()}
    low, high = np.nanmin([*lines.values()]), np.nanmax([*lines.values()])
    looks, axis = {engine: numbered_look(i) for i, engine in enumerate(lines)}, "log" if high > WIDE * low else "linear"

    def build(moving: bool) -> Spec:
        series = list[Curve]()
        for i, (engine, values) in enumerate(lines.items()):
            at, look = thin(values, PEAKS[moving], lows=False), looks[engine]
            some = at[
                sparse_samples(len(at), i + 1, len(lines) + 1, MARKS[moving])
            ]  # marks distinguish coinciding lines
            fields = {"pair": engine, "component": "closure", "colour": look.colour, "shape": look.shape}
            series += [({**fields, "kind": kind}, t[i], values[i]) for kind, i in (("line", at), ("mark", some))]
        return chart.fill_template(
            "differences", **_dual_panel(series, looks, title, (low, high, 1.1 * high), moving, axis=axis, marked=1.0)
        )

    return chart.picture(name, "Condition number of the closure along the path", build)


def _subject(drawing: Drawing, comparison: Comparison) -> _Subject:
    # an engine that solved only a part of the samples comes last, because the first engine is drawn as lines
    order = sorted(comparison.solutions.items(), key=lambda item: item[1].rows is not None)
    solutions = {engine: solution for engine, solution in order if drawing.quantity in solution.values}
    given = {engine: solution.values[drawing.quantity] for engine, solution in solutions.items()}
    n = len(comparison.times)
    nothing = dict.fromkeys(drawing.names, np.full(n, np.nan))
    values = {engine: nothing | dict(zip(v.components, v.array.T, strict=True)) for engine, v in given.items()}
    solved = {engine: np.isin(np.arange(n), common_rows(n, solution)) for engine, solution in solutions.items()}
    return _Subject(drawing, comparison.times, values, solved)


def _labels(names: Sequence[str], columns: Mapping[str, Array]) -> dict[str, str]:
    """Return component -> label for the components to draw, at most `MAX_CURVES`: those that vary most."""
    moving = sorted(names, key=lambda name: -float(np.ptp(np.nan_to_num(columns[name]))))[:MAX_CURVES]
    return {name: label for name, label in zip(names, short_labels([*names]), strict=True) if name in moving}


def _largest_difference(subject: _Subject, pair: Pair) -> Apart:
    """Return times, the largest difference at each (NaN if a value is NaN), and its component. Shapes (n,)."""
    both, names = subject.solved[pair[0]] & subject.solved[pair[1]], subject.components(*pair)
    first, second = (np.array([subject.values[engine][name][both] for name in names]) for engine in pair)
    apart = np.abs(first - second)
    apart[~np.isfinite(apart)] = np.inf  # larger than any finite difference
    worst, largest = apart.argmax(axis=0), apart.max(axis=0)
    return subject.t[both], np.where(largest < np.inf, largest, np.nan), np.array(names, dtype=object)[worst]


def sparse_samples(n: int, slot: int, n_slots: int, marks: int = 9) -> NDArray[np.intp]:
    """Select about `marks` samples, staggered so that marks of different engines do not hide each other."""
    if n <= 2 * marks:
        return np.arange(n)
    return np.unique(((np.arange(marks) + (slot + 0.5) / n_slots) * n / marks).astype(int))


def _compared_pairs(drawing: Drawing, comparison: Comparison) -> tuple[list[Pair], float | None]:
    """Return the pairs of engines that are compared in the picture, and their tolerance if all pairs share one."""
    table = comparison.errors
    rows = table[(table["quantity"] == drawing.quantity) & (table["unit"] == drawing.unit)]
    rows = rows[rows["component"].isin(drawing.names)]
    limits = {number(limit, 4) for limit in rows["tolerance"] * rows["scale"] if not is_empty(limit)}
    pairs = list(dict.fromkeys(zip(rows["a"], rows["b"], strict=True)))
    return pairs, float(limits.pop()) if len(limits) == 1 else None


def _warnings(subject: _Subject, shown: Sequence[str], drawn: int) -> Iterable[str]:
    """Warn about components and engines that the curves do not show."""
    others = [engine for engine in subject.values if engine not in shown]
    if others:  # for example, joint forces of an open tree differ between cuts
        yield f"Not drawn as curves, because they are not comparable with {shown[0]}: {', '.join(others)}."
    names = subject.drawing.names
    if drawn < len(names):
        yield f"Curves: the {drawn} of {len(names)} components that vary most. Differences: all {len(names)}."
    for engine, solved in subject.solved.items():
        known = np.all([np.isfinite(subject.values[engine][name]) for name in subject.components(engine)], axis=0)
        bad = subject.t[solved & ~known]
        if len(bad):
            span = f"t = {number(bad[0])} s" + (f" to {number(bad[-1])} s" if len(bad) > 1 else "")
            yield f"Gap: {engine} has no values at {len(bad)} of {solved.sum()} samples ({span})."
