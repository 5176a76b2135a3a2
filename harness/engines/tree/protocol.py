"""The protocol of open-tree engines such as Pinocchio and MuJoCo.

Given motions require the five methods of `OpenTree` that have no default. Simulations and states also require the four
methods of `Mover` and the two methods of `TreeDynamics` that have no default. A `Stepper` is needed only if the engine
has its own integrator.

Arrays follow the engine's own coordinate order and use world axes; ground is body 0. For n states, q, v, a and tau have
shape (n, n_v); for the single state of a mover or stepper, they have shape (n_v,).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.kit.poses import shifted
from screwgauge.models.layout import Closure
from screwgauge.problem import InitialValue, Problem
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.couplings import Coupling
from screwgauge.reference.rotations import Array, cross, skew, times
from screwgauge.solution import Cost

if TYPE_CHECKING:
    from screwgauge.engines.tree.closed_tree import ClosedTree


@dataclass(frozen=True, slots=True, eq=False)
class BodyPoses:
    """Poses of all bodies of the tree, ground first, and the screws that move them.

    Attributes:
        R, p: Orientation and origin in the world frame. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
        screws: Twist about the world origin, angular first, that a unit velocity of each coordinate adds to all bodies
            moved by that coordinate. Shape (n, 6, n_v).
        moves: Matrix with 1 where a coordinate moves a body, else 0. Shape (n_body + 1, n_v).
    """

    R: Array
    p: Array
    screws: Array
    moves: Array

    def points(self, bodies: Sequence[int] | NDArray[np.intp], places: Array) -> Array:
        """Return the world positions of body-fixed points, shape (m, 3) -> (n, m, 3)."""
        return np.asarray(self.p[:, bodies] + times(self.R[:, bodies], places))

    def jacobian(self, moves: Array, at: Array, rows: slice) -> Array:
        """Return derivatives of point positions by coordinates at the selected poses, shape (n_row, m, 3, n_v).

        Args:
            moves: Share of each coordinate's screw that moves each point. Shape (m, n_v).
            at: World points. Shape (n_row, m, 3).
            rows: Selected poses.
        """
        screws = self.screws[rows]
        out: Array = (skew(at).reshape(len(at), -1, 3) @ screws[:, :3]).reshape(*at.shape, screws.shape[2])
        np.subtract(screws[:, None, 3:], out, out=out)
        out *= moves[:, None]
        return out

    def velocities(self, v: Array) -> Array:
        """Return angular velocities, then velocities of the origins. Shape (n, n_v) -> (n, n_body + 1, 6)."""
        return self._sum_over_movers(self.screws, v, self.p)

    def bias(self, rates: Array, v: Array, V: Array, about: Array | float = 0.0) -> Array:
        """Return body accelerations at constant coordinate velocities. Shape (n, n_body + 1, 6).

        Args:
            rates: Time derivatives of the screws. Shape (n, 6, n_v).
            v, V: Velocities of the coordinates, and of the bodies.
            about: World points at which the accelerations of each body are taken. Shape (n, n_body + 1, 3).
        """
        A = self._sum_over_movers(rates, v, self.p - about)
        A[..., 3:] += cross(V[..., :3], V[..., 3:])
        return A

    def forces_along(self, wrenches: Array) -> Array:
        """Project wrenches on the bodies onto the coordinates. Shape (n, n_v).

        Args:
            wrenches: Force and moment about the origin of each body. Shape (n, n_body + 1, 6).
        """
        force = wrenches[..., :3]
        about = np.concatenate([wrenches[..., 3:] + cross(self.p, force), force], axis=2)  # the world origin
        return np.asarray(np.einsum("nxi,nix->ni", self.screws, self.moves.T @ about))

    def _sum_over_movers(self, screws: Array, v: Array, arms: Array) -> Array:
        """Sum the screws of the coordinates that move each body, and shift each sum to the points `arms`."""
        moved = (screws * v[:, None]).reshape(-1, v.shape[1]) @ self.moves.T  # as one matrix product
        V: Array = moved.reshape(len(v), 6, -1).swapaxes(1, 2)
        V[..., 3:] += cross(V[..., :3], arms)
        return V


class OpenTree(Protocol):
    """An engine's open tree.

    Attributes:
        coordinates: Joint coordinates in the engine's order.
        bodies, parents: Bodies, excluding ground, and the parent of each body in the tree.
        closures, couplings: Closures and couplings of its model file.
        masses, com: Mass of each body [kg], and centre of mass in the body frame [m]. Shapes (n_body,), (n_body, 3).
        rounding: Dimensionless closure residual below which float32 poses are meaningless; 0 in float64.
    """

    engine: str
    version: str
    coordinates: tuple[str, ...]
    bodies: tuple[str, ...]
    closures: tuple[Closure, ...]
    couplings: tuple[Coupling, ...]
    parents: tuple[str, ...]
    masses: Array
    com: Array
    rounding: float = 0.0

    @abstractmethod
    def set_gravity(self, gravity: Array | None) -> None:
        """Set gravity [m/s^2], shape (3,); None restores the model file's gravity."""

    @abstractmethod
    def poses(self, q: Array) -> BodyPoses:
        """Compute poses of the bodies, and screws of the coordinates."""

    @abstractmethod
    def bias(self, at: BodyPoses, q: Array, v: Array, V: Array) -> Array:
        """Return angular acceleration and acceleration of the origin of each body at constant coordinate velocities.

        Args:
            at, V: Poses at q, and velocities of the bodies at these poses. V and the result have shape
                (n, n_body + 1, 6).
        """

    def com_accelerations(self, q: Array, v: Array, a: Array) -> Array:
        """Return accelerations of centres of mass without gravity; the default uses `bias`. Shape (n, n_body, 3)."""
        at = self.poses(q)
        V = at.velocities(v)
        A = self.bias(at, q, v, V) + at.velocities(a)
        return shifted(V[:, 1:], A[:, 1:], times(at.R[:, 1:], self.com))

    @abstractmethod
    def tree_force(self, q: Array, v: Array, a: Array) -> Array:
        """Compute inverse dynamics of the open tree under gravity only. Shape (n, n_v)."""

    def mass_matrix(self, q: Array) -> Array:
        """Return the tree's mass matrix; the default uses `tree_force` at unit accelerations. Shape (n, n_v, n_v)."""
        still = np.zeros_like(q)
        rest = self.tree_force(q, still, still)
        return np.stack([self.tree_force(q, still, still + unit) - rest for unit in np.eye(q.shape[1])], axis=1)

    def soft_force(self, q: Array, v: Array, a: Array, residuals: Array) -> tuple[Array, float]:
        """Return inverse dynamics with soft constraints and the resulting tolerance; by default `tree_force` and 0.

        Args:
            residuals: Largest closure residual of position, velocity and acceleration. Shape (3,).
        """
        return self.tree_force(q, v, a), 0.0

    @abstractmethod
    def transmitted(self, at: BodyPoses, q: Array, v: Array, a: Array, wrench: Array) -> Array:
        """Return the wrench on each body from its tree parent: force, then moment about the body's origin.

        If a library supplies only accelerations, `required_wrenches` and `summed_inwards` compute the wrenches.

        Args:
            at: Poses at q.
            wrench: External force and moment about the origin of each body. The argument and the result have shape
                (n, n_body + 1, 6); the result is zero for ground.
        """


#: Fixed-step methods that use an engine's accelerations, see `projected_stepper.ProjectedStepper`.
INTEGRATORS = ("Euler", "RK4")

BodyAt = Callable[[int], tuple[Array, Array, Array]]
"""Body (ground is 0) -> its R (3, 3), p (3,) and Jacobian (6, n_v), [angular; linear], in world axes."""


class Mover(Protocol):
    """An engine that computes accelerations of its closed tree, one state at a time.

    Attributes:
        setting: Description of the method and its settings.
        tree: The open tree of its model.
        notes: Remarks after a motion.
    """

    setting: str

    @property
    def tree(self) -> OpenTree: ...

    @property
    def notes(self) -> tuple[str, ...]: ...

    def place(self, q: Array, v: Array) -> None:
        """Set the state."""

    def closure(self) -> tuple[Array, Array]:
        """Return residuals of closures and couplings [m or rad], shape (m,), and their derivative G, (m, n_v)."""

    def body(self, index: int) -> tuple[Array, Array, Array]:
        """Return R, p and Jacobian of a body, see `BodyAt`."""

    def accelerate(self, tau: Array) -> Array:
        """Return accelerations due to forces along the coordinates, in an array that later calls do not modify.

        Raises:
            SingularPoseError: The accelerations are unreliable.
        """


class Stepper(Protocol):
    """An engine's own fixed-step integrator; later calls leave returned arrays unchanged.

    Attributes:
        setting: Description of the method and its settings.
        order: Order of the method.
        work: Whether the input work is requested; computing it at every step may take longer than the steps.
        closing: Names of the loop-closing forces that `accelerations` returns.
        notes: Remarks after a motion.
    """

    setting: str
    order: int
    work: bool
    closing: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def mover(self) -> Mover:
        """A second engine instance for evaluating states."""

    def begin(self, t: float, q: Array, v: Array) -> None:
        """Set the initial state."""

    def walk(self, t: float, h: float, n: int) -> tuple[Array, Array]:
        """Take n steps of size h from time t; return coordinates and velocities.

        Raises:
            SingularPoseError: The integration cannot continue.
        """

    def accelerations(self, t: float) -> tuple[Array, Array]:
        """Return current accelerations, and the forces named in `closing`, on the child sides [N], (k,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Accelerations:
    """Accelerations of states under given forces.

    Attributes:
        a: Accelerations of the tree's coordinates. Shape (n, n_v).
        cost: Cost of the engine's own calls.
        condition: Condition number of the solved system, if computed. Shape (n,).
        tolerances: Quantity -> absolute error that the engine itself reports.
    """

    a: Array
    cost: Cost
    condition: Array | None = None
    tolerances: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


class TreeDynamics(Protocol):
    """Dynamics of an engine's tree, with its loaded settings.

    Attributes:
        setting: Description of how accelerations are computed.
        integrator, dt: Fixed-step method and its step [s]; `dt` is None for scipy's methods, which use the engine's
            accelerations.
        naive: Whether the engine's forces along actuated joints are used as actuator forces.
    """

    setting: str
    integrator: str
    dt: float | None
    naive: bool = False

    def mover(self) -> Mover:
        """Create a mover that uses the engine's most accurate settings."""

    def stepper(self, closed: ClosedTree, problem: Problem, task: InitialValue) -> Stepper | None:
        """Create the engine's own integrator, if any; if None, `projected_stepper.ProjectedStepper` is used."""
        return None

    def accelerate(self, q: Array, v: Array, tau: Array, springs: Sequence[JointSpring]) -> Accelerations:
        """Compute accelerations of states under given forces along the coordinates.

        Args:
            springs: Additional springs and dampers along tree coordinates.
        """
