"""The one look of all pictures: told apart by colour-blind readers, and the same for an engine in every diagram."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from matplotlib import rc_context, rc_params_from_file

Look = dict[str, Any]  # how a line and its marks are drawn: keyword arguments of matplotlib's Line2D

# Okabe and Ito; their yellow is left out, too light for a line on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)), (0, (3, 1, 1, 1, 1, 1)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
GREY, INK, SMALL = "#767676", "#333333", 7.5
DOTTED: Look = {"color": GREY, "linestyle": (0, (1, 2)), "linewidth": 0.9}
_FILE = Path(__file__).with_name("look.mplstyle")
styled = rc_context(rc_params_from_file(_FILE, use_default_template=False))  # decorates what draws

#: Beginnings of a family's name and their colour; the first that fits.
CAMPS = (
    (("closed-form", "newton", "screw"), COLOURS[0]),
    (("pinocchio", "four-bar"), COLOURS[1]),
    (("mujoco",), COLOURS[2]),
    (("finite-differences", "missing-jdotv", "float32"), COLOURS[3]),
    (("paper",), COLOURS[4]),
)


def camp(name: str) -> str:
    """Colour of an engine, a family or a setting of one, by how its name begins."""
    return next((colour for starts, colour in CAMPS if name.startswith(starts)), GREY)


def by_camp(names: Iterable[str], before: Iterable[str] = ()) -> dict[str, Look]:
    """Looks of engines, families or settings: the colour of the camp, a marker and a dash that it has not used yet.

    Args:
        before: Names that have their looks already.
    """
    looks, camps = dict[str, Look](), [camp(name) for name in dict.fromkeys(before)]
    for name in dict.fromkeys(names):
        k = camps.count(camp(name))
        camps.append(camp(name))
        looks[name] = {"color": camp(name), "linestyle": DASHES[k % len(DASHES)], "marker": MARKERS[k % len(MARKERS)]}
    return looks


def darker(colour: str) -> str:
    """A shade for text."""
    return "#" + "".join(f"{int(0.68 * int(colour[i : i + 2], 16)):02x}" for i in (1, 3, 5))
