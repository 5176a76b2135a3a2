"""The equations of motion, to be evaluated."""

from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.forward import preload_space
from screwgauge.reference.equations.joint_types import (
    JointPose,
    closure_residual,
    components,
    constraint_wrenches,
    reaction_names,
    triad,
)
from screwgauge.reference.equations.ops import Ops
from screwgauge.reference.equations.rounding import gain
from screwgauge.reference.equations.screws import rotation
from screwgauge.reference.rotations import across_direction
