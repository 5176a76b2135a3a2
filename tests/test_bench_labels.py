"""Labels in diagrams cover neither points nor each other, and none leaves the axes."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox

from screwgauge.report.figures.labels import Label, beside, guide, place
from screwgauge.report.figures.page import arrange, panels
from screwgauge.report.figures.style import DOTTED, styled


@styled
def axes(points: np.ndarray) -> Axes:
    """Axes from 0 to 1, 400 points wide, with marks."""
    page = panels(430.0, [300.0])
    (ax,) = page.axes
    ax.plot(*points.T, "o")
    ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    arrange(page, "")
    return ax


def written(ax: Axes) -> list[Bbox]:
    return [text.get_window_extent() for text in ax.texts]


def test_labels_keep_clear_of_points_of_each_other_and_of_the_edge():
    points = np.random.default_rng(3).random((40, 2))
    ax = axes(points)
    place(ax, [beside(point, "a longer label", "black") for point in points])
    boxes = written(ax)
    assert len(points) > len(boxes) > 10
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert not any(box.count_contains(ax.transData.transform(points)) for box in boxes)
    assert all(ax.bbox.padded(4.0).count_contains(box.corners()) == 4 for box in boxes)


def test_labels_cross_guides_only_where_nothing_else_is_left():
    middle = np.array([[0.5, 0.5]])
    ax = axes(middle)
    line = guide(ax, 0.5, "", DOTTED)
    everywhere, sides = (
        beside(middle[0], "x", "black"),
        Label("x", "black", [(0.5, 0.5, 8.0, 0.0), (0.5, 0.5, -8.0, 0.0)]),
    )
    height = ax.transData.transform(middle)[0, 1]
    place(ax, [everywhere])
    (free,) = written(ax)
    assert free.y0 > height or free.y1 < height
    ax.texts[0].remove()
    place(ax, [sides])
    (crossing,) = written(ax)
    assert crossing.y0 < height < crossing.y1
    ax.texts[0].remove()
    ax.plot([0.0, 1.0], [0.5, 0.5])
    place(ax, [sides])
    assert written(ax) == []
    place(ax, [line, Label("needed", "black", sides.spots, needed=True)])
    assert [text.get_text() for text in ax.texts] == ["", "needed"]
