"""Draws any diagram with matplotlib. Places are in points from the upper left corner of the page."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
from typing import Any

import numpy as np
from matplotlib import rc_context, rcdefaults, rcParams
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator
from matplotlib.transforms import Affine2D, Bbox, IdentityTransform

from screwgauge.report.figures.data import Axis, Diagram, Guide, Legend, Look, Panel, Row
from screwgauge.report.figures.labels import SIZE as SMALL
from screwgauge.report.figures.labels import Spot, along, around, boxes, place, text_width
from screwgauge.report.figures.render import EDGE, GAP

SIZE, WRITTEN, LINE = 9.5, 8.8, 16.0  # of letters; of those beside axes; from line to line of text
SAMPLE, ASIDE, AFTER = 2.2, 0.5, 1.5  # of a legend, over its size: the line, what stays free beside and after the text
TICK = 3.0
GRID = {"colors": "#e4e4e4", "linewidths": 0.6, "zorder": 0.5}
SHADE, NOTE, WARNING = "#fbf3ef", "#444444", "#8a3b00"
STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "screwgauge",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Segoe UI", "Helvetica", "Arial", "sans-serif"],
    "font.size": SIZE,
    "text.parse_math": False,
    "axes.linewidth": 0.7,
    "axes.labelsize": WRITTEN,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.solid_capstyle": "butt",
    **{f"{axis}tick.{key}": value for axis in "xy" for key, value in (("labelsize", WRITTEN), ("major.size", TICK))},
    **{f"{axis}tick.major.{key}": value for axis in "xy" for key, value in (("width", 0.7), ("pad", 3.0))},
    "legend.frameon": False,
    **{f"legend.{key}": 0.0 for key in ("borderpad", "borderaxespad")},
    "legend.handlelength": SAMPLE,
    "legend.handletextpad": ASIDE,
    "legend.columnspacing": AFTER,
}


def draw(diagram: Diagram) -> str:
    """The diagram as SVG, the same for the same data."""
    with rc_context():
        rcdefaults()
        rcParams.update(STYLE)
        return _Page(diagram).svg()


class _Page:
    """A figure that grows downwards; `place` leads from the upper left corner to it once the height is known."""

    def __init__(self, diagram: Diagram) -> None:
        self.figure, self.place = Figure((diagram.width / 72, 1.0), dpi=72), Affine2D()
        self.panels: list[tuple[Panel, Axes, Bbox]] = []
        self.width, self.end = diagram.width, 26.0
        self.text(EDGE, 12.0, diagram.title, size=11.5, weight="bold")
        for words, colour in ((diagram.note, NOTE), *((warning, WARNING) for warning in diagram.warnings)):
            if words:
                self.text(EDGE, self.end + 4.0, words, color=colour)
                self.end += LINE
        left = max(_beside(panel) for row in diagram.rows for panel in row.panels)
        right = self.width - GAP
        for legend in diagram.legends:
            self.end = self.legend(legend, left, self.end, self.width - left)
        self.end += 6.0
        if diagram.side:
            right -= max(_entry(name, SIZE) for name in diagram.side) + GAP - AFTER * SIZE
            self.legend(diagram.side, right + GAP, self.end, 0.0)
        columns = max(len(row.panels) for row in diagram.rows)
        for row in diagram.rows:
            self.row(row, columns, left, right)

    def text(self, x: float, y: float, words: str, **style: Any) -> None:
        """A text with the middle of its height at y."""
        self.figure.text(x, y, words, va="center", transform=self.place, **style)

    def legend(self, legend: Legend, x: float, y: float, width: float, size: float = SIZE) -> float:
        """Draws a legend in as many columns as the width has room for; returns where it ends."""
        if not legend:
            return y
        widths = [_entry(name, size) for name in legend]
        room = width + AFTER * size
        columns = len(widths) if sum(widths) <= room else max(1, int(room / max(widths)))
        samples = [Line2D([], [], **_style(look)) for look in legend.values()]
        line = LINE * size / SIZE
        spot = {"loc": "upper left", "bbox_to_anchor": (x, y + 0.15 * line), "bbox_transform": self.place}
        self.figure.legend(samples, [*legend], ncols=columns, fontsize=size, **spot)
        return y + line * -(-len(widths) // columns)

    def row(self, row: Row, columns: int, left: float, right: float) -> None:
        """Draws a row of panels."""
        shared = len({panel.y for panel in row.panels}) == 1
        before = 0.0 if shared else left  # of each panel but the first
        cell = (right - left + GAP + before) / columns
        top = self.legend(row.legend, left, self.end - 3.0, right - left) + 5.0 if row.legend else self.end
        top += max(12.0 * len(panel.title) + 10.0 * bool(panel.title) for panel in row.panels)
        foot = top + row.height + max(_below(panel) for panel in row.panels)
        self.end = foot
        for i, panel in enumerate(row.panels):
            x = left + i * cell
            for k, words in enumerate(panel.title[::-1]):
                weight = "bold" if k + 1 == len(panel.title) else "normal"
                self.text(x, top - 9.0 - 12.0 * k, words, size=WRITTEN, weight=weight)
            axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
            self.panels.append((panel, axes, Bbox.from_extents(x, top, x + cell - GAP - before, top + row.height)))
            _fill(axes, panel, self.panels[-1][2], named=i == 0 or not shared)
            self.end = max(self.end, self.legend(panel.legend, x - 12.0, foot + 4.0, cell - 12.0, SMALL))
        self.end += 10.0

    def svg(self) -> str:
        """Cuts the page where it ends, and labels what has found its place."""
        self.figure.set_figheight(self.end / 72)
        self.place.scale(1.0, -1.0).translate(0.0, self.end)
        for panel, axes, box in self.panels:
            left, top, right, bottom = box.extents / np.tile((self.width, self.end), 2)
            axes.set_position((left, 1.0 - bottom, right - left, bottom - top))
            _labels(axes, panel)
        text = StringIO()
        FigureCanvasSVG(self.figure).print_svg(text, metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")))
        return text.getvalue()[text.getvalue().index("<svg") :]


def _entry(name: str, size: float) -> float:
    """Width of an entry of a legend, with what stays free after it."""
    return (SAMPLE + ASIDE + AFTER) * size + text_width(name, size)


def _beside(panel: Panel) -> float:
    """Room for what is written to the left of a panel."""
    names = max((text_width(name, WRITTEN) for _, name in panel.y.ticks), default=0.0)
    return EDGE if panel.bare else EDGE + TICK + 3.0 + names + (14.0 if panel.y.label else 0.0)


def _below(panel: Panel) -> float:
    """Room for what is written below a panel."""
    if panel.bare:
        return 0.0
    return 30.0 if panel.x.label else 17.0 if any(name for _, name in panel.x.ticks) else TICK


def _style(look: Look) -> dict[str, Any]:
    """A look as matplotlib names it."""
    return {
        "color": look.colour,
        "linewidth": look.width,
        "linestyle": "none" if look.dash is None else (0.0, look.dash) if look.dash else "solid",
        "marker": look.marker or "none",
        "markersize": look.size * (1.35 if look.marker == "*" else 1.0),  # to the tips, not as wide
        "markeredgewidth": look.width,
        "markerfacecolor": look.fill or look.colour,
    }


def _fill(axes: Axes, panel: Panel, box: Bbox, *, named: bool) -> None:
    """Draws a panel on axes as large as the box, its y axis written if `named`."""
    if not named:
        axes.yaxis.set_tick_params(labelleft=False)
    _scale(axes, "x", panel.x, box.width)
    _scale(axes, "y", panel.y, np.inf)
    axes.xaxis.set_label_coords(0.5, -23.5 / box.height)
    axes.yaxis.set_label_coords((EDGE + 3.0 - _beside(panel)) / box.width, 0.5)
    axes.set_xlabel(panel.x.label, va="center")
    axes.set_ylabel(panel.y.label if named else "", va="center")
    if panel.bare:
        axes.set_axis_off()
    else:
        axes.vlines([at for at, _ in panel.x.ticks], 0.0, 1.0, transform=axes.get_xaxis_transform(), **GRID)
        axes.hlines([at for at, _ in panel.y.ticks], 0.0, 1.0, transform=axes.get_yaxis_transform(), **GRID)
    if panel.shade:
        axes.axhspan(*panel.shade, color=SHADE, linewidth=0.0, zorder=0.0)
    for guide in panel.guides:
        (axes.axvline if guide.upright else axes.axhline)(guide.at, **_style(guide.look), zorder=1.5)
    for series in panel.series:
        look = series.look if len(series.x) > 1 or series.look.marker else replace(series.look, marker="o", size=2.0)
        for part, order in ((replace(look, marker=""), 2.0), (replace(look, dash=None), 3.0)):  # marks above all lines
            if part.marker or part.dash is not None:
                axes.add_artist(Line2D(series.x, series.y, **_style(part), zorder=order, clip_on=False))


def _scale(axes: Axes, which: str, axis: Axis, room: float) -> None:
    """Scale, ticks and limits of an axis; where its room is too small, some ticks go without name."""
    if axis.log:
        getattr(axes, f"set_{which}scale")("log", nonpositive="mask")
    at = [tick for tick, _ in axis.ticks]
    nearest = min(np.diff(np.sort(axis.share(np.array(at)))), default=1.0) * room
    every = 1 + int(max((text_width(name, WRITTEN) for _, name in axis.ticks), default=0.0) / nearest)
    names = [name if i % every == 0 else "" for i, (_, name) in enumerate(axis.ticks)]
    getattr(axes, f"set_{which}ticks")(at, names)
    getattr(axes, f"{which}axis").set_minor_locator(NullLocator())
    getattr(axes, f"set_{which}lim")(axis.low, axis.high)


def _labels(axes: Axes, panel: Panel) -> None:
    """Labels of guides, and those of points for which there is room."""
    guides = [guide for guide in panel.guides if guide.label]
    wanted = [(guide.label, _spots(axes, guide), guide.look.colour) for guide in guides]
    for one in panel.labels:
        wanted.append((one.text, around(*axes.transData.transform((one.x, one.y)).tolist()), one.colour))
    if not wanted:
        return
    drawn = [(axes.transData.transform(np.column_stack([one.x, one.y])).T, one.look) for one in panel.series]
    taken = [boxes(*points, look.size / 2 + 1.0) for points, look in drawn if look.marker]
    taken += [along(*points) for points, look in drawn if look.dash is not None]
    area = np.array(axes.bbox.extents) + [0.0, 0.0, 4.0, 4.0]
    avoid = [along(*_ends(axes, guide)) for guide in panel.guides]
    spots = place([(text, choices) for text, choices, _ in wanted], taken, avoid, area)
    for i, ((text, choices, colour), spot) in enumerate(zip(wanted, spots, strict=True)):
        if spot or i < len(guides):
            x, y, side = spot or choices[0]
            axes.text(x, y, text, size=SMALL, ha=side, va="center", color=colour, transform=IdentityTransform())


def _ends(axes: Axes, guide: Guide) -> np.ndarray:
    """Ends of a guide, x and y: from the left, or from the top."""
    across = axes.get_xaxis_transform() if guide.upright else axes.get_yaxis_transform()
    return across.transform([(guide.at, 1.0), (guide.at, 0.0)] if guide.upright else [(0.0, guide.at), (1.0, guide.at)]).T


def _spots(axes: Axes, guide: Guide) -> list[Spot]:
    """Spots beside a guide, from its right end or its top on."""
    (x, end), (y, bottom) = _ends(axes, guide).tolist()
    if guide.upright:
        sides = ((-3.0, "right"), (3.0, "left"))
        return [(x + dx, v, side) for v in np.linspace(y - 6.0, bottom + 6.0, 12).tolist() for dx, side in sides]
    return [(u, y + dy, "right") for u in np.linspace(end, (x + end) / 2, 6).tolist() for dy in (5.0, -5.5)]
