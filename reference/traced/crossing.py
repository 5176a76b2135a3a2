"""What happens across a joint: motion on the way outwards, wrenches on the way inwards.

Everything is in the axes of the frame where it stands, so that frames that coincide and axes of a frame cost nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from screwgauge.reference.mechanism import Frame, Joint
from screwgauge.reference.traced.vectors import (
    EYE,
    ZERO,
    Matrix,
    Scalar,
    Vector,
    add,
    cross,
    dot,
    matrix,
    product,
    rotation,
    scale,
    turn,
    turn_back,
    vector,
)

Wrench = tuple[Vector, Vector]
"""Force, and moment about the origin of the frame."""


@dataclass(frozen=True, slots=True)
class Coordinates:
    """Joint coordinates: value of a slide, sine and cosine of an angle; first and second derivatives.

    Attributes:
        slide: Column -> value [m].
        angle: Column -> (sine, cosine).
        v, a: Column -> rate and acceleration; none where they are not known yet.
    """

    slide: Mapping[int, Scalar]
    angle: Mapping[int, tuple[Scalar, Scalar]]
    v: Mapping[int, Scalar]
    a: Mapping[int, Scalar]


@dataclass(frozen=True, slots=True)
class Motion:
    """Where a frame is and how it moves.

    Attributes:
        R, p: Orientation and origin in the world.
        w, b, a: Angular velocity and acceleration, and the acceleration of the origin, in its own axes.
    """

    R: Matrix = EYE
    p: Vector = ZERO
    w: Vector = ZERO
    b: Vector = ZERO
    a: Vector = ZERO

    @property
    def acceleration_matrix(self) -> Matrix:
        """Acceleration of points that are fixed in the frame, beside that of its origin, is this times their place.

        ``[b] + [w]^2``: its entries serve all points, and Euler's equations.
        """
        (x, y, z), (bx, by, bz) = self.w, self.b
        return (
            (-(y * y + z * z), x * y - bz, x * z + by),
            (x * y + bz, -(x * x + z * z), y * z - bx),
            (x * z - by, y * z + bx, -(x * x + y * y)),
        )

    def of_point(self, r: Vector) -> Vector:
        """Acceleration of a point that is fixed in the frame."""
        return add(self.a, turn(self.acceleration_matrix, r))


@dataclass(frozen=True, slots=True)
class Step:
    """From one frame to the next.

    Attributes:
        axis: Of a freedom, the same in both frames; None between frames that are fixed to each other.
        column: Its coordinate, -1 for none.
        sign: -1 where it is walked backwards.
        R, p: Orientation and origin of the next frame in this one.
    """

    axis: Vector | None
    turns: bool
    column: int
    sign: float
    R: Matrix
    p: Vector

    def outward(self, at: Motion, q: Coordinates) -> Motion:
        """The motion of the next frame."""
        a = at.of_point(self.p)
        w, b = turn_back(self.R, at.w), turn_back(self.R, at.b)
        if self.axis is None:
            return Motion(product(at.R, self.R), add(at.p, turn(at.R, self.p)), w, b, turn_back(self.R, a))
        rate, acceleration = (self.sign * x.get(self.column, 0.0) for x in (q.v, q.a))
        relative, change = scale(rate, self.axis), scale(acceleration, self.axis)
        if self.turns:
            b = add(add(b, cross(w, relative)), change)
            return Motion(product(at.R, self.R), at.p, add(w, relative), b, turn_back(self.R, a))
        a = add(a, add(scale(2.0, cross(w, relative)), change))
        return Motion(at.R, add(at.p, turn(at.R, self.p)), w, b, a)

    def inward(self, wrench: Wrench, torques: dict[int, Scalar]) -> Wrench:
        """The same wrench in this frame; what it does along the freedom goes into `torques`."""
        if self.axis is not None:
            torques[self.column] = self.sign * dot(self.axis, wrench[1 if self.turns else 0])
        force = turn(self.R, wrench[0])
        return force, add(turn(self.R, wrench[1]), cross(self.p, force))


def fixed(frame: Frame) -> Step:
    """To a frame that is fixed in a body."""
    return Step(None, False, -1, 1.0, matrix(frame.R), vector(frame.p))


def unfixed(frame: Frame) -> Step:
    """Back from it to the body."""
    R = matrix(frame.R.T)
    return Step(None, False, -1, 1.0, R, scale(-1.0, turn(R, vector(frame.p))))


def freedoms(joint: Joint, columns: Sequence[int], q: Coordinates, *, reverse: bool) -> Iterator[Step]:
    """The freedoms of a joint, as they are walked."""
    sign = -1.0 if reverse else 1.0
    steps = [*zip(columns, joint.freedoms, strict=True)]
    for column, (turns, direction) in steps[::-1] if reverse else steps:
        axis = vector(direction)
        if turns:
            s, c = q.angle[column]
            yield Step(axis, True, column, sign, rotation(axis, sign * s, c), ZERO)
        else:
            yield Step(axis, False, column, sign, EYE, scale(sign * q.slide[column], axis))


def crossing(joint: Joint, columns: Sequence[int], q: Coordinates, *, reverse: bool) -> list[Step]:
    """All steps from the body on one side of a joint to that on the other."""
    start, end = (joint.child_frame, joint.parent_frame) if reverse else (joint.parent_frame, joint.child_frame)
    return [fixed(start), *freedoms(joint, columns, q, reverse=reverse), unfixed(end)]
