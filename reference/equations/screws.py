"""Vectors, twists and wrenches (section 2.1 of the paper).

A twist is ``[angular; linear at O]``, and a wrench is ``[force; moment about O]`` (eq. 9), both in world axes.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import FEW
from screwgauge.reference.rotations import cross as cross  # vector product, re-exported for users of screws

Array = NDArray[Any]
"""Floats of any precision, or objects that support arithmetic."""

_SWAPPED = [3, 4, 5, 0, 1, 2]


def dot(a: Array, b: Array) -> Any:
    """Return the scalar product along the last axis."""
    return (a * b).sum(-1)


def scale(s: Any, v: Array) -> Array:
    """Multiply each vector by a scalar. Shapes (...), (..., m)."""
    return np.asarray(np.asarray(s)[..., None] * v)


def times(M: Array, v: Array) -> Array:
    """Multiply matrices by vectors. Shapes (..., m, n), (..., n)."""
    if M.size <= FEW or object in (M.dtype, v.dtype):
        return np.asarray((M @ v[..., None])[..., 0])
    return np.asarray(np.einsum("...ij,...j->...i", M, v))  # about twice as fast


def transpose(M: Array) -> Array:
    """Transpose stacked matrices."""
    return M.swapaxes(-1, -2)


def join(*parts: Array) -> Array:
    """Concatenate vectors of different lengths. Shapes (..., m_i) -> (..., sum m_i)."""
    return _concatenate(parts, ())


def stack(*parts: Array) -> Array:
    """Stack the rows of matrices. Shapes (..., m_i, n) -> (..., sum m_i, n)."""
    return _concatenate(parts, (slice(None),))


def _concatenate(parts: tuple[Array, ...], after: tuple[slice, ...]) -> Array:
    """Concatenate arrays and broadcast leading shapes; `after` has a slice for each axis after the joined axis."""
    axis = -1 - len(after)
    leads = {x.shape[:axis] for x in parts}
    if len(leads) == 1:
        return np.concatenate(parts, axis=axis)
    ends = np.cumsum([x.shape[axis] for x in parts]).tolist()
    shape = (*np.broadcast_shapes(*leads), ends[-1], *parts[0].shape[parts[0].ndim - len(after) :])
    whole = np.empty(shape, dtype=np.result_type(*parts))
    for x, end in zip(parts, ends, strict=True):
        place: Any = (..., slice(end - x.shape[axis], end), *after)
        whole[place] = x
    return whole


def rotation(axis: Array, sine: Any, cosine: Any) -> Array:
    """Evaluate Rodrigues' formula ``e e^T + cos (1 - e e^T) + sin [e x]``; cf. eqs. (19)-(21). Shape (..., 3, 3)."""
    E, F, K = _generators(axis.tobytes(), axis.dtype.str)
    return np.asarray(E + np.asarray(cosine)[..., None, None] * F + np.asarray(sine)[..., None, None] * K)


@lru_cache(maxsize=1024)
def _generators(axis: bytes, dtype: str) -> tuple[Array, Array, Array]:
    """Return ``e e^T``, ``1 - e e^T`` and ``[e x]``; cache them because joint axes repeat."""
    e = np.frombuffer(axis, dtype=dtype)
    (x, y, z), E = e, np.outer(e, e)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]], dtype=e.dtype)
    return E, np.eye(3, dtype=e.dtype) - E, K


def unit_screws(turns: Array, directions: Array, points: Array) -> Array:
    """Build unit screws of rotations and slides, eqs. (2), (18). (m,), (..., m, 3), (..., m, 3) -> (..., m, 6)."""
    S = np.zeros((*directions.shape[:-1], 6), dtype=directions.dtype)
    e = directions[..., turns, :]
    S[..., turns, :3], S[..., turns, 3:] = e, cross(points[..., turns, :], e)
    S[..., ~turns, 3:] = directions[..., ~turns, :]
    return S


def force(f: Array, r: Array) -> Array:
    """Return the wrench of a force `f` acting at the point `r`, eq. (9). Shape (..., 6)."""
    return join(f, cross(r, f))


def couple(m: Array) -> Array:
    """Return the wrench of a moment `m`. Shape (..., 6)."""
    return join(0.0 * m, m)


def power(W: Array, V: Array) -> Any:
    """Return the power of a wrench on a twist, which is their reciprocal product, eq. (8)."""
    return dot(W, V[..., _SWAPPED])


def powers(W: Array, V: Array) -> Array:
    """Return the power of each of m wrenches on each of n twists. Shapes (..., m, 6), (..., n, 6) -> (..., m, n)."""
    return np.asarray(W @ transpose(V[..., _SWAPPED]))


def lie_bracket(X: Array, Y: Array) -> Array:
    """Return the Lie bracket ``[w1 x w2; w1 x v2 - w2 x v1]`` of two twists, eq. (36) with a corrected first row."""
    w1, w2 = X[..., :3], Y[..., :3]
    return join(cross(w1, w2), cross(w1, Y[..., 3:]) - cross(w2, X[..., 3:]))


def velocity_at(V: Array, r: Array) -> Array:
    """Return the velocity [m/s] of the body point at `r`, eq. (28)."""
    return np.asarray(V[..., 3:] + cross(V[..., :3], r))
