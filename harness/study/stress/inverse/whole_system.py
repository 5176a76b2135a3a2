"""Actuator forces read from the Newton-Euler system of all bodies, in place of virtual power."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter

import numpy as np

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
from screwgauge.reference.pose import layout
from screwgauge.reference.precision import wide_force_matrix
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Values
from screwgauge.study.run import solve
from screwgauge.study.stress.case import Finding
from screwgauge.study.stress.inverse.measure import compared

_FORCE = "actuator_force"


def whole_system(scene: Scene, *, refined: bool) -> tuple[Array, Array]:
    """Actuator forces of smallest norm from eqs. (57)-(58), all reactions being unknowns beside them.

    Args:
        refined: One step of iterative refinement with a wider matrix.

    Returns:
        Forces [N], shape (n, n_actuator), and the condition number of the system, shape (n,).
    """
    lay, motion = layout(scene.mechanism), scene.motion
    at = positions(lay, motion.y, motion.t)
    rate = velocities(lay, at, motion.yd)
    _, A = accelerations(lay, rate, motion.ydd)
    bodies = body_motion(lay, at, rate.V, A)
    loads = [(load.body, load.point, load.force, load.torque) for load in scene.loads]
    F, T = required_wrench(lay, at, bodies, scene.gravity, loads)
    reactions = joint_reactions(lay, at)
    c = force_matrix(lay, at, bodies.com, reactions)
    rule = preload_rows(rate.K[:, lay.mechanism.actuated_columns], c.shape[2])
    wide = wide_force_matrix(lay, motion.y) if refined else None
    unknown, condition = solve_newton_euler(c, F, T, rule, reactions, rate.system.length, wide=wide)
    return np.asarray(unknown[:, len(reactions.names) :], dtype=float), condition


def findings(scene: Scene) -> Iterator[Finding]:
    """The forces against the truth, as they come out and refined. Nothing where there is no truth."""
    solutions, _ = solve(scene, ("truth",), (_FORCE,))
    if "truth" not in solutions or solutions["truth"].rows is not None:
        return
    truth = solutions["truth"]
    like = truth.values[_FORCE]
    for refined in (False, True):
        start = perf_counter()
        f, condition = whole_system(scene, refined=refined)
        seconds = perf_counter() - start
        found = Solution(
            engine="screw whole system" + (" refined" if refined else ""),
            version="",
            values={_FORCE: Values(like.components, like.units, f)},
            condition=condition,
            estimate={_FORCE: linear.EPS * condition},
        )
        finding = compared(scene, found, truth, _FORCE)
        yield Finding(
            finding.engine,
            _FORCE,
            finding.error,
            finding.admitted,
            finding.condition,
            seconds,
            finding.reason if finding.verdict != "ok" else "",
        )
