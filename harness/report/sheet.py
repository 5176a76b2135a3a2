"""The sheet a figure is drawn on. Places are in inches; legends have strips of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator

from screwgauge.report.svg import tidy

# Okabe and Ito, told apart by colour-blind readers; their yellow is left out, too light for a line on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)), (0, (3, 1, 1, 1, 1, 1)))
MARKERS = ("o", "x", "+", "s", "^", "D")
GREY = "#767676"
STYLE = {
    "svg.fonttype": "none",  # text stays text: small, searchable, selectable
    "svg.hashsalt": "screwgauge",  # same data, same file
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.linewidth": 0.7,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "path.simplify": False,  # thinned before, on purpose
}
LEFT, RIGHT, GAP, BOTTOM, LINE, TITLE = 0.85, 0.15, 0.22, 0.5, 0.25, 0.34  # inches
UPPER, LOWER, LABEL = 2.3, 1.6, 0.24
LETTER, SAMPLE = 0.068, 0.52  # widths in a legend: of a letter; of the line before the text, with gaps


@dataclass(frozen=True, slots=True)
class Strip:
    """One legend in a strip across the sheet."""

    handles: Sequence[Line2D]

    def columns(self, width: float) -> int:
        """As many as fit side by side."""
        lengths = [len(str(handle.get_label())) for handle in self.handles]
        if sum(lengths) * LETTER + len(lengths) * SAMPLE <= width - LEFT:
            return len(lengths)
        return max(1, min(len(lengths) - 1, int((width - LEFT) / (max(lengths) * LETTER + SAMPLE))))

    def height(self, width: float) -> float:
        return LINE * -(-len(self.handles) // self.columns(width))


def _width(n_panels: int) -> float:
    return {1: 8.0, 2: 10.0}.get(n_panels, 12.0)


class Sheet:
    """Title, notes and legends on top; a row of panels; further legends; a second row.

    `upper` and `lower` are the axes, panel by panel; `lower` is empty without a second row.
    """

    def __init__(
        self,
        title: str,
        labels: Sequence[str],
        strips: Sequence[Strip],
        *,
        notes: Sequence[str] = (),
        lower_strips: Sequence[Strip] = (),
        lower: bool = True,
    ) -> None:
        width, n = _width(len(labels)), len(labels)
        head = TITLE + LINE * len(notes) + sum(s.height(width) for s in strips) + LABEL * any(labels)
        between = 0.15 + sum(s.height(width) for s in lower_strips)
        self.size = (width, head + UPPER + BOTTOM + (between + LOWER if lower else 0.0))
        self.canvas = Canvas(figsize=self.size)
        self._text(0.06, title, weight="bold", size=11.5)
        y = TITLE
        for note in notes:
            self._text(y, note, color="#8a3b00")
            y += LINE
        self._strips(y, strips)
        self.upper = self._row(head, UPPER, n)
        self.lower = self._row(head + UPPER + between, LOWER, n) if lower else []
        self._strips(head + UPPER + 0.1, lower_strips)
        for ax, label in zip(self.upper, labels, strict=True):
            ax.set_title(label, loc="left", size=9.5, pad=4)
            ax.tick_params(labelbottom=not lower)
        for ax in self.lower or self.upper:
            ax.set_xlabel("t [s]")

    def _text(self, y: float, text: str, **style: Any) -> None:
        self.canvas.text(0.1 / self.size[0], 1 - y / self.size[1], text, va="top", ha="left", **style)

    def _strips(self, y: float, strips: Sequence[Strip]) -> None:
        width, height = self.size
        for strip in strips:
            self.canvas.legend(
                handles=strip.handles,
                loc="upper left",
                bbox_to_anchor=(LEFT / width, 1 - y / height),
                ncols=strip.columns(width),
                borderaxespad=0.0,
                borderpad=0.0,
                frameon=False,
                handlelength=2.2,
                columnspacing=1.4,
            )
            y += strip.height(width)

    def _row(self, y: float, tall: float, n: int) -> list[Any]:
        width, height = self.size
        wide = (width - LEFT - RIGHT - GAP * (n - 1)) / n
        axes: list[Any] = []
        for i in range(n):
            box = (
                (LEFT + i * (wide + GAP)) / width,
                1 - (y + tall) / height,
                wide / width,
                tall / height,
            )
            axes.append(self.canvas.add_axes(box, sharey=axes[0] if axes else None))
            axes[-1].tick_params(labelleft=i == 0, length=3)
            axes[-1].margins(x=0.02)
            axes[-1].xaxis.set_major_locator(MaxNLocator(6 if wide > 2.3 else 3, steps=[1, 2, 5, 10]))
        return axes

    def svg(self) -> str:
        """The sheet as small, reproducible SVG."""
        text = StringIO()
        self.canvas.savefig(text, format="svg", metadata={"Date": None})
        return tidy(text.getvalue())


def style() -> Any:
    """Context in which sheets are made and saved."""
    return mpl.rc_context({**mpl.rcParamsDefault, **STYLE})


def log_scale(ax: Any, low: float, high: float) -> None:
    """A logarithmic axis of values over whole decades, with labels such as 1e-12."""
    first, last = np.floor(np.log10(low)), np.ceil(np.log10(high))
    last = max(last, first + 1)
    ax.set_yscale("log")
    ax.set_ylim(10.0**first, 10.0**last)
    decades = np.arange(first, last + 1)
    step = max(1, int(np.ceil(len(decades) / 6)))
    ax.yaxis.set_major_locator(LogLocator(numticks=99))
    ax.set_yticks(10.0 ** decades[::step], minor=False)
    ax.set_yticks([], minor=True)
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"1e{round(np.log10(value))}"))
