"""The pictures of ``screwgauge diagnose``: where torques differ, and what explains it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.blocks import Picture
from screwgauge.report.figures.page import arrange, log_scale, panels, saved
from screwgauge.report.figures.style import COLOURS, GREY, MARKERS, SMALL, Look, styled

if TYPE_CHECKING:
    from screwgauge.diagnosis.diagnose import Diagnosis

BAR, MOST = 15.0, 20  # points of a bar with the gap beside it; bars of a picture
LEAST, FEWEST = 1e-3, 4  # share below which a change has no bar, unless there are so few
FLOOR = 1e-17  # what is zero is drawn so small


@styled
def make_plots(found: Diagnosis) -> list[Picture]:
    """All pictures; none where the torques agree."""
    if found.attribution is None or not found.attribution.steps:
        return []
    return [_by_joint(found), _by_hypothesis(found)]


def _by_joint(found: Diagnosis) -> Picture:
    """Scaled torque difference of each joint, before and after backfill."""
    rows = sorted(found.by_joint, key=lambda row: row[1])[-MOST:]
    page = panels(576.0, [BAR * len(rows) + BAR])
    (ax,) = page.axes
    place, looks = np.arange(len(rows)), dict[str, Look]()
    for k, name in ((1, "as they are"), (2, "after backfill")):
        looks[name] = {"color": COLOURS[k], "linestyle": "none", "marker": MARKERS[k]}
        ax.plot(np.maximum([row[k] for row in rows], FLOOR), place, **looks[name])
    ax.set_yticks(place, [row[0] for row in rows])
    ax.set(xlabel="largest difference, over the largest magnitude of the joint")
    log_scale(ax.xaxis)
    arrange(page, "Torque difference by joint", above=[looks])
    return saved(page, "torques-by-joint")


def _by_hypothesis(found: Diagnosis) -> Picture:
    assert found.attribution is not None
    ranking = found.attribution.ranking[:MOST]
    seen = max(FEWEST, sum(share >= LEAST for _, share in ranking))
    ranking = ranking[:seen][::-1]
    page = panels(576.0, [BAR * len(ranking) + BAR])
    (ax,) = page.axes
    place, shares = np.arange(len(ranking)), [max(100.0 * share, 0.0) for _, share in ranking]
    bars = ax.barh(place, shares, color=COLOURS[0], height=0.6)
    ax.bar_label(bars, [f"{share:.3g} %" for share in shares], padding=3.0, fontsize=SMALL)
    ax.axvline(100.0, color=GREY, linewidth=0.8)
    ax.set_yticks(place, [hypothesis.name for hypothesis, _ in ranking])
    ax.set(xlabel="share of the torque difference that each change explains alone [%]", xlim=(0.0, 115.0))
    arrange(page, "What explains the torque difference")
    return saved(page, "torques-by-hypothesis")
