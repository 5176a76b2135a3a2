"""Draws a forward bench: error of the observables and of the energy against processor time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import StringIO
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from screwgauge.report.bench.labels import Label, place
from screwgauge.report.bench.looks import Look, looks
from screwgauge.report.plots import Plot
from screwgauge.report.sheet import log_scale, style
from screwgauge.report.svg import tidy
from screwgauge.scene.setting import Published
from screwgauge.study.bench.forward_run import Contest
from screwgauge.study.bench.forward_work import Outcome

WIDTH, HEIGHT, LEGEND = 12.0, 6.0, 2.3  # inches
ZERO = 1e-17  # where an error of exactly zero is drawn
OTHERS = "#555555"
SENSELESS = 10.0  # scaled error from which a motion has nothing to do with the scene: it is in the table only
_PANELS: tuple[tuple[str, str, Callable[[Outcome], float]], ...] = (
    (
        "observable",
        "largest error of an observable [m or rad]",
        lambda o: max((o.largest or {}).values(), default=np.nan),
    ),
    ("energy", "energy not accounted for [J]", lambda o: o.energy),
)


def make_plots(found: Contest) -> list[Plot]:
    """The work-precision diagram."""
    done = [o for o in found.outcomes if _time(o) > 0.0 and o.scaled < SENSELESS]
    if not done:
        return []
    title = "Error against processor time"
    with style():
        return [Plot("01-work-precision", title, _draw(title, found, done))]


def _time(outcome: Outcome) -> float:
    """Processor time, or wall time where an engine does not measure it [s]."""
    return outcome.cpu if np.isfinite(outcome.cpu) else outcome.wall


def _draw(title: str, found: Contest, done: Sequence[Outcome]) -> str:
    canvas = Canvas(figsize=(WIDTH, HEIGHT))
    canvas.text(0.1 / WIDTH, 1 - 0.08 / HEIGHT, title, va="top", ha="left", weight="bold", size=11.5)
    note = "Lower left is better. Stars and dashed lines: published by others, measured on other machines."
    canvas.text(0.1 / WIDTH, 1 - 0.36 / HEIGHT, note, va="top", ha="left", color="#444444")
    families = list(dict.fromkeys(o.entrant.family for o in done))
    look = looks([(family, False) for family in families])
    wide = (WIDTH - LEGEND - 1.9) / 2
    for k, (measure, words, error) in enumerate(_PANELS):
        box = ((0.8 + k * (wide + 0.85)) / WIDTH, 0.6 / HEIGHT, wide / WIDTH, (HEIGHT - 1.4) / HEIGHT)
        _panel(canvas.add_axes(box), words, found.scene.published, measure, done, error, look)
    handles = [Line2D([], [], label=family, **look[family, False].style()) for family in families]
    handles.append(Line2D([], [], label="published by others", **_STAR))
    canvas.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(1 - LEGEND / WIDTH, 1 - 0.75 / HEIGHT),
        borderaxespad=0.0,
        frameon=False,
        labelspacing=0.7,
        title="hollow: stopped before the end",
        title_fontsize=8.5,
        alignment="left",
    )
    text = StringIO()
    canvas.savefig(text, format="svg", metadata={"Date": None})
    return tidy(text.getvalue())


_STAR: dict[str, Any] = {"marker": "*", "markersize": 11, "color": OTHERS, "linestyle": "none"}


def _panel(
    ax: Any,
    words: str,
    published: Sequence[Published],
    measure: str,
    done: Sequence[Outcome],
    error: Callable[[Outcome], float],
    look: dict[tuple[str, bool], Look],
) -> None:
    """One diagram: a line for each family, stars and dashed lines for what others have published."""
    points = {o: (_time(o), max(error(o), ZERO)) for o in done if np.isfinite(error(o))}
    theirs = [p for p in published if p.measure == measure or np.isnan(p.accuracy)]
    x = [t for t, _ in points.values()] + [p.cpu_s for p in theirs if np.isfinite(p.cpu_s)]
    y = [e for _, e in points.values()] + [p.accuracy for p in theirs if np.isfinite(p.accuracy)]
    _axes(ax, np.array(x or [1.0]), np.array(y or [1.0]), words)
    labels: list[Label] = []
    lines = []
    for (family, _), how in look.items():
        line = [(*points[o], o) for o in points if o.entrant.family == family]
        if not line:
            continue
        at = np.array([(t, e) for t, e, _ in line])
        ax.plot(*at.T, **how.style(), zorder=3, clip_on=False)
        short = np.array([(t, e) for t, e, o in line if o.status != "ok"]).reshape(-1, 2)
        ax.plot(*short.T, **{**how.style(), "markerfacecolor": "white", "linestyle": "none"}, zorder=4)
        labels += [(t, e, o.entrant.label, how.ink) for t, e, o in line]
        lines.append([(float(t), float(e)) for t, e in at])
    labels = [*_published(ax, theirs), *labels]
    place(ax, labels, [*((t, e) for t, e in points.values()), *((a, b) for a, b, *_ in labels)], lines)


def _published(ax: Any, theirs: Sequence[Published]) -> list[Label]:
    """Marks of published results; returns the labels of those that are points."""
    labels: list[Label] = []
    for item in theirs:
        name = item.who.split(",")[0].split(":")[0]
        timed, known = np.isfinite(item.cpu_s), np.isfinite(item.accuracy)
        if timed and known:
            ax.plot([item.cpu_s], [item.accuracy], **_STAR, zorder=5, clip_on=False)
            labels.append((item.cpu_s, item.accuracy, name, OTHERS))
        elif timed:
            ax.axvline(item.cpu_s, color=OTHERS, linewidth=1.0, linestyle=(0, (6, 3)), zorder=1)
            where = {"transform": ax.get_xaxis_transform(), "rotation": 90, "size": 7.5, "color": OTHERS}
            ax.text(item.cpu_s, 0.02, f" {name}", ha="right", va="bottom", **where)
        elif known:
            ax.axhline(item.accuracy, color=OTHERS, linewidth=1.0, linestyle=(0, (6, 3)), zorder=1)
            where = {"transform": ax.get_yaxis_transform(), "size": 7.5, "color": OTHERS}
            ax.text(0.99, item.accuracy, f"{name} ", ha="right", va="bottom", **where)
    return labels


def _axes(ax: Any, x: Any, y: Any, words: str) -> None:
    ax.set_xscale("log")
    ax.set_xlim(10 ** np.floor(np.log10(x.min() / 1.5)), 10 ** np.ceil(np.log10(x.max() * 1.5)))
    ax.xaxis.set_major_locator(LogLocator(numticks=99))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} s"))
    log_scale(ax, y.min() / 2, y.max() * 2)
    ax.set_xlabel("processor time of the integration")
    ax.set_ylabel(words)
    ax.tick_params(length=3)
