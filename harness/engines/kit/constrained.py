"""Inverse dynamics for engines that formulate constraints in their own coordinates, such as absolute coordinates."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from screwgauge.engines.error_estimate import ACCELERATED, SolvedPart, Trust, examine_part, worst_of
from screwgauge.engines.kit.acting import along_joints
from screwgauge.engines.kit.answers import (
    answer,
    at_samples,
    force_values,
    inertia,
    inertia_values,
    motion_values,
)
from screwgauge.engines.kit.closing import ClosedMotion, Closing, Placement
from screwgauge.engines.kit.projection import idle_accelerations
from screwgauge.engines.kit.rates import per_actuator
from screwgauge.engines.kit.reactions import axial_line, joint_wrenches, reactions
from screwgauge.engines.kit.statement import check_statement
from screwgauge.problem import GivenMotion, Problem, Progress, Rows, quiet
from screwgauge.quantities import RULED, description_names, length, stages
from screwgauge.reference import linear
from screwgauge.reference.applied import Applied
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import Clock, Solution


class Constrained(Protocol):
    """Equations of a mechanism in an engine's coordinates x; this module adds couplings and forces along joints.

    Attributes:
        mechanism: Description of the mechanism.
        home: x at the home pose, which nearly closes the loops. Shape (n_x,).
        units: Unit of each entry of x: 1 for angles and dimensionless entries, a length for lengths. Shape (n_x,).
        gap_units: Unit of each gap, as for `units`. Shape (m,).
        rows: Indices of the gaps of each joint, in the order of the description. Other gaps belong to no joint.
    """

    mechanism: Mechanism
    home: Array
    units: Array
    gap_units: Array
    rows: Sequence[Sequence[int]]

    @abstractmethod
    def place(self, x: Array) -> Placement:
        """Return body poses, their derivatives, and constraint gaps at x, shape (n, n_x)."""

    @abstractmethod
    def bias(self, x: Array, xd: Array) -> tuple[Array, Array]:
        """Return the second derivatives of the gaps and the body accelerations at constant rates of x.

        Args:
            x, xd: Shape (n, n_x).

        Returns:
            Shapes (n, m), (n, n_body + 1, 6).
        """

    @abstractmethod
    def dynamics(self, x: Array, xd: Array, applied: Applied) -> tuple[Array, Array]:
        """Return the mass matrix, and the sum of gravity, loads, point springs and velocity terms along x.

        Args:
            x, xd: Shape (n, n_x).
            applied: Loads at these samples, each of shape (3,) or (n, 3); springs and motors at joints are ignored.

        Returns:
            M and f of ``M xdd = f + constraints``. Shapes (n, n_x, n_x), (n, n_x).
        """


def solve_constrained(
    labels: tuple[str, str, str], engine: Constrained, problem: Problem, progress: Progress = quiet
) -> Solution:
    """Solve a given motion for all quantities except those of an open tree.

    Args:
        labels: Name and version of the engine, and a description of its method and settings.

    Raises:
        ClosureError: The motion reaches a pose where the loops cannot close, or passes through a singular pose.
        ValueError: The engine's equations are inconsistent, see `check_statement`.
    """
    clock = Clock()
    check_statement(engine, problem)
    return answer(labels, engine.mechanism, problem, _PartSolver(engine, problem, clock).solve, progress, clock)


class _PartSolver:
    """Solver that computes the requested quantities of a problem part by part."""

    def __init__(self, engine: Constrained, problem: Problem, clock: Clock) -> None:
        self.engine, self.problem, self.clock = engine, problem, clock
        self.closing = Closing(engine.mechanism, engine.place, engine.home, engine.units, engine.gap_units)

    def solve(self, motion: GivenMotion, applied: Applied) -> SolvedPart:
        mechanism = self.engine.mechanism
        with self.clock.stage("positions"):
            closed = self.closing.follow(motion)
        values, trust = self._evaluate(closed, applied)

        def solve_perturbed(some: Rows, shake: Array) -> dict[str, Array]:
            return self._evaluate(self.closing.perturb(closed, some, shake), at_samples(applied, some))[0]

        table, k = description_names(mechanism, self.problem.points), motion.y.shape[1]
        units = {name: units for name, (_, units) in table.items()}
        part = examine_part(values, trust, closed.system, k, solve_perturbed, self.clock, units, length(mechanism))
        return replace(part, q=closed.q)

    def _evaluate(self, closed: ClosedMotion, applied: Applied) -> tuple[dict[str, Array], Trust]:
        """Compute the requested quantities at closed poses, with their error data."""
        wanted, depth, moved = self.problem.wanted, stages(self.problem.wanted), None
        values, sizes, conditions = {"joint_position": closed.q}, dict[str, Array](), dict[str, Array]()
        x_units, dynamics = self.engine.units, None
        if depth in "vaf":
            with self.clock.stage("velocities"):
                values |= motion_values(wanted, closed)
                sizes["speed"] = np.abs(closed.xd / x_units).max(axis=1)
                if "jacobian" in wanted:
                    values["jacobian"], conditions["jacobian"] = self._rates(closed)
        if depth in "af":
            with self.clock.stage("accelerations"):
                if closed.task.idle:
                    dynamics = self.engine.dynamics(closed.x, closed.xd, applied)
                moved = self._accelerate(closed, dynamics, conditions)
                values |= motion_values(wanted, closed, moved[1])
                sizes["rush"] = np.maximum(sizes["speed"] ** 2, np.abs(moved[0] / x_units).max(axis=1))
        if depth == "f" or "mass_matrix" in wanted:
            with self.clock.stage("forces"):
                M, acting = dynamics or self.engine.dynamics(closed.x, closed.xd, applied)
                values |= inertia_values(closed, M) if "mass_matrix" in wanted else {}
            if moved is not None:
                terms = (M @ moved[0][..., None])[..., 0], acting
                sizes["load"] = (np.max(np.abs(terms), axis=0) * x_units).max(axis=1) / length(self.engine.mechanism)
                values |= self._forces(closed, moved[1], terms[0] - acting, conditions)
        gain = closed.condition / linear.norms(closed.system)
        speed, rush, load = (sizes.get(name, 0.0) for name in ("speed", "rush", "load"))
        trust = Trust(closed.condition, gain, closed.joints.condition, conditions, speed, rush, load)
        return {name: array for name, array in values.items() if name in wanted}, trust

    def _accelerate(
        self, closed: ClosedMotion, dynamics: tuple[Array, Array] | None, conditions: dict[str, Array]
    ) -> tuple[Array, Array]:
        """Compute accelerations of x and of the bodies; forces determine the accelerations of undriven coordinates.

        Args:
            dynamics: See `Constrained.dynamics`; needed for undriven coordinates.
        """
        bias, idle, rotors = self.engine.bias(closed.x, closed.xd), [*closed.task.idle], self.engine.mechanism.rotors
        if not idle or dynamics is None:
            return closed.accelerations(*bias)
        ydd = closed.task.ydd.copy()
        ydd[:, idle] = 0.0
        (still, A), (M, acting), K = closed.accelerations(*bias, ydd), dynamics, closed.K
        along = along_joints(self.problem.applied, closed.task.t, closed.joints, closed.V)
        along -= rotors * closed.joints.accelerations(closed.V, A)
        need = (M @ still[..., None])[..., 0] - acting - self._project(closed, along)
        Q = (K.swapaxes(1, 2) @ need[..., None])[..., 0]
        B = closed.J[:, self.engine.mechanism.actuated_columns] @ K
        ydd[:, idle], condition = idle_accelerations(B, inertia(closed, M)[..., idle], Q, idle)
        conditions |= dict.fromkeys(ACCELERATED, condition)
        return closed.accelerations(*bias, ydd)

    def _project(self, closed: ClosedMotion, along: Array) -> Array:
        """Transform forces along joint coordinates to forces along x. Shape (n, n_q) -> (n, n_x)."""
        return np.asarray((along[:, None] @ closed.J)[:, 0])

    def _rates(self, closed: ClosedMotion) -> tuple[Array, Array]:
        """Return the quantity `jacobian`, and the condition number of the actuator rates, see `per_actuator`."""
        mechanism = self.engine.mechanism
        B = closed.J[:, mechanism.actuated_columns] @ closed.K
        twists, points = closed.at.T @ closed.K[:, None], self.problem.points
        return per_actuator(twists, closed.at.R, points, mechanism.body_index, B, idle=closed.task.idle)

    def _forces(self, closed: ClosedMotion, A: Array, need: Array, conditions: dict[str, Array]) -> dict[str, Array]:
        """Return the force quantities and add the condition numbers of the solved systems to `conditions`.

        Args:
            A: Accelerations of the bodies. Shape (n, n_body + 1, 6).
            need: Force that constraints, actuators and joints supply together. Shape (n, n_x).
        """
        problem, mechanism, at, rows = self.problem, self.engine.mechanism, closed.at, self.engine.rows
        ruled = problem.rule == "spherical_axial" and bool(problem.wanted & RULED)
        with self.clock.stage("forces"):
            along = along_joints(problem.applied, closed.task.t, closed.joints, closed.V)
            qdd = closed.joints.accelerations(closed.V, A)
            need = need - self._project(closed, along - mechanism.rotors * qdd)
            f, condition = closed.actuator_forces(need, axial_line(mechanism, at, rows) if ruled else None)
            values = force_values(closed, qdd, closed.generalized_forces(need), f, along)
        if problem.wanted & RULED:
            solved = dict.fromkeys(RULED if ruled else ("actuator_force", "axis_moment"), condition)
            conditions |= worst_of(conditions, solved)
        if "reaction" in problem.wanted:
            with self.clock.stage("reactions"):
                gaps, couplings = closed.multipliers(need, f)
                wrenches = joint_wrenches(mechanism, at, rows, gaps)
                values["reaction"] = reactions(mechanism, at.R, at.p, wrenches, couplings)
        return values
