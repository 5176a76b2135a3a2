"""What one asks the solver: poses, velocities, accelerations, forces, freedoms, motions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from screwgauge.engines.methods import METHODS, SIZES, Pace
from screwgauge.engines.screw.forward import TracedForward
from screwgauge.engines.screw.integrate import Trajectory
from screwgauge.engines.screw.integrate import integrate as integrate_task
from screwgauge.engines.screw.inverse import Work, solve_motion
from screwgauge.engines.screw.model import LONG, ScrewModel, Settings
from screwgauge.engines.screw.programs import check_traceable
from screwgauge.engines.screw.traced import TracedWork
from screwgauge.problem import InitialValue, Integration
from screwgauge.reference import dynamics, kinematics, reactions
from screwgauge.reference.closed import continuation
from screwgauge.reference.closed.anchors import Anchors
from screwgauge.reference.closed.assembly_mode import AssemblyMode
from screwgauge.reference.closed.branch import Branch
from screwgauge.reference.closed.constant_coordinates import home_equations
from screwgauge.reference.closed.continuation import Continuation
from screwgauge.reference.closed.curves import Curve, bent, straight
from screwgauge.reference.closed.cut_coordinates import read
from screwgauge.reference.closed.hermite_prediction import knots, predicted
from screwgauge.reference.closed.loops import LoopEquations, loop_equations
from screwgauge.reference.dynamics import force_matrix, joint_reactions
from screwgauge.reference.forward import Forces, forward, forward_dense, inertia_matrix
from screwgauge.reference.kinematics import (
    Velocities,
    accelerations,
    chain_acceleration,
    closed_form,
    closure_system,
    lie_matrix,
    positions,
    velocities,
)
from screwgauge.reference.layout import Layout, layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.pose import Pose, chain_screws, length, loop_matrix, pose
from screwgauge.reference.precision import in_precision, wide_force_matrix
from screwgauge.reference.reactions import joint_point, reaction_components
from screwgauge.reference.rotations import Array


def at_home(mechanism: Mechanism) -> tuple[Layout, Pose]:
    """A mechanism laid out, and its pose at home."""
    lay = layout(mechanism)
    return lay, pose(lay, mechanism.home[None])


def posed(lay: Layout, *y: float) -> Pose:
    """The pose of given independent coordinates [rad, m]."""
    return positions(lay, np.array([y]), np.zeros(1))


def moved(lay: Layout, y: Array, yd: Array) -> Velocities:
    """Poses and velocities of given independent coordinates and their rates, shape (n, k) each."""
    return velocities(lay, positions(lay, y, np.zeros(len(y))), yd)


def integrate(
    lay: Layout,
    forces: Forces | Callable[[float], Forces],
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
    return integrate_task(lay, InitialValue(start, yd, float(times[0]), times, Integration(**integration)), forces)
