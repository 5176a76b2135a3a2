"""The picture of ``screwgauge history``: digits and run time of each scene, check after check."""

from __future__ import annotations

import pandas as pd

from screwgauge.report.blocks import Picture
from screwgauge.report.figures.page import arrange, linear_scale, log_scale, panels, saved
from screwgauge.report.figures.style import COLOURS, MARKERS, Look, styled

MOST = 7  # scenes that are drawn; all are in the table


@styled
def make_plots(found: pd.DataFrame) -> list[Picture]:
    """Digits of the worst error above, time below, over the number of the check."""
    page, looks = panels(576.0, [110.0, 110.0], sharex=True), dict[str, Look]()
    scenes = [str(name) for name in found["scene"].unique()]
    for k, name in enumerate(scenes[:MOST]):
        rows = found[found["scene"] == name]
        looks[name] = {"color": COLOURS[k], "marker": MARKERS[k]}
        for ax, column in zip(page.axes, ("digits", "seconds"), strict=True):
            ax.plot(range(1, len(rows) + 1), rows[column].astype(float), **looks[name])
    digits, seconds = page.axes
    digits.set_ylabel("digits")
    seconds.set(xlabel="check", ylabel="time [s]")
    linear_scale(digits.yaxis)
    linear_scale(seconds.xaxis)
    log_scale(seconds.yaxis)
    left = [f"{len(scenes) - MOST} other scenes are in the table."] if len(scenes) > MOST else []
    arrange(page, "Digits of the worst error, and run time, check after check", left, above=[looks])
    return [saved(page, "history")]
