"""Other numbers in the place of those in a model file: which, where they have an effect, and how far off they are."""

from collections.abc import Callable

import numpy as np
from campaigns.marks import Mark, is_urdf

from screwgauge.models.files.mjcf import compilers
from screwgauge.models.matter import steiner
from screwgauge.reference.rotations import Array, rotation, rotation_vector
from support.robots import unit

Random = np.random.Generator


class CannotError(Exception):
    """A kind of change that a file has no place for."""


# --- other numbers: of those that are there, a relative size, chance and the part


def grown(x: Array, size: float, *_: object) -> Array:
    return (1.0 + size) * x


def times(factor: float) -> Callable[..., Array]:
    return lambda x, *_: factor * x


def shifted(x: Array, size: float, rng: Random, _: Mark) -> Array:
    """By a share of 0.1 m."""
    return x + 0.1 * size * unit(rng)


def one_grown(I: Array, size: float, rng: Random, _: Mark) -> Array:
    I[(k := rng.integers(3)), k] *= 1.0 + size
    return I


def product_more(I: Array, size: float, rng: Random, _: Mark) -> Array:
    i, j = ((0, 1), (0, 2), (1, 2))[rng.integers(3)]
    I[i, j] = I[j, i] = I[i, j] + size * np.diag(I).min()
    return I


def reordered(I: Array, *_: object) -> Array:
    I[0, 1], I[1, 2] = I[1, 2], I[0, 1]
    I[1, 0], I[2, 1] = I[0, 1], I[1, 2]
    return I


def about_the_origin(I: Array, size: float, rng: Random, mark: Mark) -> Array:
    R = mark.get("turn")
    return I + float(mark.get("mass")[0]) * R.T @ steiner(mark.get("position")) @ R


def tilted(x: Array, size: float, rng: Random, _: Mark) -> Array:
    axis = x / np.linalg.norm(x)
    across = np.cross(axis, unit(rng))
    tilt = axis + np.tan(size) * across / np.linalg.norm(across)
    return tilt / np.linalg.norm(tilt)


def turned_across(R: Array, size: float, rng: Random, mark: Mark) -> Array:
    """About no other axis than across the joint's: about that it would be another zero."""
    across = np.cross(about(mark), unit(rng))
    return R @ rotation(across / np.linalg.norm(across), np.array(size))


def turned_about(R: Array, size: float, rng: Random, mark: Mark) -> Array:
    return R @ rotation(about(mark), np.array(size))


def more(x: Array, size: float, *_: object) -> Array:
    return x + size * (x if x[0] else 1.0)


def permuted(I: Array, *_: object) -> Array:
    return I + np.diag(np.roll(np.diag(I), 1) - np.diag(I))


def last_more(x: Array, size: float, *_: object) -> Array:
    return np.r_[x[:-1], x[-1] + size * max(1.0, abs(x[-1]))]


def negated(I: Array, *_: object) -> Array:
    return 2.0 * np.diag(np.diag(I)) - I


def pulled(k: int) -> Callable[..., Array]:
    """Gravity along one axis."""
    return lambda g, size, *_: g + 9.81 * size * np.eye(3)[k]


# --- where they have an effect


def off(mark: Mark) -> bool:
    return bool(np.linalg.norm(mark.get("position")) > 1e-3)


def principal(mark: Mark) -> bool:
    """Whether a tensor is written as three moments, none like another."""
    I = mark.get("tensor")
    return unlike(I) and not np.any(I - np.diag(np.diag(I)))


def full(mark: Mark) -> bool:
    """Whether a tensor is written with products and three moments, none like another."""
    I = mark.get("tensor")
    return unlike(I) and bool(np.any(I - np.diag(np.diag(I))))


def unlike(I: Array) -> bool:
    moments = np.sort(np.diag(I))
    return bool(np.diff(moments).min() > 1e-2 * moments[-1])


def asymmetric(mark: Mark) -> bool:
    I = mark.get("tensor")
    moments = np.linalg.eigvalsh(I)
    products = np.abs(I - np.diag(np.diag(I))).max()
    return bool(np.diff(moments).min() > 1e-2 * moments[-1] and products > 1e-3 * moments[-1])


def unlike_products(mark: Mark) -> bool:
    I = mark.get("tensor")
    return bool(abs(I[0, 1] - I[1, 2]) > 1e-3 * np.abs(I).max())


def turned(mark: Mark) -> bool:
    R, I = mark.get("turn"), mark.get("tensor")
    return bool(np.abs(R - np.eye(3)).max() > 1e-2) and bool(np.abs(R.T @ I @ R - I).max() > 0.0)


def hinge(mark: Mark) -> bool:
    return (mark.element.get("type") or "hinge") in ("revolute", "continuous", "hinge")


def own_axis(mark: Mark) -> bool:
    """Whether the axis stands at the joint itself and not in a default."""
    return is_urdf(mark.xml) or bool(mark.element.get("axis"))


def about(mark: Mark) -> Array:
    """Axis of the joint that a placement is before. Unit vector, shape (3,)."""
    axis = mark.joint.get("axis")
    return np.asarray(axis / np.linalg.norm(axis))


def pivoted(mark: Mark) -> bool:
    """Whether a placement is before a hinge about an axis through its origin."""
    return hinge(mark.joint) and (is_urdf(mark.xml) or not np.any(mark.joint.get("position")))


def turned_axis(mark: Mark) -> bool:
    """Whether the orientation of a placement takes the axis of its joint to another line: half a turn is its sign."""
    return bool(np.linalg.norm(np.cross(mark.get("turn") @ about(mark), about(mark))) > 1e-2)


def limited(mark: Mark) -> bool:
    return mark.element.get("type") != "continuous"


# --- how large a change is


def distance(old: Array, new: Array, mark: Mark) -> float:
    """Norm of a difference."""
    return float(np.linalg.norm(new - old))


def angle(old: Array, new: Array, mark: Mark) -> float:
    """Between two orientations [rad]."""
    return float(np.linalg.norm(rotation_vector(old.T @ new)))


def turned_by(old: Array, new: Array, mark: Mark) -> float:
    I = mark.get("tensor")
    step = distance(old @ I @ old.T, new @ I @ new.T, mark)
    if step <= 1e-9 * np.abs(I).max():
        raise CannotError("nothing would change")
    return step


def of_limit(old: Array, new: Array, mark: Mark) -> float:
    """Difference of limits [m or rad]."""
    degrees = not is_urdf(mark.xml) and compilers(mark.xml).get("angle") != "radian" and hinge(mark)
    return distance(old, new, mark) * (np.pi / 180.0 if degrees else 1.0)
