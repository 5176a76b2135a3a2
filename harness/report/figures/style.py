"""The one look of all pictures: told apart by colour-blind readers, and the same for an engine in every diagram."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from matplotlib import rc_context

Look = dict[str, Any]  # how a line and its marks are drawn: keyword arguments of matplotlib's Line2D

# Okabe and Ito; their yellow is left out, too light for a line on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)), (0, (3, 1, 1, 1, 1, 1)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
GREY, INK, FAINT, SMALL = "#767676", "#333333", "#e4e4e4", 7.5
DOTTED: Look = {"color": GREY, "linestyle": (0, (1, 2)), "linewidth": 0.9}
STYLE = {
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Segoe UI", "sans-serif"],
    "font.size": 9.0,
    "text.parse_math": False,  # titles may have a $
    "text.hinting": "none",  # letters are measured as they will be in the SVG, not moved to whole pixels
    "figure.dpi": 72.0,  # a pixel is a point, as in the SVG
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.titley": 1.0,  # where nothing stands in its way; to look for that took a fifth of the time
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "lines.markersize": 5.5,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "legend.borderpad": 0.0,
    "legend.handlelength": 2.6,
    "legend.borderaxespad": 0.0,
    "path.simplify_threshold": 0.3,  # points: long curves keep what can be seen, peaks among it
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "screwgauge",  # the same data give the same file
}
styled = rc_context(STYLE)  # decorates what draws

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
