"""The picture of ``screwgauge history``: digits and run time of each scene, check after check."""

from __future__ import annotations

import pandas as pd

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import WIDTH, Spec, quantity, told
from screwgauge.report.figures.looks import numbered

MOST = 7  # scenes that are drawn; all are in the table


def make_plots(found: pd.DataFrame) -> list[Picture]:
    """Digits of the worst error above, time below, over the number of the check."""
    scenes = [str(name) for name in found["scene"].unique()]
    looks = {name: numbered(i) for i, name in enumerate(scenes[:MOST])}
    table = found.assign(check=found.groupby("scene").cumcount() + 1)[["scene", "check", "digits", "seconds"]]
    values = table[table["scene"].isin(looks)].astype({"digits": float, "seconds": float}).to_dict("records")

    def build(moving: bool) -> Spec:
        y = {"digits": quantity("digits", "digits"), "seconds": chart.logarithm("seconds", "time [s]")}
        x = quantity("check", "check", axis={"tickMinStep": 1})
        ways = told("scene", looks, "color", "strokeDash", "shape")
        asked = chart.hover(scene="scene", check="check", digits="digits []", seconds="time [s]")
        mark = {"type": "line", "point": {"size": 45}}
        view: Spec = {"width": WIDTH, "height": 110, "mark": mark}
        panels = [view | {"encoding": {"x": x, "y": y[column], **ways, **asked}} for column in y]
        return {"data": {"values": values}, "vconcat": panels}

    left = [f"{len(scenes) - MOST} other scenes are in the table."] if len(scenes) > MOST else []
    title = "Digits of the worst error, and run time, check after check"
    return [chart.picture("history", title, build, left)]
