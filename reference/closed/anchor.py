"""A closed pose from which others are predicted, how much the closing equations change away from it, and where no
others are reached."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.rotations import Array

#: A change dJ is small in any of these norms, ``|s^-p U^T dJ V s^(p-1)|``: p = 1 is that of ``J^-1 dJ``; p = 0, that of
#: ``dJ J^-1``, takes tens of steps past the lock of a leg at 1e-6 rad where p = 1/2 takes more than 500.
NORMS = (0.0, 0.5, 1.0)
REMEDY = "shorten the motion or check the geometry"
SHORT = 64 * linear.EPS  # a way in y of which rounding leaves nothing


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """A closed pose from which others are predicted.

    Attributes:
        z, y: Unknowns and independent coordinates, without dimension. Shapes (n_q,), (k,).
        matrix: Derivative of the closure residuals. Shape (m, n_q).
        error: Largest closure residual.
        K: Velocity map dz/dy. Shape (n_q, k).
        U, s, V: Its singular value decomposition ``U diag(s) V^T``. Shapes (m, n_q), (n_q,), (n_q, n_q).
        weights: Squares of what entries of ``U^T dJ V`` are divided by in each norm, `NORMS`. Shape (n_q^2, 3).
        slack: What rounding moves a solution by.
        singular: Whether rounding leaves nothing of the distance to a singular pose.
        blurred: Whether rounding changed the derivative more than steps may.
        all: All joint coordinates, where the unknowns are some of them. Shape (n_all,).
    """

    z: Array
    y: Array
    matrix: Array
    error: float
    K: Array
    U: Array
    s: Array
    V: Array
    weights: Array
    slack: float
    singular: bool
    blurred: bool
    all: Array

    @classmethod
    def at(cls, z: Array, y: Array, matrix: Array, error: float, joints: Array, *, blurred: bool = False) -> Anchor:
        """Shapes as above."""
        U, s, Vt = np.linalg.svd(matrix, full_matrices=False)
        s = np.maximum(s, 1e-100)  # whose powers are numbers
        K = (Vt.T / s) @ U[-len(y) :].T
        weights = [np.outer(s ** (-2.0 * left), s ** (2.0 * left - 2.0)).ravel() for left in NORMS]
        slack, singular = 64 * linear.EPS / float(s[-1]), bool(s[-1] < SHORT * s[0])
        return cls(z, y, matrix, error, K, U, s, Vt.T, np.array(weights).T, slack, singular, blurred, joints)

    def change(self, matrix: Array) -> Array:
        """How much other derivatives differ from this one. Shape (n, m, n_q) -> (n,)."""
        turned = self.U.T @ matrix @ self.V - np.diag(self.s)
        return np.asarray(np.sqrt((turned.reshape(len(matrix), len(self.weights)) ** 2 @ self.weights).min(axis=1)))


def no_further(y: Array) -> str:
    """That a motion cannot be followed beyond independent coordinates `y`, shape (k,)."""
    return f"the loops cannot close beyond y = {np.array2string(y, precision=6)}, or the pose there is singular"


class PathEnd(ClosureError):
    """A motion that cannot be followed any further.

    Attributes:
        z, y: The last pose reached: unknowns, shape (n_q,), and independent coordinates, shape (k,). No dimension.
        t: Time of the sample that cannot be reached [s].
        singular: Whether that pose is singular; otherwise the way is too long, or too near to a singular pose.
        beyond: Whether the loops close beyond it, too.
        landing: The pose there, if so, and its share of the way.
    """

    def __init__(
        self, at: Anchor, size: Array | float, t: float, singular: bool, landing: tuple[Anchor, float] | None
    ) -> None:
        super().__init__(no_further(at.y * size), f"t = {t:g} s", REMEDY)
        self.z, self.y, self.t, self.singular, self.landing = at.z, at.y, t, singular, landing
        self.beyond = landing is not None
