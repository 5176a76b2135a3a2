"""A further engine in one file: Drake on the URDF of the minimal cut, for given motions.

Drake says what its open tree does; loops, and forces from their multipliers, are those of all engines with such a tree.
A package has in its pyproject.toml: ``[project.entry-points."screwgauge.engines"] drake = "drake_engine:DRAKE"``.
"""

from importlib.metadata import version

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from screwgauge.engines.registry import Engine
from screwgauge.engines.tree.closed_tree import close_tree
from screwgauge.engines.tree.model import TreeModel, loops_file
from screwgauge.engines.tree.protocol import BodyPoses, OpenTree
from screwgauge.problem import GivenMotion
from screwgauge.reference.applied import GRAVITY
from screwgauge.reference.errors import ModelFileError

TASKS = frozenset((GivenMotion,))
LACKS = {"reaction": "it does not say what its joints transmit"}
DRAKE = Engine("drake", "Drake on the URDF, minimal cut", f"{__name__}:load", TASKS, "drake", ".urdf", "minimal", LACKS)


def load(files):
    file = loops_file(files)
    return TreeModel(close_tree(DrakeTree(files.model, file), file))


class DrakeTree(OpenTree):
    """See `screwgauge.engines.tree.protocol.OpenTree`. Drake has [angular; linear], too, and bodies at their joints."""

    engine, version = "drake", version("drake")

    def __init__(self, urdf, file):
        self.plant = plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(str(urdf))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("ground"))
        plant.Finalize()
        self.context = plant.CreateDefaultContext()
        self.closures, self.couplings = file.closures, file.couplings
        joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
        moving = sorted((j for j in joints if j.num_velocities()), key=lambda j: j.velocity_start())
        self.coordinates = tuple(j.name() for j in moving)
        above = {j.child_body().name(): j.parent_body().name() for j in joints}
        known = {"ground", *file.bodies, *(side for c in file.closures for side in (c.parent, c.child))}

        def parent(name):  # past the massless crosses of composite joints
            return above[name] if above[name] in known else parent(above[name])

        self.bodies = tuple(sorted(known - {"ground"}))
        self.parents = tuple(parent(name) for name in self.bodies)
        self.links = [plant.GetBodyByName(name) for name in self.bodies]
        self.masses = np.array([link.default_mass() for link in self.links])
        self.com = np.array([link.default_com() for link in self.links])

    def under(self, gravity):
        self.plant.mutable_gravity_field().set_gravity_vector(GRAVITY if gravity is None else gravity)

    def at(self, q, v):
        for i in range(len(q)):
            self.plant.SetPositionsAndVelocities(self.context, np.concatenate([q[i], v[i]]))
            yield i

    def poses(self, q):
        shape, world = (len(q), len(self.links) + 1), self.plant.world_frame()
        R, p, screws = np.tile(np.eye(3), (*shape, 1, 1)), np.zeros((*shape, 3)), np.zeros((len(q), 6, q.shape[1]))
        moves = np.zeros((shape[1], q.shape[1]))
        for i in self.at(q, np.zeros_like(q)):
            for k, link in enumerate(self.links, 1):
                X = link.EvalPoseInWorld(self.context)
                R[i, k], p[i, k] = X.rotation().matrix(), X.translation()
                at = link.body_frame(), X.inverse().translation(), world, world  # the world's origin, moved along
                J = self.plant.CalcJacobianSpatialVelocity(self.context, JacobianWrtVariable.kV, *at)
                moves[k] = J.any(axis=0)
                screws[i] = np.where(moves[k], J, screws[i])
        return BodyPoses(R, p, screws, moves)

    def bias(self, at, q, v, V):
        A = np.zeros_like(V)
        for i in self.at(q, v):
            moved = self.plant.CalcSpatialAccelerationsFromVdot(self.context, np.zeros_like(v[i]))
            for k, link in enumerate(self.links, 1):
                A[i, k] = moved[int(link.index())].get_coeffs()
        return A

    def tree_force(self, q, v, a):
        tau = np.empty_like(q)
        for i in self.at(q, v):
            weights = MultibodyForces(self.plant)
            self.plant.CalcForceElementsContribution(self.context, weights)
            tau[i] = self.plant.CalcInverseDynamics(self.context, a[i], weights)
        return tau

    def transmitted(self, at, q, v, a, wrench):
        raise ModelFileError("does not say what its joints transmit", "model of drake", "do not ask it for reactions")
