"""The engine `drake` solves given motions: Drake evaluates the URDF's open tree, and shared code closes the loops."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

import screwgauge.plugins as kit
from screwgauge.plugins import Array


def load(files: kit.ModelFiles) -> kit.TreeModel:
    """Load a URDF with its loops file."""
    file = kit.loops_file(files)
    return kit.TreeModel(kit.close_tree(DrakeTree(files.model, file), file))


class DrakeTree(kit.OpenTree):
    """Drake's open tree, see `OpenTree`. Twists are [angular; linear]; the origin of each body lies at its joint."""

    engine, version = "drake", version("drake")

    def __init__(self, urdf: Path, file: kit.LoopsFile) -> None:
        self.plant = plant = MultibodyPlant(0.0)
        text = kit.tree_urdf(urdf, file.joints)
        try:
            Parser(plant).AddModelsFromString(text, "urdf")
        except RuntimeError as error:
            what = f"Drake cannot load the file ({str(error).splitlines()[-1].rstrip('.')})"
            raise kit.ModelFileError(what, str(urdf), "correct the URDF") from None
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(kit.GROUND))
        plant.Finalize()
        self.context = plant.CreateDefaultContext()
        self.closures, self.couplings = file.closures, file.couplings
        joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
        moving = sorted((j for j in joints if j.num_velocities()), key=lambda j: int(j.velocity_start()))
        for joint in moving:  # joint losses are not part of the open tree
            joint.SetDampingVector(self.context, np.zeros(1))
        self.coordinates = tuple(j.name() for j in moving)
        above = {j.child_body().name(): j.parent_body().name() for j in joints}
        closed = (side for closure in file.closures for side in (closure.parent, closure.child))
        known = {kit.GROUND, *file.bodies, *closed}
        self.bodies = tuple(sorted(known - {kit.GROUND}))
        parents = list[str]()
        for name in map(above.__getitem__, self.bodies):
            while name not in known:  # a massless cross of a composite joint
                name = above[name]
            parents.append(name)
        self.parents = tuple(parents)
        index = {name: i for i, name in enumerate((kit.GROUND, *self.bodies))}
        self.carriers = [index[name] for name in parents]
        self.links = [plant.GetBodyByName(name) for name in self.bodies]
        inertias = [link.default_spatial_inertia() for link in self.links]
        self.masses = np.array([M.get_mass() for M in inertias])
        self.com = np.nan_to_num([M.get_com() for M in inertias])  # massless bodies have no centre of mass
        about = [M.Shift(c).CalcRotationalInertia() for M, c in zip(inertias, self.com, strict=True)]
        self.matter = kit.Matter(self.masses, self.com, np.array([I.CopyToFullMatrix3() for I in about]))
        rotors = {one.coordinate: one.amount for one in kit.resistances(file.joints, ("rotor",))}
        self.rotors = np.array([rotors.get(name, 0.0) for name in self.coordinates])
        self.set_gravity(None)

    def set_gravity(self, gravity: Array | None) -> None:
        """Set gravity."""
        self.g = np.array(kit.GRAVITY if gravity is None else gravity)
        self.plant.mutable_gravity_field().set_gravity_vector(self.g)

    def _visit(self, q: Array, v: Array) -> Iterator[int]:
        for i in range(len(q)):
            self.plant.SetPositionsAndVelocities(self.context, np.concatenate([q[i], v[i]]))
            yield i

    def poses(self, q: Array) -> kit.BodyPoses:
        """Compute the body poses, and the joint screws at the world origin from Drake's Jacobians."""
        shape, world = (len(q), len(self.links) + 1), self.plant.world_frame()
        R, p, screws = np.tile(np.eye(3), (*shape, 1, 1)), np.zeros((*shape, 3)), np.zeros((len(q), 6, q.shape[1]))
        moves = np.zeros((shape[1], q.shape[1]))
        for i in self._visit(q, np.zeros_like(q)):
            for k, link in enumerate(self.links, 1):
                X = link.EvalPoseInWorld(self.context)
                R[i, k], p[i, k] = X.rotation().matrix(), X.translation()
                at = link.body_frame(), X.inverse().translation(), world, world
                J = self.plant.CalcJacobianSpatialVelocity(self.context, JacobianWrtVariable.kV, *at)
                moves[k] = J.any(axis=0)
                screws[i] = np.where(moves[k], J, screws[i])
        return kit.BodyPoses(R, p, screws, moves)

    def bias(self, at: kit.BodyPoses, q: Array, v: Array, V: Array) -> Array:
        """Compute the body accelerations for zero joint accelerations."""
        A = np.zeros_like(V)
        for i in self._visit(q, v):
            moved = self.plant.CalcSpatialAccelerationsFromVdot(self.context, np.zeros_like(v[i]))
            for k, link in enumerate(self.links, 1):
                A[i, k] = moved[int(link.index())].get_coeffs()
        return A

    def tree_force(self, q: Array, v: Array, a: Array) -> Array:
        """Compute the inverse dynamics of the open tree, and add the rotor inertias that a URDF cannot express."""
        tau = np.empty_like(q)
        for i in self._visit(q, v):
            weights = MultibodyForces(self.plant)
            self.plant.CalcForceElementsContribution(self.context, weights)
            tau[i] = self.plant.CalcInverseDynamics(self.context, a[i], weights)
        return tau + self.rotors * a

    def transmitted(self, at: kit.BodyPoses, q: Array, v: Array, a: Array, wrench: Array) -> Array:
        """Compute the joint wrenches with the Newton-Euler equations, working inwards from the tips.

        Drake computes reactions by its forward dynamics, which are singular if composite joints have massless crosses.
        """
        V = at.velocities(v)
        A = self.bias(at, q, v, V) + at.velocities(a)
        needed = kit.required_wrenches(self.matter, at.R, V, A, self.g) - wrench
        return kit.summed_inwards(self.carriers, at.p, needed)
