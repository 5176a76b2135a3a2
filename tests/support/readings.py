"""Model files as libraries read them, and trees of bodies that move as these say."""

from screwgauge.models.files.robot_yaml import read_yaml
from screwgauge.models.kinematics import draw, residual_at_home, tree_of
from screwgauge.models.readings.compiled import collect_warnings
from screwgauge.models.readings.loops import with_loops
from screwgauge.models.readings.mujoco import joint_equality
from screwgauge.models.readings.read import LIBRARIES, libraries_for, read, read_source
from screwgauge.models.readings.reading import (
    BodyReading,
    ClosureReading,
    CouplingReading,
    JointReading,
    Reading,
    collapse,
)
from screwgauge.models.readings.source import by_name, in_file, prepare
from screwgauge.witness.constraints import closure_gaps, closure_rows, gap_bias, gaps_and_rows, move_joints
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import TreeStates
