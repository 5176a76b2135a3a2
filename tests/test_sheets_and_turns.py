"""Motions around singular poses, over a thousand turns, and from one assembly into another.

A motion is followed from home: continuity decides. Samples without times have no order: what is computed at one depends
on that sample alone, on the part of the assembly that home reaches without a singular pose. Where a sample could belong
to two assemblies, or where none is reached, it is refused by its number.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import screwgauge
from screwgauge import Scene, load_scene
from support.errors import ClosureError, SingularPoseError
from support.questions import BASE_LOCK, WRIST_LOCKS
from support.scene import GivenMotion
from support.singular import AROUND, SHEETS, Passing, Tables, five_bar, four_bar, slider_crank, three_rpr

TURNS = 1000
PER_TURN = 12
QUANTITIES = ("joint_position", "actuator_force")
#: Rounding of angles of a thousand turns, 6e3 rad, and of forces there.
SAME = 1e-9


@dataclass(frozen=True)
class Way:
    """A motion, and where it leads.

    Attributes:
        scene: Makes it.
        winds: Coordinates that end whole turns away from where they began, and how many; others may say so or not.
        leads: ``back`` to the first pose, to ``another`` assembly, or ``nowhere``: a singular pose is in the way.
        order: Whether samples without order have an answer, or which error names one of them.
    """

    scene: Callable[[], Scene]
    winds: dict[str, int]
    leads: str = "back"
    order: type[Exception] | None = None


def moved(scene: Scene, t: np.ndarray, y: np.ndarray, yd: np.ndarray, ydd: np.ndarray) -> Scene:
    return replace(scene, task=GivenMotion(t, y, yd, ydd), drive=None, text={})


def of(linkage: Tables) -> Scene:
    still = {name: {"offset": linkage["joints"][name]["home"][0]} for name in linkage["independent"]}
    with TemporaryDirectory() as folder:
        return Passing("linkage", linkage, still, 1.0, "", 0.0, "").scene(Path(folder), 2)


def turning(scene: Scene, which: tuple[int, ...], turns: int = TURNS) -> Scene:
    mechanism = scene.mechanism
    t = np.arange(turns * PER_TURN + 1) / PER_TURN
    y = np.tile(mechanism.home[mechanism.independent_columns], (len(t), 1))
    yd, ydd = np.zeros_like(y), np.zeros_like(y)
    for i in which:
        y[:, i] += 2.0 * np.pi * t
        yd[:, i] = 2.0 * np.pi
    return moved(scene, t, y, yd, ydd)


def circle(
    scene: Scene, centre: np.ndarray, axes: tuple[int, int], start: float, turns: float, *, back: bool = False
) -> Scene:
    """Turns on a circle around `AROUND`."""
    t = np.linspace(0.0, 2.0 if back else 1.0, 61)
    whole = 2.0 * np.pi * turns
    angle = start + whole * (1.0 - np.cos(np.pi * t)) / 2.0
    rate, second = whole * np.pi * np.sin(np.pi * t) / 2.0, whole * np.pi**2 * np.cos(np.pi * t) / 2.0
    y = np.tile(centre, (len(t), 1))
    yd, ydd = np.zeros_like(y), np.zeros_like(y)
    for i, (f, df) in zip(axes, ((np.cos, lambda x: -np.sin(x)), (np.sin, np.cos)), strict=True):
        y[:, i] += AROUND * f(angle)
        yd[:, i] = AROUND * df(angle) * rate
        ydd[:, i] = AROUND * (df(angle) * second - f(angle) * rate**2)
    return moved(scene, t, y, yd, ydd)


def cuspidal(sheet: int, turns: float, *, back: bool = False) -> Scene:
    """Three assemblies meet here."""
    scene = of(three_rpr(*SHEETS[sheet]))
    mechanism = scene.mechanism
    centre = mechanism.home[mechanism.independent_columns] - [0.0, 0.0, AROUND]
    return circle(scene, centre, (1, 2), np.pi / 2, turns, back=back)


def beyond_reach() -> Scene:
    scene = of(three_rpr(*SHEETS[0]))
    mechanism = scene.mechanism
    y = mechanism.home[mechanism.independent_columns] + np.linspace(0.0, -0.3, 31)[:, None] * [0.0, 1.0, 0.0]
    rest = np.zeros_like(y)
    return moved(scene, np.arange(31.0), y, np.tile([0.0, -0.01, 0.0], (31, 1)), rest)


ISOLATED = np.array([np.pi, 0.0])
LINE = five_bar((0.2, 0.25), (0.4, 0.45), 0.4, (np.pi + AROUND, 0.0))
PAPER = "3ups-upu-s"
WAYS = {
    "crank and rocker, a thousand turns": Way(
        lambda: turning(of(four_bar(0.2, 0.5, 0.45, 0.6, 1.0)), (0,)), {"a": TURNS, "b": -TURNS}
    ),
    "slider-crank, a thousand turns": Way(
        lambda: turning(of(slider_crank(0.1, 0.3, 0.4)), (0,)), {"a": TURNS, "b": -TURNS}
    ),
    "Bennett's linkage, a thousand turns": Way(lambda: turning(load_scene("bennett"), (0,)), {}),
    "two cranks, a thousand turns": Way(
        lambda: turning(of(five_bar((0.2, 0.2), (0.6, 0.7), 0.4, (1.0, 1.0))), (0, 1)),
        {"a": TURNS, "b": -TURNS, "d": -TURNS, "e": TURNS},
    ),
    "around an isolated singular pose": Way(lambda: circle(of(LINE), ISOLATED, (0, 1), 0.0, 1.0), {}),
    "around a base joint's lock": Way(
        lambda: circle(load_scene(PAPER), np.array([BASE_LOCK, 0.0]), (0, 1), 0.0, 1.0), {}
    ),
    "around a wrist's gimbal lock": Way(
        lambda: circle(load_scene(PAPER), np.array([WRIST_LOCKS[PAPER], 0.0]), (0, 1), 0.0, 1.0), {}
    ),
    "around a cusp": Way(lambda: cuspidal(0, -1.0), {}, "another", SingularPoseError),
    "around a cusp from the other assembly": Way(lambda: cuspidal(1, 1.0), {}, "another", SingularPoseError),
    "around a cusp and back": Way(lambda: cuspidal(0, -1.0, back=True), {}, "back", SingularPoseError),
    "twice around a cusp": Way(lambda: cuspidal(0, -2.0), {}, "nowhere", SingularPoseError),
    "to other assemblies alone": Way(beyond_reach, {}, "nowhere", SingularPoseError),
}
ANSWERED = [name for name, way in WAYS.items() if way.leads != "nowhere"]
LONG = [pytest.param(name, marks=pytest.mark.slow) if "thousand" in name else name for name in ANSWERED]
SCENES = cache(lambda name: WAYS[name].scene())


@cache
def run(name: str) -> screwgauge.Results:
    return screwgauge.run(SCENES(name), ["screw"], QUANTITIES)


def samples(name: str) -> tuple[np.ndarray, ...]:
    motion = SCENES(name).motion
    return motion.y, motion.yd, motion.ydd


def away(a: np.ndarray, b: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Differences, angles modulo half turns. (n, n_q)."""
    found = a - b
    found[:, angles] -= 2.0 * np.pi * np.round(found[:, angles] / (2.0 * np.pi))
    return found


def angles(scene: Scene) -> np.ndarray:
    return np.array([unit == "rad" for unit in scene.mechanism.units])


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", LONG)
def test_a_motion_leads_where_continuity_does(name):
    way, q = WAYS[name], run(name).values("joint_position")
    names, turn = SCENES(name).mechanism.coordinates, angles(SCENES(name))
    back = np.abs(away(q[-1:], q[:1], turn)).max()
    assert back < SAME if way.leads == "back" else back > 0.1
    wound = {c: round(x) for c, x in zip(names, (q[-1] - q[0]) / (2.0 * np.pi), strict=True) if round(x)}
    assert way.winds.items() <= wound.items()


@pytest.mark.parametrize("name", [name for name in WAYS if name not in ANSWERED])
def test_a_motion_into_a_singular_pose_is_refused(name):
    with pytest.raises((SingularPoseError, ClosureError), match="t = "):
        run(name)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", LONG)
def test_samples_with_times_are_that_motion(name):
    found = screwgauge.compile(SCENES(name), QUANTITIES, backend="numpy")(*samples(name), t=SCENES(name).t)
    for quantity in QUANTITIES:
        right = run(name).values(quantity)
        assert np.abs(found[quantity] - right).max() < SAME * np.abs(right).max()


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LONG if not isinstance(name, str) or not WAYS[name].order])
def test_samples_without_order_are_answered_each_for_itself(name):
    order = np.random.default_rng(0).permutation(len(SCENES(name).t))
    solver = screwgauge.compile(SCENES(name), QUANTITIES, backend="numpy")
    found = solver(*(x[order] for x in samples(name)))
    some = solver(*(x[order[:7]] for x in samples(name)))
    q, f = (run(name).values(quantity)[order] for quantity in QUANTITIES)
    assert np.abs(away(found["joint_position"], q, angles(SCENES(name)))).max() < SAME
    assert np.abs(found["actuator_force"] - f).max() < SAME * np.abs(f).max()
    assert np.abs(some["joint_position"] - found["joint_position"][:7]).max() < SAME


@pytest.mark.sampled(4)
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, way in WAYS.items() if way.order])
def test_samples_that_two_assemblies_or_none_could_have_are_named(name):
    order = np.random.default_rng(0).permutation(len(SCENES(name).t))
    t, *rows = (x[:2] for x in (SCENES(name).t, *samples(name)))
    solver = screwgauge.compile(moved(SCENES(name), t, *rows), QUANTITIES, backend="numpy")
    with pytest.raises((SingularPoseError, ClosureError), match=r"row \d+"):
        solver(*(x[order] for x in samples(name)))


def test_a_motion_changes_nothing_about_samples_without_order():
    name = "around a cusp"
    t, *rows = (x[:5] for x in (SCENES(name).t, *samples(name)))
    solver = screwgauge.compile(moved(SCENES(name), t, *rows), QUANTITIES, backend="numpy")
    before = solver(*rows)
    solver(*samples(name), t=SCENES(name).t)
    after = solver(*rows)
    assert all(np.array_equal(before[quantity], after[quantity]) for quantity in QUANTITIES)
