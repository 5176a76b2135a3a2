"""Labels in diagrams cover neither points nor each other, and none leaves the axes."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from screwgauge.report.bench.labels import place


def test_labels_keep_clear_of_points_of_each_other_and_of_the_edge():
    canvas = Figure(figsize=(6, 4), dpi=72)
    ax = canvas.add_axes((0.1, 0.1, 0.8, 0.8))
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    rng = np.random.default_rng(3)
    points = [tuple(p) for p in rng.random((40, 2))]
    lost = place(ax, [(x, y, "a label", "black") for x, y in points], points)
    canvas.draw_without_rendering()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert len(boxes) == len(points) - lost > 10
    for i, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[i + 1 :])
        assert not any(box.contains(*xy) for xy in ax.transData.transform(points))
        assert ax.bbox.contains(box.x0, box.y0)
        assert ax.bbox.contains(box.x1, box.y1)
