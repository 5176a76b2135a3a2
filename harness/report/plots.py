"""Finished pictures, and those of a run's report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from screwgauge.report.comparison import comparison, condition
from screwgauge.report.figures.data import Diagram
from screwgauge.report.figures.render import render
from screwgauge.report.figures.selection import drawable
from screwgauge.report.formatting import file_name
from screwgauge.study.results import Results


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


def make_plots(results: Results) -> list[Plot]:
    """All pictures of the report, in order."""
    figures = drawable(tuple(results.scene.figures), results.solutions)
    diagrams = [(file_name(figure.title), comparison(figure, results)) for figure in figures]
    if any(np.isfinite(s.condition).any() for s in results.solutions.values()):
        diagrams.append(("condition", condition(results)))
    return drawn(diagrams)
