"""Colours, dashes and markers: told apart by colour-blind readers, and the same for an engine in every diagram."""

from __future__ import annotations

from collections.abc import Iterable

from screwgauge.report.figures.data import Look

# Okabe and Ito; their yellow is left out, too light for a line on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ((), (5.0, 2.0), (1.0, 1.5), (6.0, 2.0, 1.0, 2.0), (3.0, 1.0, 1.0, 1.0, 1.0, 1.0))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
GREY = "#767676"
DOTTED = Look(GREY, (1.0, 2.0), 0.9)

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
    looks, camps = {}, [camp(name) for name in dict.fromkeys(before)]
    for name in dict.fromkeys(names):
        k = camps.count(camp(name))
        camps.append(camp(name))
        looks[name] = Look(camp(name), DASHES[k % len(DASHES)], 1.1, MARKERS[k % len(MARKERS)])
    return looks


def darker(colour: str) -> str:
    """A shade for text."""
    return "#" + "".join(f"{int(0.68 * int(colour[i : i + 2], 16)):02x}" for i in (1, 3, 5))
