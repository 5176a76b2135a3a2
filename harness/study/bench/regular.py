"""Stress tests without singularities: masses, size and inertia of bodies, speed, load, and a million samples.

The last case shows the drift of schemes that integrate joint positions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from screwgauge.judging.answer import motion_task
from screwgauge.models.catalog import load_mechanism, mechanism_tables
from screwgauge.problem import ModelFiles, Problem
from screwgauge.reference.applied import Load
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.expressions import number
from screwgauge.reference.graph import Layout
from screwgauge.reference.mechanism import KINDS
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Stopwatch, Values, empty
from screwgauge.study.bench.question import SCENE, Question, compare, exact_text, scene_at, scene_in_motion
from screwgauge.study.bench.scheme import PARTS, chains, march, platform_screws
from screwgauge.study.bench.stress import Ask
from screwgauge.study.bench.variants import variant
from screwgauge.study.reference_values import join_samples, reference_values
from screwgauge.study.stream import stream, times

#: Moments of inertia of the platform as a plate and of half a leg as a rod [kg m^2], close to the paper's values.
PLATE, ROD = 0.46, 1.16e-2
#: Directions of rates and of accelerations, with larger component one.
_RATE = np.array([[1.0, -0.6], [0.5, -1.0], [-0.3, 1.0]])
_ACCELERATION = np.array([[0.4, 1.0], [-1.0, 0.2], [1.0, -0.5]])
#: Directions of force [N] and moment [N m] at the platform's centre of mass, with largest component one.
_FORCE, _TORQUE = np.array([0.3, -0.2, 1.0]), np.array([1.0, 0.1, -0.2])

Tables = dict[str, Any]


def body_ladder(change: Callable[[Tables, float], None]) -> Ask:
    """Make a stress case from a function that changes the mechanism tables of the unloaded default scene.

    The changed tables are written as a description, from which the model files of all engines are generated as usual.
    """

    @wraps(change)
    def ask(severity: float, quick: bool, folder: Path) -> Iterator[Question]:
        tables, path = mechanism_tables(SCENE), folder / f"{SCENE}.toml"
        change(tables, severity)
        path.write_text(tomli_w.dumps(tables), encoding="utf-8")
        scene = replace(load_scene(SCENE), mechanism=load_mechanism(path), mechanism_file=path).under(loads=())
        yield compare(scene_in_motion(scene, quick), folder)

    return ask


def speed(w: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Yield questions about speeds from zero up to centrifugal forces of a million times the weight."""
    scene = scene_in_motion(load_scene(SCENE), quick)
    y, n = scene.motion.y, len(scene.motion)
    yield compare(scene_at(scene, y, w * _RATE[:n], w**2 * _ACCELERATION[:n]), folder)


def load(size: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Yield questions about loads from zero up to the weight of a mountain."""
    loads = (Load("platform", None, size * _FORCE, size * _TORQUE),)
    yield compare(scene_in_motion(load_scene(SCENE).under(loads=loads), quick), folder)


def _times(texts: list[Any], factor: float) -> list[str]:
    """Multiply numbers of a description, which may be strings, by a factor."""
    return [exact_text(number(text, "description") * factor) for text in texts]


def _scale(body: Tables, mass: float, inertia: float) -> None:
    (body["mass"],) = _times([body["mass"]], mass)
    body["inertia"] = dict(zip(body["inertia"], _times([*body["inertia"].values()], inertia), strict=True))


@body_ladder
def mass_ratio(tables: Tables, ratio: float) -> None:
    for name, body in tables["bodies"].items():
        if name.startswith("leg"):
            _scale(body, ratio, ratio)


@body_ladder
def scale(tables: Tables, s: float) -> None:
    for body in tables["bodies"].values():
        _scale(body, s**3, s**5)
        body["com"] = _times(body["com"], s)
    for joint in tables["joints"].values():
        for frame in (joint[key] for key in ("parent_frame", "child_frame") if key in joint):
            frame["position"] = _times(frame["position"], s)
        if KINDS[joint["kind"]] == (False,):  # joint P: its coordinate is a length
            joint["home"] = _times(joint["home"], s)


@body_ladder
def inertia_anisotropy(tables: Tables, e: float) -> None:
    for name, body in tables["bodies"].items():
        if name.startswith("leg"):
            moments, axis = (ROD, ROD, ROD * e), ["3/7", "2/7", "-6/7"]
        else:
            moments, axis = (PLATE * (1.0 + e), PLATE, 2.0 * PLATE), ["6/7", "2/7", "3/7"]
        body["inertia"] = dict(zip(("xx", "yy", "zz"), map(exact_text, moments), strict=True))
        body["inertia_rotation"] = {"axis": axis, "angle": "0.4"}


STEP = 1e-3  # time between samples [s]
SCHEME_STEP = 1e-2  # step of the paper's scheme [s]
PART = 2048  # number of steps of the scheme per part
CHECKED = 8  # number of samples compared with the truth, including the last one
QUANTITIES = ("joint_position", "generalized_force")
SCHEMES = {
    "paper Euler": ("euler", "steps of eq. (27), whose first-order error is neither corrected nor estimated"),
    "paper RK4": ("rk4", "a fourth-order error that is neither corrected nor estimated"),
}


def long_run(count: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Yield questions about the default scene with a given number of samples."""
    scene = replace(load_scene(SCENE), rule="min_norm")
    at = _sample_numbers(int(count)) * STEP
    files, right = ModelFiles(scene.mechanism_file), reference_values(scene, at, QUANTITIES)
    method = variant("screw", stream_samples, scene=scene, count=int(count))
    problem, engines = scene.at(at).problem(QUANTITIES), {"screw": files, "paper": files}
    whole = Question(scene.mechanism, engines, problem, (method,), QUANTITIES, right)
    yield whole
    posed = replace(problem, wanted=frozenset(QUANTITIES[:1]))
    for label, (steps, cause) in SCHEMES.items():
        scheme = variant("paper", paper_steps, label, scene=scene, method=steps)
        yield replace(whole, problem=posed, methods=(scheme,), quantities=QUANTITIES[:1], cause=cause)


def _sample_numbers(count: int) -> Array:
    """Return sample numbers from 1 on that are also steps of the scheme, including the last sample."""
    stride = round(SCHEME_STEP / STEP)
    return np.unique(np.geomspace(1, count // stride, CHECKED).round().astype(int)) * stride


def stream_samples(lay: Layout, problem: Problem, *, scene: Scene, count: int) -> Solution:
    """Solve all samples of a scene with `screw`, part by part, and return the samples at the times of a problem."""
    clock, at = Stopwatch(), np.rint(motion_task(problem).t / STEP).astype(int)
    parts: dict[str, list[Values]] = {name: [] for name in sorted(problem.wanted)}
    worst, done, version = 0.0, 0, ""
    for t, solution in stream(scene, times(count, STEP, first=STEP), engine="screw", quantities=problem.wanted):
        rows = at[(at > done) & (at <= done + len(t))] - done - 1
        for name, kept in parts.items():
            kept.append(solution.values[name].at(rows))
        worst, done, version = max(worst, float(solution.condition.max())), done + len(t), solution.version
    values = {name: join_samples(kept) for name, kept in parts.items()}
    return Solution("screw", version, values, np.full(len(at), worst), cost=clock.cost())


def paper_steps(lay: Layout, problem: Problem, *, scene: Scene, method: str) -> Solution:
    """Integrate joint positions with the paper's own scheme, with corrected twist, in steps of `SCHEME_STEP`.

    The times of the problem are ends of steps.
    """
    clock, parts, side, first = Stopwatch(), PARTS[method], chains(lay), np.zeros(1)
    ends = np.rint(motion_task(problem).t / SCHEME_STEP).astype(int)
    theta, kept = side.gather(positions(lay, scene.moved(first).y, first)), []
    for begin in range(0, int(ends[-1]), PART):
        n = min(PART, int(ends[-1]) - begin)
        t = (begin + np.arange(parts * n + 1) / parts) * SCHEME_STEP
        theta = march(side, theta[-1], platform_screws(lay, scene.moved(t))[0], SCHEME_STEP, method)
        kept.append(theta[ends[(ends > begin) & (ends <= begin + n)] - begin])
    q, mechanism = side.scatter(np.concatenate(kept), len(lay.mechanism.coordinates)), lay.mechanism
    values = {"joint_position": Values(mechanism.coordinates, mechanism.units, q)}
    return Solution("paper", "", values, empty(len(q)), cost=clock.cost())
