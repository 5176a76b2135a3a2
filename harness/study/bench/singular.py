"""Stress tests at singularities: poses of the 3-UPS-UPU-S, wrist locks, and motions through singular poses.

Planar linkages have motions in closed form, and start in the home pose. Where assembly branches meet, samples of the
independent coordinates do not determine the branch that follows: such a motion has no answer, whatever the samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tomli_w

from screwgauge import __version__
from screwgauge.models.catalog import load_mechanism, mechanism_path
from screwgauge.models.generate import write_models
from screwgauge.problem import Problem
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import closed_form_positions, positions
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.equations.forward import NewtonEuler, force_matrix
from screwgauge.reference.equations.kinematics import gaps, pose
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.precision import in_precision
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.solution import Error, Solution, Stopwatch, Values
from screwgauge.study.bench.question import (
    ENGINES,
    QUANTITIES,
    SCENE,
    UNKNOWN,
    Question,
    compare,
    pose_question,
    scene_at,
)
from screwgauge.study.bench.variants import given_motion, variant
from screwgauge.study.linkages import Tables, five_bar, four_bar, slider_crank
from screwgauge.study.methods import Method
from screwgauge.study.reference_values import Reference

#: The paper's radii of the circles of joints on the ground and on the platform, and height of the platform [m].
_R, _r, _H = 0.8, 0.5, 0.3 * np.sqrt(3.0)
#: Tilt b at which leg 1 no longer prevents the platform from turning.
SINGULAR_B = float(np.arctan2(_H, _r) - np.arccos(np.hypot(_r, _H) / _R))
#: Tilt a at which leg 2 lies on the first axis of its base joint, at b = 0.
BASE_LOCK = -float(np.arctan2(_H, _r))
#: Mechanism -> tilt a at which the outer axes of leg 2's wrist coincide, at b = 0: 40.5 and 51.3 degrees.
WRIST_LOCKS = {"3ups-upu-s": -float(np.arcsin(_H / _R)), "3ups-upu-s-table2": float(np.arccos(_r / _R))}
_FULL = ("pinocchio-full", "mujoco-full")
_TREE = "the wrist's angles, which lock here, are coordinates of its tree"
_IMPLICIT = "all coordinates are solved for, and the third rotation, which vanishes, is divided by the distance"
_SMALL = "the leg's direction is a small difference of lengths, whose rounding is divided by the distance"
#: Range of a motion in a beyond the lock of leg 4 [rad], and the angles that distinguish the assembly modes of that
#: leg.
FAR, _ANGLES = 1.2, ("leg4.q1", "leg4.q2")
_FORCE = "actuator_force"
#: Angular velocity and acceleration of (a, b), without symmetry.
_RATE, _ACCELERATION = np.array([0.7, 0.4]), np.array([-0.3, 0.9])


def upu_singularity(distance: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Approach the tilt b at which leg 1, perpendicular to the line from O to its wrist, lets the platform turn."""
    a = np.array([0.1] if quick else [0.05, 0.1, 0.3])
    scene = _poses(SCENE, np.stack([a, np.full_like(a, SINGULAR_B - distance)], axis=1))
    question = compare(scene, folder, cause=_IMPLICIT)
    yield question
    if question.known:
        labels = {"screw whole system": False, "screw whole system refined": True}
        methods = tuple(variant("screw", whole_system, name, refined=x) for name, x in labels.items())
        problem = replace(question.problem, wanted=frozenset((_FORCE,)))
        yield replace(question, methods=methods, quantities=(_FORCE,), problem=problem)


def u_lock(distance: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Approach the tilt of 46.1 degrees at which a leg lies along the first axis of its base joint."""
    y = np.array([BASE_LOCK, 0.0]) + np.array([0.3, 0.1, distance])[:, None] * _direction(-0.6)
    yield compare(_poses(SCENE, y), folder, cause=_SMALL)


def wrist_chart(distance: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Pass through the tilts at which the coordinates of a wrist lock, for both choices of its axes."""
    for name, lock in WRIST_LOCKS.items():
        scene = _poses(name, _path_around(lock, distance, 5 if quick else 9))
        setting = "" if name == SCENE else "table2"
        yield compare(scene, folder, setting=setting)
        yield compare(scene, folder, engines=_FULL, quantities=QUANTITIES[1:], setting=setting, cause=_TREE)


def assembly(distance: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Pass the lock of leg 4 with several step sizes; with the last step size, only one distant pose is solved."""
    for step in (0.1, FAR) if quick else (0.001, 0.01, 0.1, FAR):
        a = np.linspace(0.0, FAR, 1 + round(FAR / step))[-1 if step == FAR else 0 :]
        scene = scene_at(load_scene(SCENE), np.stack([a, np.full_like(a, distance)], axis=1))
        write_models(scene.mechanism, folder, gravity=scene.applied.g)
        mechanism, quantity = scene.mechanism, "joint_position"
        q = positions(layout(mechanism), scene.motion.y, scene.motion.t)
        values = {quantity: Values(mechanism.coordinates, mechanism.units, q).pick(_ANGLES)}
        right = Reference.by_size("closed form", mechanism, values)
        methods = tuple(Method(name, label=f"{name} {step:g} rad") for name in ENGINES)
        yield pose_question(scene, folder, scene.problem((quantity,)), methods, (quantity,), right)


def whole_system(lay: Layout, problem: Problem, *, refined: bool = False) -> Solution:
    """Solve eqs. (57)-(58) for all bodies at once, without virtual power; return actuator forces of minimum norm.

    The error estimate is the rounding error times the condition number of the system.

    Args:
        refined: Apply one step of iterative refinement with the residual of a more precise matrix; see
            `wide_force_matrix`.
    """
    clock, task = Stopwatch(), given_motion(problem)
    q = positions(lay, task.y, task.t, (task.yd, task.ydd))
    system = NewtonEuler(motion_at(lay, q, task.yd, task.ydd, problem.applied, task.t))
    wide = wide_force_matrix(lay, task.y) if refined else None
    unknown = system.solve(system.need[..., None], wide)[..., 0]
    f = np.asarray(unknown[:, len(system.names) :], dtype=float)
    return Solution(
        "screw",
        __version__,
        {_FORCE: Values(lay.mechanism.actuator_names, lay.mechanism.actuator_units, f)},
        system.condition,
        errors={_FORCE: Error(linear.EPS * system.condition, condition=system.condition)},
        cost=clock.cost(),
    )


def wide_force_matrix(lay: Layout, y: Array) -> Array | None:
    """Compute the matrix c of eq. (57) in numpy's widest number type, at poses known in closed form.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).

    Returns:
        See `force_matrix`. None if that type is not wider than a double, or the closed form leaves the loops open.
    """
    wider = np.finfo(np.longdouble)
    if not wider.eps < np.finfo(float).eps:
        return None
    lay = layout(in_precision(lay.mechanism, np.longdouble))
    q = closed_form_positions(lay, y.astype(np.longdouble))
    if q is None:
        return None
    at, closed = pose(lay, q), np.abs(gaps(lay, q)).max(initial=0.0) < 64 * wider.eps
    return force_matrix(at, q, at.S) if closed else None


def _direction(angle: float) -> Array:
    """Return a unit vector in the plane of (a, b)."""
    return np.array([np.cos(angle), np.sin(angle)])


def _path_around(lock: float, distance: float, steps: int) -> Array:
    """Build a path up to the lock, back, around it on the side of b < 0, and up to it from behind. Shape (n, 2)."""
    start, sense = (-0.6, -1.0) if lock < 0.0 else (np.pi + 0.6, 1.0)
    angles = start + sense * np.linspace(0.0, np.pi, steps)
    arc = [0.05 * _direction(angle) for angle in angles]
    near, far = (distance * _direction(angle) for angle in (angles[0], angles[-1]))
    rows = np.array([0.3 * _direction(angles[0]), arc[0], near, *arc, far])
    return np.asarray(rows + np.array([lock, 0.0]))


def _poses(name: str, y: Array) -> Scene:
    """Return a scene with a mechanism at given poses, all with the same rates and accelerations."""
    scene = replace(load_scene(SCENE), mechanism=load_mechanism(name), mechanism_file=mechanism_path(name))
    return scene_at(scene, y, np.tile(_RATE, (len(y), 1)), np.tile(_ACCELERATION, (len(y), 1)))


#: Duration of motions relative to the time of the singular pose, so that evenly spaced samples never hit that pose.
LAST = float(np.sqrt(3.0))
REFUSED, REGULAR = "refused", "regular"
MOVED = ("joint_position", "joint_acceleration", "actuator_force")


@dataclass(frozen=True, slots=True)
class Passing:
    """Linkage with a motion, which may have no solution.

    Attributes:
        motion: Independent coordinate -> its table in a scene.
        lasts: Time of the last sample [s].
        answer: `REFUSED` or `REGULAR`.
        at: Time at which the motion passes, touches or approaches the singular pose [s].
        why: Description of that pose.
    """

    name: str
    linkage: Tables
    motion: Mapping[str, Tables]
    lasts: float
    answer: str
    at: float
    why: str

    def scene(self, folder: Path, samples: int, engines: Sequence[str] = ("screw", "pinocchio", "mujoco")) -> Scene:
        """Write a scene with evenly spaced times to a folder, and read it."""
        folder.mkdir(parents=True, exist_ok=True)
        tables: Tables = {"mechanism": "linkage.toml", "gravity": [0.0, -9.81, 0.0], "engines": [*engines]}
        tables |= {"motion": self.motion, "time": {"times": np.linspace(0.0, self.lasts, samples).tolist()}}
        (folder / "linkage.toml").write_text(tomli_w.dumps({"name": self.name, **self.linkage}), encoding="utf-8")
        (folder / "scene.toml").write_text(tomli_w.dumps(tables), encoding="utf-8")
        return load_scene(folder / "scene.toml")


def _drive(
    name: str, linkage: Tables, rates: Mapping[str, tuple[float, float]], at: float, why: str, gap: float = 0.0
) -> Passing:
    """Build a linkage that moves at constant rates.

    Args:
        rates: Independent coordinate -> start and rate.
        gap: Positive if branches do not meet, so that one of them continues.
    """
    motion = {label: {"polynomial": [*pair]} for label, pair in rates.items()}
    return Passing(name, linkage, motion, LAST * at, REGULAR if gap > 0.0 else REFUSED, at, why)


def textbook_linkages() -> Iterator[Passing]:
    """Yield textbook linkages, each with a motion through or up to a singular pose."""
    half, turn = float(np.pi / 2), float(np.pi)
    crank = slider_crank(0.3, 0.5, 0.4, driven="x")
    start, end = crank["joints"]["x"]["home"][0], 0.8
    slow = {"x": {"offset": 0.79, "harmonics": [[2.0, -0.01, 0.0]]}}
    swing = {"x": {"offset": (start + end) / 2, "harmonics": [[turn, (start - end) / 2, 0.0]]}}
    why = "crank and rod are collinear: the crank may continue or turn back"
    yield Passing("dead-centre", crank, slow, LAST, REFUSED, half, why)
    yield Passing("fold", crank, swing, LAST, REFUSED, 1.0, why)
    why = "rod and crank coincide: the slide may continue, or rest while the rod turns with the crank"
    yield _drive("equal-rods", slider_crank(0.1, 0.1, 0.7), {"a": (0.7, 1.0)}, half - 0.7, why)
    why, start = "crank and rod are collinear across the slide: the slide may continue or turn back", -half - 0.8
    offset = slider_crank(0.1, 0.25, start, offset=0.15)
    yield _drive("offset-slider-crank", offset, {"a": (start, 1.0)}, 0.8, why)
    bars = "all bars are collinear: the rocker may continue in either sense"
    for name, lengths, singular, why in (
        ("parallelogram", (0.3, 0.5, 0.3, 0.5), turn, bars),
        ("kite", (0.5, 0.3, 0.3, 0.5), 0.0, "the ends of coupler and rocker meet: both turn freely"),
        ("rhombus", (0.3, 0.3, 0.3, 0.3), turn, bars),
    ):
        yield _drive(name, four_bar(*lengths, singular - 0.8), {"a": (singular - 0.8, 1.0)}, 0.8, why)
    yield _spreading_five_bar("five-bar", (0.2, 0.25), (0.4, 0.45), 0.0, (1.0, 0.7))


def _spreading_five_bar(
    name: str, cranks: Sequence[float], rods: Sequence[float], gap: float, rates: Sequence[float]
) -> Passing:
    """Build a five-bar whose cranks turn apart until the rods are collinear except for a gap."""
    base, at = sum(rods) - sum(cranks) - gap, 0.7
    angles = float(np.pi) - at * rates[0], -at * rates[1]
    linkage = five_bar((cranks[0], cranks[1]), (rods[0], rods[1]), base, angles)
    why = "cranks and rods are collinear: the rods may continue or turn back"
    return _drive(name, linkage, {"a": (angles[0], rates[0]), "e": (angles[1], rates[1])}, at, why, gap)


def near_change_points(count: int, gap: float, seed: int = 0) -> Iterator[Passing]:
    """Yield random four-bars, slider-cranks and five-bars in turn, moving past poses with nearly collinear bars.

    Args:
        gap: Length by which the bars exceed what that pose requires [m]. At 0, two branches meet there;
            below 0, no branch passes the pose; above 0, the home branch passes it.
    """
    for i in range(count):
        rng = np.random.default_rng([seed, i])
        kind = ("four-bar", "slider-crank", "five-bar")[i % 3]
        yield _NEAR[kind](f"{kind}-near-{i}", rng, gap)


def _four_bar_near(name: str, rng: np.random.Generator, gap: float) -> Passing:
    """Build a four-bar whose crank (its shortest bar) and longest bar together equal the other two except for a gap."""
    crank, (p, q) = float(rng.uniform(0.15, 0.25)), map(float, rng.uniform(0.3, 0.5, 2))
    longest, which = p + q - gap - crank, int(rng.integers(3))
    coupler, rocker, base = [(longest, p, q), (p, longest, q), (p, q, longest)][which]
    singular = np.pi if which == 2 else 0.0
    start = float(singular - rng.uniform(0.5, 1.0))
    linkage = four_bar(crank, coupler, rocker, base, start, side=float(rng.choice([-1.0, 1.0])))
    return _drive(name, linkage, {"a": (start, 1.0)}, float(singular - start), "all bars are nearly collinear", gap)


def _slider_crank_near(name: str, rng: np.random.Generator, gap: float) -> Passing:
    """Build a slider-crank near a singular pose; one in three has no offset, so that the slide may rest."""
    crank = float(rng.uniform(0.1, 0.2))
    offset = 0.0 if rng.random() < 1.0 / 3.0 else float(rng.uniform(0.05, 0.2))
    way = float(rng.uniform(0.5, 1.0))
    start = -float(np.pi) / 2 - way
    linkage = slider_crank(crank, crank + offset + gap, start, offset=offset)
    return _drive(name, linkage, {"a": (start, 1.0)}, way, "crank and rod are nearly collinear across the slide", gap)


def _five_bar_near(name: str, rng: np.random.Generator, gap: float) -> Passing:
    cranks, rods = rng.uniform(0.15, 0.25, 2).tolist(), rng.uniform(0.4, 0.5, 2).tolist()
    return _spreading_five_bar(name, cranks, rods, gap, rng.uniform(0.6, 1.4, 2).tolist())


_NEAR = {"four-bar": _four_bar_near, "slider-crank": _slider_crank_near, "five-bar": _five_bar_near}


def change_points(gap: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Yield questions about linkages that pass poses with nearly collinear bars; at gap 0, also textbook linkages."""
    some = [*near_change_points(3 if quick else 9, gap), *(textbook_linkages() if gap == 0.0 else ())]
    for one in some:
        place = folder / one.name
        scene = one.scene(place, 5 if quick else 41)
        if one.answer == REGULAR:
            yield replace(compare(scene, place, quantities=MOVED), cause=f"{one.name}: {one.why}")
            continue
        write_models(scene.mechanism, place, gravity=scene.applied.g)
        question = pose_question(scene, place, scene.problem(MOVED), tuple(map(Method, ENGINES)), MOVED, UNKNOWN)
        yield replace(question, unanswerable=f"{one.name}: {one.why}")
