"""Labels in diagrams cover neither points nor each other, and none leaves the axes."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import IdentityTransform

from screwgauge.report.figures.labels import SIZE, along, around, boxes, place
from screwgauge.report.svg import text_width


def test_labels_keep_clear_of_points_of_each_other_and_of_the_edge():
    canvas = Figure(figsize=(6, 4), dpi=72)
    ax = canvas.add_axes((0.1, 0.1, 0.8, 0.8))
    rng = np.random.default_rng(3)
    points = ax.transAxes.transform(rng.random((40, 2)))
    wanted = [("a label", around(x, y)) for x, y in points]
    spots = place(wanted, [boxes(*points.T, 4.0)], [], ax.bbox.extents)
    for spot in spots:
        if spot:  # as matplotlib, which measures letters, would write it
            x, y, anchor = spot
            side = {"start": "left", "middle": "center", "end": "right"}[anchor]
            ax.text(x, y, "a label", ha=side, va="center", size=SIZE, transform=IdentityTransform())
    canvas.draw_without_rendering()
    lost, shown = spots.count(None), [text.get_window_extent() for text in ax.texts]
    assert len(shown) == len(points) - lost > 10
    for i, box in enumerate(shown):
        assert not any(box.overlaps(other) for other in shown[i + 1 :])
        assert not any(box.contains(*xy) for xy in points)
        assert ax.bbox.contains(box.x0, box.y0)
        assert ax.bbox.contains(box.x1, box.y1)


def test_labels_cross_guides_only_where_nothing_else_is_left():
    here, line = np.array([50.0]), along(np.array([0.0, 100.0]), np.array([50.0, 50.0]))
    area = np.array([0.0, 0.0, 100.0, 100.0])
    (free,) = place([("x", around(50.0, 50.0))], [boxes(here, here, 4.0)], [line], area)
    assert free is not None
    assert abs(free[1] - 50.0) > SIZE / 2
    (crossing,) = place([("x", around(50.0, 50.0)[:2])], [boxes(here, here, 4.0)], [line], area)
    assert crossing == (58.0, 50.0, "start")
    assert place([("x", around(50.0, 50.0)[:2])], [line], [], area) == [None]


def test_texts_are_not_wider_than_thought():
    canvas = Figure(dpi=720)  # fine enough that letters are not moved to whole pixels
    for text in ("legs 2 to 4 (UPS), the largest", "|screw - pinocchio|", "1e-12", "MuJoCo's softness [N m]", "0.5 µs"):
        drawn = canvas.text(0.0, 0.0, text, size=9.5).get_window_extent().width / 10.0
        assert 0.9 * text_width(text) < drawn < text_width(text)
