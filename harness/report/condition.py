"""Draws the condition number of each engine's closure along the path."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwgauge.report.curves import bin_maxima, sparse
from screwgauge.report.drawing import handle, mark, pair_look
from screwgauge.report.sheet import Sheet, Strip, log_scale
from screwgauge.study.comparison import Comparison

WIDE = 30.0  # ratio of largest to smallest from which the axis is logarithmic


def draw_condition(title: str, results: Comparison) -> str:
    """One line an engine, the largest of each stretch of samples; markers keep lines apart that coincide."""
    finite = {e: np.where(np.isfinite(s.condition), s.condition, np.nan) for e, s in results.solutions.items()}
    lines = {engine: line for engine, line in finite.items() if not np.isnan(line).all()}
    looks = [_look(i, len(results.times)) for i in range(len(lines))]
    handles = [handle(engine, **look) for engine, look in zip(lines, looks, strict=True)]
    sheet = Sheet(title, [""], [Strip(handles)], lower=False)
    ax = sheet.upper[0]
    for i, line in enumerate(lines.values()):
        t, peak = bin_maxima(results.times, line)
        at = sparse(len(t), i, len(lines))
        ax.plot(t, peak, **looks[i], markevery=at.tolist())
    numbers = np.concatenate([line[np.isfinite(line)] for line in lines.values()])
    if numbers.max() > WIDE * numbers.min():
        log_scale(ax, float(numbers.min()), float(numbers.max()))
    ax.set_ylabel("condition number [1]")
    return sheet.svg()


def _look(i: int, n: int) -> dict[str, Any]:
    look = {**(mark(i, n) if i else {}), **pair_look(i), "linestyle": "-"}
    return {**look, "marker": "o"} if n < 2 and not i else look
