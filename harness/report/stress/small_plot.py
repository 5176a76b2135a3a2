"""One small plot: digits over severity, every point marked with its verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from screwgauge.quantities import MAX_DIGITS, digits
from screwgauge.report.bench.looks import CAMPS, MARKERS
from screwgauge.report.formatting import number
from screwgauge.report.sheet import DASHES, GREY
from screwgauge.study.stress.case import DEGRADED, GOOD, OK, REFUSED, SILENT, Case
from screwgauge.study.stress.run import Row

RED, SHADE = "#b3202a", "#fbf3ef"
LOWEST, NO_NUMBER, APART = (
    -2.6,
    -0.9,
    0.55,
)  # end of the axis; where crosses begin, a line of them for each camp
NUMBERED = range(-2, 4)  # decades that are written out
SHORT = 1.6  # decades: on a shorter axis every rung has its tick


@dataclass(frozen=True, slots=True)
class Ink:
    """Colour of the engine's camp, marker and dashes of the setting."""

    colour: str
    marker: str = "o"
    dash: Any = "-"

    def style(self) -> dict[str, Any]:
        """Keyword arguments of a line in a legend."""
        return {
            **mark(OK, self),
            "color": self.colour,
            "linestyle": self.dash,
            "linewidth": 1.2,
        }


PLAIN = Ink(GREY)


def inks(plots: Sequence[Sequence[str]]) -> tuple[dict[str, Ink], list[dict[str, Ink]]]:
    """Inks of bare engines, the same in all plots, and of engines with a setting, plot by plot.

    Args:
        plots: Names of the engines in each plot; what follows a blank is a setting.
    """
    bare = dict.fromkeys(name for names in plots for name in names if " " not in name)
    common = _assign(list(bare), {})
    own = []
    for names in plots:
        taken: dict[str, int] = {}
        for name in names:
            if name in common:
                taken[_colour(name)] = taken.get(_colour(name), 0) + 1
        own.append(_assign([name for name in names if name not in common], taken))
    return common, own


def _assign(names: Sequence[str], taken: dict[str, int]) -> dict[str, Ink]:
    found = {}
    for name in names:
        colour = _colour(name)
        k = taken.get(colour, 0)
        taken[colour] = k + 1
        found[name] = Ink(colour, MARKERS[k % len(MARKERS)], DASHES[k % len(DASHES)])
    return found


def _colour(name: str) -> str:
    return next((colour for starts, colour, _ in CAMPS if name.startswith(starts)), GREY)


def mark(verdict: str, ink: Ink) -> dict[str, Any]:
    """Full: ok; hollow: degraded; a cross below the axis: refused; in a red frame: silently wrong."""
    size = 4.5 + (1.5 if ink.marker == "*" else 0.0)
    common = {
        "linestyle": "none",
        "marker": ink.marker,
        "markersize": size,
        "markeredgecolor": ink.colour,
        "markerfacecolor": ink.colour,
        "markeredgewidth": 1.1,
    }
    changes: dict[str, dict[str, Any]] = {
        OK: {},
        DEGRADED: {"markerfacecolor": "white"},
        REFUSED: {"marker": "x"},
        SILENT: {"marker": "s", "markersize": 6.0, "markeredgecolor": RED, "markeredgewidth": 1.4},
    }
    return common | changes[verdict]


def draw(ax: Any, case: Case, rows: Sequence[Row], look: Mapping[str, Ink]) -> None:
    """Draws one case.

    Args:
        rows: Those of the quantity drawn.
        look: Ink of every engine.
    """
    place = _places(sorted({row.severity for row in rows}))
    camps = list(dict.fromkeys(look[row.finding.engine].colour for row in rows))
    for engine in dict.fromkeys(row.finding.engine for row in rows):
        here = sorted((row for row in rows if row.finding.engine == engine), key=lambda row: row.severity)
        ink = look[engine]
        x = [place[row.severity] for row in here]
        y = [digits(row.finding.error) for row in here]
        ax.plot(x, y, color=ink.colour, linestyle=ink.dash, linewidth=1.1, zorder=3)
        below = NO_NUMBER - APART * (camps.index(ink.colour) % 3)
        for row, u, v in zip(here, x, y, strict=True):
            verdict = row.finding.verdict
            ax.plot([u], [below if np.isnan(v) else v], **mark(verdict, ink), clip_on=False, zorder=4)
    ax.axhspan(LOWEST, digits(GOOD), color=SHADE, zorder=0, linewidth=0)
    ax.axhline(digits(GOOD), color=GREY, linewidth=0.8, linestyle=(0, (1, 2)), zorder=1)
    ax.set_ylim(LOWEST, MAX_DIGITS + 0.6)
    ax.yaxis.set_major_locator(FixedLocator([0, 3, 6, 9, 12, 15]))
    ax.set_ylabel("digits", size=8.5, labelpad=2)
    _severity_axis(ax, case, place)
    ax.set_title(case.title, size=9, loc="left", weight="bold", pad=5)
    ax.tick_params(length=3, labelsize=8)


def _places(severities: Sequence[float]) -> dict[float, float]:
    """Decades; zero stands one decade before the smallest."""
    least = min((s for s in severities if s > 0), default=1.0)
    return {s: float(np.log10(s)) if s > 0 else float(np.log10(least)) - 1.0 for s in severities}


def _severity_axis(ax: Any, case: Case, place: Mapping[float, float]) -> None:
    low, high = min(place.values()), max(place.values())
    margin = 0.04 * max(high - low, 1.0)
    ax.set_xlim(*((high + margin, low - margin) if case.falling else (low - margin, high + margin)))
    ticks, names = _ticks(place, low, high)
    ax.xaxis.set_major_locator(FixedLocator(ticks))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda t, _: names.get(t, _decade(round(t)))))
    ax.set_xlabel(case.axis, size=8.5, labelpad=2)


def _ticks(place: Mapping[float, float], low: float, high: float) -> tuple[list[float], dict[float, str]]:
    """Decades and zero; on a ladder of hardly more than a decade the rungs themselves. Names of what is no decade."""
    if high - low < SHORT and 0.0 not in place:
        return sorted(place.values()), {at: number(severity, 2) for severity, at in place.items()}
    step = max(1, int(np.ceil((high - low) / 6)))
    decades = [float(k) for k in range(int(np.ceil(low)), int(np.floor(high)) + 1) if k % step == 0]
    if 0.0 not in place:
        return decades, {}
    zero = place[0.0]
    return [zero, *(t for t in decades if abs(t - zero) > 0.6 * step)], {zero: "0"}


def _decade(k: int) -> str:
    """``0.01``, ``1000``, ``1e4``."""
    return f"{10.0**k:g}" if k in NUMBERED else f"1e{k}"
