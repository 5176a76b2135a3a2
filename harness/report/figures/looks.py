"""The one look of all pictures: told apart by colour-blind readers, and the same for an engine in every diagram."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

# Okabe and Ito; their yellow is left out, too light for a line on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ((1, 0), (6, 3), (2, 2), (8, 2, 2, 2), (4, 1, 1, 1))
CROSS, PLUS = "M-.8,-.8L.8,.8M-.8,.8L.8,-.8", "M-1,0H1M0,-1V1"
STAR = "M0,-1L.24,-.31L.95,-.31L.36,.12L.59,.81L0,.38L-.59,.81L-.36,.12L-.95,-.31L-.24,-.31Z"
SHAPES = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "triangle-right", "triangle-left")
GREY, INK = "#767676", "#1b1f24"

#: Beginnings of a family's name and their colour; the first that fits.
CAMPS = (
    (("closed-form", "newton", "screw"), COLOURS[0]),
    (("pinocchio", "four-bar"), COLOURS[1]),
    (("mujoco",), COLOURS[2]),
    (("finite-differences", "missing-jdotv", "float32"), COLOURS[3]),
    (("paper",), COLOURS[4]),
)


@dataclass(frozen=True, slots=True)
class Look:
    """How a line and its marks are drawn; `dash`: lengths of strokes and gaps [pixels]."""

    colour: str
    dash: tuple[int, ...] = DASHES[0]
    shape: str = SHAPES[0]


def numbered(i: int) -> Look:
    """The i-th look of things without a camp."""
    return Look(COLOURS[i % len(COLOURS)], DASHES[i % len(DASHES)], SHAPES[i % len(SHAPES)])


def camp(name: str) -> str:
    """Colour of an engine, a family or a setting of one, by how its name begins."""
    return next((colour for starts, colour in CAMPS if name.startswith(starts)), GREY)


def by_camp(names: Iterable[str], before: Iterable[str] = ()) -> dict[str, Look]:
    """Looks of engines, families or settings: the colour of the camp, a shape and a dash that it has not used yet.

    Args:
        before: Names that have their looks already.
    """
    looks, camps = dict[str, Look](), [camp(name) for name in dict.fromkeys(before)]
    for name in dict.fromkeys(names):
        k = camps.count(camp(name))
        camps.append(camp(name))
        looks[name] = Look(camp(name), DASHES[k % len(DASHES)], SHAPES[k % len(SHAPES)])
    return looks
