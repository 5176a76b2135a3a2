"""The picture of a simulation bench: error of the observables and of the energy against processor time."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import labels
from screwgauge.report.figures.page import arrange, panels, saved
from screwgauge.report.figures.style import by_camp, styled
from screwgauge.report.figures.work_precision import FILLED, HOLLOW, STAR, Point, work_precision
from screwgauge.study.bench.rows import OK

if TYPE_CHECKING:
    from screwgauge.study.bench.forward_score import Outcome
    from screwgauge.study.bench.run import Bench as Contest

SENSELESS = 10.0  # scaled error from which a motion has nothing to do with the scene: it is in the table only
#: What is measured, its axis, and its error.
MEASURES: tuple[tuple[str, str, Callable[[Outcome], float]], ...] = (
    (
        "observable",
        "largest error of an observable [m or rad]",
        lambda o: max((o.largest or {}).values(), default=np.nan),
    ),
    ("energy", "energy not accounted for [J]", lambda o: o.energy),
)


@styled
def make_plots(contest: Contest) -> list[Picture]:
    """The work-precision diagram, if there is anything to draw."""
    done = [o for o in contest.outcomes if _time(o) > 0.0 and o.scaled < SENSELESS]
    if not done:
        return []
    looks = by_camp(o.contestant.family for o in done)
    looks = {family: {**look, "linestyle": "-", "markersize": 6.0} for family, look in looks.items()}
    page = panels(880.0, [330.0], len(MEASURES))
    wanted = []
    for ax, (measure, label, error) in zip(page.axes, MEASURES, strict=True):
        lines = []
        for family, look in looks.items():
            outcomes = [o for o in done if o.contestant.family == family and np.isfinite(error(o))]
            lines.append((look, [Point(_time(o), error(o), o.contestant.label, o.status == OK) for o in outcomes]))
        theirs = [item for item in contest.scene.published if item.measure == measure or np.isnan(item.accuracy)]
        others = [Point(item.cpu_s, item.accuracy, item.who.split(",")[0].split(":")[0]) for item in theirs]
        wanted.append(work_precision(ax, lines, lambda seconds: f"{seconds:g} s", others))
        ax.set(xlabel="processor time of the integration", ylabel=label)
    note = "Lower left is better. Stars and dashed lines: published by others, measured on other machines."
    side = {**looks, "published by others": STAR, "stopped before the end": {**FILLED, **HOLLOW}}
    arrange(page, "Error against processor time", [note], side=side)
    for ax, texts in zip(page.axes, wanted, strict=True):
        labels.place(ax, texts)
    return [saved(page, "01-work-precision")]


def _time(outcome: Outcome) -> float:
    """Processor time, or wall time where an engine does not measure it [s]."""
    return outcome.cpu if np.isfinite(outcome.cpu) else outcome.wall
