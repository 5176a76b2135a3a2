"""Compute closed poses, velocities and accelerations of a given motion, for engines with their own coordinates.

An engine supplies the body poses and the constraint residuals at its coordinates. Joint coordinates that a motion
prescribes, or that couplings relate, become further unknowns, because body poses do not show full turns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.engines.kit.poses import JointReading, follow_joints, read_joints
from screwgauge.engines.kit.projection import along_line, min_norm
from screwgauge.problem import GivenMotion, Rows
from screwgauge.quantities import length
from screwgauge.reference import linear
from screwgauge.reference.closed.continuation import Continuation
from screwgauge.reference.couplings import CouplingRows, bind
from screwgauge.reference.mechanism import KINDS, Mechanism
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Poses and constraint residuals (gaps) of a mechanism at engine coordinates x.

    Attributes:
        R, p: Poses of the bodies, ground first. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
        T: Twist of each body (angular velocity, then velocity of its origin) per unit rate of x.
            Shape (n, n_body + 1, 6, n_x).
        gaps: Residual of each constraint except couplings [m or rad]. Shape (n, m).
        G: Derivative of the gaps with respect to x. Shape (n, m, n_x).
    """

    R: Array
    p: Array
    T: Array
    gaps: Array
    G: Array


Place = Callable[[Array], Placement]
"""Coordinates of an engine, shape (n, n_x), -> poses and gaps."""


@dataclass(frozen=True, eq=False)
class ClosedMotion:
    """Samples of a given motion at which the loops are closed.

    Attributes:
        x: Coordinates of the engine. Shape (n, n_x).
        at: Poses and gaps at these coordinates.
        joints: Joint coordinates at these poses.
        system: Dimensionless closing system: derivatives of the gaps, of the equations that link further unknowns to
            the poses, of the couplings and of y, with respect to x and the s further unknowns.
            Shape (n, m + s + c + k, n_x + s).
        units, rows: Units of the system's columns and rows. Shapes (n_x + s,), (m + s + c + k,).
        tracked: Indices of the joint coordinates that are further unknowns.
    """

    mechanism: Mechanism
    task: GivenMotion
    x: Array
    at: Placement
    joints: JointReading
    system: Array
    units: Array
    rows: Array
    tracked: list[int]

    @cached_property
    def _inverted(self) -> tuple[Array, Array]:
        inverse, condition = linear.invert_along(self.system)
        return inverse * self.units[:, None] / self.rows, condition

    @property
    def inverse(self) -> Array:
        """Inverse of the closing system in physical units. Shape (n, n_x + s, m + s + c + k)."""
        return self._inverted[0]

    @property
    def condition(self) -> Array:
        """Condition number of the closing system. Shape (n,)."""
        return self._inverted[1]

    @property
    def A(self) -> Array:
        """Closing system in physical units, except the rows of y. Shape (n, m + s + c, n_x + s)."""
        m = len(self.rows) - self.task.y.shape[1]
        return np.asarray(self.system[:, :m] * self.rows[:m, None] / self.units)

    @property
    def q(self) -> Array:
        """Joint coordinates [rad or m]. Shape (n, n_q)."""
        return self.joints.q

    @cached_property
    def K(self) -> Array:
        """Rates of x per unit rate of y. Shape (n, n_x, k)."""
        return np.asarray(self.inverse[:, : self.x.shape[1], -self.task.y.shape[1] :])

    @cached_property
    def J(self) -> Array:
        """Rates of the joint coordinates per unit rate of x. Shape (n, n_q, n_x)."""
        n, q, b, _ = self.joints.matrix.shape
        return np.asarray(self.joints.matrix.reshape(n, q, 6 * b) @ self.at.T.reshape(n, 6 * b, -1))

    @cached_property
    def xd(self) -> Array:
        """Rates of x. Shape (n, n_x)."""
        return np.asarray((self.K @ self.task.yd[..., None])[..., 0])

    @cached_property
    def V(self) -> Array:
        """Twists of the bodies. Shape (n, n_body + 1, 6)."""
        return self._body_rates(self.xd)

    @cached_property
    def qd(self) -> Array:
        """Rates of the joint coordinates. Shape (n, n_q)."""
        return self.joints.rates(self.V)

    def _body_rates(self, rates: Array) -> Array:
        return np.asarray((self.at.T @ rates[:, None, :, None])[..., 0])

    def accelerations(self, bias: Array, rest: Array, ydd: Array | None = None) -> tuple[Array, Array]:
        """Return the accelerations of x and of the bodies.

        Args:
            bias: Second derivative of the gaps at zero accelerations of x, ``dG/dt xd``. Shape (n, m).
            rest: Accelerations of the bodies at zero accelerations of x, ``dT/dt xd``. Shape (n, n_body + 1, 6).
            ydd: Second derivatives of the independent coordinates, by default the motion's second derivatives. Shape
                (n, k).

        Returns:
            Second derivatives of x, shape (n, n_x), and accelerations of the bodies (angular part, then linear part at
            the origin), (n, n_body + 1, 6). `JointReading.accelerations` computes those of the joint coordinates.
        """
        s, tied = self.tracked, self.joints.accelerations(self.V, rest)
        coupled = bind_to(self.mechanism, s).bias(self.q[:, s], self.qd[:, s])
        given = self.task.ydd if ydd is None else ydd
        right = np.concatenate([-bias, -tied[:, s], -coupled, given], axis=1)
        xdd = (self.inverse[:, : self.x.shape[1]] @ right[..., None])[..., 0]
        return xdd, rest + self._body_rates(xdd)

    def generalized_forces(self, need: Array) -> Array:
        """Return the forces along y that are equivalent to given forces along x. Shape (n, n_x) -> (n, k)."""
        return np.asarray((self.K.swapaxes(1, 2) @ need[..., None])[..., 0])

    def actuator_forces(self, need: Array, line: Array | None = None) -> tuple[Array, Array]:
        """Solve for actuator forces that, together with constraint forces, supply the required forces along x.

        Args:
            need: Required forces: inertia minus all applied forces. Shape (n, n_x).
            line: For the rule ``spherical_axial``: the joint's force per unit multiplier of the gaps, in two
                directions perpendicular to its line. Shape (n, 2, m). By default actuator forces have minimum norm.

        Returns:
            Actuator forces, shape (n, n_actuator), and the condition number of their equations, (n,).
        """
        if line is None:
            return min_norm(self._drive @ self.K, self.generalized_forces(need), self.task.idle)
        wide = ((0, 0), (0, 0), (0, len(self.tracked)))
        across = np.pad(line, ((0, 0), (0, 0), (0, self.A.shape[1] - self.at.gaps.shape[1])))
        return along_line(np.pad(self._drive, wide), self.A, np.pad(need, wide[1:]), across)

    def multipliers(self, need: Array, f: Array) -> tuple[Array, Array]:
        """Return the multipliers of gaps, (n, m), and couplings, (n, n_coupling), that supply the remaining forces.

        Args:
            need, f: See `actuator_forces`.
        """
        m, s, rest = self.at.gaps.shape[1], len(self.tracked), need - (f[:, None] @ self._drive)[:, 0]
        # the force that actuators do not supply does no work in motions along y, so the multipliers of y are zero
        forces = (rest[:, None] @ self.inverse[:, : self.x.shape[1]])[:, 0]
        return forces[:, :m], forces[:, m + s : -self.task.y.shape[1]]

    @property
    def _drive(self) -> Array:
        """Rates of the actuated coordinates per unit rate of x. Shape (n, n_actuator, n_x)."""
        return self.J[:, self.mechanism.actuated_columns]


def bind_to(mechanism: Mechanism, columns: list[int]) -> CouplingRows:
    """Bind a mechanism's couplings to some of its joint coordinates."""
    return bind(mechanism.couplings, [mechanism.coordinates[i] for i in columns])


class Closing:
    """Solver that closes an engine's loops by Newton's method along a motion that starts in the home assembly mode.

    The gaps may include redundant constraints.
    """

    def __init__(self, mechanism: Mechanism, place: Place, home: Array, units: Array, gap_units: Array) -> None:
        """Start at the home pose.

        Args:
            home: Coordinates of the engine at the home pose; they nearly close the loops. Shape (n_x,).
            units: Unit of each entry of x: 1 for angles and dimensionless entries, a length for lengths.
                Shape (n_x,).
            gap_units: Unit of each gap, as for `units`. Shape (m,).
        """
        self.mechanism, self.place, names = mechanism, place, mechanism.coordinates
        wanted = {*mechanism.independent.values(), *(name for one in mechanism.couplings for name in one.named)}
        self.tracked = [i for i, name in enumerate(names) if name in wanted]
        self.couplings = bind_to(mechanism, self.tracked)
        self.pick = [self.tracked.index(i) for i in mechanism.independent_columns]
        turns = np.array([turn for joint in mechanism.joints for turn in KINDS[joint.kind]], dtype=bool)[self.tracked]
        sizes = np.where(turns, 1.0, length(mechanism))
        self.home, self.size = np.concatenate([home, mechanism.home[self.tracked]]), np.concatenate([units, sizes])
        self.y_size, coupled = sizes[self.pick], sizes[self.couplings.columns]
        self.rows = np.concatenate([gap_units, sizes, coupled, self.y_size])
        angles = np.concatenate([np.zeros(len(home), dtype=bool), turns]), turns[self.pick]
        start = self.home / self.size, mechanism.home[mechanism.independent_columns]
        self.before: Array | None = None
        self.path = Continuation(self._evaluate, start, angles, self.y_size)

    def _evaluate(self, z: Array, y: Array) -> tuple[Array, ...]:
        """Return residuals and their derivative, both dimensionless."""
        x, s = self._split(z)
        at = self.place(x)
        read = read_joints(self.mechanism, at.R, at.p, self._scatter(s))
        open_by, A = self._system(at, read, s)
        away = s[:, self.pick] - y * self.y_size
        return np.concatenate([open_by, away], axis=1) / self.rows, A * self.size / self.rows[:, None]

    def _scatter(self, s: Array) -> Array:
        """Extend the unknown joint coordinates to all joint coordinates, with NaN elsewhere. (n, n_s) -> (n, n_q)."""
        near = np.full((len(s), len(self.mechanism.coordinates)), np.nan)
        near[:, self.tracked] = s
        return near

    def _system(self, at: Placement, read: JointReading, s: Array) -> tuple[Array, Array]:
        """Return residuals and the whole closing system, with the rows of y last."""
        (n, m, n_x), k, c = at.G.shape, len(self.tracked), len(self.couplings)
        A = np.zeros((n, m + k + c + len(self.pick), n_x + k))
        A[:, :m, :n_x] = at.G
        rows = read.matrix[:, self.tracked]
        A[:, m : m + k, :n_x] = rows.reshape(n, k, -1) @ at.T.reshape(n, -1, n_x)
        A[:, range(m, m + k), range(n_x, n_x + k)] = -1.0
        A[:, m + k : m + k + c, n_x:] = self.couplings.matrix(s)
        A[:, range(m + k + c, A.shape[1]), [n_x + i for i in self.pick]] = 1.0
        tied = read.q[:, self.tracked] - s
        return np.concatenate([at.gaps, tied, self.couplings.residuals(s)], axis=1), A

    def follow(self, task: GivenMotion) -> ClosedMotion:
        """Close the next samples of a motion.

        Raises:
            ClosureError: The motion reaches a pose where the loops cannot close, or passes through a singular pose.
        """
        z, system, *_ = self.path.follow(task.y, task.t, (task.yd, task.ydd), task.drive)
        x, s = self._split(z)
        at = self.place(x)
        joints = follow_joints(self.mechanism, at.R, at.p, self._scatter(s), self.before)
        self.before = joints.q[-1]
        return self._close(task, x, at, joints, system)

    def perturb(self, closed: ClosedMotion, some: Rows, shake: Array) -> ClosedMotion:
        """Perturb the unknowns at some samples to simulate rounding.

        Args:
            some: Indices of the samples.
            shake: Dimensionless perturbation. Shape (n_some, n_x + s).
        """
        z = np.concatenate([closed.x, closed.q[:, self.tracked]], axis=1)[some] / self.size + shake
        x, s = self._split(z)
        at = self.place(x)
        joints = read_joints(self.mechanism, at.R, at.p, closed.q[some])
        system = self._system(at, joints, s)[1] * self.size / self.rows[:, None]
        return self._close(closed.task.part(some), x, at, joints, system)

    def _split(self, z: Array) -> tuple[Array, Array]:
        """Split the unknowns into engine coordinates and further unknowns."""
        x, s = np.split(z * self.size, [len(self.home) - len(self.tracked)], axis=1)
        return x, s

    def _close(self, task: GivenMotion, x: Array, at: Placement, joints: JointReading, system: Array) -> ClosedMotion:
        return ClosedMotion(self.mechanism, task, x, at, joints, system, self.size, self.rows, self.tracked)
