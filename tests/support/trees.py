"""Trees of joints in MuJoCo and Pinocchio, their loops and steppers; imports both."""

from __future__ import annotations

from screwgauge.engines.mujoco import plain
from screwgauge.engines.mujoco.mover import MujocoMover
from screwgauge.engines.mujoco.settings import INTEGRATORS, REFINABLE
from screwgauge.engines.mujoco.steps import sprung_model
from screwgauge.engines.mujoco.tree import MujocoTree
from screwgauge.engines.pinocchio.mover import PinocchioMover
from screwgauge.engines.pinocchio.tree import PinocchioTree
from screwgauge.engines.tree.closed import close_tree
from screwgauge.engines.tree.closure import Loops, make_loops
from screwgauge.engines.tree.forces import tree_forces
from screwgauge.engines.tree.model import TreeModel, loops_file
from screwgauge.engines.tree.project import project
