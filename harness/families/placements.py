"""Joint placements of each family at the home pose, with lengths of about 1 m."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import repeat

import numpy as np

from screwgauge.families.sketch import Sketch
from screwgauge.reference.mechanism import GROUND, KINDS
from screwgauge.reference.rotations import Array, rotation

_Y, _Z = np.eye(3)[1:]


def _ring(s: Sketch, n: int, depth: float) -> Array:
    """Draw points around the z-axis, about 1 m away. Shape (n, 3)."""
    angles = 2 * np.pi * (np.arange(n) + s.rng.uniform(-0.3, 0.3, n)) / n
    radii = s.rng.uniform(0.6, 1.2, n)
    return np.stack([radii * np.cos(angles), radii * np.sin(angles), s.rng.uniform(-depth, depth, n)], axis=1)


def _bars(n: int) -> list[str]:
    """List the bodies between n successive joints of a loop."""
    return [GROUND, *(f"{i}" for i in range(1, n)), GROUND]


def _freedoms(kinds: str) -> int:
    return sum(len(KINDS[kind]) for kind in kinds)


def _draw_kinds(s: Sketch, kinds: str, low: int, high: int) -> str:
    """Draw between `low` and `high` - 1 joint kinds; kinds that `kinds` repeats are more likely."""
    return "".join(s.rng.choice(list(kinds), size=s.rng.integers(low, high)))


# --- single loops, and chains of connected loops


def _planar(s: Sketch, n: int) -> None:
    """Draw n bars with R joints and up to two P joints, in stacked planes."""
    points, slides = _ring(s, n, 0.3), s.rng.permutation(n)[: s.rng.integers(0, 3)]
    kinds = "".join("P" if i in slides else "R" for i in range(n))
    angles = (s.rng.uniform(0, 2 * np.pi) for _ in kinds)
    axes = (np.array([np.cos(a), np.sin(a), 0.0]) if kind == "P" else _Z for kind, a in zip(kinds, angles, strict=True))
    s.place(kinds, _bars(n), zip(points, axes, strict=True))


def _ladder(s: Sketch) -> None:
    """Draw a planar four-bar, then add pairs of links, each between two existing bodies."""
    loops = int(s.rng.integers(2, 9))
    _planar(s, 4)
    for k in range(1, loops):
        a, b = s.rng.permutation([GROUND, *s.bodies])[:2]
        points = _ring(s, 3, 0.3) + np.array([0.7 * k, 0.0, 0.0])
        s.place("RRR", (str(a), f"{k}-0", f"{k}-1", str(b)), zip(points, repeat(_Z)))


def _loop(s: Sketch, kinds: str) -> None:
    """Draw a loop of joints in general position."""
    points = _ring(s, len(kinds), 0.6)
    s.chain(kinds[:-1], GROUND, "end", points[:-1])
    s.join(kinds[-1], "end", GROUND, points[-1])


def _mixed_loop(s: Sketch) -> None:
    """Draw a loop with joints of mixed kinds and with one or two degrees of freedom."""
    kinds = ""
    while _freedoms(kinds) not in (7, 8) or kinds.count("P") + kinds.count("C") > 3:
        kinds = _draw_kinds(s, "RRRPUSC", 3, 8)
    _loop(s, kinds)


def _spatial_ladder(s: Sketch) -> None:
    """Draw a spatial loop, and add chains with six degrees of freedom, which do not change its mobility."""
    loops = int(s.rng.integers(2, 9))
    _loop(s, str(s.rng.choice(["RSUR", "RCCC", "RRSRR", "RSCR"])))
    for k in range(1, loops):
        a, b = (str(name) for name in s.rng.permutation([GROUND, *s.bodies])[:2])
        kinds = str(s.rng.choice(["UPS", "RSU", "RUS", "SPU", "RCCR", "RRRS", "PUS"]))
        s.chain(kinds, a, b, _ring(s, len(kinds), 0.6) + 0.5 * k * s.unit())


def _bennett(s: Sketch) -> None:
    """Draw axes normal to the sides of a skew quadrilateral with equal opposite sides."""
    (x, y), (u, v), h = s.rng.uniform(0.5, 1.2, 2), s.rng.uniform(0.5, 1.2, 2), s.rng.uniform(0.1, 0.4)
    points = np.array([[x, y, h], [-u, v, -h], [-x, -y, h], [u, -v, -h]])
    axes = np.cross(points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points)
    s.place("RRRR", _bars(4), ((point, axis / np.linalg.norm(axis)) for point, axis in zip(points, axes, strict=True)))


def _sarrus(s: Sketch) -> None:
    """Draw two chains of three parallel axes that guide the platform along a line."""
    turn = s.rng.uniform(0.7, 2.4)
    for angle, side in ((0.0, -1), (turn, 1)):
        axis = np.array([np.cos(angle), np.sin(angle), 0.0])
        out = np.array([np.sin(angle), -np.cos(angle), 0.0]) * side
        points = (
            (height + s.rng.uniform(-0.1, 0.1)) * _Z
            + (reach + s.rng.uniform(-0.1, 0.1)) * out
            + s.rng.uniform(-0.3, 0.3) * axis
            for height, reach in ((0.0, 0.5), (0.5, 1.0), (1.0, 0.4))
        )
        s.place("RRR", s.chain_names(GROUND, "platform", 3), zip(points, repeat(axis)))


def _draw_axis(s: Sketch, angle: float, tilt: float, near: float) -> tuple[Array, Array]:
    """Return a random point on an axis through the origin, and the direction of the axis."""
    axis = rotation(_Z, np.array(angle)) @ rotation(_Y, np.array(tilt)) @ _Z
    return axis * s.rng.uniform(near, 1.0), axis


def _spherical_loop(s: Sketch) -> None:
    """Draw R joints whose axes intersect in one point."""
    n = int(s.rng.integers(4, 6))
    angles = (2 * np.pi * (i + s.rng.uniform(-0.25, 0.25)) / n for i in range(n))
    s.place("R" * n, _bars(n), (_draw_axis(s, angle, s.rng.uniform(0.4, 1.2), 0.3) for angle in angles))


# --- trees, gears


def _serial(s: Sketch, kinds: str = "") -> None:
    """Draw an open chain or tree of two to eight bodies."""
    for i, kind in enumerate(kinds or _draw_kinds(s, "RRRRPUSC", 2, 9)):
        on = GROUND if i == 0 else f"{i - 1 if s.rng.random() < 0.7 else s.rng.integers(i)}"
        s.join(kind, on, f"{i}", 0.4 * i * _Z + 0.3 * s.rng.normal(size=3))


def _gear_train(s: Sketch) -> None:
    """Draw an open chain or tree in which couplings make all coordinates depend on one or two of them."""
    free = int(s.rng.integers(1, 3))
    _serial(s, "".join(s.rng.choice(list("RRP"), size=free)) + _draw_kinds(s, "RRRPUC", 2, 6))
    for row in range(free, s.firsts[-1]):
        s.tie(row, int(s.rng.integers(row)))


def _geared_loop(s: Sketch) -> None:
    """Draw a loop with two degrees of freedom, then couple two of its R joints, adjacent or not."""
    kinds = str(s.rng.choice(["RRRRRRRR", "RUSRR", "RRSCR"]))
    _loop(s, kinds)
    row, of = s.rng.permutation([s.firsts[i] for i, kind in enumerate(kinds) if kind == "R"])[:2].tolist()
    s.tie(row, of)


def _belt_train(s: Sketch) -> None:
    """Draw an open chain or tree; couplings of several coordinates leave two or three degrees of freedom."""
    free = int(s.rng.integers(2, 4))
    _serial(s, "".join(s.rng.choice(list("RRP"), size=free)) + _draw_kinds(s, "RRRPUC", 2, 6))
    for row in range(free, s.firsts[-1]):
        s.tie(row, *s.rng.permutation(row)[: s.rng.integers(2, 4)].tolist())


def _belted_loop(s: Sketch) -> None:
    """Draw a loop with two or three degrees of freedom, then couple three of its R joints, adjacent or not."""
    kinds = str(s.rng.choice(["RRRRRRRR", "RRRRRRRRR", "RUSRR", "RRSCR"]))
    _loop(s, kinds)
    s.tie(*s.rng.permutation([s.firsts[i] for i, kind in enumerate(kinds) if kind == "R"])[:3].tolist())


# --- platforms on legs


def _ends(s: Sketch, n: int, size: float = 0.6) -> list[tuple[Array, Array]]:
    """Draw the leg ends on the base and on a platform 1 m above it. Shape (3,) each."""
    tilted = s.rng.random() < 0.2
    top = _ring(s, n, 0.2) * size
    top = top @ s.draw_rotation().T if tilted else top
    return list(zip(_ring(s, n, 0.2), top + s.rng.uniform(0.7, 1.3) * _Z, strict=True))


def _legs(s: Sketch, n: int, kinds: str, driven: int) -> None:
    """Draw n legs of one kind; unless they have an actuated slide, move their inner joints off the straight line."""
    for foot, head in _ends(s, n):
        between = [foot + (head - foot) * k / (len(kinds) - 1) for k in range(1, len(kinds) - 1)]
        bent = [point + 0.4 * s.unit() * (kinds[driven] != "P") for point in between]
        s.chain(kinds, GROUND, "platform", np.array([foot, *bent, head]), driven=driven)


def _ups(s: Sketch, n: int, middle: str = "") -> None:
    """Draw n UPS legs around an optional passive leg."""
    _legs(s, n, "UPS", 1)
    if middle:
        heights = 0.9 * np.arange(len(middle)) / max(len(middle) - 1, 1)
        s.chain(middle, GROUND, "platform", heights[:, None] * _Z + 0.1 * s.rng.normal(size=(len(middle), 3)))


def _n_ups(s: Sketch) -> None:
    """Draw as many UPS legs as the passive middle leg has degrees of freedom; six if there is no middle leg."""
    middle = str(s.rng.choice(["S", "UP", "UPR", "UPU", ""]))
    _ups(s, _freedoms(middle) or 6, middle)


def _six_pus(s: Sketch) -> None:
    """Draw six slides, each with a rod to the platform."""
    for foot, head in _ends(s, 6):
        s.chain("PUS", GROUND, "platform", np.array([foot, foot + 0.3 * s.rng.normal(size=3), head]), driven=0)


def _three_rrr(s: Sketch) -> None:
    """Draw a planar platform on three RRR legs."""
    base, top = _ring(s, 3, 0.2), _ring(s, 3, 0.2) * np.array([0.4, 0.4, 1.0])
    for foot, head in zip(base, top, strict=True):
        elbow = (foot + head) / 2 + rotation(_Z, np.array(np.pi / 2)) @ (head - foot) * s.rng.uniform(0.4, 0.8)
        s.place("RRR", s.chain_names(GROUND, "platform", 3), zip((foot, elbow, head), repeat(_Z)), driven=0)


def _three_rrr_spherical(s: Sketch) -> None:
    """Draw a platform on three legs of R joints whose axes all intersect in one point."""
    for k in range(3):
        places = (
            _draw_axis(s, 2 * np.pi * k / 3 + angle + s.rng.uniform(-0.2, 0.2), tilt + s.rng.uniform(-0.2, 0.2), 0.4)
            for angle, tilt in ((0.0, 2.0), (0.9, 1.4), (0.2, 0.8))
        )
        s.place("RRR", s.chain_names(GROUND, "platform", 3), places, driven=0)


def _three_upu(s: Sketch) -> None:
    """Draw three UPU legs, in general position or such that the platform does not rotate."""
    if s.rng.random() < 0.5:
        _legs(s, 3, "UPU", 1)
    else:
        for foot, head in _ends(s, 3):
            axes, along = s.axes("U", s.off_axis(head - foot)), (head - foot) / np.linalg.norm(head - foot)
            places = (foot, axes), (foot, along), (head, axes[::-1])
            s.place("UPU", s.chain_names(GROUND, "platform", 3), places, driven=1)


def _delta(s: Sketch) -> None:
    """Draw three cranks, each with two equal rods that prevent the platform's rotation."""
    for k, (foot, head) in enumerate(_ends(s, 3, 0.4)):
        hinge = np.cross(_Z, foot / np.linalg.norm(foot))
        hinge /= np.linalg.norm(hinge)
        elbow = foot + np.array([0.4, 0.4, 0.0]) * foot + s.rng.uniform(0.1, 0.4) * _Z
        s.join("R", GROUND, f"arm{k}", foot, hinge, driven=True)
        for side in (-0.15, 0.15):
            s.chain("US", f"arm{k}", "platform", np.array([elbow, head]) + side * hinge)


#: Families that a seed does not choose without a name, because its choices must be the same in all versions.
NAMED = ("belt-train", "belted-loop")
#: Family -> function that draws it.
FAMILIES: dict[str, Callable[[Sketch], None]] = {
    **{f"planar-{n}": partial(_planar, n=n) for n in (4, 5, 6)},
    **{kinds.lower(): partial(_loop, kinds=kinds) for kinds in ("RSSR", "RSUR", "RCCC", "RSCR", "RRSRR")},
    "7r": partial(_loop, kinds="RRRRRRR"),
    "mixed-loop": _mixed_loop,
    "bennett": _bennett,
    "sarrus": _sarrus,
    "spherical-loop": _spherical_loop,
    "ladder": _ladder,
    "spatial-ladder": _spatial_ladder,
    "serial": _serial,
    "gear-train": _gear_train,
    "geared-loop": _geared_loop,
    "belt-train": _belt_train,
    "belted-loop": _belted_loop,
    "n-ups": _n_ups,
    "6-rus": partial(_legs, n=6, kinds="RUS", driven=0),
    "6-pus": _six_pus,
    "3-rrr": _three_rrr,
    "3-rrr-spherical": _three_rrr_spherical,
    "3-rps": partial(_legs, n=3, kinds="RPS", driven=1),
    "3-upu": _three_upu,
    "delta": _delta,
    "redundant": lambda s: _ups(s, int(s.rng.integers(4, 7)), "S"),
    "underactuated": lambda s: _ups(s, int(s.rng.integers(3, 6))),
}
