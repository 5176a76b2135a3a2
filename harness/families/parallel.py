"""Families with a platform on legs. Each returns how many freedoms it is to have."""

from __future__ import annotations

import numpy as np

from screwgauge.families.single import ring
from screwgauge.families.sketch import Sketch
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, rotation

_Z = np.array([0.0, 0.0, 1.0])


def ends(s: Sketch, n: int, size: float = 0.6) -> tuple[Array, Array]:
    """Points of n legs on the base and on a platform 1 m above it. Shapes (n, 3)."""
    top = ring(s, n, 0.2) * size @ s.turned().T if s.rng.random() < 0.2 else ring(s, n, 0.2) * size
    return ring(s, n, 0.2), top + s.rng.uniform(0.7, 1.3) * _Z


def _legs(s: Sketch, n: int, kinds: str, driven: int, out: float = 0.4) -> None:
    """n legs of one kind; joints between the ends are off the straight line."""
    for foot, head in zip(*ends(s, n), strict=True):
        between = [foot + (head - foot) * k / (len(kinds) - 1) for k in range(1, len(kinds) - 1)]
        bent = [point + out * s.unit() * (kinds[driven] != "P") for point in between]
        s.chain(kinds, GROUND, "platform", np.array([foot, *bent, head]), driven=driven)


def ups(s: Sketch, n: int, middle: str) -> int:
    """n UPS legs, and a passive one in the middle that leaves n or fewer freedoms."""
    _legs(s, n, "UPS", 1)
    points = np.array([[0.0, 0.0, 0.9 * k / max(len(middle) - 1, 1)] for k in range(len(middle))])
    s.chain(middle, GROUND, "platform", points + 0.1 * s.rng.normal(size=points.shape)) if middle else None
    return sum({"U": 2, "P": 1, "S": 3, "R": 1}[kind] for kind in middle) or 6


def six_rus(s: Sketch) -> int:
    """Six cranks, each with a rod to the platform."""
    _legs(s, 6, "RUS", 0)
    return 6


def six_pus(s: Sketch) -> int:
    """Six slides, each with a rod to the platform."""
    for foot, head in zip(*ends(s, 6), strict=True):
        s.chain("PUS", GROUND, "platform", np.array([foot, foot + 0.3 * s.rng.normal(size=3), head]), driven=0)
    return 6


def three_rrr(s: Sketch) -> int:
    """A planar platform on three legs of three R joints."""
    base, top = ring(s, 3, 0.2), ring(s, 3, 0.2) * np.array([0.4, 0.4, 1.0])
    for k, (foot, head) in enumerate(zip(base, top, strict=True)):
        elbow = (foot + head) / 2 + rotation(_Z, np.array(np.pi / 2)) @ (head - foot) * s.rng.uniform(0.4, 0.8)
        for i, point in enumerate((foot, elbow, head)):
            s.join("R", _link(k, i), _link(k, i + 1), point, _Z, driven=i == 0)
    return 3


def three_rrr_spherical(s: Sketch) -> int:
    """A platform on three legs of three R joints whose axes all meet in a point."""
    for k in range(3):
        for i, (angle, tilt) in enumerate(((0.0, 2.0), (0.9, 1.4), (0.2, 0.8))):
            spin = rotation(_Z, np.array(2 * np.pi * k / 3 + angle + s.rng.uniform(-0.2, 0.2)))
            axis = spin @ rotation(np.array([0.0, 1.0, 0.0]), np.array(tilt + s.rng.uniform(-0.2, 0.2))) @ _Z
            s.join("R", _link(k, i), _link(k, i + 1), axis * s.rng.uniform(0.4, 1.0), axis, driven=i == 0)
    return 3


def three_rps(s: Sketch) -> int:
    """A platform on three legs RPS."""
    _legs(s, 3, "RPS", 1)
    return 3


def three_upu(s: Sketch) -> int:
    """A platform on three legs UPU, in general position or such that it does not turn."""
    if s.rng.random() < 0.5:
        _legs(s, 3, "UPU", 1)
        return 3
    for k, (foot, head) in enumerate(zip(*ends(s, 3), strict=True)):
        axes = s.axes("U", s.beside(head - foot))
        along = (head - foot) / np.linalg.norm(head - foot)
        s.join("U", GROUND, f"{k}-0", foot, axes)
        s.join("P", f"{k}-0", f"{k}-1", foot, along, driven=True)
        s.join("U", f"{k}-1", "platform", head, axes[::-1])
    return 3


def delta(s: Sketch) -> int:
    """Three cranks, each with two rods of equal length that keep the platform from turning."""
    for k, (foot, head) in enumerate(zip(*ends(s, 3, 0.4), strict=True)):
        hinge = np.cross(_Z, foot / np.linalg.norm(foot))
        hinge /= np.linalg.norm(hinge)
        elbow = foot + np.array([0.4, 0.4, 0.0]) * foot + s.rng.uniform(0.1, 0.4) * _Z
        s.join("R", GROUND, f"arm{k}", foot, hinge, driven=True)
        for side in (-0.15, 0.15):
            points = np.array([elbow, head]) + side * hinge
            s.chain("US", f"arm{k}", "platform", points)
    return 3


def redundant(s: Sketch) -> int:
    """More legs that push than there are freedoms."""
    return ups(s, int(s.rng.integers(4, 7)), "S")


def _link(leg: int, i: int) -> str:
    """The i-th body of a leg of three joints."""
    return (GROUND, f"{leg}-0", f"{leg}-1", "platform")[i]
