"""Planar four-bars and slider-cranks in the x-z plane, of which many numbers are zero, at random or as wished."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import screwgauge
from screwgauge import Scene
from screwgauge.problem import GivenMotion

Write = Callable[[str, str], Path]


@dataclass(frozen=True)
class Bar:
    """A bar along its own x axis, whose frame is at its first joint. Length [m], mass [kg], centre [m]."""

    length: float
    mass: float = 1.0
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def written(self, name: str) -> str:
        i = 0.02 * self.mass
        return (
            f"[bodies.{name}]\nmass = {self.mass!r}\ncom = {[*self.com]}\n"
            f"inertia = {{ xx = {i!r}, yy = {1.2 * i!r}, zz = {1.1 * i!r} }}\n"
        )


def _joint(name: str, parent: str, child: str, home: float, x: float = 0.0, end: float = 0.0, slides: bool = False):
    kind, axis = ("P", [1, 0, 0]) if slides else ("R", [0, -1, 0])
    return (
        f'[joints.{name}]\nkind = "{kind}"\nparent = "{parent}"\nchild = "{child}"\naxes = [{axis}]\n'
        f"parent_frame.position = [{x!r}, 0, 0]\nchild_frame.position = [{end!r}, 0, 0]\nhome = [{home!r}]\n"
    )


def four_bar(bars: Sequence[Bar], base: float, crank: float) -> str:
    first, second, third = (bar.length for bar in bars)
    tip = first * np.array([np.cos(crank), np.sin(crank)])
    way = np.array([base, 0.0]) - tip
    d = float(np.hypot(*way))
    coupler = float(np.arctan2(way[1], way[0]) + np.arccos((second**2 + d**2 - third**2) / (2 * second * d)))
    end = tip + second * np.array([np.cos(coupler), np.sin(coupler)]) - [base, 0.0]
    rocker = float(np.arctan2(end[1], end[0]))
    return "".join(
        [
            *(bar.written(name) for name, bar in zip(("crank", "coupler", "rocker"), bars, strict=True)),
            _joint("a", "ground", "crank", crank) + "actuated = true\n",
            _joint("b", "crank", "coupler", coupler - crank, first),
            _joint("c", "ground", "rocker", rocker, base),
            _joint("d", "coupler", "rocker", rocker - coupler, second, third),
        ]
    )


def slider_crank(bars: Sequence[Bar], crank: float) -> str:
    r, l = bars[0].length, bars[1].length
    rod = float(-np.arcsin(r * np.sin(crank) / l))
    return "".join(
        [
            *(bar.written(name) for name, bar in zip(("crank", "rod", "slide"), bars, strict=True)),
            _joint("a", "ground", "crank", crank) + "actuated = true\n",
            _joint("b", "crank", "rod", rod - crank, r),
            _joint("bore", "ground", "slide", float(r * np.cos(crank) + l * np.cos(rod)), slides=True),
            _joint("d", "rod", "slide", -rod, l),
        ]
    )


def moving(write: Write, text: str, y: Sequence[float], rate: float, second: float = 0.0, g=(0.0, 0.0, -9.81)) -> Scene:
    write("planar.toml", f'name = "planar"\nindependent.crank = "a"\n{text}')
    said = f'mechanism = "planar.toml"\ngravity = {[*g]}\nmotion.crank.offset = {y[0]!r}\ntime.times = [0]\n'
    scene = screwgauge.load_scene(write("scene.toml", said))
    array = np.array(y, dtype=float)[:, None]
    task = GivenMotion(np.arange(len(y)) * 1.0, array, np.full_like(array, rate), np.full_like(array, second))
    return replace(scene, task=task)


def at_random(write: Write, seed: int) -> Scene:
    rng = np.random.default_rng(seed)
    masses = 10.0 ** (rng.uniform(-3, 2) + rng.uniform(-1, 1, 3))
    if rng.random() < 0.3:
        masses[rng.integers(3)] *= 1e-6
    coms = rng.choice([0.0, 1.0], (3, 3)) * rng.normal(size=(3, 3)) * [0.1, 0.05, 0.1]
    home = float(rng.uniform(0.5, 2.0))
    l = rng.uniform([0.3, 0.8, 0.6], [0.4, 0.9, 0.7])
    base = float(l[1] - 0.2)
    if seed % 3 == 0:  # a parallelogram
        l[2], base = l[0], float(l[1])
    bars = [Bar(float(x), float(m), tuple(c.tolist())) for x, m, c in zip(l, masses, coms, strict=True)]
    text = four_bar(bars, base, home) if seed % 2 else slider_crank(bars, home)
    g = [(0.0, 0.0, -9.81), (0.0, 0.0, 0.0), (0.0, -9.81, 0.0), (3.0, 1.0, -9.0)][rng.integers(4)]
    rate, second = rng.choice([0.0, 1e-6, 1e-3, 1.0, 100.0]), rng.choice([0.0, 0.0, 1e-3, 5.0])
    return moving(write, text, [home, home + 0.1, home + 0.3], float(rate), float(second), g)
