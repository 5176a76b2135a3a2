"""The way back onto the closed loops, by the smallest correction of an engine's tree coordinates and rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.engines.tree.protocol import Mover
from screwgauge.reference.closed.newton import ROUNDING
from screwgauge.reference.errors import SingularPoseError
from screwgauge.reference.rotations import Array

#: Singular values of the closing rows below this share of the largest are not divided by: next to a singular pose of
#: the loops the smallest correction would be a long one along what the rows hardly see.
SMALLEST = 1e-7
MOST = 4  # from a state that drifted by 1e-6 two corrections are enough


@dataclass(frozen=True, slots=True, eq=False)
class Projected:
    """A state on the closed loops, and how far it was off.

    Attributes:
        q, v: Tree coordinates and rates. Shape (n_v,).
        gap, rate: Largest closing error that was removed, in position [m or rad] and rate [per s].
        left: Largest closing error that is left [m or rad].
    """

    q: Array
    v: Array
    gap: float
    rate: float
    left: float


def project(mover: Mover, q: Array, v: Array) -> Projected:
    """Brings a state back onto the closed loops and leaves the engine there.

    Newton's method with one factorisation: what drifted by 1e-6 is closed to 1e-12 by the first correction.

    Raises:
        SingularPoseError: The state has grown until it is no pose any more.
    """
    mover.place(q, v)
    gaps, G = mover.closure()
    if not len(gaps):
        return Projected(q, v, 0.0, 0.0, 0.0)
    gap = left = float(np.abs(gaps).max())
    with np.errstate(invalid="ignore", over="ignore"):
        rate = float(np.abs(G @ v).max())
    if not np.isfinite([gap, rate]).all():
        raise SingularPoseError(
            "the state grew until nothing brings it back onto the loops", "integration", "take smaller steps"
        )
    if gap <= ROUNDING and rate <= 4 * ROUNDING * float(np.abs(v).max()):
        return Projected(q, v, gap, rate, gap)
    inverse = _pseudo_inverse(G)
    for _ in range(MOST):
        if not ROUNDING < left < np.inf:
            break
        trial = q - inverse @ gaps
        mover.place(trial, v)
        gaps, found = mover.closure()
        after = float(np.abs(gaps).max())
        if not after < left:
            mover.place(q, v)
            break
        stalled, (q, G, left) = after > 0.5 * left, (trial, found, after)
        if stalled:
            break
    for _ in range(2):
        v = v - inverse @ (G @ v)
    mover.place(q, v)
    return Projected(q, v, gap, rate, left)


def _pseudo_inverse(G: Array) -> Array:
    """Shape (m, n) -> (n, m), by the eigenvectors of G^T G: small for any number of redundant rows."""
    w, V = np.linalg.eigh(G.T @ G)
    kept = w > SMALLEST**2 * max(float(w[-1]), np.finfo(float).tiny)
    V = V[:, kept]
    return np.asarray((V / w[kept]) @ (V.T @ G.T))
