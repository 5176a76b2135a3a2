"""One page of small plots: for each case the digits kept over its severity, a line per engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import StringIO
from typing import Any

from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D

from screwgauge.report.plots import Plot
from screwgauge.report.sheet import style
from screwgauge.report.stress.small_plot import PLAIN, Ink, draw, inks, mark
from screwgauge.report.svg import tidy
from screwgauge.study.stress.case import DEGRADED, OK, REFUSED, SILENT, Case
from screwgauge.study.stress.run import Row, Stress

TITLE = "Digits kept as scenes become extreme"
NOTE = (
    "Severity grows to the right, that of a ratio to both sides. "
    "In the shaded part, below nine digits, a result needs a warning."
)
COLUMNS, WIDE = 3, 3.9  # small plots side by side; inches of each
HEAD, AXES, FOOT, LINE = (
    0.34,
    1.75,
    0.54,
    0.165,
)  # inches: its title, the plot, its axis, a line of its legend
LEFT, RIGHT = 0.5, 0.22  # inches beside a plot
TOP, LETTER, SAMPLE = 0.64, 0.066, 0.55  # inches: above the legends; of a letter; of the line before the text
_WORDS = {OK: "ok", DEGRADED: "degraded, and says so", REFUSED: "refused", SILENT: "silently wrong"}


def make_plots(found: Stress) -> list[Plot]:
    """The page, if there is anything to draw."""
    drawn = {case: rows for case in found.cases if (rows := _points(found, case))}
    if not drawn:
        return []
    common, own = inks([_engines(rows) for rows in drawn.values()])
    columns = min(COLUMNS, len(drawn))
    width = columns * WIDE
    legends = _common_legends(common)
    top = TOP + 0.22 * len(legends) + 0.1
    heights = _heights([len(ink) for ink in own], columns)
    tall = top + sum(heights)
    with style():
        canvas = Canvas(figsize=(width, tall))
        canvas.text(0.1 / width, 1 - 0.1 / tall, TITLE, va="top", weight="bold", size=11.5)
        canvas.text(0.1 / width, 1 - 0.36 / tall, NOTE, va="top", color="#444444", size=9)
        for i, handles in enumerate(legends):
            _legend(canvas, handles, (0.1, TOP + 0.22 * i), len(handles))
        for i, (case, rows) in enumerate(drawn.items()):
            line, column = divmod(i, columns)
            left, upper = column * WIDE + LEFT, top + sum(heights[:line]) + HEAD
            size = (WIDE - LEFT - RIGHT) / width, AXES / tall
            ax = canvas.add_axes((left / width, 1 - upper / tall - size[1], *size))
            draw(ax, case, rows, {**common, **own[i]})
            lines = [Line2D([], [], label=name, **ink.style()) for name, ink in own[i].items()]
            if lines:
                _legend(canvas, lines, (left - 0.1, upper + AXES + FOOT), _beside(lines), 7.5)
        text = StringIO()
        canvas.savefig(text, format="svg", metadata={"Date": None})
    return [Plot("01-digits", TITLE, tidy(text.getvalue()))]


def _points(found: Stress, case: Case) -> list[Row]:
    return [row for row in found.rows if row.case == case.name and row.finding.quantity in (case.drawn, "judge")]


def _engines(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row.finding.engine for row in rows))


def _heights(settings: Sequence[int], columns: int) -> list[float]:
    """Heights of the lines of small plots: the longest legend below them counts."""
    lines = [settings[i : i + columns] for i in range(0, len(settings), columns)]
    return [HEAD + AXES + FOOT + 0.2 + LINE * -(-max(line) // 2) for line in lines]


def _beside(lines: Sequence[Line2D]) -> int:
    """Columns of a small plot's own legend."""
    longest = max(len(str(line.get_label())) for line in lines)
    return 2 if 2 * (longest * LETTER * 0.85 + SAMPLE) < WIDE else 1


def _common_legends(common: Mapping[str, Ink]) -> list[list[Line2D]]:
    """Engines, if any is without a setting, and verdicts."""
    engines = [Line2D([], [], label=name, **ink.style()) for name, ink in common.items()]
    verdicts = [Line2D([], [], label=word, **mark(verdict, PLAIN)) for verdict, word in _WORDS.items()]
    return [handles for handles in (engines, verdicts) if handles]


def _legend(
    canvas: Canvas, handles: Sequence[Line2D], at: tuple[float, float], columns: int, size: float = 8.5
) -> None:
    """A legend whose upper left corner is so many inches from that of the page."""
    width, tall = canvas.get_size_inches()
    settings: dict[str, Any] = {
        "loc": "upper left",
        "bbox_to_anchor": (at[0] / width, 1 - at[1] / tall),
        "ncols": columns,
        "frameon": False,
        "borderaxespad": 0.0,
        "borderpad": 0.0,
        "handletextpad": 0.5,
        "columnspacing": 1.2,
        "labelspacing": 0.35,
        "handlelength": 2.4,
        "fontsize": size,
    }
    canvas.legend(handles=handles, **settings)
