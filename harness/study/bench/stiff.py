"""Stress tests with stiff springs and dampers across prismatic joints: accelerations, a short motion and its energy.

The reference is Radau collocation of high order that evaluates all stages of a step at once. Ten stages have order
nineteen and damp fast components, so that few steps suffice to reach rounding. The tested integrators share no code
with this method.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from screwgauge.models.generate import write_models
from screwgauge.problem import InitialValue, Integration, Problem, States
from screwgauge.reference import linear
from screwgauge.reference.applied import GRAVITY, Applied, JointSpring
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed_motion import ClosedMotion, motion_at
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.idle_motion import rule
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.simulation import REACH, eigenvalues
from screwgauge.solution import Solution, Values
from screwgauge.study.bench.question import (
    ACCELERATION,
    SCENE,
    SCREW,
    Question,
    loaded_scene,
    loop_condition,
    pose_question,
    push,
    true_velocities,
    with_integration,
)
from screwgauge.study.methods import Method
from screwgauge.study.reference_values import PreparedScene, Reference

#: Damping ratio at home: overdamped, so that eigenvalues are real; the fastest is 1e5 1/s for 1e10 N/m.
DAMPING = 1.2
SAFETY = 8.0  # factor for rounding of a spring's force: of its length, product and sum, in both directions
DURATION = 0.1  # duration of the motion [s]
START = (0.01, -0.005)  # start [rad], relative to the pose at which the springs are relaxed
RADAU = Integration("Radau", 1e-5, 1e-7)
DOP853 = Integration("DOP853", 1e-7, 1e-9)
MOST_STEPS = 100  # largest number of steps that an explicit method may need for stability alone
QUANTITIES = ("motion", "energy")
_PUSHED = (
    Method("pinocchio", {"mu": 1e-10, "iterations": 5}),
    Method("mujoco", {"solimp": 0.9999, "passes": 6}),  # the softness of constraints is not examined here
)
_RADAU = tuple(Method(engine, label=f"{engine} Radau") for engine in ("screw", "pinocchio", "mujoco"))


def stiff_legs(stiffness: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Yield questions on the 3-UPS-UPU-S with four springs: accelerations, and integrated motions."""
    yield from accelerations(stiffness, folder)
    question, fastest = motion(leg_springs(load_scene(SCENE).mechanism, stiffness), folder)
    yield explicit_method(question, fastest)
    yield admit_tolerance(question, RADAU, *_RADAU)
    yield question


def leg_springs(mechanism: Mechanism, stiffness: float) -> tuple[JointSpring, ...]:
    """Put a spring and damper along every actuated joint, relaxed in the home pose.

    Args:
        stiffness: Stiffness of each spring [N/m].
    """
    lay, home = layout(mechanism), mechanism.home[None]
    at = motion_at(lay, home, np.zeros((1, len(mechanism.independent))))
    fastest = np.linalg.eigvals(np.linalg.solve(at.inertia_matrix[0], at.B[0].T @ at.B[0])).real.max()
    damping = 2.0 * DAMPING * float(np.sqrt(stiffness / fastest))
    return tuple(
        JointSpring(mechanism.coordinates[i], stiffness, float(home[0, i]), damping) for i in mechanism.actuated_columns
    )


def accelerations(stiffness: float, folder: Path) -> Iterator[Question]:
    """Yield questions about the loaded default scene with springs, whose forces the actuators compensate."""
    posed = loaded_scene(folder)
    springs, at = leg_springs(posed.scene.mechanism, stiffness), true_velocities(posed)
    admitted = {ACCELERATION: _spring_rounding(posed, springs, at)}
    for method in (SCREW, *_PUSHED):
        question = push(posed, method)
        yield replace(
            question,
            problem=_with_springs(posed, question.problem, springs, method.engine, at),
            admitted=admitted,
            by="the rounding of spring forces, eps times stiffness times length,",
            condition=loop_condition(at),
        )


def _with_springs(
    posed: PreparedScene, problem: Problem, springs: tuple[JointSpring, ...], engine: str, at: ClosedMotion
) -> Problem:
    """Return the problem with springs and with actuator forces that compensate them."""
    states = problem.task
    if not isinstance(states, States) or states.tau is None:
        raise TypeError("the task has no forces")
    f, tau = posed.reference.values["actuator_force"].array, states.tau.copy()
    for i, spring in enumerate(springs):
        k = states.coordinates.index(spring.coordinate)
        pull = spring.stiffness * (states.q[:, k] - spring.rest) + spring.damping * states.v[:, k]
        # Pinocchio has no springs, so their forces are added with the loads, before the actuator forces
        tau[:, k] = (tau[:, k] - f[:, i] + pull) - pull + f[:, i] if engine == "pinocchio" else tau[:, k] + pull
    if engine == SCREW.engine:  # `screw` gets the poses that it computes itself
        states = replace(states, q=at.q, v=at.joint_velocity)
    carried = () if engine == "pinocchio" else springs
    return replace(problem, applied=replace(problem.applied, springs=carried), task=replace(states, tau=tau))


def _spring_rounding(posed: PreparedScene, springs: tuple[JointSpring, ...], at: ClosedMotion) -> float:
    """Return the scaled error in accelerations that rounding of the springs' lengths and velocities may cause."""
    lay = layout(posed.scene.mechanism)
    states, spring = posed.states(tuple(spring.coordinate for spring in springs)), springs[0]
    largest = spring.stiffness * np.abs(states.q) + spring.damping * np.abs(states.v)
    force = SAFETY * linear.EPS * float(largest.max())
    columns = lay.mechanism.columns(states.coordinates)
    K = at.joint_map
    moved = np.linalg.solve(at.inertia_matrix, K[:, columns].swapaxes(1, 2))
    joints = force * np.abs(K @ moved).sum(axis=2).max(axis=0)
    scales, like = posed.reference.scales[ACCELERATION], posed.reference.values[ACCELERATION]
    return float((joints / np.array([scales[unit] for unit in like.units])).max())


def motion(springs: tuple[JointSpring, ...], folder: Path) -> tuple[Question, float]:
    """Return a short motion from rest, without methods, and its largest eigenvalue at the start [1/s].

    The reference values come from collocation, in steps that grow as the motion gets slower.
    """
    scene = load_scene(SCENE)
    mechanism, lay = scene.mechanism, layout(scene.mechanism)
    applied, start, rest = Applied(gravity=np.array(GRAVITY), springs=springs), np.array(START), np.zeros(2)
    write_models(mechanism, folder, gravity=applied.g)
    fastest = float(np.abs(eigenvalues(lay, applied, start, rest)).max())
    first = min(0.1 / fastest, DURATION / 10)
    decades = int(np.ceil(np.log10(DURATION / first)))
    # four steps per decade, of which every fourth is compared
    grid = np.concatenate([[0.0], np.geomspace(first, DURATION, 1 + 4 * max(2, decades))])
    looked_at = [0, *range(1, len(grid), 4)]

    def slope(states: Array) -> Array:
        return np.concatenate([states[:, 2:], _closed_motion(lay, states, applied).ydd], axis=1)

    at = _closed_motion(lay, collocate(slope, np.concatenate([start, rest]), grid)[looked_at], applied)
    change, E = np.abs(at.q - at.q[0]).max(axis=0), at.energy
    values = {
        "motion": Values(mechanism.coordinates, mechanism.units, at.q),
        "energy": Values(("energy",), ("J",), np.zeros((len(looked_at), 1))),
    }
    scales = {
        "motion": {"rad": float(change[lay.turns].max()), "m": float(change[~lay.turns].max())},
        "energy": {"J": float(np.abs(E - E[0]).max())},
    }
    task, wanted = InitialValue(start, rest, 0.0, grid[looked_at]), frozenset(("joint_position", "joint_velocity"))
    right = Reference("collocation", values, "", scales)
    question = pose_question(scene, folder, Problem(applied, task, wanted), _RADAU, QUANTITIES, right)
    condition = float(np.linalg.cond(at.system.A[..., : at.loops.moving]).max())
    return replace(question, methods=(), read=read, condition=condition), fastest


def _closed_motion(lay: Layout, states: Array, applied: Applied) -> ClosedMotion:
    return motion_at(lay, positions(lay, states[:, :2], np.zeros(len(states))), states[:, 2:], applied=applied)


def admit_tolerance(question: Question, integration: Integration, *methods: Method) -> Question:
    """Pose the motion to one of scipy's methods, admitting errors up to its tolerance."""
    # the error of one step, since damping removes earlier ones; relative to an angle, not to its travel
    each = integration.rtol * max(map(abs, START)) + integration.atol
    each /= min(question.right.scales["motion"].values())
    return replace(
        with_integration(question, integration),
        methods=methods,
        admitted={"motion": each, "energy": 2.0 * each},  # energy is quadratic
        by=f"the tolerance, {integration.rtol:g},",
    )


def explicit_method(question: Question, fastest: float) -> Question:
    """Pose the motion to DOP853, which is not asked if its stable steps would be too short."""
    steps, reason = DURATION * fastest / REACH, ""
    if steps > MOST_STEPS:
        reason = (
            f"stiff for an explicit method: the eigenvalue of {fastest:.2g} 1/s limits its step to "
            f"{REACH / fastest:.1e} s, {steps:.0f} steps for stability alone"
        )
    return replace(admit_tolerance(question, DOP853, Method("screw", label="screw DOP853")), refused=reason)


def read(question: Question, solution: Solution) -> Mapping[str, Values]:
    """Return joint positions, and the deficit in the sum of kinetic and potential energy and the work of dampers."""
    lay, columns = layout(question.mechanism), question.mechanism.independent_columns
    q, v = (solution.values[name].array[:, columns] for name in ("joint_position", "joint_velocity"))
    moving = _closed_motion(lay, np.concatenate([q, v], axis=1), question.problem.applied)
    missing = moving.energy - np.asarray(solution.work)
    return {
        "motion": solution.values["joint_position"],
        "energy": Values(("energy",), ("J",), (missing - missing[0])[:, None]),
    }


STAGES = 10
MOST_ITERATIONS = 40  # largest number of iterations of the simplified Newton method
CLOSE = 1e-13  # change in the last iteration, relative to each component's largest value
DIFFERENCE = 2.0**-17  # step of central differences: the cube root of the rounding error

Slope = Callable[[Array], Array]
"""Derivatives of states, one state per row. Shape (n, m) -> (n, m)."""


def collocate(slope: Slope, state: Array, times: Array) -> Array:
    """Integrate an autonomous system, taking one step from each time to the next.

    Args:
        state: State at the first time. Shape (m,).
        times: Increasing times. Shape (n,).

    Returns:
        States at the times. Shape (n, m).

    Raises:
        ScrewgaugeError: A step does not converge.
    """
    states = [np.asarray(state, dtype=float)]
    largest = np.abs(states[0])
    for t, h in zip(times, np.diff(times), strict=False):
        states.append(_step(slope, states[-1], float(h), largest=largest, t=float(t)))
        largest = np.maximum(largest, np.abs(states[-1]))
    return np.array(states)


def _step(slope: Slope, state: Array, h: float, *, largest: Array, t: float) -> Array:
    (_, _, A, _), m = rule(STAGES), len(state)
    size = DIFFERENCE * np.maximum(np.abs(state), 1.0)
    slopes = slope(np.concatenate([state + np.diag(size), state - np.diag(size)]))
    J = ((slopes[:m] - slopes[m:]) / (2.0 * size[:, None])).T
    inverse = np.linalg.inv(np.eye(STAGES * m) - h * np.kron(A, J))
    Y = np.tile(state, (STAGES, 1))
    last = np.inf
    for _ in range(MOST_ITERATIONS):
        left = state + h * (A @ slope(Y)) - Y
        change = (inverse @ left.ravel()).reshape(Y.shape)
        Y = Y + change
        # damped components are scaled by their earlier magnitude
        scale = np.maximum(np.abs(Y).max(axis=0), 1e-3 * largest).clip(1e-300)
        relative = float((np.abs(change).max(axis=0) / scale).max())
        if relative < CLOSE or (relative < 1e-9 and relative > 0.5 * last):  # converged to rounding
            return np.asarray(Y[-1])
        last = relative
    raise ScrewgaugeError(
        f"a step of {h:g} s does not converge (last relative change {last:.1e})", f"t = {t:g} s", "use shorter steps"
    )
