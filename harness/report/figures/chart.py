"""Pictures from specifications of Vega-Lite: data in, one configuration for all, drawn in one place."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Picture
from screwgauge.report.figures.looks import GREY, INK, Look

Spec = dict[str, Any]
Curve = tuple[Spec, Array, Array]  # what it is, by field; times [s] and values, shapes (n,)
WIDTH, GAP = 560, 24  # of all panels in a line together, and between two of them [pixels]
LETTER = 5.9  # width of one, on average [pixels]
SCHEMA = "https://vega.github.io/schema/vega-lite/v6.json"
AXIS = {"domainColor": GREY, "tickColor": GREY, "gridColor": "#e4e4e4", "labelOverlap": True, "titlePadding": 6}
TITLES = {"titleFontWeight": "normal", "titleFontSize": 12, "labelFontSize": 11, "labelLimit": 0, "titleLimit": 0}
LAYOUT = {"top": {"direction": "vertical", "anchor": "start", "margin": 2, "bounds": "full"}}
CONFIG: Spec = {
    "aria": False,  # a label for every mark takes as long as all else; the page says what the picture is
    "background": "white",
    "font": "DejaVu Sans, Verdana, Segoe UI, sans-serif",
    "padding": 6,
    "title": {"anchor": "start", "frame": "bounds", "fontSize": 14, "subtitleFontSize": 11, "subtitlePadding": 5},
    "axis": AXIS | TITLES,
    "header": {**TITLES, "labelFontWeight": "bold", "labelAnchor": "start", "title": None, "labelPadding": 4},
    "legend": {**TITLES, "orient": "top", "title": None, "symbolSize": 60, "columnPadding": 14, "layout": LAYOUT},
    "view": {"stroke": None},
    "scale": {"zero": False, "continuousPadding": 5},
    "concat": {"spacing": GAP},
    "facet": {"spacing": GAP},
    "line": {"strokeWidth": 1.5},
    "text": {"fontSize": 10, "color": INK},
}
COMMON: Spec = {"$schema": SCHEMA, "config": CONFIG}


def picture(name: str, title: str, build: Callable[[bool], Spec], notes: Iterable[str] = ()) -> Picture:
    """Draws a specification.

    Args:
        build: Specification without a title; ``True``: with what moves, and more points than can be seen at once.
        notes: How to read it, and what it does not show.
    """
    import vl_convert

    lines = [line for note in notes for line in wrap(note, int(WIDTH / LETTER))]
    head = {"text": wrap(title, int(WIDTH / 8)) or "", "subtitle": lines, "subtitleColor": INK}
    still, live = (
        json.dumps(_plain({**COMMON, "title": head, **build(moving)}), ensure_ascii=False) for moving in (False, True)
    )
    svg = vl_convert.vegalite_to_svg(still)
    return Picture(name, title, svg[svg.index("<svg ") :], live)


def _plain(value: Any) -> Any:
    """Values as JSON has them: NaN as null; in texts a space for what is not printable, which no SVG may contain."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, str):
        return value if value.isascii() and value.replace("\n", "").isprintable() else "".join(map(_sign, value))
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value


def _sign(sign: str) -> str:
    return sign if sign.isprintable() or sign == "\n" else " "


def curves(series: Iterable[Curve], moving: bool) -> Spec:
    """Data of many points: what a curve is is said once, its points are numbers; a gap where a value is none."""
    rows, said, digits = ["s,t,v"], list[Spec](), 6 if moving else 4
    for i, (fields, t, v) in enumerate(series):
        pairs = zip(t.tolist(), v.tolist(), strict=True)
        rows += [f"{i},{a:.7g},{b:.{digits}g}" if abs(b) < np.inf else f"{i},{a:.7g}," for a, b in pairs]
        said.append({"s": i, **fields})
    names = list(dict.fromkeys(name for fields in said for name in fields))
    parse = dict.fromkeys("stv", "number")
    return {
        "data": {"values": "\n".join(rows), "format": {"type": "csv", "parse": parse}},
        "transform": [{"lookup": "s", "from": {"data": {"values": said}, "key": "s", "fields": names}}],
    }


def quantity(field: str, title: str | None, **more: Any) -> Spec:
    """A channel of numbers along an axis."""
    return {"field": field, "type": "quantitative", "title": title, **more}


def told(field: str, looks: Mapping[str, Look], *channels: str, legend: bool = True) -> Spec:
    """Channels (``color``, ``strokeDash``, ``shape`` ...) that tell things apart, with one legend for all of them."""
    width = max(map(len, looks), default=0) * LETTER + 40
    longer = {"symbolSize": 400} if "strokeDash" in channels else {}
    shown = {"columns": max(1, int(WIDTH / width)), **longer} if legend else None
    kinds, spare = {"strokeDash": "dash", "shape": "shape"}, () if legend else ("",)  # Vega-Lite joins what is alike
    ranges = {channel: [getattr(x, kinds.get(channel, "colour")) for x in looks.values()] for channel in channels}
    return {
        channel: {
            "field": field,
            "type": "nominal",
            "scale": {"domain": [*looks, *spare], "range": [*values, *values[: len(spare)]]},
            "legend": shown,
        }
        for channel, values in ranges.items()
    }


def timeline(name: str, series: Sequence[Curve], lines: Spec, marks: Spec, moving: bool) -> Spec:
    """Lines over time and marks, which `name` means for parameters, by the ``kind`` of each curve; channels of both."""
    alone = any(len(t) == 1 for fields, t, _ in series if fields["kind"] == "line")
    kinds = {
        "line": ({"type": "line", "point": alone}, lines),
        "mark": ({"type": "point", "size": 26, "opacity": 1.0}, marks),
    }
    layers = [
        {"transform": [{"filter": {"field": "kind", "equal": kind}}], "mark": mark, "encoding": encoding}
        for kind, (mark, encoding) in kinds.items()
    ]
    layers[1]["name"] = name
    return {
        **curves(series, moving),
        "layer": layers,
        "encoding": {"x": quantity("t", "t [s]", scale={"nice": False, "padding": 0})},
    }


def switch(field: str, values: Iterable[str], view: str, moving: bool) -> list[Spec]:
    """Parameter: clicks on the legend of a field switch its values on and off."""
    select = {"type": "point", "fields": [field], "toggle": "true"}
    value = [{field: one} for one in values]
    return [{"name": f"{field}s", "select": select, "bind": "legend", "value": value, "views": [view]}] * moving


def switched(field: str, moving: bool, *before: Spec) -> Spec:
    """Channel of what can be seen only while it is switched on; `before`: conditions that come first."""
    on = {"param": f"{field}s", "value": 1.0, "empty": False}
    return {"opacity": {"condition": [*before, on], "value": 0.0}} if moving else {}


def zoom(views: Sequence[str], moving: bool, *along: str) -> list[Spec]:
    """Parameter: dragging moves; the wheel enlarges, with Ctrl held, as it scrolls the page; twice clicked: all."""
    wheel = "wheel![event.ctrlKey || event.metaKey]"
    select = {"type": "interval", "encodings": along or ("x",), "zoom": wheel}
    return [{"name": "zoom", "select": select, "bind": "scales", "views": views}] * moving


def hover(**titles: str) -> Spec:
    """What is shown at a point: fields and what they are called; those with a unit are numbers."""
    form = {True: {"type": "quantitative", "format": ".6g"}, False: {"type": "nominal"}}
    return {"tooltip": [{"field": field, "title": title, **form["[" in title]} for field, title in titles.items()]}


def thin(values: Array, bins: int, *, lows: bool = True) -> NDArray[np.intp]:
    """Samples that show as much as all: the largest (and smallest) of each stretch, and where one has no number.

    Args:
        values: Shape (n,).
        bins: Stretches.

    Returns:
        Indices, ascending; all n if they are no more than the stretches.
    """
    n = len(values)
    if n <= bins:
        return np.arange(n)
    edges = np.arange(bins) * n // bins
    width = int(np.diff(edges, append=n).max())
    at = np.minimum(edges[:, None] + np.arange(width), np.append(edges[1:], n)[:, None] - 1)
    stretch = values[at]
    gap = ~np.isfinite(stretch)
    found = [np.where(gap, -np.inf, stretch).argmax(axis=1)]
    found += [np.where(gap, np.inf, stretch).argmin(axis=1)] if lows else []
    missing = gap.any(axis=1) if lows else gap.all(axis=1)
    each = np.arange(bins)
    return np.unique(np.concatenate([*(at[each, one] for one in found), at[each, gap.argmax(axis=1)][missing]]))


def logarithmic(view: Spec, title: str, low: float, high: float, *, log: bool = True) -> Spec:
    """A view of values `v` with a logarithmic y axis that a parameter makes linear.

    A scale of Vega-Lite cannot change its type: logarithms are taken before, and written as powers of ten.

    Args:
        low, high: Ends of the logarithmic axis, more than 0; made decades.
        log: Which it is at first.
    """
    decades = {"domainMin": (np.floor(np.log10(low)), 0.0), "domainMax": (np.ceil(np.log10(high)), high)}
    ends = {end: {"expr": f"axis == 'log' ? {log:g} : {linear:g}"} for end, (log, linear) in decades.items()}
    axis = {
        "tickMinStep": {"expr": "axis == 'log' ? 1 : 0"},
        "tickCount": 5,
        "labelExpr": "axis == 'log' ? format(pow(10, datum.value), '.0e') : datum.label",
    }
    bind = {"input": "radio", "options": ["log", "linear"], "name": f"{title}: "}
    first = {"name": "axis", "value": "log" if log else "linear", "bind": bind}
    taken = {"calculate": "axis == 'log' ? log(datum.v) / LN10 : datum.v", "as": "y"}
    return {
        **view,
        "params": [first, *view["params"]],
        "transform": [*view["transform"], taken],
        "encoding": {**view["encoding"], "y": quantity("y", title, axis=axis, scale=ends)},
    }
