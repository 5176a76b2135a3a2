"""Planar linkages with bars of given lengths, at given angles at home.

Bars lie along the x axes of their bodies, so that their lengths are exactly those asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwgauge.reference.rotations import Array

Tables = dict[str, Any]
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PinJoint:
    """A joint between two bars of a planar linkage: a hinge, or a slide along x of both.

    Attributes:
        parent, child: Bars, or ``ground``.
        at: Where it is on the parent, in its axes [m].
        on: Where it is on the child [m].
        home: Its coordinate at home [rad or m].
    """

    name: str
    parent: str
    child: str
    at: Point
    on: Point
    home: float
    driven: bool = False
    slides: bool = False

    @property
    def table(self) -> Tables:
        return {
            "kind": "P" if self.slides else "R",
            "parent": self.parent,
            "child": self.child,
            "axes": [[1, 0, 0] if self.slides else [0, 0, 1]],
            "home": [self.home],
            "parent_frame": {"position": [*self.at, 0.0]},
            "child_frame": {"position": [*self.on, 0.0]},
            "actuated": self.driven,
        }


@dataclass(frozen=True, slots=True)
class PlanarLinkage:
    """A planar linkage at home.

    Attributes:
        bars: Body -> where its centre of mass is on its x axis [m].
        pins: Its joints.
        independent: Names of joints.
    """

    bars: Mapping[str, float]
    pins: tuple[PinJoint, ...]
    independent: tuple[str, ...]

    def table(self, name: str) -> Tables:
        """Its description. Masses grow from bar to bar, and centres of mass lie beside the bars."""
        bodies = {
            bar: {
                "mass": 1.0 + 0.5 * i,
                "com": [x, 0.01 - 0.03 * i, 0.0],
                "inertia": {"xx": 0.001, "yy": 0.02, "zz": 0.02},
            }
            for i, (bar, x) in enumerate(self.bars.items())
        }
        joints = {pin.name: pin.table for pin in self.pins}
        return {"name": name, "independent": {q: q for q in self.independent}, "bodies": bodies, "joints": joints}


def four_bar(
    crank: float, coupler: float, rocker: float, base: float, angle: float, *, side: float = 1.0
) -> PlanarLinkage:
    """Lengths [m], the angle of the crank at home, and the side of the diagonal on which the coupler's end lies."""
    tip = _along(crank, angle)
    lean, swing = _triangle(tip, np.array([base, 0.0]), coupler, rocker, side)
    pins = (
        PinJoint("a", "ground", "crank", (0.0, 0.0), (0.0, 0.0), angle, driven=True),
        PinJoint("b", "crank", "coupler", (crank, 0.0), (0.0, 0.0), lean - angle),
        PinJoint("c", "ground", "rocker", (base, 0.0), (0.0, 0.0), swing),
        PinJoint("d", "coupler", "rocker", (coupler, 0.0), (rocker, 0.0), swing - lean),
    )
    return PlanarLinkage({"crank": crank / 2, "coupler": coupler / 2, "rocker": rocker / 2}, pins, ("a",))


def slider_crank(crank: float, rod: float, angle: float, *, offset: float = 0.0, driven: str = "a") -> PlanarLinkage:
    """Lengths, and height of the slide above the crank's axis [m].

    Args:
        driven: The crank, ``a``, or the slide, ``x``.
    """
    lean = float(np.arcsin((offset - crank * np.sin(angle)) / rod))
    reach = float(crank * np.cos(angle) + rod * np.cos(lean))
    pins = (
        PinJoint("a", "ground", "crank", (0.0, 0.0), (0.0, 0.0), angle, driven=driven == "a"),
        PinJoint("b", "crank", "rod", (crank, 0.0), (0.0, 0.0), lean - angle),
        PinJoint("c", "rod", "slider", (rod, 0.0), (0.0, 0.0), -lean),
        PinJoint("x", "ground", "slider", (0.0, offset), (0.0, 0.0), reach, driven=driven == "x", slides=True),
    )
    return PlanarLinkage({"crank": crank / 2, "rod": rod / 2, "slider": 0.0}, pins, (driven,))


def five_bar(
    cranks: tuple[float, float], rods: tuple[float, float], base: float, angles: tuple[float, float], side: float = 1.0
) -> PlanarLinkage:
    """Two driven cranks, whose rods meet: lengths [m], and angles of the cranks at home."""
    tips = _along(cranks[0], angles[0]), np.array([base, 0.0]) + _along(cranks[1], angles[1])
    left, right = _triangle(*tips, *rods, side)
    pins = (
        PinJoint("a", "ground", "left", (0.0, 0.0), (0.0, 0.0), angles[0], driven=True),
        PinJoint("b", "left", "left-rod", (cranks[0], 0.0), (0.0, 0.0), left - angles[0]),
        PinJoint("c", "left-rod", "right-rod", (rods[0], 0.0), (rods[1], 0.0), right - left),
        PinJoint("d", "right", "right-rod", (cranks[1], 0.0), (0.0, 0.0), right - angles[1]),
        PinJoint("e", "ground", "right", (base, 0.0), (0.0, 0.0), angles[1], driven=True),
    )
    centres = zip(("left", "left-rod", "right-rod", "right"), (cranks[0], *rods, cranks[1]), strict=True)
    return PlanarLinkage({bar: length / 2 for bar, length in centres}, pins, ("a", "e"))


def _along(length: float, angle: float) -> Array:
    return length * np.array([np.cos(angle), np.sin(angle)])


def _triangle(start: Array, end: Array, first: float, second: float, side: float) -> tuple[float, float]:
    """Angles of two bars from two points to where they meet, left of the way between these where `side` is 1."""
    way = end - start
    d = float(np.hypot(*way))
    opening = np.arccos((first**2 + d**2 - second**2) / (2.0 * first * d))
    lean = float(np.arctan2(way[1], way[0]) + side * opening)
    meet = start + _along(first, lean) - end
    return lean, float(np.arctan2(meet[1], meet[0]))
