"""Rotations and poses, written here once more: what judges a diagnosis takes no code of what is judged."""

from collections.abc import Iterable
from math import asin, atan2, cos, pi, sin

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Random = np.random.Generator
EYE = np.eye(3)


def unit(v: Iterable[float]) -> Array:
    """A direction. Shape (3,)."""
    v = np.array([*v], dtype=float)
    return np.asarray(v / np.linalg.norm(v))


def direction(rng: Random) -> Array:
    """A direction at random. Shape (3,)."""
    return unit(rng.normal(size=3))


def skew(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def turn(axis: Array, angle: float) -> Array:
    """Rodrigues' formula. Shape (3, 3)."""
    K = skew(unit(axis))
    return np.asarray(EYE + sin(angle) * K + (1.0 - cos(angle)) * K @ K)


def pose(R: Array = EYE, p: Iterable[float] = (0.0, 0.0, 0.0)) -> Array:
    """Shape (4, 4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, [*p]
    return T


def inverse(T: Array) -> Array:
    """Invert a pose."""
    R = T[:3, :3].T
    return pose(R, -R @ T[:3, 3])


def point(T: Array, p: Array) -> Array:
    return np.asarray(T[:3, :3] @ p + T[:3, 3])


def of_rpy(angles: Iterable[float]) -> Array:
    a, b, c = angles
    return turn(EYE[2], c) @ turn(EYE[1], b) @ turn(EYE[0], a)


def to_rpy(R: Array) -> Array:
    if abs(R[2, 0]) > 1.0 - 1e-12:
        return np.array([0.0, -pi / 2 * np.sign(R[2, 0]), atan2(-R[0, 1], R[1, 1])])
    return np.array([atan2(R[2, 1], R[2, 2]), -asin(R[2, 0]), atan2(R[1, 0], R[0, 0])])


def of_quaternion(q: Iterable[float]) -> Array:
    q = np.array([*q], dtype=float)
    w, v = q[0] / np.linalg.norm(q), q[1:] / np.linalg.norm(q)
    return np.asarray((2.0 * w * w - 1.0) * EYE + 2.0 * np.outer(v, v) + 2.0 * w * skew(v))


def to_quaternion(R: Array) -> Array:
    """w, x, y, z, the first of the largest entries positive. Shape (4,)."""
    K = np.array(
        [
            [np.trace(R), R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], 2 * R[0, 0] - np.trace(R), R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
            [R[0, 2] - R[2, 0], R[0, 1] + R[1, 0], 2 * R[1, 1] - np.trace(R), R[1, 2] + R[2, 1]],
            [R[1, 0] - R[0, 1], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 2 * R[2, 2] - np.trace(R)],
        ]
    )
    q = np.linalg.eigh(K)[1][:, -1]
    return np.asarray(q * np.sign(q[np.argmax(np.abs(q))]))


def frame(rng: Random, reach: float = 0.1) -> Array:
    """A pose at random."""
    return pose(turn(direction(rng), rng.uniform(0.2, 3.0)), rng.uniform(-reach, reach, 3))


def numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


def text(values: Iterable[float] | float) -> str:
    """Numbers as a file has them."""
    some = [float(v) for v in np.atleast_1d(np.asarray(values, dtype=float))]
    return " ".join(f"{0.0 if abs(v) < 1e-300 else v:.17g}" for v in some)
