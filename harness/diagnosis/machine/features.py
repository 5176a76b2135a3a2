"""Features of bodies (points, lines and directions), and how well two bodies match at a given placement."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import replace

import numpy as np

from screwgauge.models.machine import Element, Link, Machine
from screwgauge.models.matter import displace
from screwgauge.reference.rotations import Array, cross

#: Largest distance between features that count as equal, in machine lengths or rad.
EXACT = 1e-6
UPPER = np.triu_indices(3)


def features(link: Link, body: str) -> list[Element]:
    """Return the geometry of a link on one of its bodies; return an empty list for a free link.

    A ball stands for a point, a hinge for a line and a slide for a direction.
    """
    if link.kind == "F":
        return []
    if body != link.near and link.step is not None:
        return [each.displace(link.step) for each in features(replace(link, step=None), body)]
    if link.kind == "S" and link.centre is not None:
        return [Element("ball", np.zeros(6), link.centre)]
    element = link.elements[0 if body == link.near else -1]
    return [replace(element, kind="ball") if element.kind == "free" else element]


def gap(one: Element, other: Element, length: float) -> Array:
    """Compute the differences in direction and in location, in machine lengths, between two features. Shape (6,)."""
    if one.kind != other.kind:
        return np.append(2.0, np.zeros(5))
    sign = 1.0 if one.direction @ other.direction >= 0.0 else -1.0
    step = (other.centre - one.centre) / length
    way = {"hinge": cross(step, one.direction), "slide": np.zeros(3)}.get(one.kind, step)
    return np.append(one.direction - sign * other.direction, way)


class Shape:
    """The features and mass properties of a body, as arrays."""

    def __init__(self, machine: Machine, body: str) -> None:
        links = machine.at(body)
        stated = [link for link in links if not _is_derived(machine, link, body)]
        some = [each for link in stated or links for each in features(link, body)]
        self.kinds = np.array([each.kind for each in some], dtype=str)
        self.points = np.array([each.centre for each in some]).reshape(-1, 3)
        self.ways = np.array([each.direction for each in some]).reshape(-1, 3)
        self.matter = machine.bodies[body].matter

    def move(self, T: Array) -> Shape:
        """Transform the shape by T, shape (4, 4)."""
        other = copy(self)
        other.points, other.ways = self.points @ T[:3, :3].T + T[:3, 3], self.ways @ T[:3, :3].T
        other.matter = displace(self.matter, T)
        return other

    def places(self) -> Iterator[tuple[str, Array, Array]]:
        """Yield kind, point and direction of each feature with a location; the direction of a point is zero."""
        yield from ((k, *pair) for k, *pair in zip(self.kinds, self.points, self.ways, strict=True) if k != "slide")
        if self.matter.mass:
            yield "com", self.matter.com, np.zeros(3)

    def directions(self) -> Iterator[tuple[str, Array]]:
        """Yield kind and direction of features and principal axes; the sense of a direction is arbitrary."""
        yield from ((k, way) for k, way in zip(self.kinds, self.ways, strict=True) if k != "ball")
        if self.matter.mass:
            yield from ((f"inertia {i}", way) for i, way in enumerate(np.linalg.eigh(self.matter.inertia)[1].T))


def _is_derived(machine: Machine, link: Link, body: str) -> bool:
    """Return True if a link's location on a body is determined only by the home pose of the link's other body."""
    closures = [machine.reading.closures[name] for each in link.elements for name in each.closures]
    ends = {machine.part_of(each.second) for each in closures}
    return bool(closures) and not link.joints and ends == {body} and all(each.derived for each in closures)


class Overlay:
    """A comparison of a body of B with a body of A, at any placement of B."""

    def __init__(self, a: Machine, b: Machine, bodies: tuple[str, str]) -> None:
        self.ours, self.theirs, self.length = Shape(a, bodies[0]), Shape(b, bodies[1]), a.length
        self.lines, self.balls = (self.ours.kinds == kind for kind in ("hinge", "ball"))
        self.unlike = self.ours.kinds[:, None] != self.theirs.kinds

    def residuals(self, T: Array) -> Array:
        """Compute the residuals of features, centre of mass and inertia, one row each. Shape (n, 6).

        Args:
            T: Placement of B's world frame in A's. Shape (4, 4).
        """
        rows = [*self._gaps(T)]
        first, second = self.ours.matter, displace(self.theirs.matter, T)
        if first.mass and second.mass:
            rows.append(np.append((first.com - second.com) / self.length, np.zeros(3)))
            scale = float(np.abs(first.inertia).max()) or 1.0
            rows.append(((first.inertia - second.inertia) / scale)[UPPER])
        return np.array(rows or [np.zeros(6)])

    def misfits(self, T: Array) -> Array:
        """Compute the norms of the `residuals`. Shape (n,)."""
        return np.asarray(np.linalg.norm(self.residuals(T), axis=1))

    def _gaps(self, T: Array) -> Array:
        """Compute the `gap` between each feature of A and the nearest feature of B. Shape (n, 6)."""
        ours = self.ours
        if not self.unlike.size:
            return np.tile(np.append(1.0, np.zeros(5)), (len(ours.points), 1))
        R = T[:3, :3]
        ways = self.theirs.ways @ R.T
        signs = np.where(ours.ways @ ways.T >= 0.0, 1.0, -1.0)
        turns = ours.ways[:, None] - signs[..., None] * ways
        steps = (self.theirs.points @ R.T + T[:3, 3] - ours.points[:, None]) / self.length
        across = cross(steps, np.broadcast_to(ours.ways[:, None], steps.shape))
        off = np.where(self.lines[:, None, None], across, np.where(self.balls[:, None, None], steps, 0.0))
        gaps = np.concatenate([turns, off], axis=-1)
        gaps[self.unlike] = np.append(2.0, np.zeros(5))
        nearest = np.argmin(np.einsum("ijk,ijk->ij", gaps, gaps), axis=1)
        return np.asarray(gaps[np.arange(len(gaps)), nearest])


def misfits(a: Machine, b: Machine, bodies: tuple[str, str], T: Array) -> Array:
    """Compute the misfits between a body of B and a body of A, with B's world frame at T, (4, 4). Shape (n,)."""
    return Overlay(a, b, bodies).misfits(T)
