"""Stress tests of closed loops: Pinocchio's proximal settings, redundant constraints, and MuJoCo's soft loops.

Soft constraints limit how small the errors in loop gap, force and energy can get; refinement removes this limit, but a
smaller time step does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from screwgauge.judging.answer import answer_at
from screwgauge.judging.residuals import energies
from screwgauge.models.catalog import four_bars, load_mechanism
from screwgauge.models.files.loops import loops_of
from screwgauge.models.generate import write_models
from screwgauge.problem import InitialValue, Integration, Problem
from screwgauge.quantities import natural_scales
from screwgauge.reference.applied import hold
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import mobility
from screwgauge.scene.read import load_scene
from screwgauge.solution import Solution, Values
from screwgauge.study.bench.question import (
    ACCELERATION,
    ENGINES,
    SCENE,
    SCREW,
    UNKNOWN,
    Question,
    closure_residuals,
    files_of,
    loaded_scene,
    loop_condition,
    pose_question,
    push,
    tree_coordinates,
    true_velocities,
    with_integration,
)
from screwgauge.study.linkages import FILE, four_bar_states, write_four_bar
from screwgauge.study.methods import Method
from screwgauge.study.reference_values import PreparedScene, Reference, pose_scene, reference_values, sizes
from screwgauge.study.solving import solve

REGULAR_SAMPLES = 3
_RESIDUAL = "mu times the last change of the multipliers (relative_residual)"
#: Regular poses in motion (poses with crank = pi/2 are singular).
REGULAR_SCENE = """\
mechanism = "mechanism.toml"
gravity = [0, -9.81, 0]
[motion.crank]
polynomial = [0.3, -5, 4]
[time]
times = [0, 0.05, 0.1]
"""


def proximal(mu: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Yield questions for `constraintDynamics` over mu and iterations, including settings that integrate motions."""
    posed = loaded_scene(folder)
    yield push(posed, SCREW)
    yield replace(push(posed), by=_RESIDUAL, of="full rank")
    mechanism, files = load_mechanism(FILE), {"pinocchio": write_four_bar(folder)}
    problem, exact = four_bar_states(REGULAR_SAMPLES)
    right = Reference.by_size("exact", mechanism, {ACCELERATION: exact})
    yield Question(mechanism, files, problem, (), (ACCELERATION,), right, by=_RESIDUAL, of="deficient")


def redundant_constraints(loops: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Yield questions about a mechanism with a given number of loops, each of which has three redundant constraints."""
    (folder / "mechanism.toml").write_text(four_bars(int(loops), driven=True), encoding="utf-8")
    (folder / "scene.toml").write_text(REGULAR_SCENE, encoding="utf-8")
    posed = pose_scene(load_scene(folder / "scene.toml"), folder / "models", samples=REGULAR_SAMPLES)
    yield _forces(posed)
    yield push(posed, SCREW)
    yield push(posed)


def _forces(posed: PreparedScene) -> Question:
    """Pose the question for the forces of a motion, including only reactions with a unique value."""
    mechanism, motion = posed.scene.mechanism, posed.scene.motion
    lay = layout(mechanism)
    counts = mobility(lay, positions(lay, motion.y[:1], motion.t[:1]))
    reactions = counts.names[: counts.constraints]
    unique = tuple(name for name, flag in zip(reactions, counts.unique, strict=False) if flag)
    kinds = [sorted({name.split(".")[1] for name in group}) for group in (unique, {*reactions} - {*unique})]
    quantities = "generalized_force", "reaction"
    right = reference_values(posed.scene, posed.t, quantities)
    values = {**right.values, "reaction": right.values["reaction"].pick(unique)}
    question = pose_question(
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
    # undetermined reactions have no correct digit, and must not excuse errors in the unique ones
    return replace(question, admitted=dict.fromkeys(quantities, 0.0), remarks={"reaction": remark})


QUANTITIES = ("loop_gap", "constraint_force", "energy", "joint_position")
#: Tolerances of the reference, whose error after a second is about 1e-11 of the motion, and of `screw`.
TIGHT, OWN = 1e-12, 1e-11
INSTANT, SAMPLES = 1.0, 11  # instant [s] of the default scene at which all terms contribute; number of samples
DURATION, QUICK_DURATION = 1.0, 0.3  # [s]


def softness(dt: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Simulate the loaded default scene under constant actuator forces with MuJoCo's own integrators."""
    scene = load_scene(SCENE)
    write_models(scene.mechanism, folder, gravity=scene.applied.g)
    right = constant_force_motion(QUICK_DURATION if quick else DURATION, SAMPLES)
    exact = replace(right, files=files_of(scene, folder))
    yield with_integration(exact, Integration(rtol=OWN, atol=OWN))
    yield replace(exact, right=tree_reference(exact), methods=())


def refinement(softness: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Yield questions that apply the last constraint force as an external force and solve for accelerations again."""
    posed = loaded_scene(folder)
    yield push(posed, SCREW)
    yield replace(push(posed), condition=loop_condition(true_velocities(posed)))


@lru_cache(maxsize=4)
def constant_force_motion(duration: float, samples: int, tolerance: float = TIGHT) -> Question:
    """Pose the default scene from `INSTANT` on under constant actuator forces, with reference values from `screw`."""
    scene = load_scene(SCENE).at([INSTANT])
    mechanism, motion = scene.mechanism, scene.motion
    forces = solve(scene, ("screw",), ("actuator_force",))[0]["screw"].values["actuator_force"].array[0]
    driven = [joint.coordinates[0] for joint in mechanism.actuators]
    applied = scene.under(motors=hold(dict(zip(driven, forces.tolist(), strict=True)))).applied
    integration, t = Integration(rtol=tolerance, atol=tolerance), np.linspace(0.0, duration, samples)
    task = InitialValue(motion.y[0].copy(), motion.yd[0].copy(), 0.0, t, integration)
    problem = Problem(applied, task, frozenset(("joint_position", "joint_velocity", "reaction")))
    question = replace(pose_question(scene, Path(), problem, (SCREW,), QUANTITIES, UNKNOWN), read=read)
    solution = SCREW.load(question.files["screw"]).solve(question.problem)
    if solution.stopped:
        raise ScrewgaugeError(solution.stopped, f"{scene.name} held at {INSTANT:g} s", "choose a shorter time")
    values = read(question, solution)
    return replace(question, right=_by_largest(question.mechanism, values), condition=float(solution.condition.max()))


def tree_reference(question: Question) -> Reference:
    """Return reference values for the coordinates of MuJoCo's tree and for the forces that close its loops."""
    values, mechanism = question.right.values, question.mechanism
    closing = tuple(f"{closure.joint}.f{axis}" for closure in loops_of(mechanism, "minimal").closures for axis in "xyz")
    force, q = values["constraint_force"].pick(closing), values["joint_position"].pick(tree_coordinates(mechanism))
    return _by_largest(mechanism, {**values, "constraint_force": force, "joint_position": q})


def read(question: Question, solution: Solution) -> Mapping[str, Values]:
    """Return loop gap, constraint forces, energy and joint positions; the tree coordinates place the bodies."""
    rows = np.arange(len(solution.condition))
    answer = answer_at(question.mechanism, question.problem, solution, rows)
    gaps = np.linalg.norm(closure_residuals(answer.motion)[0], axis=2)
    return {
        "loop_gap": Values(("largest",), ("m",), gaps.max(axis=1)[:, None]),
        "constraint_force": solution.values["reaction"],
        "energy": Values(("energy",), ("J",), np.sum(energies(answer), axis=0)[:, None]),
        "joint_position": solution.values["joint_position"],
    }


def _by_largest(mechanism: Mechanism, values: Mapping[str, Values]) -> Reference:
    """Build a reference with closed loops that scales each quantity by its largest magnitude."""
    gap, force, energy, q = (values[name] for name in QUANTITIES)
    largest = float(np.abs(force.array).max())
    scales = {
        "loop_gap": {"m": natural_scales(mechanism)["m"]},
        "constraint_force": {"N": largest, "N m": largest},
        "energy": {"J": float(np.abs(energy.array - energy.array[0]).max())},
        "joint_position": sizes(q),
    }
    closed = Values(gap.components, gap.units, np.zeros_like(gap.array))
    return Reference("screw", {**values, "loop_gap": closed}, "", scales)
