"""Finished pictures, and those of a run's report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.figures.data import Diagram
from screwgauge.report.figures.render import render
from screwgauge.report.figures.selection import drawable
from screwgauge.report.formatting import file_name
from screwgauge.report.run_diagrams import condition_diagram, quantity_diagram

if TYPE_CHECKING:
    from screwgauge.study.comparison import Comparison


@dataclass(frozen=True, slots=True)
class Plot:
    """A finished picture; `name` is its file name without ending."""

    name: str
    title: str
    svg: str


def drawn(diagrams: Iterable[tuple[str, Diagram]]) -> list[Plot]:
    """Pictures of named diagrams, numbered in order."""
    named = enumerate(diagrams, 1)
    return [Plot(f"{i:02d}-{name}", diagram.title, render(diagram)) for i, (name, diagram) in named]


def make_plots(comparison: Comparison) -> list[Plot]:
    """All pictures of the report, in order."""
    figures = drawable(tuple(comparison.scene.figures), comparison.solutions)
    diagrams = [(file_name(figure.title), quantity_diagram(figure, comparison)) for figure in figures]
    if any(np.isfinite(s.condition).any() for s in comparison.solutions.values()):
        diagrams.append(("condition", condition_diagram(comparison)))
    return drawn(diagrams)
