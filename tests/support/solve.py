"""What one asks the solver: poses, velocities, accelerations, forces, freedoms, motions."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from screwgauge.engines.methods import METHODS, SIZES, Pace
from screwgauge.engines.screw.forward import TracedForward
from screwgauge.engines.screw.integrate import Trajectory
from screwgauge.engines.screw.integrate import integrate as integrate_task
from screwgauge.engines.screw.inverse import Work, solve_motion
from screwgauge.engines.screw.model import LONG, ScrewModel
from screwgauge.engines.screw.programs import check_traceable
from screwgauge.engines.screw.traced import TracedWork
from screwgauge.problem import InitialValue, Integration
from screwgauge.reference.applied import Applied
from screwgauge.reference.closed import assembly_mode, continuation
from screwgauge.reference.closed.anchors import Anchors
from screwgauge.reference.closed.assembly_mode import AssemblyMode, BranchPose, closed_form_positions, positions
from screwgauge.reference.closed.continuation import Continuation
from screwgauge.reference.closed.loops import LoopEquations, home_equations, loop_equations, read
from screwgauge.reference.closed.newton import Curve, bent_paths, knots, predict_unknowns, straight_path
from screwgauge.reference.closed_motion import ClosedMotion, motion_at
from screwgauge.reference.equations.forward import NewtonEuler, force_matrix
from screwgauge.reference.equations.kinematics import gaps, joint_bias, length, pose
from screwgauge.reference.graph import Edge, Layout, layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.precision import in_precision
from screwgauge.reference.rotations import Array
from screwgauge.study.bench.singular import whole_system, wide_force_matrix


def at_home(mechanism: Mechanism) -> tuple[Layout, Array]:
    return layout(mechanism), mechanism.home[None]


def posed(lay: Layout, *y: float) -> Array:
    return positions(lay, np.array([y]), np.zeros(1))


def chain_screws(lay: Layout, q: Array, chain: Sequence[Edge]) -> Array:
    S, signs = pose(lay, q).S, [(edge, -1 if edge.reverse else 1) for edge in chain]
    screws = [sign * S[:, i] for edge, sign in signs for i in lay.columns[edge.joint.name][::sign]]
    return np.stack(screws, axis=2)


def moved(lay: Layout, y: Array, yd: Array, ydd: Array | None = None, **forces: Any) -> ClosedMotion:
    """The closed mechanism at given independent coordinates and their derivatives, shape (n, k) each.

    Args:
        forces: As of `motion_at`.
    """
    return motion_at(lay, positions(lay, y, np.zeros(len(y))), yd, ydd, **forces)


def under(at: ClosedMotion, applied: Applied | None = None, **forces: Any) -> ClosedMotion:
    return motion_at(at.loops.lay, at.q, at.yd, None, applied, **forces)


def chain_acceleration(S: Array, w: Array, beta: Array) -> Array:
    """Acceleration screw of the end of a serial chain by eq. (44). Shapes (n, 6, m), (n, m), (n, m) -> (n, 6)."""
    terms = [S[..., i] * w[:, i, None] for i in range(w.shape[1])]
    return (S @ beta[..., None])[..., 0] + joint_bias(np.zeros(S.shape[:-1]), terms)


def integrate(
    lay: Layout,
    applied: Applied,
    times: Array,
    start: Array | None = None,
    yd: Array | None = None,
    **integration: Any,
) -> Trajectory:
    """Integrates by the screw solver, from home and from rest if nothing else is said; `integration` as in
    `Integration`."""
    mechanism = lay.mechanism
    home = mechanism.home[mechanism.independent_columns]
    start, yd = home if start is None else start, np.zeros_like(home) if yd is None else yd
    return integrate_task(lay, InitialValue(start, yd, float(times[0]), times, Integration(**integration)), applied)
