"""What a figure of the report shows: which components of which quantity, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase

from screwgauge.scene.figures import Figure
from screwgauge.solution import Solution, Values

MAX_PANELS = 6  # more side by side cannot be read; they then share one


def select(values: Values, unit: str, patterns: tuple[str, ...]) -> list[int]:
    """Columns of the components that have the unit and match one of the patterns."""
    return [
        i
        for i, (name, has) in enumerate(zip(values.components, values.units, strict=True))
        if has == unit and any(fnmatchcase(name, pattern) for pattern in patterns)
    ]


def first_values(solutions: Mapping[str, Solution], quantity: str) -> Values | None:
    """Values of the first engine that has the quantity."""
    found = (s.values[quantity] for s in solutions.values() if quantity in s.values)
    return next(found, None)


def drawable(figures: tuple[Figure, ...], solutions: Mapping[str, Solution]) -> tuple[Figure, ...]:
    """The figures with the panels for which an engine has values; defaults if none is left."""
    kept = []
    for figure in figures:
        values = first_values(solutions, figure.quantity)
        if values is None:
            continue
        panels = tuple(panel for panel in figure.panels if select(values, figure.unit, panel[1]))
        if panels:
            kept.append(Figure(figure.title, figure.quantity, figure.unit, panels))
    return tuple(kept) or default_figures(solutions)


def default_figures(solutions: Mapping[str, Solution]) -> tuple[Figure, ...]:
    """One figure per quantity and unit; a panel per part of the mechanism where the names tell."""
    figures = []
    for quantity in dict.fromkeys(name for solution in solutions.values() for name in solution.values):
        values = first_values(solutions, quantity)
        if values is None:
            continue
        title = quantity.replace("_", " ").capitalize()
        for unit in dict.fromkeys(values.units):
            names = [name for name, has in zip(values.components, values.units, strict=True) if has == unit]
            figures.append(Figure(title, quantity, unit, _panels(names)))
    return tuple(figures)


def _panels(names: list[str]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Panels by the part before the first dot (``leg1``), or one panel."""
    parts = list(dict.fromkeys(name.split(".")[0] for name in names))
    if not 1 < len(parts) <= MAX_PANELS or len(parts) == len(names):
        return (("", ("*",)),)
    return tuple((part, (part, f"{part}.*")) for part in parts)


def short_labels(names: list[str]) -> list[str]:
    """Names without the leading dotted parts that all of them share: ``leg1.q1`` -> ``q1``."""
    parts = [name.split(".") for name in names]
    shared = 0
    while all(len(p) > shared + 1 and p[shared] == parts[0][shared] for p in parts):
        shared += 1
    return [".".join(p[shared:]) for p in parts]
