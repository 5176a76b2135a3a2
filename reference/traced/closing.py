"""A joint that closes a loop: wrenches reciprocal to its freedoms, what is open along them, its own coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference.mechanism import Joint
from screwgauge.reference.rotations import triad
from screwgauge.reference.traced.crossing import Motion, Wrench
from screwgauge.reference.traced.vectors import (
    EYE,
    ZERO,
    Matrix,
    Scalar,
    Vector,
    add,
    apply,
    cross,
    dot,
    matrix,
    product,
    scale,
    sqrt,
    sub,
    transpose,
    turn,
    turn_back,
    vector,
)


def across(axis: Vector) -> list[Vector]:
    """Two directions across an axis: axes of the frame, if it is one of them."""
    k = int(np.argmax(np.abs(axis)))
    others = [EYE[i] for i in range(3) if i != k]
    if abs(axis[k]) == 1.0:
        return others
    first = np.cross(axis, others[0])
    first /= np.linalg.norm(first)
    return [vector(first), vector(np.cross(axis, first))]


@dataclass(frozen=True, slots=True)
class Row:
    """One reciprocal wrench, of the parent on the child.

    Attributes:
        u: Its direction, in the axes chosen.
        child, parent: The wrench in the joint's frame of the child, and of the parent.
        residual: How far the loop is open along it [m or rad].
    """

    force: bool
    u: Vector
    child: Wrench
    parent: Wrench
    residual: Scalar


@dataclass(frozen=True, slots=True)
class Cut:
    """A cut joint at one pose.

    Attributes:
        M, d: Orientation and origin of its frame of the child in that of the parent.
        outer: Whether directions keep to the child, else to the parent.
    """

    joint: Joint
    M: Matrix
    d: Vector
    outer: bool

    @property
    def slides(self) -> bool:
        return self.joint.kind in "PC"

    def rows(self) -> list[Row]:
        """All reciprocal wrenches: forces first."""
        kind, axis = self.joint.kind, vector(self.joint.axes[0])
        forces = across(axis) if self.slides else EYE
        rows = [self._row(u, None) for u in forces]
        if kind == "U":
            last = turn(self.M, vector(self.joint.axes[1]))
            normal = cross(axis, last)
            rows.append(self._row(turn_back(self.M, normal) if self.outer else normal, -dot(axis, last)))
        elif kind == "P":
            M = self.M
            turned = scale(0.5, (M[2][1] - M[1][2], M[0][2] - M[2][0], M[1][0] - M[0][1]))
            rows += [self._row(u, dot(u, turned)) for u in EYE]
        elif kind in "RC":
            other = turn_back(self.M, axis) if self.outer else turn(self.M, axis)
            tilt = cross(other, axis) if self.outer else cross(axis, other)
            rows += [self._row(u, dot(u, tilt)) for u in across(axis)]
        return rows

    def _row(self, u: Vector, residual: Scalar | None) -> Row:
        """A moment, or a force if no residual is given."""
        on_child = u if self.outer else turn_back(self.M, u)
        on_parent = turn(self.M, u) if self.outer else u
        if residual is not None:
            return Row(False, u, (ZERO, on_child), (ZERO, on_parent), residual)
        arm = self.d if self.slides else ZERO  # of other joints both points coincide
        return Row(True, u, (on_child, ZERO), (on_parent, cross(arm, on_parent)), dot(on_parent, self.d))

    def _less(self, child: Vector, parent: Vector) -> Vector:
        """Difference of two vectors of the frames, in the axes chosen."""
        return sub(child, turn_back(self.M, parent)) if self.outer else sub(turn(self.M, child), parent)

    def biases(self, child: Motion, parent: Motion, slide: Scalar) -> list[Scalar]:
        """Acceleration along each wrench where unknown joint accelerations are zero.

        Args:
            child, parent: Motions of the joint's two frames.
            slide: Rate of its slide.
        """
        w_p = turn_back(self.M, parent.w) if self.outer else parent.w
        axes = [vector(axis) for axis in self.joint.axes]
        arm = self.d if self.slides else ZERO
        linear = self._less(child.a, parent.of_point(arm))
        if self.slides:
            axis = turn_back(self.M, axes[0]) if self.outer else axes[0]
            linear = sub(linear, scale(2.0 * slide, cross(w_p, axis)))
        w = self._less(child.w, parent.w)
        angular = sub(self._less(child.b, parent.b), cross(w_p, w))
        if self.joint.kind == "U":
            normal = self.rows()[-1].u
            on_parent, on_child = (turn(self.M, w), w) if self.outer else (w, turn_back(self.M, w))
            angular = sub(angular, scale(dot(axes[0], on_parent) * dot(axes[1], on_child), normal))
        return [dot(row.u, linear if row.force else angular) for row in self.rows()]

    def chart(self) -> Chart:
        """Sines, cosines and axes of its angles."""
        axes = triad(self.joint.axes)
        handed = float(np.sign(np.linalg.det(axes)))
        A = matrix(axes)
        M = product(product(A, self.M), transpose(A))
        if self.joint.kind == "S":
            h = sqrt(M[1][2] * M[1][2] + M[2][2] * M[2][2])
            k = 1.0 / h
            pairs = [(-k * M[1][2], k * M[2][2]), (M[0][2], h), (-k * M[0][1], k * M[0][0])]
        else:  # the angles that the joint has not are zero
            pairs = [(M[2][1], M[1][1] if self.joint.kind == "U" else M[2][2]), (M[0][2], M[0][0])]
        turns = {"S": 3, "U": 2, "P": 0}.get(self.joint.kind, 1)
        return Chart(self, A, handed, [(handed * s, c) for s, c in pairs[:turns]])


@dataclass(frozen=True, slots=True)
class Chart:
    """Angles of a cut joint about three orthogonal axes, of which the first few are its own.

    Attributes:
        A: Its axes as rows.
        handed: -1 where they make a left-handed triad.
        pairs: Sine and cosine of each angle.
    """

    cut: Cut
    A: Matrix
    handed: float
    pairs: list[tuple[Scalar, Scalar]]

    def angles(self) -> list[Scalar]:
        return [apply("atan2", s, c) for s, c in self.pairs]

    def rates(self, child: Motion, parent: Motion) -> tuple[list[Scalar], list[Scalar]]:
        """First and second derivatives of the angles, from the motions of the joint's two frames."""
        M = self.cut.M
        w = turn(self.A, sub(turn(M, child.w), parent.w))
        drag = cross(parent.w, sub(turn(M, child.w), parent.w))
        b = turn(self.A, sub(sub(turn(M, child.b), parent.b), drag))
        if not self.pairs:
            return [], []
        if len(self.pairs) == 1:
            return [w[0]], [b[0]]
        s1, c1 = self.handed * self.pairs[0][0], self.pairs[0][1]
        w, b = ((x[0], c1 * x[1] + s1 * x[2], c1 * x[2] - s1 * x[1]) for x in (w, b))
        if len(self.pairs) == 2:
            return [w[0], w[1]], [b[0], b[1]]
        (s2, c2), h = (self.handed * self.pairs[1][0], self.pairs[1][1]), self.handed
        # axes in the frame after the first turn: x, y and (s2, 0, c2)
        third = w[2] / c2
        v = [w[0] - s2 * third, w[1], third]
        twist = scale(h * third, (v[1] * c2, -(v[0] * c2), -(v[1] * s2)))
        b = sub(b, add(twist, (0.0, 0.0, h * v[0] * v[1])))
        last = b[2] / c2
        return v, [b[0] - s2 * last, b[1], last]

    def slide(self) -> Scalar:
        """Value of its slide."""
        return dot(vector(self.cut.joint.axes[0]), self.cut.d)


def along(cut: Cut) -> tuple[Wrench, Wrench]:
    """A unit of what acts along the freedom of a cut R joint, or the slide of another, on child and on parent."""
    axis = vector(cut.joint.axes[0])
    on_child = turn_back(cut.M, axis)
    if cut.joint.kind == "R":
        return (ZERO, on_child), (ZERO, axis)
    return (on_child, ZERO), (axis, cross(cut.d, axis))
