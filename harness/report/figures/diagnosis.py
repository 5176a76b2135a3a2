"""Pictures of ``screwgauge diagnose``: both machines, and the torque effects of their differences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from screwgauge.diagnosis.sentences import percent
from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import Spec
from screwgauge.report.stage.machines import machines

if TYPE_CHECKING:
    from screwgauge.diagnosis.answer import Diagnosis, ToldCause

MOST = 20  # number of joints and causes in a picture
LEAST, FEWEST = 1e-3, 4  # share below which a cause gets no bar, unless there are at most this many causes
FLOOR = 1e-17  # size at which zero is drawn


def share_text(cause: ToldCause) -> str:
    """Format a cause's share of the torque difference; empty if the cause has no torque effect or numeric change."""
    return percent(cause.share) if has_share(cause) else ""


def has_share(cause: ToldCause) -> bool:
    """Return True if a cause has a meaningful share."""
    return cause.kind in ("cause", "small") and not math.isnan(cause.share)


def make_plots(diagnosis: Diagnosis) -> list[Picture]:
    """Draw the machines if they differ, and the torques if the torques differ."""
    pictures = [machines(diagnosis)] if diagnosis.differences else []
    shown = sorted(filter(has_share, diagnosis.causes), key=lambda cause: -abs(cause.share))[:MOST]
    if not shown:
        return pictures
    largest = sorted(diagnosis.found.by_joint, key=lambda row: -row[1])[:MOST]
    points: list[Spec] = [{"joint": name, "x": max(float(change), FLOOR)} for name, change in largest]
    joints = chart.fill_template("joints", points=points, **chart.logarithm("x", [p["x"] for p in points]))
    shown = shown[: max(FEWEST, sum(abs(cause.share) >= LEAST for cause in shown))]
    numbers = {id(cause): k for k, cause in enumerate(diagnosis.causes, 1)}  # numbered as in the table of causes
    bars = [
        {"cause": f"{numbers[id(cause)]}: {cause.name}", "x": 100.0 * cause.share, "text": share_text(cause)}
        for cause in shown
    ]
    shares = chart.fill_template("shares", bars=bars)
    return [
        *pictures,
        chart.picture("torques-by-joint", "Effect of the differences on the torques", lambda moving: joints),
        chart.picture("torques-by-cause", "Effect of each cause on the torques", lambda moving: shares),
    ]
