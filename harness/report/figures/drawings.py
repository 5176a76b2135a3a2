"""Selection of components for the pictures of a run. Components without a unique value get separate pictures."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from screwgauge.scene.entries import Figure
from screwgauge.solution import Solution, Values
from screwgauge.study.comparison import Comparison
from screwgauge.study.formatting import file_name, unit_text, words

MAX_PANELS = 6  # with more panels, which would be illegible, components share one panel


@dataclass(frozen=True, slots=True)
class Drawing:
    """Components of a picture, which are either all unique or all non-unique.

    Attributes:
        panels: Labels and names of components.
        unique: True if each component has a unique value; only unique values have a tolerance.
        others: Number of the figure's components that are omitted because they are not unique (or unique, if `unique`
            is False).
        contour: True if a single component is drawn over a grid.
    """

    title: str
    quantity: str
    unit: str
    panels: tuple[tuple[str, tuple[str, ...]], ...]
    unique: bool = True
    others: int = 0
    contour: bool = False

    @property
    def names(self) -> list[str]:
        """Names of all components."""
        return [name for _, some in self.panels for name in some]

    @property
    def note(self) -> str:
        """Remark on values that are not unique; empty if all values are unique."""
        n = len(self.names) + self.others
        if not self.unique:
            return (
                f"Not unique: redundant constraints leave these components undetermined ({len(self.names)} of "
                f"{n}). Many values satisfy the equations, so engines may differ; the components are not compared."
            )
        if not self.others:
            return ""
        return f"Not shown: {self.others} of {n} components, which have no unique value. Digits refer to the others."


def named_drawings(comparison: Comparison) -> dict[str, Drawing]:
    """Return picture name -> drawing."""
    drawn = drawings(tuple(comparison.scene.figures), comparison.solutions, comparison.not_unique)
    return {f"{i:02d}-{file_name(each.title)}": each for i, each in enumerate(drawn, 1)}


def drawings(
    figures: tuple[Figure, ...], solutions: Mapping[str, Solution], not_unique: Mapping[str, Collection[str]]
) -> list[Drawing]:
    """Turn figures into drawings, with separate drawings for non-unique values.

    Args:
        not_unique: Quantity -> components without a unique value.
    """
    values = _first_values(solutions)
    selected = [one for figure in figures for one in _contours(figure, values)]
    for figure in drawable_figures(figures, solutions, selected):
        open_ = not_unique.get(figure.quantity, ())
        names = [(label, select(values[figure.quantity], figure.unit, some)) for label, some in figure.panels]
        n = sum(len(some) for _, some in names)
        for unique in (True, False):
            picked = [(label, tuple(x for x in some if (x not in open_) is unique)) for label, some in names]
            if panels := tuple(panel for panel in picked if panel[1]):
                others = n - sum(len(some) for _, some in panels)
                title = figure.title if unique else f"{figure.title}: not unique"
                selected.append(Drawing(title, figure.quantity, figure.unit, panels, unique, others))
    return selected


def select(values: Values, unit: str, patterns: tuple[str, ...]) -> list[str]:
    """Return the names of the components that have a unit and match a pattern."""
    names = zip(values.components, values.units, strict=True)
    return [name for name, has in names if has == unit and any(fnmatchcase(name, pattern) for pattern in patterns)]


def _contours(figure: Figure, values: Mapping[str, Values]) -> Iterator[Drawing]:
    """Yield the contour plot of a figure, if an engine computes its component."""
    known = values.get(figure.quantity)
    if known is not None and figure.contour in known.components:
        unit = known.units[known.components.index(figure.contour)]
        yield Drawing(figure.title, figure.quantity, unit, (("", (figure.contour,)),), contour=True)


def drawable_figures(
    figures: tuple[Figure, ...], solutions: Mapping[str, Solution], others: Collection[Drawing] = ()
) -> tuple[Figure, ...]:
    """Keep curve figures and panels for which an engine has values; if none remain, return default figures."""
    values, kept = _first_values(solutions), []
    for figure in (figure for figure in figures if figure.quantity in values):
        has = [panel for panel in figure.panels if select(values[figure.quantity], figure.unit, panel[1])]
        kept += [replace(figure, panels=tuple(has))] if has else []
    return tuple(kept) or (() if others else default_figures(solutions))


def unmatched_figures(figures: tuple[Figure, ...], solutions: Mapping[str, Solution]) -> list[str]:
    """Warn about figures of quantities that no engine computes, and about patterns that match no component."""
    values = _first_values(solutions)
    missing = [figure for figure in figures if figure.quantity not in values]
    strange = [figure for figure in figures if figure.contour and not [*_contours(figure, values)]]
    return [
        *(f"figure '{x.title}': {x.quantity} has no component {x.contour}" for x in strange if x not in missing),
        *(
            f"figure '{each.title}' is left out: {each.quantity} was not requested, or no engine computed it"
            for each in missing
        ),
        *_no_component([figure for figure in figures if figure.quantity in values], values),
    ]


def _no_component(figures: Iterable[Figure], values: Mapping[str, Values]) -> list[str]:
    return [
        f"figure '{figure.title}': no component of {figure.quantity} in {figure.unit} matches {pattern}"
        for figure in figures
        for pattern in dict.fromkeys(pattern for _, patterns in figure.panels for pattern in patterns)
        if not select(values[figure.quantity], figure.unit, (pattern,))
    ]


def default_figures(solutions: Mapping[str, Solution]) -> tuple[Figure, ...]:
    """Return default figures: one per quantity and unit, with a panel per named part of the mechanism."""
    figures = []
    for quantity, values in _first_values(solutions).items():
        units = dict.fromkeys(values.units)
        for unit in units:
            title = words(quantity).capitalize() + f" [{unit_text(unit)}]" * (len(units) > 1)
            figures.append(Figure(title, quantity, unit, _panels(select(values, unit, ("*",)))))
    return tuple(figures)


def _first_values(solutions: Mapping[str, Solution]) -> dict[str, Values]:
    """Return quantity -> values of the first engine that computes it."""
    values: dict[str, Values] = {}
    for solution in solutions.values():
        values |= {quantity: v for quantity, v in solution.values.items() if quantity not in values}
    return values


def _panels(names: list[str]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Group names into panels by the part before the first dot (``leg1``), or into a single panel."""
    parts = list(dict.fromkeys(name.split(".")[0] for name in names))
    if not 1 < len(parts) <= MAX_PANELS or len(parts) == len(names):
        return (("", ("*",)),)
    return tuple((part, (part, f"{part}.*")) for part in parts)


def short_labels(names: list[str]) -> list[str]:
    """Remove the dotted prefix that all names share: ``leg1.q1`` -> ``q1``."""
    parts = [name.split(".") for name in names]
    shared = 0
    while all(len(p) > shared + 1 and p[shared] == parts[0][shared] for p in parts):
        shared += 1
    return [".".join(p[shared:]) for p in parts]
