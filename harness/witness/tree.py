"""A tree of links as arrays: moving parts, masses, and loop constraints.

Each link is moved by one elementary joint: a hinge, a slide, a ball or a free joint. Such a tree represents a
mechanism or a model file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.couplings import PolynomialSum
from screwgauge.reference.rotations import Array

Rows = NDArray[np.intp]

#: Kind of an elementary joint -> number of its coordinates, and number of its velocities. Coordinates of ``ball`` are
#: the link's quaternion (w, x, y, z), which is (1, 0, 0, 0) at zero displacement; ``free`` has the position of the
#: link's origin before the quaternion. Velocities are the link's angular velocity and, for ``free``, then the velocity
#: of its origin, both in the link's axes.
COORDINATES = {"hinge": 1, "slide": 1, "ball": 4, "free": 7}
FREEDOMS = {"hinge": 1, "slide": 1, "ball": 3, "free": 6}


class FixedFrame(NamedTuple):
    """A frame fixed to a link, or a stack of such frames; link 0 is ground. Shapes (...), (..., 3, 3), (..., 3) [m]."""

    link: Any = 0
    R: Array = np.eye(3)
    p: Array = np.zeros(3)

    def place(self, R: Array, p: Array) -> FixedFrame:
        """Return a frame on the same link, given its pose relative to this frame."""
        return FixedFrame(self.link, self.R @ R, self.p + self.R @ p)


def stack_frames(frames: Sequence[FixedFrame]) -> FixedFrame:
    """Stack single frames. Shapes (m,), (m, 3, 3), (m, 3)."""
    R, p = (np.array([getattr(each, name) for each in frames], dtype=float) for name in "Rp")
    return FixedFrame(np.array([each.link for each in frames], dtype=np.intp), R.reshape(-1, 3, 3), p.reshape(-1, 3))


class TreeLink(NamedTuple):
    """A link and the elementary joint that moves it.

    Attributes:
        kind: An entry of `COORDINATES`.
        start: Frame of the joint on the preceding link.
        axis: Unit axis of a hinge or slide in `start`. Shape (3,).
        coordinate, velocity: The joint's first column among all coordinates and among all velocities.
        zero: Coordinate of a hinge or slide at zero displacement.
        sign: -1 if the joint is traversed from child to parent, otherwise 1.
    """

    kind: str
    start: FixedFrame
    axis: Array
    coordinate: int
    velocity: int
    zero: float = 0.0
    sign: float = 1.0


class LoopConstraint(NamedTuple):
    """Two frames whose origins coincide (``point``), or which are fully aligned (``weld``)."""

    kind: str
    first: FixedFrame
    second: FixedFrame


Coupled = tuple[int, int, float, tuple[tuple[int, int, Array], ...]]
"""A coordinate equal to a sum of polynomials in other coordinates: its column, its velocity's column, and the constant;
then, for each other coordinate, both columns and the polynomial's coefficients, lowest power first."""


def coupled_column(columns: Mapping[str, tuple[int, int]], coordinate: str, function: PolynomialSum) -> Coupled:
    """Build a coupling in a tree; `columns` maps a coordinate to its column and to its velocity's column."""
    leads = tuple((*columns[name], np.array([0.0, *p])) for name, p in function.terms.items())
    return *columns[coordinate], function.constant, leads


@dataclass(frozen=True, eq=False)
class SpanningTree:
    """A tree of links.

    Attributes:
        links: Links in an order in which parents come first, numbered from 1.
        freedom: Number of velocities.
        bodies: Frames of the bodies.
        mass, com, inertia: Mass [kg], centre of mass [m] and moment of inertia about this centre [kg m^2] of each body,
            in body axes. Shapes (n_body,), (n_body, 3), (n_body, 3, 3).
        closures, couplings: Constraints by name.
        gravity: Gravity [m/s^2]. Shape (3,).
        weight: Share of gravity that acts on each body. Shape (n_body,) or a number.
        passive: ``armature``, ``damping``, ``friction`` and ``stiffness`` of each velocity, and ``rest``, the position
            at which springs exert no force; contains either all of these entries or none. Shape (n_freedom,).
        length: Length of the machine [m].
    """

    links: tuple[TreeLink, ...]
    freedom: int
    bodies: FixedFrame
    mass: Array
    com: Array
    inertia: Array
    closures: Mapping[str, LoopConstraint] = field(default_factory=dict)
    couplings: Mapping[str, Coupled] = field(default_factory=dict)
    gravity: Array = field(default_factory=lambda: np.zeros(3))
    weight: Array | float = 1.0
    passive: Mapping[str, Array] = field(default_factory=dict)
    length: float = 1.0

    @cached_property
    def starts(self) -> FixedFrame:
        """Frames of all joints on the preceding links."""
        return stack_frames([link.start for link in self.links])

    @cached_property
    def single(self) -> tuple[Rows, Rows, Rows, Array, Array, Array]:
        """Arrays for hinges and slides: link positions, columns of coordinates and of velocities, zeros, signed axes,
        and 1 for hinges.

        Shapes (k,), (k,), (k,), (k,), (k, 3), (k, 1).
        """
        some = [i for i, link in enumerate(self.links) if FREEDOMS[link.kind] == 1]
        links = [self.links[i] for i in some]
        turns = np.array([[float(link.kind == "hinge")] for link in links]).reshape(-1, 1)
        axes = np.array([link.sign * link.axis for link in links]).reshape(-1, 3)
        numbers = [(i, self.links[i].coordinate, self.links[i].velocity) for i in some]
        own, columns, velocities = np.array(numbers, dtype=np.intp).reshape(-1, 3).T
        return own, columns, velocities, np.array([link.zero for link in links]), axes, turns

    @cached_property
    def ends(self) -> FixedFrame:
        """First frames of all closures, then the second frames."""
        closures = self.closures.values()
        return stack_frames([each.first for each in closures] + [each.second for each in closures])

    @cached_property
    def levels(self) -> tuple[tuple[Rows, Rows], ...]:
        """Links of equal depth, and their parents, level by level."""
        before, left = np.array([0, *(link.start.link for link in self.links)]), [*range(1, len(self.links) + 1)]
        known, levels = {0}, list[tuple[Rows, Rows]]()
        while left:  # links may be in any order
            some = np.array([i for i in left if int(before[i]) in known])
            levels.append((some, before[some]))
            known |= {*some.tolist()}
            left = [i for i in left if i not in known]
        return tuple(levels)

    @cached_property
    def velocity(self) -> tuple[Rows, Array, NDArray[np.bool_]]:
        """Link that each velocity moves, or 0; the velocity's axis in that link; and whether it is a rotation.

        Shapes (n_freedom,), (n_freedom, 3), (n_freedom,).
        """
        number, axes = np.zeros(self.freedom, dtype=np.intp), np.zeros((self.freedom, 3))
        turns = np.zeros(self.freedom, dtype=bool)
        for i, link in enumerate(self.links, 1):
            wide = FREEDOMS[link.kind]
            own = slice(link.velocity, link.velocity + wide)
            number[own], turns[own] = i, [link.kind != "slide"] * min(wide, 3) + [False] * (wide - 3)
            axes[own] = np.resize(np.eye(3), (wide, 3)) if wide > 1 else link.sign * link.axis
        return number, axes, turns

    @cached_property
    def carries(self) -> Array:
        """Matrix with 1 where a velocity moves a link, ground first. Shape (n_link + 1, n_freedom)."""
        carries = np.zeros((len(self.links) + 1, self.freedom))
        for level, before in self.levels:
            carries[level] = carries[before]
            for i, link in ((i, self.links[i - 1]) for i in level.tolist()):
                carries[i, link.velocity : link.velocity + FREEDOMS[link.kind]] = 1.0
        return carries

    @property
    def moves(self) -> Array:
        """Matrix with 1 where a velocity moves a body. Shape (n_body, n_freedom)."""
        return np.asarray(self.carries[self.bodies.link])

    @cached_property
    def before(self) -> Array:
        """Matrix with 1 where the column's joint precedes the row's joint. Shape (n_freedom, n_freedom)."""
        number = self.velocity[0]
        return np.asarray(self.carries[number] * (number[:, None] != number))


@dataclass(frozen=True, slots=True, eq=False)
class TreeStates:
    """Samples of a motion.

    Attributes:
        q: Coordinates, see `COORDINATES` [rad or m]. Shape (n, n_coordinate).
        qd, qdd: Velocities, see `FREEDOMS`, and their derivatives. Shape (n, n_freedom).
    """

    q: Array
    qd: Array
    qdd: Array

    def at(self, which: slice | NDArray[Any]) -> TreeStates:
        """Select samples."""
        return TreeStates(self.q[which], self.qd[which], self.qdd[which])
