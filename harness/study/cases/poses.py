"""Ladders towards singular poses of the 3-UPS-UPU-S, and towards gimbal locks of its wrists."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from screwgauge.models.catalog import load_mechanism, mechanism_path
from screwgauge.models.generate import write_models
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.graph import layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.solution import Values
from screwgauge.study.cases.asking import ENGINES, QUANTITIES, SCENE, compare, still
from screwgauge.study.cases.question import Question, put
from screwgauge.study.methods import Method
from screwgauge.study.reference import Reference

#: The paper's radii of the joints' circles on the ground and on the platform, and height of the latter [m].
_R, _r, _H = 0.8, 0.5, 0.3 * np.sqrt(3.0)
#: Half the angle of the platform at which the first axis of leg 1 no longer holds it.
SINGULAR_B = float(np.arctan2(_H, _r) - np.arccos(np.hypot(_r, _H) / _R))
#: Tilt a at which leg 2 lies on the first axis of its base joint, at b = 0.
BASE_LOCK = -float(np.arctan2(_H, _r))
#: Mechanism -> tilt a at which the outer axes of leg 2's wrist coincide, at b = 0: 40.5 and 51.3 degrees.
WRIST_LOCKS = {"3ups-upu-s": -float(np.arcsin(_H / _R)), "3ups-upu-s-table2": float(np.arccos(_r / _R))}
_FULL = ("pinocchio-full", "mujoco-full")
_TREE = "the wrist's angles, which lock here, are coordinates of its tree"
_IMPLICIT = "all coordinates are solved for, and the third rotation, which vanishes, is divided by the distance"
_SMALL = "the leg's direction is a small difference of lengths, whose rounding is divided by the distance"
#: How far a motion in a leads past the lock of leg 4 [rad], and the angles that tell the assemblies of that leg.
FAR, _ANGLES = 1.2, ("leg4.q1", "leg4.q2")
#: Angular velocity and acceleration of (a, b), without symmetry.
_RATE, _ACCELERATION = np.array([0.7, 0.4]), np.array([-0.3, 0.9])
_WHOLE = (
    Method("screw", {"whole_system": True}, "screw whole system"),
    Method("screw", {"whole_system": True, "refined": True}, "screw whole system refined"),
)


def upu_singularity(distance: float, quick: bool, folder: Path) -> Iterator[Question]:
    """The tilt b at which leg 1, at right angles to the line from O to its wrist, lets the platform turn."""
    a = np.array([0.1] if quick else [0.05, 0.1, 0.3])
    question = compare(
        _passing(SCENE, np.stack([a, np.full_like(a, SINGULAR_B - distance)], axis=1)), folder, cause=_IMPLICIT
    )
    yield question
    if question.known:
        problem = replace(question.problem, wanted=frozenset(("actuator_force",)))
        yield replace(question, methods=_WHOLE, quantities=("actuator_force",), problem=problem)


def u_lock(distance: float, quick: bool, folder: Path) -> Iterator[Question]:
    """The tilt of 46.1 degrees at which a leg lies along the first axis of its base joint."""
    y = np.array([BASE_LOCK, 0.0]) + np.array([0.3, 0.1, distance])[:, None] * _towards(-0.6)
    yield compare(_passing(SCENE, y), folder, cause=_SMALL)


def wrist_chart(distance: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Through the tilts at which the coordinates of a wrist lock, in both choices of its axes."""
    for name, lock in WRIST_LOCKS.items():
        scene, setting = _passing(name, _around(lock, distance, 5 if quick else 9)), "" if name == SCENE else "table2"
        yield compare(scene, folder, setting=setting)
        yield compare(scene, folder, engines=_FULL, quantities=QUANTITIES[1:], setting=setting, cause=_TREE)


def assembly(distance: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Past the lock of leg 4, in steps of several sizes, the last of which is one far pose."""
    for step in (0.1, FAR) if quick else (0.001, 0.01, 0.1, FAR):
        a = np.linspace(0.0, FAR, 1 + round(FAR / step))[-1 if step == FAR else 0 :]
        scene = still(load_scene(SCENE), np.stack([a, np.full_like(a, distance)], axis=1))
        write_models(scene.mechanism, folder, gravity=scene.applied.g)
        known = positions(layout(scene.mechanism), scene.motion.y, scene.motion.t)
        names, units = scene.mechanism.coordinates, scene.mechanism.units
        right = {"joint_position": Values(names, units, known).pick(_ANGLES)}
        methods = tuple(Method(name, label=f"{name} {step:g} rad") for name in ENGINES)
        yield put(
            scene,
            folder,
            scene.problem(("joint_position",)),
            methods,
            ("joint_position",),
            Reference.by_size("closed form", scene.mechanism, right),
        )


def _towards(angle: float) -> Array:
    """Direction in the plane of (a, b)."""
    return np.array([np.cos(angle), np.sin(angle)])


def _around(lock: float, distance: float, steps: int) -> Array:
    """Up to the lock, back, around it on the side of b < 0, and up to it from behind. Shape (n, 2)."""
    start, sense = (-0.6, -1.0) if lock < 0.0 else (np.pi + 0.6, 1.0)
    angles = start + sense * np.linspace(0.0, np.pi, steps)
    arc = [0.05 * _towards(angle) for angle in angles]
    near, far = (distance * _towards(angle) for angle in (angles[0], angles[-1]))
    rows = np.array([0.3 * _towards(angles[0]), arc[0], near, *arc, far])
    return np.asarray(rows + np.array([lock, 0.0]))


def _passing(name: str, y: Array) -> Scene:
    """A mechanism at poses, all with the same rates and accelerations."""
    scene = replace(load_scene(SCENE), mechanism=load_mechanism(name), mechanism_file=mechanism_path(name))
    return still(scene, y, np.tile(_RATE, (len(y), 1)), np.tile(_ACCELERATION, (len(y), 1)))
