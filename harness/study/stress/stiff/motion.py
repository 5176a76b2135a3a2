"""A short motion on stiff springs: scipy's methods on every engine's accelerations, and the engines' own steps."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import shorten

import numpy as np

from screwgauge.engines.integrators import load_integrator
from screwgauge.engines.tree.stepper import Stepper, integrate_steps
from screwgauge.models.catalog import mechanism_path
from screwgauge.models.generate import GRAVITY, stem, write_models
from screwgauge.problem import ForwardProblem, Method
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.forward import Forces, energy, forward
from screwgauge.reference.kinematics import Velocities, positions, velocities
from screwgauge.reference.pose import Layout, layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.stiffness import REACH, eigenvalues
from screwgauge.solution import ForwardSolution
from screwgauge.study.stress.case import GOOD, Finding
from screwgauge.study.stress.stiff.collocation import collocate
from screwgauge.study.stress.stiff.springs import leg_springs

DURATION = 0.1  # [s]
START = (0.01, -0.005)  # [rad] off the pose at which the springs are relaxed
RADAU = Method("Radau", 1e-5, 1e-7)
DOP853 = Method("DOP853", 1e-7, 1e-9)
MOST = 100  # steps that an explicit method may need for stability alone
STEPPERS = (
    Stepper("pinocchio", "Euler", 1e-4),
    Stepper("mujoco", "Euler", 1e-4, solimp=0.9999),
    Stepper("mujoco", "implicitfast", 1e-4, solimp=0.9999),
)
SUFFIX = {"screw": ".toml", "pinocchio": ".urdf", "mujoco": ".xml"}


@dataclass(frozen=True, slots=True, eq=False)
class Right:
    """The motion as it is.

    Attributes:
        rate: Poses and rates at the times. Shapes (n, ...).
        fastest: Largest eigenvalue at the start [1/s].
        scale: By which motions are measured: largest change of angles and of lengths, for each coordinate. (n_q,).
        released: Largest change of the energy [J].
        condition: Of the closed loops, at its worst.
    """

    lay: Layout
    forces: Forces
    times: Array
    rate: Velocities
    fastest: float
    scale: Array
    released: float
    condition: float


def right_motion(springs: tuple[JointSpring, ...]) -> Right:
    """The reference, in steps that grow with time as the motion gets slower."""
    lay = layout(load_scene("3ups-upu-s").mechanism)
    forces = Forces(gravity=np.array(GRAVITY), springs=springs)
    start = np.array(START)
    fastest = float(np.abs(eigenvalues(lay, forces, start, np.zeros(2))).max())
    first = min(0.1 / fastest, DURATION / 10)
    # four steps a decade, every fourth of them looked at
    grid = np.concatenate([[0.0], np.geomspace(first, DURATION, 1 + 4 * max(2, _decades(first)))])

    def slope(states: Array) -> Array:
        rate = _rates(lay, states)
        return np.concatenate([states[:, 2:], forward(lay, rate, forces).ydd], axis=1)

    states = collocate(slope, np.concatenate([start, np.zeros(2)]), grid)[[0, *range(1, len(grid), 4)]]
    rate = _rates(lay, states)
    change = np.abs(rate.pose.q - rate.pose.q[0]).max(axis=0)
    turns = np.array([turn for joint in lay.mechanism.joints for turn, _ in joint.freedoms])
    E = energy(lay, rate, forces)
    return Right(
        lay=lay,
        forces=forces,
        times=grid[[0, *range(1, len(grid), 4)]],
        rate=rate,
        fastest=fastest,
        scale=np.where(turns, change[turns].max(), change[~turns].max()),
        released=float(np.abs(E - E[0]).max()),
        condition=float(np.linalg.cond(rate.A).max()),
    )


def _decades(first: float) -> int:
    return int(np.ceil(np.log10(DURATION / first)))


def _rates(lay: Layout, states: Array) -> Velocities:
    return velocities(lay, positions(lay, states[:, :2], np.zeros(len(states))), states[:, 2:])


def climb(stiffness: float) -> Iterator[Finding]:
    """Every engine and method at one stiffness."""
    scene = load_scene("3ups-upu-s")
    springs = leg_springs(scene.mechanism, stiffness)
    right = right_motion(springs)
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        write_models(scene.mechanism, Path(folder))
        problem = make_problem(springs, right.times)
        yield from explicit(problem, right)
        for engine in SUFFIX:
            yield from integrated(f"{engine} Radau", _of(problem, engine, Path(folder)), right)
        for stepper in STEPPERS:
            own = _of(problem, stepper.engine, Path(folder))
            yield from _stepped(f"{stepper.engine} {stepper.integrator}", own, right, stepper)


def make_problem(springs: tuple[JointSpring, ...], times: Array) -> ForwardProblem:
    """The motion as `screw` is given it."""
    return ForwardProblem(
        model=mechanism_path("3ups-upu-s"),
        loops=None,
        gravity=np.array(GRAVITY),
        loads=(),
        springs=springs,
        motors=(),
        start=np.array(START),
        rates=np.zeros(2),
        times=times,
        method=RADAU,
    )


def _of(problem: ForwardProblem, engine: str, folder: Path) -> ForwardProblem:
    """The problem with an engine's own model file."""
    if engine == "screw":
        return problem
    name = stem("3ups-upu-s", "minimal")
    return replace(problem, model=folder / f"{name}{SUFFIX[engine]}", loops=folder / f"{name}.loops.toml")


def explicit(problem: ForwardProblem, right: Right) -> Iterator[Finding]:
    """DOP853, unless the step that keeps it stable is too short."""
    steps = DURATION * right.fastest / REACH
    if steps <= MOST:
        yield from integrated("screw DOP853", replace(problem, method=DOP853), right)
        return
    reason = (
        f"stiff for an explicit method: the eigenvalue of {right.fastest:.2g} 1/s bounds its step to "
        f"{REACH / right.fastest:.1e} s, {steps:.0f} steps for stability alone"
    )
    yield from _refused("screw DOP853", reason)


def integrated(label: str, problem: ForwardProblem, right: Right) -> Iterator[Finding]:
    """One of scipy's methods on an engine's accelerations; its tolerance says what it admits."""
    method = problem.method

    def admits(found: ForwardSolution) -> tuple[float, str]:
        # of one step, since what is damped adds nothing up; relative to an angle, not to how far it moves
        each = (method.rtol * float(np.abs(START).max()) + method.atol) / float(right.scale.min())
        return each, f"the tolerance, {method.rtol:g},"

    yield from _findings(label, lambda: load_integrator(label.split()[0])(problem), admits, right)


def _stepped(label: str, problem: ForwardProblem, right: Right, stepper: Stepper) -> Iterator[Finding]:
    """An engine's own steps, of which nothing is admitted."""
    words = "loops soft even at d = 0.9999 and " if stepper.engine == "mujoco" else ""
    cause = f"{words}steps of 0.1 ms, however fast the motion; nothing estimates their error"
    yield from _findings(label, lambda: integrate_steps(problem, stepper), lambda _: (0.0, cause), right)


def _findings(
    label: str,
    integrate: Callable[[], ForwardSolution],
    admits: Callable[[ForwardSolution], tuple[float, str]],
    right: Right,
) -> Iterator[Finding]:
    """Both quantities, or why there are none.

    Args:
        admits: Scaled error that a solution admits, and in which words.
    """
    try:
        found = integrate()
    except ScrewgaugeError as error:
        yield from _refused(label, str(error))
        return
    if found.stopped:
        yield from _refused(label, found.stopped)
        return
    bound, words = admits(found)
    errors = (("motion", _motion(found.q, right)), ("energy", _energy(found, right)))
    for (quantity, value), factor in zip(errors, (1.0, 2.0), strict=True):  # energy is quadratic
        admitted = max(GOOD, factor * bound)
        reason = f"{words} admits {admitted:.1e}" if bound else words
        yield Finding(label, quantity, value, admitted, right.condition, found.seconds, reason if value > GOOD else "")


def _refused(label: str, reason: str) -> Iterator[Finding]:
    reason = shorten(reason, 200, placeholder=" ...")  # some name a whole state
    for quantity in ("motion", "energy"):
        yield Finding(label, quantity, reason=reason)


def _motion(q: Array, right: Right) -> float:
    """Largest error of joint positions against the largest change."""
    return float((np.abs(q - right.rate.pose.q) / right.scale).max())


def _energy(found: ForwardSolution, right: Right) -> float:
    """What is missing in kinetic energy, springs, gravity and the work of dampers, against what was released."""
    yd = right.lay.mechanism.independent_columns
    rate = velocities(right.lay, positions(right.lay, found.q[:, yd], np.zeros(len(found.q))), found.v[:, yd])
    E = energy(right.lay, rate, right.forces) - found.work
    return float(np.abs(E - E[0]).max() / right.released)
