"""The pictures of ``screwgauge diagnose``: where torques differ, and what explains it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import Spec, numbered
from screwgauge.report.stage.machines import machines

if TYPE_CHECKING:
    from screwgauge.diagnosis.causes.attribution import Cause
    from screwgauge.diagnosis.diagnose import Diagnosis

MOST = 20  # joints and changes of a picture
LEAST, FEWEST = 1e-3, 4  # share below which a change has no bar, unless there are so few
FLOOR = 1e-17  # what is zero is drawn so small


def share_text(cause: Cause) -> str:
    """Share of the torque difference, or of the rest of it."""
    if math.isnan(cause.weight):
        return ""
    percent = f"{100.0 * cause.weight:.{'2g' if abs(cause.weight) < 0.1 else '1f'}} %"
    return percent if math.isnan(cause.of_rest) else f"{percent} of the rest"


def make_plots(diagnosis: Diagnosis) -> list[Picture]:
    """All pictures: the machines where they differ, and of torques where these do."""
    pictures = [machines(diagnosis)] if diagnosis.differences else []
    if diagnosis.attribution is None or not diagnosis.attribution.seen:
        return pictures
    rows, when = sorted(diagnosis.by_joint, key=lambda row: -row[1])[:MOST], {"as they are": 1, "after backfill": 2}
    points: list[Spec] = [
        {"joint": row[0], "when": name, "x": max((row[1], row[2])[k - 1], FLOOR)}
        for name, k in when.items()
        for row in rows
    ]
    looks = chart.ways("when", {name: numbered(k) for name, k in when.items()})
    joints = chart.filled("joints", points=points, **looks, **chart.logarithm("x", [p["x"] for p in points]))
    ranked = [cause for cause in diagnosis.causes if abs(cause.share) >= 0.0][:MOST]
    ranked = ranked[: max(FEWEST, sum(abs(cause.share) >= LEAST for cause in ranked))]
    bars = [{"change": cause.name, "x": 100.0 * cause.share, "text": share_text(cause)} for cause in ranked]
    shares = chart.filled("shares", bars=bars)
    return [
        *pictures,
        chart.picture("torques-by-joint", "Torque difference by joint", lambda moving: joints),
        chart.picture("torques-by-cause", "What explains the torque difference", lambda moving: shares),
    ]
