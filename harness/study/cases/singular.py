"""Motions through singular poses that lie between samples, and next to such poses, of planar linkages in closed form.

Where branches of assembly meet, a motion given at samples does not say on which of them it goes on: it has no answer,
however the samples lie. Home is where the motion starts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tomli_w

from screwgauge.models.generate import write_models
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.study.cases.asking import ENGINES, compare
from screwgauge.study.cases.question import UNKNOWN, Question, put
from screwgauge.study.linkages import PlanarLinkage, Tables, five_bar, four_bar, slider_crank
from screwgauge.study.methods import Method

#: Motions last so many times the way to the singular pose: evenly spread samples, however many, have none there.
LAST = float(np.sqrt(3.0))
REFUSED, REGULAR = "refused", "regular"
MOVED = ("joint_position", "joint_acceleration", "actuator_force")


@dataclass(frozen=True, slots=True)
class Passing:
    """A linkage in a motion, and whether it has an answer.

    Attributes:
        motion: Independent coordinate -> its table in a scene.
        lasts: Time of the last sample [s].
        answer: `REFUSED` or `REGULAR`.
        at: Time of the singular pose that it passes, touches or comes next to [s].
        why: What happens there.
    """

    name: str
    linkage: PlanarLinkage
    motion: Mapping[str, Tables]
    lasts: float
    answer: str
    at: float
    why: str

    def scene(self, folder: Path, samples: int, engines: Sequence[str] = ("screw", "pinocchio", "mujoco")) -> Scene:
        """Written to a folder and read, at evenly spread times."""
        folder.mkdir(parents=True, exist_ok=True)
        times = np.linspace(0.0, self.lasts, samples).tolist()
        tables = {
            "mechanism": "linkage.toml",
            "gravity": [0.0, -9.81, 0.0],
            "engines": [*engines],
            "motion": self.motion,
            "time": {"times": times},
        }
        (folder / "linkage.toml").write_text(tomli_w.dumps(self.linkage.table(self.name)), encoding="utf-8")
        (folder / "scene.toml").write_text(tomli_w.dumps(tables), encoding="utf-8")
        return load_scene(folder / "scene.toml")


def _turning(**coordinates: tuple[float, float]) -> dict[str, Tables]:
    """Motions at constant rates: where they start, and the rate."""
    return {name: {"polynomial": [*pair]} for name, pair in coordinates.items()}


def known() -> Iterator[Passing]:
    """Linkages that textbooks name, each through or up to a singular pose."""
    angle, half = 0.4, float(np.pi / 2)
    crank = slider_crank(0.3, 0.5, angle, driven="x")
    start, end = crank.pins[-1].home, 0.8
    slow = {"x": {"offset": 0.79, "harmonics": [[2.0, -0.01, 0.0]]}}
    why = "crank and rod are one line: the crank may go on or back"
    yield Passing("dead-centre", crank, slow, LAST, REFUSED, half, why)
    swing = {"x": {"offset": (start + end) / 2, "harmonics": [[float(np.pi), (start - end) / 2, 0.0]]}}
    yield Passing("fold", crank, swing, LAST, REFUSED, 1.0, why)
    over = half - 0.7
    yield Passing(
        "equal-rods",
        slider_crank(0.1, 0.1, 0.7),
        _turning(a=(0.7, 1.0)),
        LAST * over,
        REFUSED,
        over,
        "rod and crank coincide: the slide may go on, or rest while the rod turns with the crank",
    )
    yield Passing(
        "offset-slider-crank",
        slider_crank(0.1, 0.25, -half - 0.8, offset=0.15),
        _turning(a=(-half - 0.8, 1.0)),
        LAST * 0.8,
        REFUSED,
        0.8,
        "crank and rod are one line across the slide: the slide may go on or back",
    )
    bars = "all bars are one line: the rocker may go on in either sense"
    yield _passing_four_bar("parallelogram", (0.3, 0.5, 0.3, 0.5), float(np.pi), bars)
    yield _passing_four_bar("kite", (0.5, 0.3, 0.3, 0.5), 0.0, "the ends of coupler and rocker meet: both turn freely")
    yield _passing_four_bar("rhombus", (0.3, 0.3, 0.3, 0.3), float(np.pi), bars)
    yield _passing_five_bar("five-bar", (0.2, 0.25), (0.4, 0.45), 0.0, (1.0, 0.7))


def _passing_four_bar(name: str, lengths: tuple[float, float, float, float], singular: float, why: str) -> Passing:
    start, answer = singular - 0.8, REFUSED
    return Passing(name, four_bar(*lengths, start), _turning(a=(start, 1.0)), LAST * 0.8, answer, 0.8, why)


def _passing_five_bar(
    name: str, cranks: tuple[float, float], rods: tuple[float, float], gap: float, rates: tuple[float, float]
) -> Passing:
    """Cranks that turn away from each other until the rods are one line but for a gap: the base is as long as that."""
    base, lasts = sum(rods) - sum(cranks) - gap, 0.7
    angles = float(np.pi) - lasts * rates[0], -lasts * rates[1]
    linkage = five_bar(cranks, rods, base, angles)
    motion = _turning(a=(angles[0], rates[0]), e=(angles[1], rates[1]))
    why = "cranks and rods are one line: the rods may go on or back"
    return Passing(name, linkage, motion, LAST * lasts, _answer(gap), lasts, why)


def _answer(gap: float) -> str:
    """Branches meet, or do not reach each other; where they do not meet, one goes on."""
    return REGULAR if gap > 0.0 else REFUSED


def near_change_points(count: int, gap: float, seed: int = 0) -> Iterator[Passing]:
    """Four-bars, slider-cranks and five-bars in turn, at random, past poses where all bars are nearly one line.

    Args:
        gap: By how much the two bars between the others are too long to get there [m]: at 0 two branches meet; below,
            no branch gets past; above, that of home does.
    """
    for i in range(count):
        rng = np.random.default_rng([seed, i])
        make = (_four_bar_near, _slider_crank_near, _five_bar_near)[i % 3]
        yield make(f"{make.__name__.strip('_').replace('_', '-')}-{i}", rng, gap)


def _four_bar_near(name: str, rng: np.random.Generator, gap: float) -> Passing:
    """The crank is the shortest, and it and the longest are as long as the other two but for the gap."""
    crank, (p, q) = float(rng.uniform(0.15, 0.25)), map(float, rng.uniform(0.3, 0.5, 2))
    longest, which = p + q - gap - crank, int(rng.integers(3))
    coupler, rocker, base = [(longest, p, q), (p, longest, q), (p, q, longest)][which]
    singular = np.pi if which == 2 else 0.0
    start = float(singular - rng.uniform(0.5, 1.0))
    linkage = four_bar(crank, coupler, rocker, base, start, side=float(rng.choice([-1.0, 1.0])))
    way = float(singular - start)
    why = "all bars are nearly one line"
    return Passing(name, linkage, _turning(a=(start, 1.0)), LAST * way, _answer(gap), way, why)


def _slider_crank_near(name: str, rng: np.random.Generator, gap: float) -> Passing:
    """One in three has no offset: then the slide may rest."""
    crank = float(rng.uniform(0.1, 0.2))
    offset = 0.0 if rng.random() < 1.0 / 3.0 else float(rng.uniform(0.05, 0.2))
    way = float(rng.uniform(0.5, 1.0))
    start = -float(np.pi) / 2 - way
    linkage = slider_crank(crank, crank + offset + gap, start, offset=offset)
    why = "crank and rod are nearly one line across the slide"
    return Passing(name, linkage, _turning(a=(start, 1.0)), LAST * way, _answer(gap), way, why)


def _five_bar_near(name: str, rng: np.random.Generator, gap: float) -> Passing:
    cranks, rods = rng.uniform(0.15, 0.25, 2).tolist(), rng.uniform(0.4, 0.5, 2).tolist()
    first, second = rng.uniform(0.6, 1.4, 2).tolist()
    return _passing_five_bar(name, (cranks[0], cranks[1]), (rods[0], rods[1]), gap, (first, second))


def change_points(gap: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Linkages past poses where their bars are nearly one line; at gap 0 those that textbooks name, too."""
    some = [*near_change_points(3 if quick else 9, gap), *(known() if gap == 0.0 else ())]
    for one in some:
        place = folder / one.name
        scene = one.scene(place, 5 if quick else 41)
        if one.answer == REGULAR:
            yield replace(compare(scene, place, quantities=MOVED), cause=f"{one.name}: {one.why}")
            continue
        write_models(scene.mechanism, place, gravity=scene.applied.g)
        question = put(scene, place, scene.problem(MOVED), tuple(map(Method, ENGINES)), MOVED, UNKNOWN)
        yield replace(question, unanswerable=f"{one.name}: {one.why}")
