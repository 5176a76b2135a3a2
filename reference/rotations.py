"""Rotations about unit axes, and angles about serial pairs and triples of axes, for arrays of any leading shape."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TURN = 2.0 * np.pi
#: Signs of the second angle triple: a rotation has two triples about orthogonal axes, (x, y, z) and (x, -y, z) + pi.
MIDDLE = np.array([1.0, -1.0, 1.0])
#: Axis after x, y and z; array size (one or two poses) up to which indexing takes less time than the calls it saves.
NEXT, FEW = np.array([1, 2, 0]), 150


def skew(v: Array) -> Array:
    """Return the matrix of the cross product, ``skew(v) @ x = v x x``. Shape (..., 3) -> (..., 3, 3)."""
    zero = np.zeros_like(v[..., 0])
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*v.shape[:-1], 3, 3)


def cross(a: Array, b: Array) -> Array:
    """Return the cross product along the last axis, like numpy but with a fraction of its overhead. Shape (..., 3)."""
    if max(a.size, b.size) <= FEW:
        return np.asarray((a * b.take(NEXT, -1) - a.take(NEXT, -1) * b).take(NEXT, -1))
    alike = a.shape == b.shape and a.dtype == b.dtype
    c = np.empty_like(a) if alike else np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    ax, ay, az, bx, by, bz = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    c[..., 0] = ay * bz - az * by
    c[..., 1] = az * bx - ax * bz
    c[..., 2] = ax * by - ay * bx
    return c


def across(axis: Array) -> tuple[Sequence[str], Array]:
    """Return labels and directions orthogonal to a unit axis; they are frame axes if the axis is a frame axis.

    Returns:
        Labels such as ``xy``, or ``12``; and two orthogonal unit vectors, shape (2, 3).
    """
    k = int(np.argmax(np.abs(axis)))
    others = [i for i in range(3) if i != k]
    if not axis[others].any():
        return ["xyz"[i] for i in others], np.eye(3, dtype=axis.dtype)[others]
    first = np.cross(axis, np.eye(3, dtype=axis.dtype)[others[0]])
    first = first / np.linalg.norm(first)
    return "12", np.array([first, np.cross(axis, first)])


def widest(points: ArrayLike) -> float:
    """Return the largest distance between two points, or 0 for fewer than two points. Shape (n, 3)."""
    cloud = np.reshape(points, (-1, 3))
    return float(np.linalg.norm(cloud[:, None] - cloud[None], axis=2).max(initial=0.0))


def lanes(n: int, *shape: int) -> Array:
    """Allocate an array of n samples that are adjacent in memory, component by component. Shape (n, ...)."""
    return np.empty((*shape, n)).transpose(len(shape), *range(len(shape)))


def product(A: Array, B: Array) -> Array:
    """Multiply matrices entry by entry, which is faster for arrays allocated by `lanes`.

    Args:
        A: Shape (n, ..., 3, 3).
        B: Second factor, per sample or constant. Shape (n, ..., 3, 3) or (3, 3).
    """
    if A.size <= FEW:
        return np.asarray(A @ B)
    out = lanes(len(A), *A.shape[1:])
    part = np.empty_like(out)
    np.multiply(A[..., :1], B[..., :1, :], out=out)
    for k in (1, 2):
        out += np.multiply(A[..., k : k + 1], B[..., k : k + 1, :], out=part)
    return out


def times(A: Array, v: Array) -> Array:
    """Multiply matrices by vectors entry by entry. Shapes (n, ..., 3, 3), (n, ..., 3) or (3,)."""
    if A.size <= FEW:
        return np.asarray((A @ v[..., None])[..., 0])
    return A[..., 0] * v[..., :1] + A[..., 1] * v[..., 1:2] + A[..., 2] * v[..., 2:]


def vee(M: Array) -> Array:
    """Return the axial vector of the antisymmetric part; the inverse of `skew`. Shape (..., 3, 3) -> (..., 3)."""
    return 0.5 * np.stack(
        [M[..., 2, 1] - M[..., 1, 2], M[..., 0, 2] - M[..., 2, 0], M[..., 1, 0] - M[..., 0, 1]], axis=-1
    )


def rotation_vector(R: Array) -> Array:
    """Return the axis times the angle, which is at most pi [rad]. Shape (..., 3, 3) -> (..., 3)."""
    sine = vee(R)
    size = np.linalg.norm(sine, axis=-1, keepdims=True)
    angle = np.arctan2(size, 0.5 * (np.trace(R, axis1=-2, axis2=-1)[..., None] - 1.0))
    axis, half = sine / np.maximum(size, 1e-300), ((size <= 1e-7) & (angle > 1.0))[..., 0]
    if half.any():  # at half a turn the sine vanishes; the axis is the invariant direction
        axis[half] = np.linalg.svd(R[half] - np.eye(3))[2][..., -1, :]
    return np.asarray(np.where(angle < 1e-7, sine, angle * axis))


def rotation(axis: Array, angle: Array) -> Array:
    """Return the rotation matrix for an axis and an angle by Rodrigues' formula.

    Args:
        axis: Unit axis. Shape (3,).
        angle: Angle [rad]. Shape (...).

    Returns:
        Rotation matrix. Shape (..., 3, 3).
    """
    K, KK, I = _generator(axis.tobytes(), axis.dtype.str)
    # 1 - cos as 2 sin^2 of the half angle avoids cancellation at small angles
    sine, versine = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
    some = range(2, 2 + np.ndim(angle))
    turned = np.multiply.outer(K, sine) + np.multiply.outer(KK, versine) + I.reshape(3, 3, *[1] * len(some))
    return np.asarray(turned.transpose(*some, 0, 1))  # samples are adjacent in memory, as in `lanes`


@lru_cache(maxsize=1024)
def _generator(axis: bytes, dtype: str) -> tuple[Array, Array, Array]:
    """Return the skew matrix of an axis, its square and the identity; cache them because joint axes repeat."""
    K = skew(np.frombuffer(axis, dtype=dtype))
    return K, K @ K, np.eye(3, dtype=K.dtype)


def quaternion_rotation(q: Array) -> Array:
    """Return the rotation matrix for a unit quaternion (w, x, y, z). Shape (..., 4) -> (..., 3, 3)."""
    w, K = q[..., :1, None], skew(q[..., 1:])
    return np.asarray(np.eye(3) + 2.0 * (w * K + K @ K))


def sequence_angles(M: Array, m: int = 3, hand: float = 1.0) -> Array:
    """Return the first m angles of ``M = Rot(x, q1) Rot(y, q2) Rot(z, hand q3)``; they also reproduce M in gimbal lock.

    Args:
        M: Rotation matrix in right-handed axes. Shape (..., 3, 3).
        m: Number of axes of the joint; pairs of angles cannot reach gimbal lock.
        hand: -1 if the joint's third axis is opposite to the third of these axes.

    Returns:
        Angles [rad] within half a turn; the second of three angles is within +-pi/2. Shape (..., m).
    """
    if m < 3:
        both = np.arctan2(M[..., 2, 1], M[..., 1, 1]), np.arctan2(M[..., 0, 2], M[..., 0, 0])
        return np.stack(both, axis=-1)[..., :m]
    q1 = np.arctan2(-M[..., 1, 2], M[..., 2, 2])
    q2 = np.arctan2(M[..., 0, 2], np.hypot(M[..., 1, 2], M[..., 2, 2]))
    # consistent with q1: where q2 is a right angle, q1 and q3 are arbitrary, but their combination is correct
    c, s = np.cos(q1)[..., None], np.sin(q1)[..., None]
    row = c * M[..., 1, :2] + s * M[..., 2, :2]
    return np.stack([q1, q2, hand * np.arctan2(row[..., 0], row[..., 1])], axis=-1)


def within_half_turn(angles: Array) -> Array:
    """Reduce angles to the range from -pi to pi. Any shape."""
    return np.asarray(angles - TURN * np.round(angles / TURN))


def nearest_turn(angles: Array, near: Array) -> Array:
    """Add full turns to angles so that they are nearest to given angles. Any shape."""
    return np.asarray(angles + TURN * np.round((near - angles) / TURN))


def other_triple(angles: Array) -> Array:
    """Return the second triple of angles of the same rotation about three orthogonal axes. Shape (..., 3)."""
    return np.asarray(MIDDLE.astype(angles.dtype) * angles + np.pi)


def nearest_angles(angles: Array, near: Array) -> tuple[Array, Flags]:
    """Choose the angles nearest to given angles among both triples of a rotation and all full turns.

    Args:
        angles, near: Angles about orthogonal axes [rad]; fewer than three angles lack a second triple. Shape (..., m).

    Returns:
        The angles, shape (..., m), and flags that are True for the second triple, shape (...).
    """
    one = nearest_turn(angles, near)
    if angles.shape[-1] < 3:
        return one, np.zeros(angles.shape[:-1], dtype=bool)
    other = nearest_turn(other_triple(angles), near)
    swapped = np.abs(other - near).sum(axis=-1) < np.abs(one - near).sum(axis=-1)
    return np.where(swapped[..., None], other, one), swapped


def follow(begin: Array, angles: Array, sure: Flags, t: Array | None = None, rates: Array | None = None) -> Array:
    """Follow angles from sample to sample: choose the equivalent angles nearest to the prediction.

    Args:
        begin: Initial angles, near which the first sample is chosen. Shape (m,).
        angles: Angles of a joint at each sample [rad]. Shape (n, m).
        sure: True for well-determined angles; a sample in gimbal lock does not predict later samples. Shape (n,).
        t, rates: Times [s], shape (n,), and rates [rad/s], shape (n, m), used to predict each sample from the preceding
            sample; without them, the prediction is the preceding sample.

    Returns:
        Continuous angles [rad]. Shape (n, m).
    """
    sure = sure & np.isfinite(angles).all(axis=1)
    if t is None or rates is None:
        t, rates = np.zeros(len(angles)), np.zeros_like(angles)
    at = np.concatenate([t[:1], t[sure]])  # no prediction from `begin`
    half = 0.5 * np.diff(at)[:, None]
    x, r = np.vstack([begin, angles[sure]]), np.vstack([np.zeros_like(begin), rates[sure]])
    half[:1] = 0.0
    if len(begin) == 3:
        same = x[1:] - x[:-1] - half * (r[1:] + r[:-1])
        other = other_triple(x[1:]) - x[:-1] - half * (MIDDLE * r[1:] + r[:-1])
        # whether a sample switches triples does not depend on the triple of the preceding sample
        change = np.abs(within_half_turn(other)).sum(axis=1) < np.abs(within_half_turn(same)).sum(axis=1)
        swapped = (np.cumsum(change) % 2 == 1)[:, None]
        x[1:], r[1:] = np.where(swapped, other_triple(x[1:]), x[1:]), np.where(swapped, MIDDLE * r[1:], r[1:])
    x[1:] -= TURN * np.cumsum(np.round((np.diff(x, axis=0) - half * (r[1:] + r[:-1])) / TURN), axis=0)
    out, last = np.empty_like(angles), np.cumsum(sure)[~sure]
    out[sure] = x[1:]
    out[~sure] = nearest_angles(angles[~sure], x[last] + (t[~sure] - at[last])[:, None] * r[last])[0]
    return out


def across_direction(R: Array, direction: Array) -> Array:
    """Return two world directions orthogonal to a body direction, eq. (56). Shapes (..., 3, 3), (3,) -> (..., 2, 3)."""
    return np.asarray(np.linalg.svd(direction[None])[2][1:] @ R.swapaxes(-1, -2))
