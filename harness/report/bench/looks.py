"""Colours and markers of the diagrams: a colour for each camp, a marker for each line within it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from screwgauge.report.sheet import COLOURS, GREY

#: Beginning of a family's name -> colour and who that is; the first that fits.
CAMPS = (
    (("closed-form", "newton", "screw"), COLOURS[0], "screw"),
    (("pinocchio", "four-bar"), COLOURS[1], "Pinocchio"),
    (("mujoco",), COLOURS[2], "MuJoCo"),
    (("finite-differences", "missing-jdotv", "float32"), COLOURS[3], "shortcuts"),
    (("paper",), COLOURS[4], "the paper's scheme"),
)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


@dataclass(frozen=True, slots=True)
class Look:
    """How one line is drawn; hollow if it starts from given joint motion."""

    colour: str
    marker: str
    hollow: bool

    @property
    def ink(self) -> str:
        """A darker shade, for text."""
        parts = (int(self.colour[i : i + 2], 16) for i in (1, 3, 5))
        return "#" + "".join(f"{int(0.68 * part):02x}" for part in parts)

    def style(self, size: float = 6.0) -> dict[str, Any]:
        """Keyword arguments of a line."""
        face = "white" if self.hollow else self.colour
        return {
            "color": self.colour,
            "marker": self.marker,
            "markersize": size + (1.5 if self.marker == "*" else 0.0),
            "markerfacecolor": face,
            "markeredgecolor": self.colour,
            "markeredgewidth": 1.2,
            "linewidth": 1.1,
        }


def looks(lines: Sequence[tuple[str, bool]]) -> dict[tuple[str, bool], Look]:
    """Looks of all lines (name, starts from given motion) of a bench, the same in every diagram."""
    used: dict[str, int] = {}
    found = {}
    for name, given in lines:
        colour = next((c for starts, c, _ in CAMPS if name.startswith(starts)), GREY)
        number = used.get(colour, 0)
        used[colour] = number + 1
        found[name, given] = Look(colour, MARKERS[number % len(MARKERS)], given)
    return found
