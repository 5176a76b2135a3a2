"""What a tree engine (Pinocchio, MuJoCo) has to say about its open tree; everything else follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from screwgauge.models.layout import Closure
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class BodyPoses:
    """Poses and Jacobians of all bodies of the tree, ground first.

    Attributes:
        R, p: Orientation and origin in the world. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
        J: Jacobian of the angular velocity and of the origin's velocity, world axes. (n, n_body + 1, 6, n_v).
    """

    R: Array
    p: Array
    J: Array


class Tree(Protocol):
    """An engine's open tree. All arrays are in the engine's own coordinate order; world axes; ground is body 0."""

    engine: str
    version: str
    coordinates: tuple[str, ...]
    bodies: tuple[str, ...]  # without ground
    closures: tuple[Closure, ...]
    parents: tuple[str, ...]  # tree parent of each body
    com: Array  # centre of mass in each body's frame [m], shape (n_body, 3)

    def poses(self, q: Array) -> BodyPoses:
        """Shape (n, n_v)."""
        ...

    def accelerations(self, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Velocity and acceleration of each body: angular, then of its origin; gravity not included.

        Returns:
            Shape (n, n_body + 1, 6) each.
        """
        ...

    def com_accelerations(self, q: Array, v: Array, a: Array) -> Array:
        """The engine's own acceleration of each centre of mass. Shape (n, n_body, 3)."""
        ...

    def tree_force(self, q: Array, v: Array, a: Array) -> Array:
        """Inverse dynamics of the open tree under gravity alone. Shape (n, n_v)."""
        ...

    def soft_force(self, q: Array, v: Array, a: Array, residuals: Array) -> tuple[Array, float]:
        """The same with soft constraints on, if the engine has them, and the absolute tolerance that follows.

        Args:
            residuals: Largest closure residual of position, rate and acceleration. Shape (3,).
        """
        ...

    def transmitted(self, q: Array, v: Array, a: Array, wrench: Array) -> Array:
        """Wrench on each body from its tree parent: force, then moment about the body's origin.

        Args:
            wrench: External force and moment about the origin of each body. Shape (n, n_body + 1, 6).

        Returns:
            Shape (n, n_body + 1, 6); ground's is zero.
        """
        ...
