"""Vega-Lite diagrams from ``specs/*.json`` in one style, with colours per engine that suit colour-blind readers."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.environment import plain
from screwgauge.reference.errors import printable
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Picture
from screwgauge.report.figures.renderer import RENDERER, DrawingError

Spec = dict[str, Any]
Curve = tuple[Spec, Array, Array]  # fields that describe the curve; times [s] and values, shapes (n,)
SPECS = Path(__file__).with_name("specs")
UNSEEN = 1.0 / 400.0  # largest deviation that is not visible, as a fraction of the height of a panel
WIDTH, GAP, LETTER = 560, 24, 5.6  # total width of panels in a line, gap between them, mean width of a letter [pixels]
#: Zooms with Ctrl and the wheel; the wheel alone scrolls the page.
_ZOOM = {"type": "interval", "encodings": ["x"], "zoom": "wheel![event.ctrlKey || event.metaKey]"}
#: Formats numbers of a logarithmic axis: 0.01, 500, 1e4.
POWER = (
    "datum.value >= 0.01 && datum.value <= 1000 ? format(datum.value, '~g') : "
    "replace(format(datum.value, '.0e'), '+', '')"
)
TIME = "format(datum.value, '~s') + 's'"  # formats times of a logarithmic axis
_COMMON: Spec = {"zoom": _ZOOM, "zoom_both": {**_ZOOM, "encodings": ["x", "y"]}}  # for every specification


@cache
def _text(name: str) -> str:
    return (SPECS / f"{name}.json").read_text(encoding="utf-8")


def fill_template(name: str, /, **values: Any) -> Spec:
    """Replace every ``"$key"`` in a specification, at any depth; a facet with one panel becomes that panel."""
    spec: Spec = _fill(json.loads(_text(name)), _COMMON | values)
    if spec.get("columns") == 1:
        panel = spec.pop("spec")
        spec = {key: value for key, value in spec.items() if key not in ("facet", "columns")} | panel
    return spec


def _fill(node: Any, values: Spec) -> Any:
    if isinstance(node, dict):
        return {key: _fill(item, values) for key, item in node.items()}
    if isinstance(node, list):
        return [_fill(item, values) for item in node]
    return values[node[1:]] if isinstance(node, str) and node.startswith("$") and len(node) > 1 else node


def ways(field: str, looks: Mapping[str, Look]) -> Spec:
    """Build template values that distinguish marks by a field: scale domain and ranges, legend columns, and clicks."""
    entry = max(map(len, looks), default=0) * LETTER + 42
    kinds = {kind: [getattr(look, kind) for look in looks.values()] for kind in ("colour", "dash", "shape")}
    return {
        field: list(looks),
        **{f"{field}_{kind}": some for kind, some in kinds.items()},
        f"{field}_columns": max(1, int(WIDTH / entry)),
        f"{field}_click": {"type": "point", "fields": [field], "toggle": "true"},
        f"{field}_on": [{field: name} for name in looks],
    }


def curves(series: Sequence[Curve], moving: bool, *, linear: bool = False) -> Spec:
    """Build template values ``data`` and ``lookup``: a description of each curve, and its points, which may have gaps.

    Args:
        linear: True if the curves share a linear axis; a still picture then omits points on a straight line between
            their neighbours.
    """
    rows, described, digits = ["s,t,v"], list[Spec](), 6 if moving else 4
    series = [(fields, t, np.where(np.isfinite(v), v, np.nan)) for fields, t, v in series]
    known = (v[np.isfinite(v)] for _, _, v in series)
    off = UNSEEN * max((float(np.ptp(v)) for v in known if v.size), default=0.0)
    for i, (fields, t, v) in enumerate(series):
        some = straight_samples(t, v, off) if linear and not moving and fields["kind"] == "line" else slice(None)
        t, v = t[some], v[some]
        numbers = np.column_stack([t, v]).ravel().tolist()
        lines = "\n".join([f"{i},%.7g,%.{digits}g"] * len(t)) % tuple(numbers)  # formatting all at once halves the time
        rows += [lines.replace(",nan", ",")] if lines else []
        described.append({"s": i, **fields})
    names = list(dict.fromkeys(name for fields in described for name in fields))
    parse = {"type": "csv", "parse": dict.fromkeys("stv", "number")}
    look_up = {"lookup": "s", "from": {"data": {"values": described}, "key": "s", "fields": names}}
    alone = any(len(t) == 1 for fields, t, _ in series if fields.get("kind", "line") == "line")
    return {"data": {"values": "\n".join(rows), "format": parse}, "lookup": look_up, "alone": alone}


def logarithm(axis: str, values: Iterable[float], names: str = POWER, most: int = 7) -> Spec:
    """Build template values ``x_scale`` and ``x_axis``, or ``y_scale`` and ``y_axis``, for a logarithmic axis.

    Args:
        values: Values to draw; only positive values can be drawn.
        names: Expression for the labels of the ticks.
        most: Largest number of decades that get ticks.
    """
    drawn = [value for value in values if 0.0 < value < np.inf] or [1.0]
    low, high = np.log10(min(drawn)) - 1e-9, np.log10(max(drawn)) + 1e-9
    decades = np.arange(np.floor(low), np.ceil(high) + 1)
    within = decades[(decades >= low) & (decades <= high)]
    ticks = (
        [part * 10.0**k for k in decades for part in (1, 2, 5)]
        if len(within) < 3
        else 10.0 ** within[:: -(-len(within) // most)]
    )
    shown = {"values": [tick for tick in ticks if low <= np.log10(tick) <= high], "labelExpr": names}
    return {f"{axis}_scale": {"type": "log", "nice": False, "padding": 14}, f"{axis}_axis": shown}


def columns(panels: int) -> Spec:
    """Build the template values ``columns`` and ``width`` for a number of panels."""
    n = 3 if panels % 3 == 0 else min(panels, 2)
    return {"columns": n, "width": (WIDTH - (n - 1) * GAP) // n}


def picture(name: str, title: str, build: Callable[[bool], Spec], notes: Iterable[str] = ()) -> Picture:
    """Draw a specification; on failure return a picture with the reason.

    Args:
        build: Function that returns the specification without a title; its argument is True for the interactive
            version, which has more points than are visible at once.
        notes: Explanations of the picture, and remarks on what it omits.
    """
    lines = [line for note in notes for line in wrap(note, int(WIDTH / LETTER))]
    head = {**fill_template("config"), "title": {"text": wrap(title, int(WIDTH / 8)) or "", "subtitle": lines}}
    still, live = (plain({**head, **build(moving)}, partial(printable, lines=True)) for moving in (False, True))
    still, draw = still_parts(still), "vegalite_to_svg"
    try:
        if any(layer.get("name") == "labels" for layer in still.get("layer", ())):
            still, live = (_place_labels(RENDERER.ask("vegalite_to_vega", spec)) for spec in (still, live))
            draw = "vega_to_svg"
        svg: str = RENDERER.ask(draw, json.dumps(still))
    except DrawingError as error:
        return Picture(name, title, "", lost=error.what)
    return Picture(name, title, svg[svg.index("<svg ") :], json.dumps(live, ensure_ascii=False))


def still_parts(node: Any) -> Any:
    """Remove interactive parts from a chart, such as invisible points."""
    if isinstance(node, list):
        return [
            still_parts(item) for item in node if not (isinstance(item, dict) and ("select" in item or _is_clear(item)))
        ]
    if not isinstance(node, dict):
        return node
    return {k: still_parts(v) for k, v in node.items() if k != "tooltip" and not (k == "opacity" and "param" in str(v))}


def _is_clear(layer: Spec) -> bool:
    return bool(layer.get("encoding", {}).get("opacity") == {"value": 0.0})


def _place_labels(spec: Spec) -> Spec:
    """Make a Vega specification place labels next to their points, which a Vega-Lite specification cannot do."""
    anchors = ["top-right", "right", "bottom-right", "top-left", "left", "bottom-left", "top", "bottom"]
    for mark in (mark for mark in spec["marks"] if mark["name"] == "labels_marks"):
        size = {"signal": "[width, height]"}
        mark["transform"] = [{"type": "label", "size": size, "anchor": anchors, "offset": [4]}]
    return spec


def thin(values: Array, bins: int, *, lows: bool = True) -> NDArray[np.intp]:
    """Thin samples without visible loss: keep the ends, the extremes of each interval, and gaps in the numbers.

    Args:
        values: Shape (n,).
        bins: Number of intervals.

    Returns:
        Ascending indices of the kept samples; all indices if n <= bins.
    """
    n = len(values)
    if n <= bins:
        return np.arange(n)
    edges = np.arange(bins + 1) * n // bins
    at = np.minimum(edges[:-1, None] + np.arange(np.diff(edges).max()), edges[1:, None] - 1)
    gap = ~np.isfinite(values[at])
    extremes = [np.where(gap, -np.inf, values[at]).argmax(axis=1)]
    extremes += [np.where(gap, np.inf, values[at]).argmin(axis=1)] if lows else []
    missing, each = gap.any(axis=1) if lows else gap.all(axis=1), np.arange(bins)
    gaps = at[each, gap.argmax(axis=1)][missing]
    return np.unique(np.concatenate([[0, n - 1], *(at[each, one] for one in extremes), gaps]))


def straight_samples(t: Array, v: Array, off: float) -> NDArray[np.intp]:
    """Select samples so that lines between them pass within `off` of every omitted sample; keep gaps. Shapes (n,).

    Each of four passes tests every second remaining sample; samples dropped in an early pass deviate less.
    """
    at = np.arange(len(t))
    for _ in range(4):
        a, b, c = at[:-2:2], at[1:-1:2], at[2::2]
        line = v[a] + (v[c] - v[a]) * (t[b] - t[a]) / (t[c] - t[a])
        kept = np.ones(len(at), dtype=bool)
        kept[1:-1:2] = ~(np.abs(v[b] - line) <= 0.75 * off)
        at = at[kept]
    return at


# The colours of Okabe and Ito without yellow, which is too light for a line on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ((1, 0), (6, 3), (2, 2), (8, 2, 2, 2), (4, 1, 1, 1))
CROSS, PLUS = "M-.8,-.8L.8,.8M-.8,.8L.8,-.8", "M-1,0H1M0,-1V1"
STAR = "M0,-1L.24,-.31L.95,-.31L.36,.12L.59,.81L0,.38L-.59,.81L-.36,.12L-.95,-.31L-.24,-.31Z"
SHAPES = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "triangle-right", "triangle-left")
GREY, INK = "#767676", "#1b1f24"

#: Name prefixes of a family -> colour; the first match counts.
CAMPS = (
    (("closed-form", "newton", "screw"), COLOURS[0]),
    (("mjx", "mjwarp"), COLOURS[5]),
    (("pinocchio", "four-bar"), COLOURS[1]),
    (("mujoco",), COLOURS[2]),
    (("finite-differences", "missing-jdotv", "float32"), COLOURS[3]),
    (("paper",), COLOURS[4]),
)


@dataclass(frozen=True, slots=True)
class Look:
    """Style of a line and its marks; `dash` lists the lengths of strokes and gaps [pixels]."""

    colour: str
    dash: tuple[int, ...] = DASHES[0]
    shape: str = SHAPES[0]


def numbered_look(i: int) -> Look:
    """Return style number i, for curves without a colour group."""
    return Look(COLOURS[i % len(COLOURS)], DASHES[i % len(DASHES)], SHAPES[i % len(SHAPES)])


def camp(name: str) -> str:
    """Return the colour for an engine, family or setting, chosen by the prefix of its name."""
    return next((colour for starts, colour in CAMPS if name.startswith(starts)), GREY)


def looks_by_camp(names: Iterable[str], before: Iterable[str] = ()) -> dict[str, Look]:
    """Return styles for engines, families or settings: the colour for the name's prefix, with an unused shape and dash.

    Args:
        before: Names that already have a style.
    """
    looks, camps = dict[str, Look](), [camp(name) for name in dict.fromkeys(before)]
    for name in dict.fromkeys(names):
        k = camps.count(camp(name))
        camps.append(camp(name))
        looks[name] = Look(camp(name), DASHES[k % len(DASHES)], SHAPES[k % len(SHAPES)])
    return looks
