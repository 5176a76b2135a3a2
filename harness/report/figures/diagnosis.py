"""The pictures of ``screwgauge diagnose``: where torques differ, and what explains it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import WIDTH, quantity, told
from screwgauge.report.figures.looks import COLOURS, numbered

if TYPE_CHECKING:
    from screwgauge.diagnosis.diagnose import Diagnosis

BAR, MOST = 16, 20  # height of a bar with the gap beside it [pixels]; bars of a picture
LEAST, FEWEST = 1e-3, 4  # share below which a change has no bar, unless there are so few
FLOOR = 1e-17  # what is zero is drawn so small


def make_plots(found: Diagnosis) -> list[Picture]:
    """All pictures; none where the torques agree."""
    if found.attribution is None or not found.attribution.steps:
        return []
    return [_by_joint(found), _by_hypothesis(found)]


def _by_joint(found: Diagnosis) -> Picture:
    """Scaled torque difference of each joint, before and after backfill."""
    title, looks = "largest difference, over the largest magnitude of the joint [1]", {}
    rows = sorted(found.by_joint, key=lambda row: -row[1])[:MOST]
    values = []
    for k, name in ((1, "as they are"), (2, "after backfill")):
        looks[name] = numbered(k)
        values += [{"joint": row[0], "when": name, "x": max(row[k], FLOOR)} for row in rows]
    y = {"field": "joint", "type": "nominal", "sort": None, "title": None, "axis": {"grid": True}}
    view = {
        "data": {"values": values},
        "width": WIDTH - 120,
        "height": {"step": BAR},
        "mark": {"type": "point", "size": 45, "opacity": 1.0, "filled": True},
        "encoding": {
            "x": chart.logarithm("x", title),
            "y": y,
            **told("when", looks, "color", "shape"),
            **chart.hover(joint="joint", when="models", x=title),
        },
    }
    return chart.picture("torques-by-joint", "Torque difference by joint", lambda moving: view)


def _by_hypothesis(found: Diagnosis) -> Picture:
    assert found.attribution is not None
    ranking = found.attribution.ranking[:MOST]
    ranking = ranking[: max(FEWEST, sum(share >= LEAST for _, share in ranking))]
    title = "share of the torque difference that each change explains alone [%]"
    shares = [(hypothesis.name, max(100.0 * share, 0.0)) for hypothesis, share in ranking]
    values = [{"change": name, "x": share, "text": f"{share:.3g} %"} for name, share in shares]
    x = quantity("x", title, scale={"domain": [0, 115], "nice": False}, axis={"values": list(range(0, 101, 20))})
    y = {"field": "change", "type": "nominal", "sort": None, "title": None}
    text = {"mark": {"type": "text", "align": "left", "dx": 4}, "encoding": {"text": {"field": "text"}}}
    bars = {"mark": {"type": "bar", "color": COLOURS[0]}, "encoding": chart.hover(change="change", x=title)}
    view = {
        "data": {"values": values},
        "width": WIDTH - 160,
        "height": {"step": BAR},
        "encoding": {"x": x, "y": y},
        "layer": [bars, text],
    }
    return chart.picture("torques-by-hypothesis", "What explains the torque difference", lambda moving: view)
