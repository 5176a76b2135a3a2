"""The picture of ``screwgauge history``: digits and run time of each scene, check after check."""

from __future__ import annotations

import pandas as pd

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import Spec, numbered

MOST = 7  # scenes that are drawn; all are in the table


def make_plots(found: pd.DataFrame) -> list[Picture]:
    """Digits of the worst error above, time below, over the number of the check."""
    scenes = [str(name) for name in found["scene"].unique()]
    told, panels = chart.ways("name", {name: numbered(i) for i, name in enumerate(scenes[:MOST])}), []
    table = found.assign(name=found["scene"].astype(str), x=found.groupby("scene").cumcount() + 1)
    table = table[table["name"].isin(told["name"])].astype({"digits": float, "seconds": float})
    across = {"x_title": "check", "x_scale": {}, "x_axis": {"tickMinStep": 1}, "height": 110}
    scales: tuple[Spec, Spec] = {"y_scale": {}, "y_axis": {}}, chart.logarithm("y", table["seconds"])
    for column, title, scale in zip(("digits", "seconds"), ("digits", "time [s]"), scales, strict=True):
        points = table.assign(y=table[column])[["name", "x", "y"]].to_dict("records")
        panels.append(chart.filled("points", points=points, y_title=title, **across, **scale, **told))
    left = [f"{len(scenes) - MOST} other scenes are in the table."] if len(scenes) > MOST else []
    title = "Digits of the worst error, and run time, check after check"
    return [chart.picture("history", title, lambda moving: {"vconcat": panels}, left)]
