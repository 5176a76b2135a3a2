"""What stands inside the panels of a figure: curves, differences, and the legends that explain them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from screwgauge.reference.rotations import Array
from screwgauge.report.curves import bin_maxima, sparse, thin
from screwgauge.report.figures import select, short_labels
from screwgauge.report.formatting import number
from screwgauge.report.sheet import COLOURS, DASHES, GREY, MARKERS
from screwgauge.solution import Values

MAX_CURVES = 12  # in a panel; more cannot be told apart


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """The components of one panel.

    Attributes:
        columns: All of them, as columns of the quantity.
        drawn: Those drawn as curves.
        names: Legend label of each one drawn.
    """

    label: str
    columns: list[int]
    drawn: list[int]
    names: list[str]


def make_panel(label: str, patterns: tuple[str, ...], unit: str, values: Values) -> Panel:
    """A panel with the components that match; of too many, the ones that move most are drawn."""
    columns = select(values, unit, patterns)
    names = short_labels([values.components[i] for i in columns])
    chosen = list(range(len(columns)))
    if len(columns) > MAX_CURVES:
        span = np.ptp(np.nan_to_num(values.array[:, columns]), axis=0)
        chosen = sorted(np.argsort(-span, kind="stable")[:MAX_CURVES].tolist())
    return Panel(label, columns, [columns[i] for i in chosen], [names[i] for i in chosen])


def look(keys: Sequence[str], name: str) -> dict[str, Any]:
    """Colour and dash of a component, the same in every panel of a figure."""
    turn, i = divmod(list(keys).index(name), len(COLOURS))
    return {"color": COLOURS[i], "linestyle": DASHES[turn % len(DASHES)], "linewidth": 1.4}


def mark(engine: int, n: int) -> dict[str, Any]:
    """Marker of the second, third ... engine: open, larger where there are few samples."""
    marker = MARKERS[(engine - 1) % len(MARKERS)]
    grow = 1.0 if marker in "ox+" else 0.85
    return {
        "marker": marker,
        "linestyle": "none",
        "markerfacecolor": "none",
        "markersize": (8.0 if n < 2 else 5.5) * grow,
        "markeredgewidth": 1.1,
    }


def draw_curves(
    ax: Any, panel: Panel, curves: Mapping[str, tuple[Array, Array]], keys: Sequence[str], height: float
) -> None:
    """The first engine as lines, the others as sparse marks in the same colours.

    Args:
        curves: Engine -> its times (n,) and its values (n, n_component).
    """
    for column, name in zip(panel.drawn, panel.names, strict=True):
        for k, (t, array) in enumerate(curves.values()):
            v, colour = array[:, column], look(keys, name)
            if k:
                at = sparse(len(t), k - 1, len(curves) - 1)
                ax.plot(t[at], v[at], color=colour["color"], **mark(k, len(t)))
            else:
                ax.plot(*thin(t, v, height), **colour, marker="." if len(t) < 2 else None)


def draw_differences(
    ax: Any, lines: Sequence[tuple[Array, Array]], tolerance: float | None, floor: float, zero: bool
) -> None:
    """Envelopes of the differences, one line a pair; grey lines for the tolerance and for zero."""
    for i, (t, line) in enumerate(lines):
        at, peak = bin_maxima(t, line)
        look = {**mark(i + 1, 1), **pair_look(i)} if len(t) < 2 else pair_look(i)
        ax.plot(at, np.where(peak < floor, floor, peak), **look)
    if tolerance:
        ax.axhline(tolerance, **TOLERANCE)
    if zero:
        ax.axhline(floor, **ZERO)


def pair_look(i: int) -> dict[str, Any]:
    """Colour and dash of a pair of engines."""
    colour = (COLOURS[-1], *COLOURS[:-1])[i % len(COLOURS)]
    return {"color": colour, "linestyle": DASHES[i % len(DASHES)], "linewidth": 1.2, "markersize": 5.0}


TOLERANCE: dict[str, Any] = {"color": GREY, "linestyle": (0, (8, 3)), "linewidth": 1.6}
ZERO: dict[str, Any] = {"color": GREY, "linestyle": (0, (1, 2)), "linewidth": 1.0}


def handle(label: str, **style: Any) -> Line2D:
    return Line2D([], [], label=label, **style)


def component_handles(keys: Sequence[str]) -> list[Line2D]:
    return [handle(name, **look(keys, name)) for name in keys]


def engine_handles(engines: Sequence[str], n: int) -> list[Line2D]:
    """Legend of the engines, in a neutral colour: what tells them apart is line or marker."""
    first = handle(engines[0], color="#333333", linewidth=1.4, marker="." if n < 2 else None)
    return [first, *(handle(e, color="#333333", **mark(k, n)) for k, e in enumerate(engines[1:], 1))]


def difference_handles(pairs: Sequence[tuple[str, str]], tolerance: float | None, zero: bool) -> list[Line2D]:
    handles = [handle(f"|{a} - {b}|", **pair_look(i)) for i, (a, b) in enumerate(pairs)]
    if tolerance:
        handles.append(handle(f"tolerance {number(tolerance, 2)}", **TOLERANCE))
    if zero:
        handles.append(handle("no difference at all", **ZERO))
    return handles
