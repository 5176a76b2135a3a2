"""Actuator forces read from the Newton-Euler system of all bodies at once, in place of virtual power."""

from __future__ import annotations

import numpy as np

from screwgauge import __version__
from screwgauge.problem import GivenMotion, Problem
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import closed_form_positions, positions
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.equations.forward import NewtonEuler, force_matrix
from screwgauge.reference.equations.kinematics import pose
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.mechanism import in_precision
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Stopwatch, Values

_FORCE = "actuator_force"


def solve_whole_system(lay: Layout, problem: Problem, task: GivenMotion, *, refined: bool) -> Solution:
    """Actuator forces of smallest norm from eqs. (57)-(58), all reactions being unknowns beside them.

    Args:
        refined: One step of iterative refinement, its residual from a wider matrix; see `wide_force_matrix`.

    Returns:
        ``actuator_force`` alone, and as estimate of its error the rounding times the condition of the system.
    """
    clock, mechanism = Stopwatch(), lay.mechanism
    q = positions(lay, task.y, task.t, (task.yd, task.ydd))
    system = NewtonEuler(motion_at(lay, q, task.yd, task.ydd, problem.applied, task.t))
    unknown = system.solve(system.need[..., None], wide_force_matrix(lay, task.y) if refined else None)[..., 0]
    f = np.asarray(unknown[:, len(system.names) :], dtype=float)
    return Solution(
        "screw",
        __version__,
        {_FORCE: Values(mechanism.actuator_names, mechanism.actuator_units, f)},
        system.condition,
        estimate={_FORCE: linear.EPS * system.condition},
        conditions={_FORCE: system.condition},
        setting="whole Newton-Euler system" + (", refined" if refined else ""),
        cost=clock.cost(),
    )


def wide_force_matrix(lay: Layout, y: Array) -> Array | None:
    """The matrix c of eq. (57) in numpy's longest format, at poses known in closed form.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).

    Returns:
        See `force_matrix`. None where that format is no wider than a double, or the closed form leaves the loops open.
    """
    wider = np.finfo(np.longdouble)
    if not wider.eps < np.finfo(float).eps:
        return None
    lay = layout(in_precision(lay.mechanism, np.longdouble))
    q = closed_form_positions(lay, y.astype(np.longdouble))
    if q is None:
        return None
    at = pose(lay, q)
    closed = np.abs(at.residual).max(initial=0.0) < 64 * wider.eps
    return force_matrix(at, at.q, at.S) if closed else None
