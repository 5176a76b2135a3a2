"""Draws any diagram as SVG."""

from __future__ import annotations

from screwgauge.report.figures.data import Diagram

EDGE, GAP = 7.0, 28.0  # beside the page, between panels [pt]


def render(diagram: Diagram) -> str:
    """The diagram as SVG, as high as it needs to be; matplotlib is loaded only now."""
    from screwgauge.report.figures.page import draw

    return draw(diagram)
