"""Trees of joints in MuJoCo and Pinocchio, their loops and steppers; imports both."""

import mujoco
import numpy as np

from screwgauge.engines.mujoco import raw_queries
from screwgauge.engines.mujoco.dynamics import INTEGRATORS, REFINABLE, MujocoMover, sprung_model
from screwgauge.engines.mujoco.tree import MujocoTree
from screwgauge.engines.pinocchio.model import PinocchioMover
from screwgauge.engines.pinocchio.tree import PinocchioTree
from screwgauge.engines.tree.applied_forces import TreeForces
from screwgauge.engines.tree.closed_states import project
from screwgauge.engines.tree.closed_tree import TreeLoops, close_tree, make_loops
from screwgauge.engines.tree.model import TreeModel
from screwgauge.engines.tree.protocol import BodyPoses, OpenTree
from screwgauge.models.files.loops import read_loops
from screwgauge.problem import ModelFiles
from screwgauge.reference.rotations import Array

TREES = {".urdf": PinocchioTree, ".xml": MujocoTree}


def opening(files: ModelFiles, q: Array, names: tuple[str, ...]) -> Array:
    """Largest distance of points that should meet, closures by points as in the minimal cut [m].

    Args:
        q: Joint coordinates of those names. Shape (n, n_q).

    Returns:
        Shape (n,).
    """
    file = read_loops(files.loops)
    tree = TREES[files.model.suffix](files.model, file)
    loops = make_loops(tree, file)
    apart = loops.gaps(tree.poses(q[:, [names.index(name) for name in tree.coordinates]]))
    points = np.repeat(np.array([not anchor.angular for anchor in loops.anchors], dtype=bool), 3)
    return np.linalg.norm(apart[:, points].reshape(len(q), -1, 3), axis=2).max(axis=1, initial=0.0)


def has_integrator(name: str) -> bool:
    return hasattr(mujoco.mjtIntegrator, INTEGRATORS[name])


class SmallestTree(OpenTree):
    """A tree with no more than a further engine has to implement, by MuJoCo."""

    def __init__(self, tree: OpenTree) -> None:
        self.right = tree
        for name in OpenTree.__annotations__:
            setattr(self, name, getattr(tree, name))

    def set_gravity(self, gravity: Array | None) -> None:
        self.right.set_gravity(gravity)

    def poses(self, q: Array) -> BodyPoses:
        return self.right.poses(q)

    def bias(self, at: BodyPoses, q: Array, v: Array, V: Array) -> Array:
        return self.right.bias(at, q, v, V)

    def tree_force(self, q: Array, v: Array, a: Array) -> Array:
        return self.right.tree_force(q, v, a)

    def transmitted(self, at: BodyPoses, q: Array, v: Array, a: Array, wrench: Array) -> Array:
        return self.right.transmitted(at, q, v, a, wrench)


def smallest_model(files: ModelFiles) -> TreeModel:
    file = read_loops(files.loops)
    return TreeModel(close_tree(SmallestTree(MujocoTree(files.model, file)), file))
