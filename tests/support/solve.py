"""What one asks the solver: poses, velocities, accelerations, forces, freedoms, motions."""

from __future__ import annotations

from screwgauge.engines.methods import METHODS, SIZES, Pace, StagedDOP853
from screwgauge.engines.screw.forward import TracedForward
from screwgauge.engines.screw.integrate import Trajectory
from screwgauge.engines.screw.inverse import Work, solve_motion
from screwgauge.engines.screw.model import LONG, ScrewModel, Settings
from screwgauge.engines.screw.traced import TracedWork
from screwgauge.reference import dynamics, kinematics, reactions
from screwgauge.reference.applied import GRAVITY, Applied, JointSpring, Load, Motor, PointSpring, hold
from screwgauge.reference.chains import closed_form
from screwgauge.reference.closed.between import Spacing, knots, predicted
from screwgauge.reference.closed.branch import Branch
from screwgauge.reference.closed.cut_coordinates import read
from screwgauge.reference.closed.following import Follower
from screwgauge.reference.closed.loops import LoopEquations, loop_equations
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.closed.ways import straight_and_bent
from screwgauge.reference.dynamics import force_matrix, joint_reactions
from screwgauge.reference.forward import Forces, energy, forces_at, forward, forward_dense, inertia_matrix, power
from screwgauge.reference.kinematics import (
    accelerations,
    chain_acceleration,
    chain_velocities,
    closure_system,
    lie_matrix,
    positions,
    velocities,
)
from screwgauge.reference.mobility import (
    chain_constraints,
    check_independent,
    exchange,
    in_lengths,
    mobility,
    output_constraints,
    output_freedoms,
    reciprocal_screws,
)
from screwgauge.reference.pose import Layout, chain_screws, layout, length, loop_matrix, pose, tree_pose
from screwgauge.reference.precision import in_precision, wide_force_matrix
from screwgauge.reference.reactions import joint_point, reaction_components
