"""The engine `exudyn` describes bodies by absolute coordinates (Euler parameters) and joints as GenericJoints.

It uses neither a spanning tree nor a cut. EXUDYN computes the mass matrix, gravity, loads, springs between points,
and constraints with their derivatives and multipliers. This module adds forces along joint coordinates through their
virtual work.
"""

from __future__ import annotations

from importlib.metadata import version

import exudyn as exu
import numpy as np
from exudyn.utilities import Force, MarkerBodyRigid, ObjectJointGeneric, RigidBodyInertia, SpringDamper, Torque

import screwgauge.plugins as kit
from screwgauge.plugins import Array

#: Translations and rotations along x, y and z that a joint locks between its two frames, see `ExudynSystem._join`.
LOCKED = {"R": "111110", "fixed": "111110", "C": "110110", "P": "110111", "E": "001110", "U": "111100", "S": "111000"}
LOCKED |= {"F": "000000"}
#: Finite-difference weights of points along a line: exact for polynomials up to degree six; constraints are of lower
#: degree.
STENCIL = ((1, 45), (2, -9), (3, 1), (-1, -45), (-2, 9), (-3, -1))


def load(files: kit.ModelFiles, integrator: str = "", dt: float = 0.0) -> ExudynModel:
    """Load a description. A model with an `integrator`, an EXUDYN solver type, can also simulate with step `dt` [s]."""
    return ExudynModel(kit.load_mechanism(files.model), str(files.model), integrator, dt)


class ExudynModel:
    """A loaded description. Each problem builds its own EXUDYN system from this description."""

    def __init__(self, mechanism: kit.Mechanism, where: str, integrator: str = "", dt: float = 0.0) -> None:
        self.mechanism, self.where, self.integrator, self.dt = mechanism, where, integrator, dt

    def solve(self, problem: kit.Problem, progress: kit.Progress = kit.quiet) -> kit.Solution:
        """Solve a given motion or a simulation."""
        takes = (kit.GivenMotion, kit.InitialValue) if self.integrator else (kit.GivenMotion,)
        if not isinstance(problem.task, takes):
            raise kit.ModelFileError("this engine supports only given motions", self.where, "choose another engine")
        kit.check_fits(problem, self.mechanism, self.where)
        with kit.temporary(exu.config, printToConsole=False):
            system, name = ExudynSystem(self.mechanism, problem.applied, self.integrator), ("exudyn", version("exudyn"))
            if isinstance(problem.task, kit.GivenMotion):
                return kit.solve_constrained((*name, "absolute coordinates"), system, problem, progress)
            labels = (*name, f"{self.integrator}, dt {self.dt:g} s")
            return kit.solve_stepwise(labels, system, problem, self.dt, progress)


class ExudynSystem(kit.Stepped):
    """An EXUDYN system that can be set to any state x: position and Euler parameters of each body.

    Attributes:
        home: x at the home pose. Shape (n_x,).
        kept: Indices of the equations used as gaps: the norm of each body's Euler parameters, then the joints' gaps.
        rows: Indices of the gaps of each joint.
    """

    def __init__(self, mechanism: kit.Mechanism, applied: kit.Applied, integrator: str) -> None:
        self.mechanism, self.applied, self.container = mechanism, applied, exu.SystemContainer()
        self.mbs, self.integrator, bodies = self.container.AddSystem(), integrator, len(mechanism.bodies)
        (R,), (p,) = kit.body_poses(mechanism, mechanism.home[None])
        self.numbers = [self.mbs.CreateGround()]
        for i, body in enumerate(mechanism.bodies, 1):
            inertia = RigidBodyInertia(body.mass, body.inertia, body.com, inertiaTensorAtCOM=True)
            place = {"referencePosition": p[i], "referenceRotationMatrix": R[i]}
            made = self.mbs.CreateRigidBody(inertia=inertia, **place, gravity=[*applied.g], returnDict=True)
            self.numbers.append(made["bodyNumber"])
        joints = [self._join(joint) for joint in mechanism.joints]
        self.loads = list[int]()
        for load in applied.loads:
            at, turns = self._mark(load.body, kit.load_point(mechanism, load)), load.axes == "body"
            self.loads += [self.mbs.AddLoad(kind(markerNumber=at, bodyFixed=turns)) for kind in (Force, Torque)]
        for spring in (one for one in applied.springs if isinstance(one, kit.PointSpring)):
            markers = [self._mark(*end) for end in spring.ends]
            self.mbs.AddObject(SpringDamper("", markers, spring.rest, spring.stiffness, spring.damping))
        self.mbs.Assemble()
        self.solver, self.settings = exu.MainSolverImplicitSecondOrder(), exu.SimulationSettings()
        self.settings.solution.file.write = False
        self.settings.linearSolver.solverType = exu.LinearSolverType.EigenDense  # accepts redundant constraints
        self.settings.linearSolver.ignoreSingularJacobian = True
        self.solver.InitializeSolver(self.mbs, self.settings)
        # with more than a hundred coordinates, the function for total coordinates frees memory it does not own (1.13.6)
        self.home = np.array(self.mbs.systemData.GetODE2Coordinates(exu.ConfigurationType.Reference))
        self.kept, self.rows, L = [*range(bodies)], list[list[int]](), kit.length(mechanism)
        for number, locked in joints:
            own = [row for row, on in zip(self.mbs.systemData.GetObjectLTGAE(number), locked, strict=True) if on]
            self.rows.append([*range(len(self.kept), len(self.kept) + len(own))])
            self.kept += own
        lengths = [L if k < 3 else 1.0 for _, locked in joints for k in np.flatnonzero(locked)]
        self.units, self.gap_units = np.tile([L, L, L, 1.0, 1.0, 1.0, 1.0], bodies), np.array([1.0] * bodies + lengths)

    def _mark(self, body: str, place: Array, R: Array | None = None) -> int:
        """Add a marker at a point of a body, aligned with the body by default."""
        frame = exu.HT(rotation=np.eye(3) if R is None else R, translation=place)
        number = self.numbers[self.mechanism.body_index[body]]
        return int(self.mbs.AddMarker(MarkerBodyRigid(bodyNumber=number, localHT=frame)))

    def _join(self, joint: kit.Joint) -> tuple[int, list[int]]:
        """Add a joint between frames whose z is the joint's last axis; return the object's index and locked axes."""
        z, locked = joint.axes[-1], [int(on) for on in LOCKED[joint.kind]]
        y = joint.axes[0] if len(joint.axes) == 2 else np.linalg.svd(z[None])[2][1]  # parent's y stays orthogonal to z
        frame = np.stack([np.cross(y, z), y, z], axis=1)
        markers = [self._mark(body, at.p, at.R @ frame) for body, at in joint.sides]
        return int(self.mbs.AddObject(ObjectJointGeneric("", markers, locked))), locked

    def _set_state(self, x: Array, xd: Array | float = 0.0) -> None:
        """Set the state."""
        self.mbs.systemData.SetODE2Coordinates(x - self.home)
        self.mbs.systemData.SetODE2Coordinates_t(xd + 0.0 * x)

    def _constraints(self, x: Array) -> tuple[Array, Array]:
        """Return the gaps and their derivative. Shape (n_x,) -> (m,), (m, n_x)."""
        self._set_state(x)
        self.solver.ComputeAlgebraicEquations(self.mbs)
        gaps, n = np.array(self.solver.GetSystemResidual())[len(x) :], len(x)
        self.solver.SetSystemJacobian(np.zeros((n + len(gaps),) * 2))  # the function adds to the array
        self.solver.ComputeJacobianAE(self.mbs, 1.0, 0.0, 1.0, False)
        return gaps[self.kept], np.array(self.solver.GetSystemJacobian())[n:, :n][self.kept]

    def place(self, x: Array) -> kit.Placement:
        """Map coordinates to poses and gaps; Euler parameters are normalised because gaps depend on their norm."""
        parts = x.reshape(len(x), -1, 7).copy()
        norms = np.linalg.norm(parts[..., 3:], axis=2)
        parts[..., 3:] /= norms[..., None]
        gaps, G = (np.array(some) for some in zip(*map(self._constraints, parts.reshape(x.shape)), strict=True))
        gaps[:, : norms.shape[1]] = norms**2 - 1.0
        return kit.Placement(*kit.absolute_poses(parts), gaps, G)

    def bias(self, x: Array, xd: Array) -> tuple[Array, Array]:
        """Return the gaps' second derivatives at constant rates, and zero body accelerations, since E(e') e' = 0."""
        out = np.empty((len(x), len(self.kept)))
        for i, (at, v) in enumerate(zip(x, xd, strict=True)):
            h = 0.2 / max(float(np.abs(v).max()), 1e-9)
            out[i] = sum(w * self._constraints(at + k * h * v)[1] for k, w in STENCIL) @ v / (60.0 * h)
        return out, np.zeros((len(x), len(self.numbers), 6))

    def dynamics(self, x: Array, xd: Array, applied: kit.Applied) -> tuple[Array, Array]:
        """Return the mass matrix, and the sum of applied forces and velocity terms."""
        M, acting = np.empty((len(x), x.shape[1], x.shape[1])), np.empty_like(x)
        vectors = [np.broadcast_to(v, (len(x), 3)) for load in applied.loads for v in (load.force, load.torque)]
        for i, state in enumerate(zip(x, xd, strict=True)):
            for number, vector in zip(self.loads, vectors, strict=True):
                self.mbs.SetLoadParameter(number, "loadVector", [*vector[i]])
            self._set_state(*state)
            self.solver.ComputeMassMatrix(self.mbs)
            self.solver.ComputeODE2RHS(self.mbs)
            M[i], acting[i] = self.solver.GetSystemMassMatrix(), self.solver.GetSystemResidual()[: x.shape[1]]
        return M, acting

    def begin(self, x: Array, xd: Array) -> None:
        """Set the initial state and the loads."""
        self.dynamics(x[None], xd[None], self.applied)
        self.mbs.systemData.SetODE2Coordinates(x - self.home, exu.ConfigurationType.Initial)
        self.mbs.systemData.SetODE2Coordinates_t(xd, exu.ConfigurationType.Initial)

    def walk(self, t: float, h: float, n: int) -> tuple[Array, Array]:
        """Take n steps with EXUDYN's own integrator."""
        how, kind = self.settings.timeIntegration, getattr(exu.DynamicSolverType, self.integrator)
        how.startTime, how.endTime, how.numberOfSteps = t, t + n * h, n
        try:
            self.mbs.SolveDynamic(self.settings, solverType=kind, updateInitialValues=True, storeSolver=False)
        except exu.SolverError:
            raise kit.SingularPoseError("EXUDYN's steps do not converge", "integration", "use smaller steps") from None
        data = self.mbs.systemData
        return np.array(data.GetODE2Coordinates()) + self.home, np.array(data.GetODE2Coordinates_t())
