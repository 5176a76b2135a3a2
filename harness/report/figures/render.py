"""Draws any diagram as SVG. Places are in points from the upper left corner of the page."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.report.figures.data import Diagram, Guide, Legend, Look, Panel, Row
from screwgauge.report.figures.labels import SIZE as SMALL
from screwgauge.report.figures.labels import Spot, along, around, boxes, place
from screwgauge.report.svg import SIZE, Page, polyline, text_width

EDGE, GAP, LINE = 7.0, 28.0, 16.0  # beside the page, between panels, from line to line of text
SAMPLE, AFTER = 26.0, 14.0  # of a legend: the line before the text; what stays free after it
TICK, WRITTEN = 3.0, 8.8  # length of a tick; size of what is written beside axes
GRID, FRAME = Look("#e4e4e4", (), 0.6), Look("#000000", (), 0.7)
SHADE, NOTE, WARNING = "#fbf3ef", "#444444", "#8a3b00"


@dataclass(frozen=True, slots=True)
class _Frame:
    """Where the axes of a panel are."""

    panel: Panel
    left: float
    top: float
    right: float
    bottom: float

    def across(self, x: Array | float) -> Array:
        return self.left + (self.right - self.left) * self.panel.x.share(x)

    def up(self, y: Array | float) -> Array:
        return self.bottom - (self.bottom - self.top) * self.panel.y.share(y)

    def line(self, guide: Guide) -> tuple[Array, Array]:
        """Ends of a guide, x and y: from the left, or from the top."""
        if guide.upright:
            return np.full(2, self.across(guide.at)), np.array([self.top, self.bottom])
        return np.array([self.left, self.right]), np.full(2, self.up(guide.at))


def render(diagram: Diagram) -> str:
    """The diagram as SVG, as high as it needs to be."""
    page, y = Page(), 26.0
    page.text(EDGE, 12.0, diagram.title, 11.5, bold=True)
    for words, colour in ((diagram.note, NOTE), *((warning, WARNING) for warning in diagram.warnings)):
        if words:
            page.text(EDGE, y + 4.0, words, colour=colour)
            y += LINE
    left = max(_beside(panel) for row in diagram.rows for panel in row.panels)
    beside = SAMPLE + max((text_width(name) for name in diagram.side), default=-SAMPLE)
    right = diagram.width - beside - GAP - GAP * bool(diagram.side)
    for legend in diagram.legends:
        y = _legend(page, legend, left, y, diagram.width - left)
    y += 6.0
    _legend(page, diagram.side, right + GAP, y, 0.0)
    columns = max(len(row.panels) for row in diagram.rows)
    for row in diagram.rows:
        y = _row(page, row, columns, (left, right), y)
    return page.picture(diagram.width, y)


def _beside(panel: Panel) -> float:
    """Room for what is written to the left of a panel."""
    names = max((text_width(name, WRITTEN) for _, name in panel.y.ticks), default=0.0)
    return EDGE if panel.bare else EDGE + TICK + 3.0 + names + (14.0 if panel.y.label else 0.0)


def _row(page: Page, row: Row, columns: int, ends: tuple[float, float], y: float) -> float:
    """Draws a row of panels from y on; returns where it ends."""
    left, right = ends
    shared = len({panel.y for panel in row.panels}) == 1
    before = 0.0 if shared else left  # of each panel but the first
    cell = (right - left + GAP + before) / columns
    top = _legend(page, row.legend, left, y - 3.0, right - left) + 5.0 if row.legend else y
    top += max(12.0 * len(panel.title) + 10.0 * bool(panel.title) for panel in row.panels)
    foot = end = 0.0
    for i, panel in enumerate(row.panels):
        x = left + i * cell
        frame = _Frame(panel, x, top, x + cell - GAP - before, top + row.height)
        for k, words in enumerate(panel.title):
            page.text(x, top - 3.0 - 12.0 * (len(panel.title) - k - 0.5), words, WRITTEN, bold=k == 0)
        foot = max(foot, _panel(page, frame, named=i == 0 or not shared))
    for i, panel in enumerate(row.panels):
        end = max(end, _legend(page, panel.legend, left + i * cell - 12.0, foot + 4.0, cell - 12.0, SMALL))
    return max(end, foot) + 10.0


def _panel(page: Page, frame: _Frame, *, named: bool) -> float:
    """Draws a panel, its y axis written if `named`; returns where what is written below it ends."""
    panel, foot = frame.panel, frame.bottom
    if panel.shade:
        low, high = (float(frame.up(y)) for y in panel.shade)
        page.path(f"M{frame.left:.2f} {low:.2f}V{high:.2f}H{frame.right:.2f}V{low:.2f}z", fill=SHADE)
    if not panel.bare:
        foot = _axes(page, frame, named=named)
    for guide in panel.guides:
        page.path(polyline(*frame.line(guide)), guide.look)
    drawn = [(frame.across(series.x), frame.up(series.y), series.look) for series in panel.series]
    for x, y, look in drawn:
        page.path(polyline(x, y), look)
    for x, y, look in drawn:
        page.marks(x, y, look if len(x) > 1 or look.marker else replace(look, marker="o", size=2.0))
    _labels(page, frame, drawn)
    return foot


def _axes(page: Page, frame: _Frame, *, named: bool) -> float:
    """Grid, ticks and what is written beside them; returns where that ends."""
    x_axis, y_axis, left, bottom = frame.panel.x, frame.panel.y, frame.left, frame.bottom
    across = [(float(frame.across(at)), name) for at, name in x_axis.ticks]
    up = [(float(frame.up(at)), name) for at, name in y_axis.ticks]
    grid = [f"M{x:.2f} {bottom:.2f}V{frame.top:.2f}" for x, _ in across]
    grid += [f"M{left:.2f} {y:.2f}H{frame.right:.2f}" for y, _ in up]
    page.path("".join(grid), GRID)
    ticks = [f"M{x:.2f} {bottom:.2f}v{TICK:g}" for x, _ in across]
    ticks += [f"M{left:.2f} {y:.2f}h-{TICK:g}" for y, _ in up]
    page.path(f"M{left:.2f} {frame.top:.2f}V{bottom:.2f}H{frame.right:.2f}{''.join(ticks)}", FRAME)
    nearest = min(np.diff(sorted(x for x, _ in across)), default=np.inf)
    every = 1 + int(max((text_width(name, WRITTEN) for _, name in across), default=0.0) / nearest)
    for x, name in across[::every]:
        page.text(x, bottom + 11.0, name, WRITTEN, "middle")
    page.text((left + frame.right) / 2, bottom + 23.5, x_axis.label, WRITTEN, "middle")
    if named:
        for y, name in up:
            page.text(left - TICK - 3.0, y, name, WRITTEN, "end")
        x, y = left - _beside(frame.panel) + EDGE + 3.0, (frame.top + bottom) / 2
        page.text(x, y, y_axis.label, WRITTEN, "middle", turned=True)
    return bottom + (30.0 if x_axis.label else 17.0 if any(name for _, name in across) else TICK)


def _labels(page: Page, frame: _Frame, drawn: list[tuple[Array, Array, Look]]) -> None:
    """Labels of guides, and those of points for which there is room."""
    guides = [guide for guide in frame.panel.guides if guide.label]
    wanted = [(guide.label, _spots(frame, guide), guide.look.colour) for guide in guides]
    for one in frame.panel.labels:
        wanted.append((one.text, around(float(frame.across(one.x)), float(frame.up(one.y))), one.colour))
    if not wanted:
        return
    taken = [boxes(x, y, look.size / 2 + 1.0) for x, y, look in drawn if look.marker]
    taken += [along(x, y) for x, y, look in drawn if look.dash is not None]
    area = np.array([frame.left, frame.top - 4.0, frame.right + 4.0, frame.bottom])
    avoid = [along(*frame.line(guide)) for guide in frame.panel.guides]
    spots = place([(text, choices) for text, choices, _ in wanted], taken, avoid, area)
    for i, ((text, choices, colour), spot) in enumerate(zip(wanted, spots, strict=True)):
        if spot or i < len(guides):
            x, y, anchor = spot or choices[0]
            page.text(x, y, text, SMALL, anchor, colour=colour)


def _spots(frame: _Frame, guide: Guide) -> list[Spot]:
    """Spots beside a guide, from its right end or its top on."""
    (x, end), (y, bottom) = (ends.tolist() for ends in frame.line(guide))
    if guide.upright:
        sides = ((-3.0, "end"), (3.0, "start"))
        return [(x + dx, v, anchor) for v in np.linspace(y + 6.0, bottom - 6.0, 12).tolist() for dx, anchor in sides]
    return [(u, y + dy, "end") for u in np.linspace(end, (x + end) / 2, 6).tolist() for dy in (-5.0, 5.5)]


def _legend(page: Page, legend: Legend, x: float, y: float, width: float, size: float = SIZE) -> float:
    """Draws a legend in as many columns as the width has room for; returns where it ends."""
    before, after, line = (length * size / SIZE for length in (SAMPLE, AFTER, LINE))
    widths = [before + text_width(name, size) + after for name in legend]
    beside = sum(widths) <= width + after
    columns = len(widths) if beside else max(1, int((width + after) / max(widths)))
    for i, (name, look) in enumerate(legend.items()):
        u = x + (sum(widths[:i]) if beside else i % columns * max(widths))
        v = np.full(2, y + (i // columns + 0.5) * line)
        sample = np.array([u, u + before - 5.0])
        page.path(polyline(sample, v), look)
        page.marks(sample[:1] + (before - 5.0) / 2, v[:1], look)
        page.text(u + before, v[0], name, size)
    return y + line * -(-len(widths) // max(columns, 1))
