"""Families of single loops, ladders of them, and serial chains. Each returns how many freedoms it is to have."""

from __future__ import annotations

import numpy as np

from screwgauge.families.sketch import Sketch
from screwgauge.reference.mechanism import GROUND, KINDS
from screwgauge.reference.rotations import Array, rotation

_Z = np.array([0.0, 0.0, 1.0])


def ring(s: Sketch, n: int, depth: float = 0.0) -> Array:
    """Points round the z-axis, about 1 m from it. Shape (n, 3)."""
    angles = 2 * np.pi * (np.arange(n) + s.rng.uniform(-0.3, 0.3, n)) / n
    radii = s.rng.uniform(0.6, 1.2, n)
    return np.stack([radii * np.cos(angles), radii * np.sin(angles), s.rng.uniform(-depth, depth, n)], axis=1)


def planar(s: Sketch, n: int) -> int:
    """One planar loop of n bars: R joints and up to two P joints, in planes one above the other."""
    points, slides = ring(s, n, 0.3), s.rng.permutation(n)[: s.rng.integers(0, 3)]
    for i, point in enumerate(points):
        angle, kind = s.rng.uniform(0, 2 * np.pi), "P" if i in slides else "R"
        axis = np.array([np.cos(angle), np.sin(angle), 0.0]) if kind == "P" else _Z
        s.join(kind, _bar(i, n), _bar(i + 1, n), point, axis)
    return n - 3


def ladder(s: Sketch, loops: int) -> int:
    """A planar four-bar and on it one pair of links after the other, each between bodies that are there already."""
    planar(s, 4)
    for k in range(1, loops):
        a, b = s.rng.permutation([GROUND, *s.bodies])[:2]
        points = ring(s, 3, 0.3) + np.array([0.7 * k, 0.0, 0.0])
        for kind, one, other, point in zip(
            "RRR", (a, f"{k}-0", f"{k}-1"), (f"{k}-0", f"{k}-1", b), points, strict=True
        ):
            s.join(kind, str(one), str(other), point, _Z)
    return 1


def loop(s: Sketch, kinds: str) -> int:
    """One loop of these joints in general position."""
    s.chain(kinds[:-1], GROUND, "end", (points := ring(s, len(kinds), 0.6))[:-1])
    s.join(kinds[-1], "end", GROUND, points[-1])
    return sum(len(KINDS[kind]) for kind in kinds) - 6


def mixed(s: Sketch) -> int:
    """One loop of any joints, of one or two freedoms."""
    while True:
        kinds = "".join(s.rng.choice(list("RRRPUSC"), size=s.rng.integers(3, 8)))
        if sum(len(KINDS[kind]) for kind in kinds) in (7, 8) and kinds.count("P") + kinds.count("C") <= 3:
            return loop(s, kinds)


def spatial_ladder(s: Sketch, loops: int) -> int:
    """A loop in space and on it one chain of six freedoms after the other, which takes and adds no freedom."""
    loop(s, str(s.rng.choice(["RSUR", "RCCC", "RRSRR", "RSCR"])))
    for k in range(1, loops):
        a, b = (str(name) for name in s.rng.permutation([GROUND, *s.bodies])[:2])
        kinds = str(s.rng.choice(["UPS", "RSU", "RUS", "SPU", "RCCR", "RRRS", "PUS"]))
        s.chain(kinds, a, b, ring(s, len(kinds), 0.6) + 0.5 * k * s.unit())
    return 1


def bennett(s: Sketch) -> int:
    """Bennett's loop: the axes are normal to the sides of a skew quadrilateral whose opposite sides are equal."""
    (x, y), (u, v), h = s.rng.uniform(0.5, 1.2, 2), s.rng.uniform(0.5, 1.2, 2), s.rng.uniform(0.1, 0.4)
    points = np.array([[x, y, h], [-u, v, -h], [-x, -y, h], [u, -v, -h]])
    for i, point in enumerate(points):
        axis = np.cross(point - points[i - 1], points[(i + 1) % 4] - point)
        s.join("R", _bar(i, 4), _bar(i + 1, 4), point, axis / np.linalg.norm(axis))
    return 1


def sarrus(s: Sketch) -> int:
    """Sarrus's loop: two chains of three parallel axes guide the platform along a line."""
    turn = s.rng.uniform(0.7, 2.4)
    for side, angle in enumerate((0.0, turn)):
        axis = np.array([np.cos(angle), np.sin(angle), 0.0])
        out = np.array([np.sin(angle), -np.cos(angle), 0.0]) * (1 if side else -1)
        names = (GROUND, f"{side}-0", f"{side}-1", "platform")
        for i, (height, reach) in enumerate(((0.0, 0.5), (0.5, 1.0), (1.0, 0.4))):
            point = (height + s.rng.uniform(-0.1, 0.1)) * _Z + (reach + s.rng.uniform(-0.1, 0.1)) * out
            s.join("R", names[i], names[i + 1], point + s.rng.uniform(-0.3, 0.3) * axis, axis)
    return 1


def spherical(s: Sketch, n: int) -> int:
    """One loop of n R joints whose axes meet in a point."""
    for i in range(n):
        tilt = rotation(_Z, np.array(2 * np.pi * (i + s.rng.uniform(-0.25, 0.25)) / n))
        axis = tilt @ rotation(np.array([0.0, 1.0, 0.0]), np.array(s.rng.uniform(0.4, 1.2))) @ _Z
        s.join("R", _bar(i, n), _bar(i + 1, n), axis * s.rng.uniform(0.3, 1.0), axis)
    return n - 3


def serial(s: Sketch, kinds: str = "") -> int:
    """An open chain or tree of two to eight bodies with any joints."""
    kinds = kinds or "".join(s.rng.choice(list("RRRRPUSC"), size=s.rng.integers(2, 9)))
    for i, kind in enumerate(kinds):
        on = GROUND if i == 0 else f"{i - 1 if s.rng.random() < 0.7 else s.rng.integers(i)}"
        s.join(kind, on, f"{i}", 0.4 * i * _Z + 0.3 * s.rng.normal(size=3))
    return sum(len(KINDS[kind]) for kind in kinds)


def gear_train(s: Sketch) -> int:
    """An open chain or tree of which one or two coordinates move all others by couplings."""
    free = int(s.rng.integers(1, 3))
    serial(
        s, "".join([*s.rng.choice(list("RRP"), size=free), *s.rng.choice(list("RRRPUC"), size=s.rng.integers(2, 6))])
    )
    for row in range(free, s.firsts[-1]):
        s.tie(row, int(s.rng.integers(row)))
    return free


def geared_loop(s: Sketch) -> int:
    """One loop of two freedoms, and a coupling between two of its R joints, not always side by side."""
    kinds = str(s.rng.choice(["RRRRRRRR", "RUSRR", "RRSCR"]))
    freedoms = loop(s, kinds)
    turning = [s.firsts[i] for i, kind in enumerate(kinds) if kind == "R"]
    row, of = s.rng.permutation(turning)[:2].tolist()
    s.tie(row, of)
    return freedoms - 1


def _bar(i: int, n: int) -> str:
    return GROUND if i % n == 0 else f"{i}"
