"""Unidentifiable directions: simultaneous changes of several numbers that leave all actuator forces unchanged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.screw.nominal import echelon
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.parameters import TENSOR, XYZ
from screwgauge.reference.rotations import Array
from screwgauge.study.identify.regressor import Regressor

#: Kinds of directions: property that can be shifted through a joint without effect; otherwise a list of numbers.
MASS, FIRST, SECOND, LIST = "point mass", "first moment", "second moment", "numbers"
#: Range of relative singular values of the regressor in which the steepest fall determines the rank.
LEAST, MOST = 1e-12, 1e-9
#: Limits for rounding: parts of a unit direction outside the null space, and outside the known directions; entries.
INSIDE, NEW, ENTRY = 1e-7, 1e-5, 1e-6


@dataclass(frozen=True, slots=True)
class Direction:
    """Change in numbers that leaves the forces of every motion unchanged.

    If a load acts at a centre of mass, this holds only to first order.

    Attributes:
        kind: `MASS`, `FIRST` or `SECOND` if that moment shifts through a joint to the other body; otherwise `LIST`.
        joint, axis: For the first three kinds, joint and place in its frame: ``axis``, or names of axes.
        bodies: Body that loses this moment, and body that gains it; a single body if the other body is the ground.
        entries: Moment (about the body's origin) or resistance -> its share in SI units; the largest share is one.
    """

    kind: str
    entries: Mapping[str, float]
    joint: str = ""
    axis: str = ""
    bodies: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Structure:
    """Numbers that some motion can determine, and directions that no motion can determine.

    Attributes:
        count: Number of moments and resistances.
        rank: Number of combinations of moments and resistances that affect forces.
        gap: Singular values on both sides of the rank, relative to the largest singular value.
        directions: All ``count - rank`` unidentifiable directions.
    """

    count: int
    rank: int
    gap: tuple[float, float]
    directions: tuple[Direction, ...]


def structure(regressor: Regressor, seed: int = 0) -> Structure:
    """Determine, from random rates, which of the unknown numbers can be identified at all."""
    matrix = regressor.random_effects(seed)
    scales = np.linalg.norm(matrix, axis=0)
    scales[scales <= LEAST * scales.max(initial=0.0)] = np.inf
    units = np.where(np.isfinite(scales), 1.0 / scales, 1.0)
    values, back = np.linalg.svd(matrix * np.where(np.isfinite(scales), units, 0.0), full_matrices=True)[1:]
    padded = np.append(values, np.zeros(1 + len(units) - len(values))) / max(values.max(initial=0.0), 1e-300)
    fall = padded[1:] / np.maximum(padded[:-1], LEAST)
    fall[(padded[:-1] < LEAST) | (padded[1:] > MOST)] = np.inf
    rank = int(np.argmin(fall)) + 1 if values.any() else 0
    found = _Found(regressor.names, units, back[rank:])
    found.add_all(regressor.scene.mechanism)
    return Structure(len(units), rank, (float(padded[max(rank - 1, 0)]), float(padded[rank])), tuple(found.directions))


class _Found:
    """Directions found so far in a null space.

    Attributes:
        units: For each number, the unit in which its regressor column has length one. Shape (count,).
        null: Orthonormal rows in these units. Shape (c, count).
    """

    def __init__(self, names: Sequence[str], units: Array, null: Array) -> None:
        self.names, self.units, self.null = names, units, null
        self.known, self.directions = np.zeros((0, len(units))), list[Direction]()

    def add_all(self, mechanism: Mechanism) -> None:
        """Add directions of joints, then of single bodies and of pairs at a joint, then all remaining directions."""
        for joint in mechanism.joints:
            for kind, axis, ends in _shifts_through(joint):
                self._pass(joint, kind, axis, ends)
        parts: list[tuple[str, ...]] = [(f"{body.name}.",) for body in mechanism.bodies]
        parts += [(f"{joint.parent}.", f"{joint.child}.", f"{joint.name}.") for joint in mechanism.joints]
        for some in parts:
            self._list(self._null_directions(np.array([name.startswith(some) for name in self.names])))
        self._list(self._remaining_directions())

    def _null_directions(self, inside: NDArray[np.bool_]) -> Array:
        """Return null directions that change only the selected numbers. Shape (m, count)."""
        values, back = np.linalg.svd(self.null[:, ~inside].T)[1:]
        return np.asarray(back[int((values > INSIDE).sum()) :] @ self.null)

    def _remaining_directions(self) -> Array:
        """Return orthonormal null directions that are orthogonal to the known directions. Shape (m, count)."""
        values, back = np.linalg.svd(self.null - self.null @ self.known.T @ self.known, full_matrices=False)[1:]
        return np.asarray(back[values > NEW])

    def _pass(self, joint: Joint, kind: str, axis: str, ends: Sequence[Array]) -> None:
        """Add a shift through a joint, if it does not affect forces."""
        vector, bodies = np.zeros(len(self.names)), list[str]()
        for body, moment, sign in zip((joint.parent, joint.child), ends, (1.0, -1.0), strict=True):
            if f"{body}.mass" in self.names:
                first = self.names.index(f"{body}.mass")
                vector[first : first + len(moment)] = sign * moment
                bodies.append(body)
        if self._add(vector / self.units):
            self.directions.append(Direction(kind, self._entries(vector), joint.name, axis, tuple(bodies)))

    def _list(self, rows: Array) -> None:
        for row in echelon(rows * self.units) if len(rows) else ():
            if self._add(row / self.units):
                self.directions.append(Direction(LIST, self._entries(row)))

    def _add(self, vector: Array) -> bool:
        """Add a vector to the known directions; return False if it is outside the null space or depends on them."""
        size = np.linalg.norm(vector)
        if not size or len(self.known) == len(self.null):
            return False
        unit = vector / size
        if np.linalg.norm(unit - unit @ self.null.T @ self.null) > INSIDE:
            return False
        new = unit - unit @ self.known.T @ self.known
        new -= new @ self.known.T @ self.known
        if np.linalg.norm(new) <= NEW:
            return False
        self.known = np.concatenate([self.known, new[None] / np.linalg.norm(new)])
        return True

    def _entries(self, vector: Array) -> dict[str, float]:
        """Return the significant entries, sorted by effect, relative to the entry with the largest effect."""
        effects = np.abs(vector / self.units)
        order = np.argsort(-effects, kind="stable")
        some = [i for i in order if effects[i] > ENTRY * effects[order[0]]]
        return {self.names[i]: float(vector[i] / vector[order[0]]) for i in some}


def _shifts_through(joint: Joint) -> Iterator[tuple[str, str, list[Array]]]:
    """Yield the shifts through a joint: kind, axis, and the moments that one body gains and the other loses."""
    axes = {"axis": next(iter(joint.axes), np.eye(3)[2]), **dict(zip(XYZ, np.eye(3), strict=True))}
    frames = joint.parent_frame, joint.child_frame
    yield MASS, "", [_point(F.p) for F in frames]
    for name, e in axes.items():
        yield FIRST, name, [0.5 * (_point(F.p + F.R @ e) - _point(F.p - F.R @ e)) for F in frames]
    products = {"axis": 2 * (axes["axis"],), **{key: (np.eye(3)[i], np.eye(3)[k]) for key, (i, k) in TENSOR.items()}}
    for name, (a, b) in products.items():
        yield SECOND, name, [_second(F.R @ a, F.R @ b) for F in frames]


def _point(x: Array) -> Array:
    """Return the moments of a unit mass at a point. Shapes (3,), (10,)."""
    return np.array([1.0, *x, *_inertia(np.outer(x, x))])


def _second(a: Array, b: Array) -> Array:
    """Return the moments of a second moment without mass, like those of matter along a line. Shape (10,)."""
    return np.array([0.0, 0.0, 0.0, 0.0, *_inertia(0.5 * (np.outer(a, b) + np.outer(b, a)))])


def _inertia(second: Array) -> list[float]:
    """Convert second moments to the entries of an inertia tensor. Shape (3, 3)."""
    tensor = np.trace(second) * np.eye(3) - second
    return [float(tensor[at]) for at in TENSOR.values()]
