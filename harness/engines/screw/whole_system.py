"""Actuator forces read from the Newton-Euler system of all bodies, in place of virtual power."""

from __future__ import annotations

import numpy as np

from screwgauge import __version__
from screwgauge.problem import GivenMotion, Problem
from screwgauge.reference import linear
from screwgauge.reference.dynamics import (
    body_motion,
    force_matrix,
    joint_reactions,
    preload_rows,
    required_wrench,
    solve_newton_euler,
)
from screwgauge.reference.kinematics import accelerations, positions, velocities
from screwgauge.reference.pose import Layout
from screwgauge.reference.precision import wide_force_matrix
from screwgauge.solution import Solution, Stopwatch, Values

_FORCE = "actuator_force"


def solve_whole_system(lay: Layout, problem: Problem, task: GivenMotion, *, refined: bool) -> Solution:
    """Actuator forces of smallest norm from eqs. (57)-(58), all reactions being unknowns beside them.

    Args:
        refined: One step of iterative refinement, its residual from a wider matrix; see `wide_force_matrix`.

    Returns:
        ``actuator_force`` alone, and as estimate of its error the rounding times the condition of the system.
    """
    clock, applied, mechanism = Stopwatch(), problem.applied, lay.mechanism
    at = positions(lay, task.y, task.t)
    rate = velocities(lay, at, task.yd)
    motion = body_motion(lay, at, rate.V, accelerations(lay, rate, task.ydd)[1])
    F, T = required_wrench(lay, at, motion, applied.g, applied.loads)
    reactions = joint_reactions(lay, at)
    c = force_matrix(lay, at, motion.com, reactions)
    rule = preload_rows(rate.K[:, mechanism.actuated_columns], c.shape[2])
    wide = wide_force_matrix(lay, task.y) if refined else None
    unknown, condition = solve_newton_euler(c, F, T, rule, reactions, rate.system.length, wide=wide)
    f = np.asarray(unknown[:, len(reactions.names) :], dtype=float)
    units = tuple("N m" if joint.kind == "R" else "N" for joint in mechanism.actuators)
    return Solution(
        "screw",
        __version__,
        {_FORCE: Values(mechanism.actuator_names, units, f)},
        condition,
        estimate={_FORCE: linear.EPS * condition},
        conditions={_FORCE: condition},
        setting="whole Newton-Euler system" + (", refined" if refined else ""),
        cost=clock.cost(),
    )
