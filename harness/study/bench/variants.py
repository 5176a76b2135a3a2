"""Variants of the solver `screw`, which show the effect of its parts, its precision and common shortcuts.

`variant` puts a function in the place of an engine. The functions in `VARIANTS` answer given motions; their
actuator forces have minimum norm, and they do not estimate errors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from screwgauge import __version__
from screwgauge.models.catalog import load_mechanism
from screwgauge.problem import GivenMotion, ModelFiles, Problem, Progress, quiet
from screwgauge.quantities import component_names
from screwgauge.reference.applied import Applied
from screwgauge.reference.closed.assembly_mode import closed_form_positions, positions
from screwgauge.reference.closed.loops import LoopEquations, loop_equations
from screwgauge.reference.closed.newton import newton as newtons_method
from screwgauge.reference.closed.newton import velocity_map
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.equations.dynamics import QUANTITIES
from screwgauge.reference.equations.kinematics import gaps, twists
from screwgauge.reference.errors import ClosureError, DescriptionError
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.precision import in_precision, round_to
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Values, empty
from screwgauge.study.bench.scheme import integrate
from screwgauge.study.methods import Method

Arrays = Mapping[str, Array]
STEP = 0.1  # largest distance from a corrected sample [rad or m]
#: Quantity -> number of times that `numpy.gradient` is applied to positions.
ORDER = {"joint_velocity": 1, "joint_acceleration": 2}


class Variant:
    """Loaded variant, a function of layout and problem that returns either quantity -> array or a solution."""

    def __init__(self, lay: Layout, function: Callable[..., Arrays | Solution]) -> None:
        self.lay, self.function, mechanism = lay, function, lay.mechanism
        self.names = component_names(mechanism.joints, (), {}, (), mechanism.actuator_names, ((), ()))

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Solve a problem.

        Raises:
            ScrewgaugeError: The function cannot solve it.
        """
        answer = self.function(self.lay, problem)
        if isinstance(answer, Solution):
            return answer
        values = {name: Values(*self.names[name], array) for name, array in answer.items()}
        return Solution("screw", __version__, values, empty(len(problem.task)))


def load_variant(
    files: ModelFiles, *, function: Callable[..., Arrays | Solution], dtype: str = "", **settings: Any
) -> Variant:
    """Load a description for a variant.

    Args:
        function: Module-level function, see `Variant`.
        dtype: Precision from the first operation to the last; double by default.
        settings: Settings of the function.
    """
    lay = layout(load_mechanism(files.model))
    if dtype:
        lay = layout(in_precision(lay.mechanism, np.dtype(dtype)))
    return Variant(lay, partial(function, **settings))


def variant(engine: str, function: Callable[..., Arrays | Solution], label: str = "", **settings: Any) -> Method:
    """Return a method that runs a function with settings in place of an engine; see `load_variant`."""
    return Method(engine, {"function": function, **settings}, label, load_variant)


def given_motion(problem: Problem) -> GivenMotion:
    """Return the motion of a problem.

    Raises:
        DescriptionError: The task of the problem is not a given motion.
    """
    if not isinstance(problem.task, GivenMotion):
        raise DescriptionError("the task is not a given motion", "variant of screw", "pass a GivenMotion")
    return problem.task


def nothing(lay: Layout, problem: Problem) -> Arrays:
    """Loop over the samples without computing anything."""
    for _ in range(len(given_motion(problem))):
        pass
    return {}


def closed_form(lay: Layout, problem: Problem, *, mended: bool = False) -> Arrays:
    """Compute the wanted quantities from positions in closed form.

    Args:
        mended: Use Newton's method if the closed form leaves the loops open; otherwise they stay open.

    Raises:
        ClosureError: The mechanism has no closed form.
    """
    motion = round_to(given_motion(problem), lay.path.dtype)
    q = closed_form_positions(lay, motion.y)
    if q is None:
        raise ClosureError("no closed form", "this mechanism", "use a mechanism whose chains are all U-P-U or U-P-S")
    if mended and np.abs(gaps(lay, q)).max() > 64 * np.finfo(q.dtype).eps:
        system, goals = _loop_equations(lay, motion.y)
        z = newtons_method(system.evaluate, system.unknowns(q), goals, most=5)[0]
        q = system.coordinates(z, q)
    return _wanted_values(lay, problem, motion, q)


def newton(lay: Layout, problem: Problem, *, steps: int) -> Arrays:
    """Compute positions with a fixed number of Newton steps, from predictions along the path from the home pose.

    Each prediction starts from a corrected sample at most `STEP` away, and is not checked.
    """
    motion = given_motion(problem)
    home, (system, goals) = lay.mechanism.home, _loop_equations(lay, motion.y)
    z = np.tile(system.unknowns(home), (len(motion), 1))
    at, near, K = z[0], goals[0], np.zeros((z.shape[1], goals.shape[1]))
    for i, y in enumerate(goals):
        z[i] = at + K @ (y - near)
        if i == 0 or np.abs(y - near).max() > STEP:
            (at,), matrix, _ = newtons_method(system.evaluate, z[i : i + 1], y[None])
            z[i], near, K = at, y, velocity_map(matrix, len(y))[0]
    if steps:
        z = newtons_method(system.evaluate, z, goals, most=steps)[0]
    return _wanted_values(lay, problem, motion, system.coordinates(z, np.tile(home, (len(z), 1))))


def differences(lay: Layout, problem: Problem) -> Arrays:
    """Differentiate positions with `numpy.gradient`; the times must be evenly spaced."""
    motion, out = given_motion(problem), {}
    q = positions(lay, motion.y, motion.t)
    step = float(motion.t[-1] - motion.t[0]) / (len(motion) - 1)
    for name in sorted(problem.wanted, key=lambda name: ORDER[name]):
        derivative = q
        for _ in range(ORDER[name]):
            derivative = np.gradient(derivative, step, axis=0)
        out[name] = derivative
    return out


def without_drift(lay: Layout, problem: Problem) -> Arrays:
    """Compute accelerations from ``A a = [0; ydd]``, neglecting the velocity terms of the loops."""
    motion = given_motion(problem)
    at = loop_equations(lay).closing_system(positions(lay, motion.y, motion.t))
    a = at.solve(motion.ydd)
    return {"joint_acceleration": at.joint_rates(a, twists(at.pose, a))}


def paper(lay: Layout, problem: Problem, *, twist: str, method: str) -> Arrays:
    """Run the paper's own scheme from the first pose, see `screwgauge.study.bench.scheme.integrate`.

    The motion must contain every step of the method and, for ``rk4``, the halfway points; values are returned at the
    steps.
    """
    q, w, beta = integrate(lay, given_motion(problem), twist=twist, method=method)
    return {"joint_position": q, "joint_velocity": w, "joint_acceleration": beta}


#: Name -> function of the variant.
VARIANTS: dict[str, Callable[..., Arrays]] = {
    "nothing": nothing,
    "closed form": closed_form,
    "newton": newton,
    "differences": differences,
    "without drift": without_drift,
    "paper": paper,
}


def _loop_equations(lay: Layout, y: Array) -> tuple[LoopEquations, Array]:
    """Return the loop equations and the dimensionless independent coordinates. Shape (n, k)."""
    system = loop_equations(lay)
    return system, y / system.sizes[system.y_columns]


def _wanted_values(lay: Layout, problem: Problem, motion: GivenMotion, q: Array) -> Arrays:
    """Compute the wanted quantities from joint positions, in the precision of the positions.

    Raises:
        TypeError: An operation changed the precision.
    """
    given, wanted = problem.applied, problem.wanted
    applied = Applied(given.g.astype(q.dtype), tuple(round_to(load, q.dtype) for load in given.loads))
    at = motion_at(lay, q, motion.yd, motion.ydd, applied)
    out = {name: q if name == "joint_position" else np.array(QUANTITIES[name](at)) for name in wanted}
    if any(array.dtype != lay.path.dtype for array in out.values()):
        raise TypeError(f"some steps were not computed in {lay.path.dtype}")
    return out
