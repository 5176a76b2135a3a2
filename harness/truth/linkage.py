"""Geometry in balls: bodies along the tree, loop equations of cut joints, and couplings.

All quantities are products of homogeneous matrices or of their jets. The module `kinematics` certifies roots of the
equations.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flint import arb, arb_mat

from screwgauge.reference.description import XYZ, written_polynomials
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.mechanism import KINDS, Joint, Mechanism
from screwgauge.truth.exact import (
    Jet,
    MatrixJet,
    Vector,
    cross,
    dot,
    identity,
    inverse,
    inverse_jet,
    mul,
    normalize,
    number,
    placement,
    rotation_matrix,
    sin_cos,
    skew,
    unit_vector,
    vector,
    widen_decimals,
)


@dataclass(frozen=True, slots=True, eq=False)
class Tie:
    """A coupling ``q_i = sum_k p_k(q_k)``.

    Attributes:
        column: Index i of the dependent coordinate.
        leads: Index k of each other coordinate, or None for the constant, and coefficients of p_k, lowest power first.
    """

    column: int
    leads: list[tuple[int | None, Vector]]

    def error(self, q: Sequence[Jet]) -> Jet:
        """Return the series of ``q_i - sum_k p_k(q_k)``."""
        error = list(q[self.column])
        for k, polynomial in self.leads:
            value = _series(polynomial, [arb(0) for _ in error] if k is None else q[k])
            error = [a - b for a, b in zip(error, value, strict=True)]
        return error

    def shares(self, q: Sequence[arb]) -> list[tuple[int, arb]]:
        """Return the derivative of the error with respect to each coordinate: pairs of a column and 1 or -p_k'."""
        slopes = [(k, -_series(polynomial, [q[k], arb(1)])[1]) for k, polynomial in self.leads if k is not None]
        return [(self.column, arb(1)), *slopes]


def _series(polynomial: Vector, x: Jet) -> Jet:
    """Compose a polynomial with the series of its coordinate, using Horner's scheme."""
    value = [arb(0) for _ in x]
    for coefficient in reversed(polynomial):
        value = mul(value, x)
        value[0] += coefficient
    return value


def read_ties(mechanism: Mechanism, tables: Mapping[str, Any]) -> list[Tie]:
    """Read the couplings of a mechanism, with coefficients from its tables."""
    place, ties = mechanism.coordinates.index, []
    for one in mechanism.couplings:
        table = {"polynomial": [0]} if one.fixing else tables["couplings"][one.name]
        written = written_polynomials(table, one.where)
        ties.append(Tie(place(one.coordinate), [(place(of) if of else None, vector(p)) for _, of, p in written]))
    return ties


def dual_axis(axes: Sequence[Vector], i: int) -> Vector:
    """Return the dual of axis i in the span of the axes: its dot product is 1 with axis i, 0 with all other axes."""
    if len(axes) == 1:
        return axes[0]
    # two axes may be orthogonal only up to rounding; the third is orthogonal to both
    triad = [*axes, cross(axes[0], axes[1])][:3]
    normal = cross(triad[(i + 1) % 3], triad[(i + 2) % 3])
    volume = dot(triad[i], normal)
    return [x / volume for x in normal]


def owner(mechanism: Mechanism, column: int) -> tuple[Joint, int]:
    """Return the joint of a coordinate, and the index of the coordinate in this joint."""
    name = mechanism.coordinates[column]
    joint = next(joint for joint in mechanism.joints if name in joint.coordinates)
    return joint, joint.coordinates.index(name)


def directions(steps: Sequence[tuple[bool, Vector, arb_mat]], start: arb_mat) -> list[tuple[bool, Vector]]:
    """Return rotation flags and world axes of a joint's degrees of freedom; preceding motions rotate each axis.

    Args:
        steps: Flag for rotation, axis in the joint frame, and matrix (4, 4) of each degree of freedom.
        start: World pose of the joint frame on the parent. Shape (4, 4).
    """
    axes = []
    for turns, axis, matrix in steps:
        rows = start.tolist()
        axes.append((turns, [dot(row[:3], axis) for row in rows[:3]]))
        start = start * matrix
    return axes


#: Exact unit vectors of a frame's axes.
AXES: tuple[Vector, ...] = tuple([arb(int(i == k)) for i in range(3)] for k in range(3))


@dataclass(frozen=True, slots=True, eq=False)
class Mass:
    """Mass [kg], centre of mass [m], central inertia tensor [kg m^2] (3, 3), and pseudo-inertia at the origin (4, 4).

    The pseudo-inertia P is the integral of ``r r^T dm`` over homogeneous points r. The power of inertial forces at a
    virtual velocity ``dT`` is ``trace(dT P T''^T)``.
    """

    mass: arb
    com: Vector
    tensor: arb_mat
    pseudo: arb_mat


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Frames of a joint on parent and child (4, 4), and the joint's axes in these frames, in balls."""

    parent: arb_mat
    child: arb_mat
    axes: list[Vector]


@dataclass(frozen=True, slots=True, eq=False)
class Move:
    """Motion ``exp(sign q D)`` along a coordinate; D is its derivative at zero, and `square` is D D."""

    column: int
    sign: int
    turns: bool
    D: arb_mat
    square: arb_mat

    def matrix(self, q: Jet) -> MatrixJet:
        """Return the series of the homogeneous matrix, given the series of the coordinate."""
        if not self.turns:
            return [identity(4) + self.D * (q[0] * self.sign), *(self.D * (x * self.sign) for x in q[1:])]
        sin, cos = sin_cos([x * self.sign for x in q])
        first = identity(4) + self.D * sin[0] + self.square * (1 - cos[0])
        return [first, *(self.D * s - self.square * c for s, c in zip(sin[1:], cos[1:], strict=True))]


Step = Move | arb_mat


class Linkage:
    """The spanning tree and the loops of a mechanism, in balls.

    Attributes:
        mechanism: Structure and names; its numerical values are not used.
        frames: Joint name -> frames and axes in balls.
        masses: Mass properties of each body.
        length: Largest coordinate of a joint frame's origin in its body [m], or 1 if all are zero; scales the rows.
        axial: Joint and direction of the rule ``spherical_axial``, as in the description.
        loops: For each cut joint, the coordinates in its loop: (column, whether it lies on the path to the child
            through the cut joint, whether it lies on the child's path in the tree).
        ties: The couplings.
    """

    def __init__(self, mechanism: Mechanism, tables: Mapping[str, Any], *, rounded: bool = False) -> None:
        """Read the tables.

        Args:
            rounded: Whether long decimals of frames and axes represent all numbers that round to them.
        """
        self.mechanism = mechanism
        self.frames = {
            joint.name: _frames(joint.kind, tables["joints"][joint.name], rounded) for joint in mechanism.joints
        }
        places = [T[i, 3] for f in self.frames.values() for T in (f.parent, f.child) for i in range(3)]
        self.length = max(abs(float(x.mid())) for x in places) or 1.0
        axial = tables.get("spherical_axial")
        self.axial = None if axial is None else (str(axial["joint"]), list(axial["direction"]))
        self.ties = read_ties(mechanism, tables)
        self.masses = [_mass(tables["bodies"][body.name]) for body in mechanism.bodies]
        tree, index = spanning_tree(mechanism), mechanism.body_index
        columns = tree.columns
        self.edges = [
            (index[edge.near], index[edge.far], self._steps(edge.joint, columns[edge.joint.name], edge.reverse))
            for edge in tree.edges
        ]
        self.cuts = [(index[j.parent], index[j.child], self._steps(j, columns[j.name], False)) for j in tree.cuts]
        path: list[set[int]] = [set() for _ in index]
        for edge, (near, far, _) in zip(tree.edges, self.edges, strict=True):
            path[far] = path[near] | {*columns[edge.joint.name]}
        ways = [(path[index[j.parent]] | {*columns[j.name]}, path[index[j.child]]) for j in tree.cuts]
        self.loops = [[(column, column in via, column in back) for column in sorted(via | back)] for via, back in ways]

    def _steps(self, joint: Joint, columns: Sequence[int], reverse: bool) -> list[Step]:
        """List the steps of a joint, parent to child or reversed: first frame, motions, inverse of the last frame."""
        frames, sign = self.frames[joint.name], -1 if reverse else 1
        moves: list[Step] = [
            _move(column, sign, turns, frames.axes[min(i, len(frames.axes) - 1)])
            for i, (column, turns) in enumerate(zip(columns, KINDS[joint.kind], strict=True))
        ]
        start, end = (frames.child, frames.parent) if reverse else (frames.parent, frames.child)
        steps: list[Step] = [start, *(moves[::-1] if reverse else moves), inverse(end)]
        return [step for step in steps if isinstance(step, Move) or not _is_identity(step)]

    def place(self, q: Sequence[Jet], spots: dict[int, arb_mat] | None = None) -> list[MatrixJet]:
        """Compute homogeneous matrices of all bodies, ground first, from the series of joint coordinates.

        Args:
            spots: If given, filled with ``sign P D P^-1`` for each tree coordinate, where P is the frame of its motion.
        """
        ground = [identity(4), *(arb_mat(4, 4) for _ in q[0][1:])]
        bodies: list[MatrixJet] = [ground] * len(self.mechanism.body_index)
        for near, far, steps in self.edges:
            bodies[far] = _walk(bodies[near], steps, q, spots)
        return bodies

    def close(
        self, q: Sequence[Jet], bodies: Sequence[MatrixJet], spots: dict[int, arb_mat] | None = None
    ) -> list[MatrixJet]:
        """Return ``G = via tree^-1`` of each loop, where via and tree are the two paths to the cut joint's child.

        G is the identity if the loop closes.
        """
        return [
            mul(_walk(bodies[parent], steps, q, spots), inverse_jet(bodies[child]))
            for parent, child, steps in self.cuts
        ]

    def exert(self, column: int, q: Sequence[Jet], bodies: Sequence[MatrixJet]) -> tuple[Joint, bool, Vector, Vector]:
        """Return a unit force along a joint coordinate that does no work on the joint's other coordinates.

        Returns:
            The joint, whether the force is a moment, its direction, and the joint's point on the child.
        """
        joint, i = owner(self.mechanism, column)
        frames, index, first = self.frames[joint.name], self.mechanism.body_index, column - i
        steps = []
        for k, turns in enumerate(KINDS[joint.kind]):
            axis = frames.axes[min(k, len(frames.axes) - 1)]
            steps.append((turns, axis, _move(first + k, 1, turns, axis).matrix([q[first + k][0]])[0]))
        axes = directions(steps, bodies[index[joint.parent]][0] * frames.parent)
        turning = steps[i][0]
        alike = [k for k, (turns, _) in enumerate(axes) if turns == turning]
        child = bodies[index[joint.child]][0] * frames.child
        return joint, turning, dual_axis([axes[k][1] for k in alike], alike.index(i)), [child[k, 3] for k in range(3)]

    def jacobian(self, q: Sequence[arb]) -> arb_mat:
        """Differentiate the errors of loops and couplings, and the selected coordinates. (6 n_cut + n_tie + k, n_q)."""
        jets = [[x] for x in q]
        spots: dict[int, arb_mat] = {}
        bodies = self.place(jets, spots)
        ways = self.close(jets, bodies, spots)
        rows = [[arb(0)] * len(q) for _ in range(6 * len(ways))]
        for c, ([G], loop) in enumerate(zip(ways, self.loops, strict=True)):
            for column, on_via, on_tree in loop:
                spot = spots[column]
                change = spot * G if not on_tree else -(G * spot) if not on_via else spot * G - G * spot
                for i, value in enumerate(error(change)):
                    rows[6 * c + i][column] = value
        for tie in self.ties:
            rows.append([arb(0)] * len(q))
            for column, share in tie.shares(q):
                rows[-1][column] = share
        chosen = self.mechanism.independent_columns
        return arb_mat(rows + [[arb(int(i == column)) for i in range(len(q))] for column in chosen])


def error(G: arb_mat) -> list[arb]:
    """Return six numbers that vanish if G is the identity; if G rotates by less than pi, they vanish only then."""
    r = G.tolist()
    turn = [(r[2][1] - r[1][2]) / 2, (r[0][2] - r[2][0]) / 2, (r[1][0] - r[0][1]) / 2]
    return [*turn, r[0][3], r[1][3], r[2][3]]


def _walk(T: MatrixJet, steps: Iterable[Step], q: Sequence[Jet], spots: dict[int, arb_mat] | None) -> MatrixJet:
    for step in steps:
        if isinstance(step, Move):
            if spots is not None:
                spots[step.column] = T[0] * (step.D * step.sign) * inverse(T[0])
            T = mul(T, step.matrix(q[step.column]))
        else:
            T = [x * step for x in T]
    return T


def _is_identity(T: arb_mat) -> bool:
    """Return True if T is certainly the identity; `!=` returns False even for balls that are only possibly equal."""
    return bool(identity(4) == T)


def _move(column: int, sign: int, turns: bool, axis: Vector) -> Move:
    A = skew(axis).tolist() if turns else [[0, 0, 0]] * 3
    p = [0, 0, 0] if turns else axis
    D = arb_mat([*([*A[i], p[i]] for i in range(3)), [0, 0, 0, 0]])
    return Move(column, sign, turns, D, D * D)


def _frames(kind: str, table: Mapping[str, Any], rounded: bool) -> Frames:
    axes = XYZ[2:] if kind == "fixed" else table.get("axes", XYZ)
    parts = table.get("parent_frame", {}), table.get("child_frame", {}), axes
    parent, child, axes = (widen_decimals(part) for part in parts) if rounded else parts
    turns = [unit_vector(axis) for axis in axes]
    count = KINDS[kind].count(False)  # a single slide is along the axis
    slides = AXES if count == 3 else [way for _, way in split(turns[0])[:2]] if count == 2 else []
    return Frames(placement(parent), placement(child), [*slides, *turns])


def split(axis: Vector) -> list[tuple[str, Vector]]:
    """List labels and directions: two across an axis and one along it; frame axes if the given axis is a frame axis."""
    k = max(range(3), key=lambda i: abs(float(axis[i].mid())))
    across = [i for i in range(3) if i != k]
    if all(axis[i] == 0 for i in across):
        return [("xyz"[i], AXES[i]) for i in (*across, k)]
    first = normalize(cross(axis, AXES[across[0]]))
    return [("1", first), ("2", cross(axis, first)), ("", axis)]


def _mass(table: Mapping[str, Any]) -> Mass:
    mass, c = number(table["mass"]), vector(table.get("com", [0, 0, 0]))
    xx, xy, xz, yy, yz, zz = (
        number(table.get("inertia", {}).get(key, 0)) for key in ("xx", "xy", "xz", "yy", "yz", "zz")
    )
    J = arb_mat([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if "inertia_rotation" in table:
        R = rotation_matrix(table["inertia_rotation"])
        J = R * J * R.transpose()
    half = J.trace() / 2
    second = [[half * int(i == j) - J[i, j] + mass * c[i] * c[j] for j in range(3)] for i in range(3)]
    first = [mass * x for x in c]
    pseudo = arb_mat([*([*second[i], first[i]] for i in range(3)), [*first, mass]])
    return Mass(mass, c, J, pseudo)
