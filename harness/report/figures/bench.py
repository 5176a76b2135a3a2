"""The pictures of a bench: error against run time, and error against parameter with the expected slopes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from screwgauge.report.blocks import Picture
from screwgauge.report.figures.labels import Label, beside, guide, place
from screwgauge.report.figures.page import arrange, log_scale, panels, saved
from screwgauge.report.figures.style import DOTTED, GREY, Look, by_camp, camp, darker, styled
from screwgauge.report.formatting import duration
from screwgauge.study.bench.rows import LEVELS, OK
from screwgauge.study.posed import QUANTITIES

if TYPE_CHECKING:
    from screwgauge.study.bench.rows import Row
    from screwgauge.study.bench.run import Bench
    from screwgauge.study.bench.slopes import Fit

NAMES = ("joint positions", "joint velocities", "joint accelerations", "actuator forces")
WORDS = dict(zip(QUANTITIES, NAMES, strict=True))
WIDTH, COLUMNS = 800.0, 3
FITTED = "Filled points are fitted; the line has the expected slope through them."
ERROR = "largest scaled error [1]"
ZERO = 1e-17  # where an error of exactly zero is drawn
FILLED: Look = {"color": GREY, "linestyle": "", "marker": "o", "markersize": 6.0}
HOLLOW: Look = {"linestyle": "", "markerfacecolor": "white"}
STAR: Look = {"color": "#555555", "linestyle": "", "marker": "*", "markersize": 9.0}
DASHED: Look = {"color": "#555555", "linestyle": (0, (6, 3)), "linewidth": 1.0}
SENSELESS = 10.0  # scaled error from which a motion has nothing to do with the scene: it is in the table only
STARTS = {"starts from y and its derivatives": FILLED, "starts from given joint motion": {**FILLED, **HOLLOW}}


@styled
def make_plots(bench: Bench) -> list[Picture]:
    """All pictures of the report; none where there is nothing to draw."""
    return _of_simulation(bench) if bench.scene.simulated else _of_given_motion(bench)


def _of_given_motion(bench: Bench) -> list[Picture]:
    drawable = [r for r in bench.rows if r.contestant.drawn and np.isfinite(r.max_scaled) and bool(r.per_sample > 0)]
    by_quantity = {quantity: [row for row in drawable if row.quantity == quantity] for quantity in QUANTITIES[::-1]}
    families, plots = list(dict.fromkeys(row.contestant.line for row in bench.rows)), list[Picture]()
    for quantity, rows in by_quantity.items():
        if rows:
            name = f"{len(plots) + 1:02d}-{quantity.replace('_', '-')}"
            plots.append(_work_precision(name, WORDS[quantity], rows, families, bench.reference))
    return [*plots, _slopes(f"{len(plots) + 1:02d}-slopes", bench.fits)] if bench.fits else plots


def _work_precision(name: str, what: str, rows: Sequence[Row], families: Sequence[str], reference: str) -> Picture:
    looks, lines = {}, []
    for family, look in by_camp(families).items():
        if group := [row for row in rows if row.contestant.line == family]:
            joined = any(row.contestant.parameter for row in group) or len({row.contestant.name for row in group}) == 1
            hollow = {"markerfacecolor": "white"} if group[0].contestant.given else {}
            looks[family] = {**look, **hollow, "linestyle": "-" if joined else "", "markersize": 6.0}
            lines.append((looks[family], [Point(r.per_sample, r.max_scaled, r.contestant.label) for r in group]))
    page = panels(WIDTH, [378.0])
    (ax,) = page.axes
    wanted = work_precision(ax, lines, duration)
    ax.set(xlabel="run time for each sample delivered", ylabel=ERROR)
    low, high = ax.get_ylim()
    guides = [guide(ax, x, f"{-np.log10(x):.0f} digits", DOTTED) for x in LEVELS if low < x < high]
    note = f"Each point is one setting; errors are against {reference}. T: duration of the motion."
    arrange(page, f"Error against run time: {what}", [f"Lower left is better. {note}"], side={**looks, **STARTS})
    place(ax, [*guides, *wanted])
    return saved(page, name)


def _of_simulation(bench: Bench) -> list[Picture]:
    """Error of the observables and of the energy against processor time."""
    sensible = {r.contestant for r in bench.rows if r.quantity == "observable" and r.max_scaled < SENSELESS}
    done = [row for row in bench.rows if row.contestant in sensible and row.work_s > 0.0]
    if not done:
        return []
    looks = by_camp(row.contestant.family for row in done)
    looks = {family: {**look, "linestyle": "-", "markersize": 6.0} for family, look in looks.items()}
    measures = {"observable": "largest error of an observable [m or rad]", "energy": "energy not accounted for [J]"}
    page, wanted = panels(880.0, [330.0], len(measures)), []
    for ax, (measure, label) in zip(page.axes, measures.items(), strict=True):
        of_measure = [(row, max(row.largest.values(), default=np.nan)) for row in done if row.quantity == measure]
        points: dict[str, list[Point]] = {family: [] for family in looks}
        for row, error in of_measure:
            if np.isfinite(error):
                points[row.contestant.family].append(Point(row.work_s, error, row.contestant.label, row.status == OK))
        lines = [(look, points[family]) for family, look in looks.items()]
        theirs = [item for item in bench.scene.published if item.measure == measure or np.isnan(item.accuracy)]
        others = [Point(item.cpu_s, item.accuracy, item.who.split(",")[0].split(":")[0]) for item in theirs]
        wanted.append(work_precision(ax, lines, lambda seconds: f"{seconds:g} s", others))
        ax.set(xlabel="processor time of the integration", ylabel=label)
    note = "Lower left is better. Stars and dashed lines: published by others, measured on other machines."
    side = {**looks, "published by others": STAR, "stopped before the end": {**FILLED, **HOLLOW}}
    arrange(page, "Error against processor time", [note], side=side)
    for ax, texts in zip(page.axes, wanted, strict=True):
        place(ax, texts)
    return [saved(page, "01-work-precision")]


@dataclass(frozen=True, slots=True)
class Point:
    """One setting of a family, or a published result. `whole`: it ran to the end; others are hollow."""

    time_s: float
    error: float
    label: str
    whole: bool = True

    @property
    def at(self) -> tuple[float, float]:
        """Where it is drawn."""
        return self.time_s, max(self.error, ZERO)


def work_precision(
    ax: Axes,
    lines: Iterable[tuple[Look, Sequence[Point]]],
    name: Callable[[float], str],
    published: Iterable[Point] = (),
) -> list[Label]:
    """Draws points of families, and those of others.

    Args:
        name: Writes a time.
        published: Points of others; a line across where only the time or only the error is known.

    Returns:
        The labels wanted, the most important first.
    """
    guides, stars, ends, between = list[tuple[float, str, bool]](), list[Label](), list[Label](), list[Label]()
    for point in published:
        timed, known = np.isfinite([point.time_s, point.error])
        if timed and known:
            ax.plot(*point.at, **STAR)
            stars.append(beside(point.at, point.label, STAR["color"], needed=True))
        elif timed or known:
            guides.append((point.time_s if timed else point.error, point.label, bool(timed)))
    for look, points in lines:
        short = [point.at for point in points if not point.whole]
        for some, how in (([point.at for point in points], look), (short, look | HOLLOW)):
            ax.plot(*np.reshape(some, (-1, 2)).T, **how)
        labels = [beside(point.at, point.label, darker(look["color"])) for point in points if point.label]
        ends += [*labels[:1], *labels[1:][-1:]]  # the ends of a line say most
        between += labels[1:-1]
    drawn = [guide(ax, at, text, DASHED, upright=upright) for at, text, upright in guides]
    ax.margins(0.06)
    log_scale(ax.xaxis, name)
    log_scale(ax.yaxis)
    return [*drawn, *stars, *ends, *between]


def _slopes(name: str, fits: Sequence[Fit]) -> Picture:
    page = panels(WIDTH, [150.0] * -(-len(fits) // COLUMNS), COLUMNS, len(fits))
    for ax, fit in zip(page.axes, fits, strict=True):
        _slope(ax, fit)
    for row in page.rows:
        row[0].set_ylabel(ERROR)
    arrange(page, "Error against what is varied, with expected slopes", [FITTED])
    return saved(page, name)


def _slope(ax: Axes, fit: Fit) -> None:
    """Points over the parameter, and a line of the expected slope through the middle of those that were fitted."""
    x, error, look = fit.x[fit.used], fit.error[fit.used], {**FILLED, "color": camp(fit.rule.line), "markersize": 5.5}
    if len(x):
        level = np.mean(np.log10(error) - fit.rule.expected * np.log10(x))
        ends = np.array([x.min() / 1.5, x.max() * 1.5])
        ax.plot(ends, 10**level * ends**fit.rule.expected, color=GREY, linewidth=1.0)
    ax.plot(fit.x, fit.error, **{**look, **HOLLOW})
    ax.plot(x, error, **look)
    ax.set_xlabel(fit.name)
    log_scale(ax.xaxis)
    log_scale(ax.yaxis)
    slope = f"{WORDS[fit.rule.quantity]}: slope {fit.slope:.3f}, expected {fit.rule.expected:g}"
    ax.set_title(f"{fit.rule.line}\n{slope}", weight="normal")
