"""What a figure of the report shows: which components of which quantity, side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase

from screwgauge.scene.figures import Figure
from screwgauge.solution import Solution, Values

MAX_PANELS = 6  # more side by side cannot be read; they then share one


def select(values: Values, unit: str, patterns: tuple[str, ...]) -> list[str]:
    """Names of the components that have the unit and match one of the patterns."""
    names = zip(values.components, values.units, strict=True)
    return [name for name, has in names if has == unit and any(fnmatchcase(name, pattern) for pattern in patterns)]


def drawable(figures: tuple[Figure, ...], solutions: Mapping[str, Solution]) -> tuple[Figure, ...]:
    """The figures with the panels for which an engine has values; defaults if none is left."""
    values, kept = _first_values(solutions), []
    for figure in (figure for figure in figures if figure.quantity in values):
        has = [panel for panel in figure.panels if select(values[figure.quantity], figure.unit, panel[1])]
        kept += [replace(figure, panels=tuple(has))] if has else []
    return tuple(kept) or default_figures(solutions)


def unmatched(figures: tuple[Figure, ...], solutions: Mapping[str, Solution]) -> list[str]:
    """Sentences on figures of quantities that nobody gives, and on patterns that no component matches."""
    values = _first_values(solutions)
    missing = [figure for figure in figures if figure.quantity not in values]
    return [
        *(f"figure '{each.title}' is left out: {each.quantity} is not asked for, or not given" for each in missing),
        *_no_component([figure for figure in figures if figure.quantity in values], values),
    ]


def _no_component(figures: Iterable[Figure], values: Mapping[str, Values]) -> list[str]:
    return [
        f"figure '{figure.title}': no component of {figure.quantity} in {figure.unit} is called {pattern}"
        for figure in figures
        for pattern in dict.fromkeys(pattern for _, patterns in figure.panels for pattern in patterns)
        if not select(values[figure.quantity], figure.unit, (pattern,))
    ]


def default_figures(solutions: Mapping[str, Solution]) -> tuple[Figure, ...]:
    """One figure per quantity and unit; a panel per part of the mechanism where the names tell."""
    figures = []
    for quantity, values in _first_values(solutions).items():
        for unit in dict.fromkeys(values.units):
            title, panels = quantity.replace("_", " ").capitalize(), _panels(select(values, unit, ("*",)))
            figures.append(Figure(title, quantity, unit, panels))
    return tuple(figures)


def _first_values(solutions: Mapping[str, Solution]) -> dict[str, Values]:
    """Quantity -> values of the first engine that has it."""
    values: dict[str, Values] = {}
    for solution in solutions.values():
        values |= {quantity: v for quantity, v in solution.values.items() if quantity not in values}
    return values


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
