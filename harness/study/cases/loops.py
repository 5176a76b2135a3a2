"""Ladders of how loops are closed: Pinocchio's proximal settings, and redundant constraints in planar loops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from screwgauge.models.catalog import four_bars, load_mechanism
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.equations.kinematics import pose
from screwgauge.reference.graph import layout
from screwgauge.reference.mobility import mobility
from screwgauge.scene.read import load_scene
from screwgauge.study.cases.asking import ACCELERATION, ENGINES, SCREW, loaded, push
from screwgauge.study.cases.question import Question, put
from screwgauge.study.linkages import FILE, four_bar_states, write_four_bar
from screwgauge.study.methods import Method
from screwgauge.study.reference import PreparedScene, Reference, pose_scene, reference_values

ITERATIONS = (1, 2, 5)
SAMPLES = 3
_RESIDUAL = "mu times the last change of the multipliers (relative_residual)"
#: Regular poses (they are singular at crank = pi/2), at speed.
SCENE = """\
mechanism = "mechanism.toml"
gravity = [0, -9.81, 0]
[motion.crank]
polynomial = [0.3, -5, 4]
[time]
times = [0, 0.05, 0.1]
"""
_REGULAR = {"mu": 1e-10, "iterations": 5, "examine": True}  # whatever the rank; two iterations leave about 1e-15
_HARD = {"solimp": 0.9999, "passes": 10, "examine": True}  # the softness is not what is looked at here
_POINTS = Method("pinocchio", _REGULAR, "pinocchio 3D"), Method("mujoco", _HARD, "mujoco connect")
_FRAMES = (
    Method("pinocchio", {**_REGULAR, "frames": True}, "pinocchio 6D"),
    Method("mujoco", {**_HARD, "weld": True}, "mujoco weld"),
)
_LOCKED = "a closure by whole frames locks the hinge: {notes} of 1, which nothing says"


def proximal(mu: float, quick: bool, folder: Path) -> Iterator[Question]:
    """`constraintDynamics` over mu and the number of iterations, and with the settings by which motions are
    integrated, whatever mu."""
    posed = loaded(folder)
    yield push(posed, SCREW)
    yield replace(push(posed, *_proximal("full rank", mu)), by=_RESIDUAL)
    methods, mechanism = _proximal("deficient", mu), load_mechanism(FILE)
    files = dict.fromkeys((method.engine for method in methods), write_four_bar(folder))
    problem, exact = four_bar_states(SAMPLES)
    right = Reference.by_size("exact", mechanism, {ACCELERATION: exact})
    yield Question(mechanism, files, problem, methods, (ACCELERATION,), right, by=_RESIDUAL)


def _proximal(loop: str, mu: float) -> tuple[Method, ...]:
    label = f"pinocchio {loop}"
    counted = (Method("pinocchio", {"mu": mu, "iterations": n, "examine": True}, f"{label} {n}x") for n in ITERATIONS)
    return (*counted, Method("pinocchio", {"examine": True}, f"{label} safe"))


def redundant_constraints(loops: float, quick: bool, folder: Path) -> Iterator[Question]:
    """More and more loops, three redundant constraints each."""
    (folder / "mechanism.toml").write_text(four_bars(int(loops), driven=True), encoding="utf-8")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    posed = pose_scene(load_scene(folder / "scene.toml"), folder / "models", samples=SAMPLES)
    yield _forces(posed)
    yield push(posed, SCREW)
    for points, frames in zip(_POINTS, _FRAMES, strict=True):
        yield push(posed, points)
        yield replace(push(posed, frames), cause=_LOCKED)


def _forces(posed: PreparedScene) -> Question:
    """Forces from the motion, only the unique ones of the reactions."""
    mechanism, motion = posed.scene.mechanism, posed.scene.motion
    lay = layout(mechanism)
    counts = mobility(lay, pose(lay, positions(lay, motion.y[:1], motion.t[:1])))
    reactions = counts.names[: counts.constraints]
    unique = tuple(name for name, flag in zip(reactions, counts.unique, strict=False) if flag)
    kinds = [sorted({name.split(".")[1] for name in group}) for group in (unique, {*reactions} - {*unique})]
    quantities = "generalized_force", "reaction"
    right = reference_values(posed.scene, posed.t, quantities)
    values = {**right.values, "reaction": right.values["reaction"].pick(unique)}
    question = put(
        posed.scene,
        posed.folder,
        posed.problem(*quantities),
        tuple(map(Method, ENGINES)),
        quantities,
        Reference.by_size(right.engine, mechanism, values),
    )
    remark = (
        f"unique and compared: {', '.join(kinds[0])}; not unique, left out: {', '.join(kinds[1])} "
        f"({counts.overconstraints} redundant constraints)"
    )
    # what is open has no digit, which says nothing of what is unique
    return replace(question, admitted=dict.fromkeys(quantities, 0.0), remarks={"reaction": remark})
