"""What a diagram shows, as data. Lengths on the page are in points (1/72 inch)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True)
class Look:
    """How a line and its marks are drawn.

    Attributes:
        colour: Of the line and of the rim of its marks.
        dash: Lengths of dashes and gaps in widths of the stroke; empty for a solid line, None for no line.
        width: Of the stroke.
        marker: One of `svg.MARKERS`; empty for none.
        fill: Colour inside the marks: that of the line if empty, ``none`` for open ones.
        size: Width of a mark.
    """

    colour: str
    dash: tuple[float, ...] | None = ()
    width: float = 1.2
    marker: str = ""
    fill: str = ""
    size: float = 5.5


Legend = Mapping[str, Look]


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Points joined by a line, marked, or both; one that is not a number is a gap. x, y: shape (n,)."""

    x: Array
    y: Array
    look: Look


@dataclass(frozen=True, slots=True)
class Guide:
    """A straight line across a panel at one y, or at one x if `upright`; its label is always written."""

    at: float
    look: Look
    label: str = ""
    upright: bool = False


@dataclass(frozen=True, slots=True)
class Label:
    """Text beside a point; left out where there is no room."""

    x: float
    y: float
    text: str
    colour: str


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis from `low` to `high` (which may be the smaller one), with named ticks; the label has its unit."""

    label: str
    low: float
    high: float
    ticks: tuple[tuple[float, str], ...] = ()
    log: bool = False

    def share(self, values: Array | float) -> Array:
        """Position along the axis, 0 at `low` and 1 at `high`; NaN where there is none. Shape as given."""
        at, low, high = np.asarray(values, dtype=float), self.low, self.high
        if self.log:
            at, low, high = np.log10(np.where(at > 0.0, at, np.nan)), np.log10(low), np.log10(high)
        return np.asarray((at - low) / (high - low))


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes:
        title: Lines above it, the first one bold.
        labels: The most important first.
        shade: Range of y that is tinted.
        legend: Below it.
        bare: Without axes, as for a drawing.
    """

    x: Axis
    y: Axis
    series: tuple[Series, ...]
    title: tuple[str, ...] = ()
    guides: tuple[Guide, ...] = ()
    labels: tuple[Label, ...] = ()
    shade: tuple[float, float] | None = None
    legend: Legend = field(default_factory=dict)
    bare: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """Panels side by side, `height` that of their axes; what all have as y axis is written once. `legend`: above."""

    panels: tuple[Panel, ...]
    height: float
    legend: Legend = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Diagram:
    """A page of panels.

    Attributes:
        note: How to read it.
        warnings: What it does not show.
        legends: Above all rows.
        side: To the right of all rows.
    """

    title: str
    rows: tuple[Row, ...]
    width: float
    note: str = ""
    warnings: tuple[str, ...] = ()
    legends: tuple[Legend, ...] = ()
    side: Legend = field(default_factory=dict)
