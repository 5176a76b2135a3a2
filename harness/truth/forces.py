"""Computes forces by two independent routes, virtual power and balances of bodies; their enclosures must overlap.

Route 1 is Lagrange's form with homogeneous matrices: ``Q_j = sum trace(dT/dy_j P T''^T) - ...``, in which no angular
velocity appears. Route 2 balances force and moment of each body and solves for all reactions at once.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from flint import arb, arb_mat

from screwgauge.problem import given_columns
from screwgauge.reference.mechanism import Joint, by_role
from screwgauge.reference.resistance import REST
from screwgauge.truth.exact import Vector, cross, difference, dot, drive, normalize, solve, unit_vector
from screwgauge.truth.kinematics import NotCertified, State, floats, independent_rows, point, spin
from screwgauge.truth.linkage import AXES, Linkage, split


class RoutesDisagree(NotCertified):
    """Raised when the enclosures from the two routes are disjoint, which proves that one route is wrong."""


BallLoad = tuple[int, Vector | None, Vector, Vector]
"""A load in balls: its body, the point on it (None: centre of mass), force [N] and torque [N m] in world axes."""

Component = tuple[Vector, list[Vector]] | Callable[[float], arb]
"""A function of time: polynomial and harmonics as in `Terms`, or a callable that returns its value at a sample."""


@dataclass(frozen=True, slots=True, eq=False)
class VaryingLoad:
    """A time-varying load on a body.

    Attributes:
        body: Index of its body.
        point: Point on the body; None for the centre of mass.
        components: Functions of time for Fx, Fy, Fz, Mx, My, Mz.
        turns: Whether the components are in body axes.
    """

    body: int
    point: Vector | None
    components: Sequence[Component]
    turns: bool

    def at(self, t: float, T: arb_mat) -> BallLoad:
        """Return the load at time t [s] on a body with pose T."""
        now = [one(t) if callable(one) else drive([one], t)[0][0] for one in self.components]
        force, torque = (point(T, each, 0) if self.turns else each for each in (now[:3], now[3:]))
        return self.body, self.point, force, torque


@dataclass(frozen=True, slots=True, eq=False)
class Unknown:
    """A unit force or moment that a joint's parent exerts on its child at a point."""

    name: str
    unit: str
    joint: Joint
    is_force: bool
    direction: Vector
    point: Vector


def generalized_force(linkage: Linkage, now: State, gravity: Vector, loads: Sequence[BallLoad]) -> list[arb]:
    """Compute the generalized actuator force along each independent coordinate, using route 1 [N m or N]."""
    forces, resisted = [], [*resisting_forces(linkage, now)]
    second = [2 * T[2] for T in now.bodies]
    for j in range(now.partial.ncols()):
        virtual = linkage.place([[q[0], now.partial[i, j]] for i, q in enumerate(now.q)])
        Q = arb(0)
        for mass, T, A in zip(linkage.masses, virtual[1:], second[1:], strict=True):
            Q += _trace(T[1] * mass.pseudo, A) - mass.mass * dot(gravity, point(T[1], mass.com))
        for body, place, push, torque in loads:
            T = virtual[body]
            at = linkage.masses[body - 1].com if place is None else place
            Q -= dot(push, point(T[1], at)) + dot(torque, spin(T, 1))
        Q += sum((force * now.partial[column, j] for column, force in resisted), arb(0))
        forces.append(Q)
    return forces


def resisting_forces(linkage: Linkage, now: State) -> Iterator[tuple[int, arb]]:
    """Yield, for each rotor, damper and dry friction, its coordinate's column and the force along that coordinate.

    Raises:
        NotCertified: The sign of a rate, which determines the direction of friction, is not certain.
    """
    for one in linkage.mechanism.resistances:
        _, rate, half = now.q[one.column]  # coefficients of a series in time
        if one.what != "friction":
            yield one.column, arb(one.amount) * (2 * half if one.what == "rotor" else rate)
        elif abs(rate) > REST:
            yield one.column, arb(one.amount) * (1 if rate > 0 else -1)
        else:
            what = f"'{one.coordinate}' is at rest, so its dry friction has no direction"
            raise NotCertified(what, "", "keep the motion away from this pose")


def _trace(A: arb_mat, B: arb_mat) -> arb:
    """Return ``trace(A B^T)``."""
    return sum((x * y for x, y in zip(A.entries(), B.entries(), strict=True)), arb(0))


def min_norm(B: arb_mat, Q: Sequence[arb]) -> arb_mat:
    """Return the minimum-norm actuator forces that satisfy ``B^T f = Q``. Shape (n_actuator, 1)."""
    Bt = B.transpose()
    try:
        return B * (Bt * B).solve(arb_mat([[x] for x in Q]))
    except ZeroDivisionError:
        what = "the actuators may be unable to move every coordinate"
        raise NotCertified(what, "", "keep the motion away from this pose") from None


def columns_of(A: arb_mat, some: Sequence[int]) -> arb_mat:
    """Select columns of a matrix. Shape (m, n) -> (m, n_some)."""
    return arb_mat(A.nrows(), len(some), [A[i, j] for i in range(A.nrows()) for j in some])


def idle_accelerations(
    B: arb_mat, columns: Sequence[Sequence[arb]], Q: Sequence[arb], idle: Sequence[int]
) -> list[arb]:
    """Solve for second derivatives x of undriven coordinates, ``N^T (Q + M x) = 0``.

    The columns of N are motions in which the actuators are at rest: one idle coordinate moves, and the driven
    coordinates compensate.

    Args:
        B: Velocities of the actuators per unit velocity of the independent coordinates. Shape (n_actuator, k).
        columns: Columns of the mass matrix that belong to the idle coordinates. Shape (m, k).
        Q: Forces along the coordinates at x = 0. Shape (k,).
        idle: Indices of the idle coordinates.

    Raises:
        NotCertified: Idle coordinates may have no inertia, or actuators may be unable to move all driven coordinates.
    """
    given, m = given_columns(len(Q), idle), len(idle)
    N = arb_mat(len(Q), m, [int(j == i) for j in range(len(Q)) for i in idle])
    driving, freely = columns_of(B, given), columns_of(B, idle)
    try:
        if given:
            back = (driving.transpose() * driving).solve(driving.transpose() * freely)
            for row, j in enumerate(given):
                for i in range(m):
                    N[j, i] = -back[row, i]
        power = arb_mat([[*column] for column in columns]) * N
        return power.transpose().solve(-(N.transpose() * arb_mat([[x] for x in Q]))).entries()
    except ZeroDivisionError:
        what = "a coordinate that no actuator drives may have no inertia"
        raise NotCertified(what, "", "keep the motion away from this pose") from None


def jacobian(linkage: Linkage, now: State, points: Sequence[tuple[int, Vector]], idle: Collection[int]) -> list[arb]:
    """Return the twist of each body about its origin, and point velocities, per unit actuator rate, row by row.

    Args:
        points: For each point, the index of its body and its position in that body.
        idle: Coordinates that no actuator drives; they are at rest.
    """
    rows, origin = linkage.mechanism.actuated_columns, [arb(0)] * 3
    driven = given_columns(now.partial.ncols(), idle)
    B = arb_mat([[now.partial[row, j] for j in driven] for row in rows])
    unit = ([arb(int(i == j)) for i in driven] for j in driven)
    back = arb_mat([min_norm(B, one).entries() for one in unit])
    columns = list[Vector]()
    for j in driven:
        moved = linkage.place([[q[0], now.partial[i, j]] for i, q in enumerate(now.q)])
        twists = [x for T in moved[1:] for x in (*spin(T, 1), *point(T[1], origin))]
        columns.append([*twists, *(x for body, place in points for x in point(moved[body][1], place))])
    return (arb_mat(columns).transpose() * back).entries()


def unknowns(linkage: Linkage, now: State) -> list[Unknown]:
    """List the reaction components of all joints, in the order of the results."""
    return [unknown for joint in by_role(linkage.mechanism.joints) for unknown in _components(linkage, now, joint)]


#: Kind of joint -> directions of its forces and of its moments, see `_directions`.
HELD = {
    "R": ("world", "across"),
    "P": ("across", "frame"),
    "U": ("world", "normal"),
    "S": ("world", ""),
    "C": ("across", "across"),
    "E": ("along", "across"),
    "F": ("", ""),
    "fixed": ("world", "across"),
}


def _components(linkage: Linkage, now: State, joint: Joint) -> list[Unknown]:
    frames, index = linkage.frames[joint.name], linkage.mechanism.body_index
    parent = now.bodies[index[joint.parent]][0] * frames.parent
    child = now.bodies[index[joint.child]][0] * frames.child
    at = [child[i, 3] for i in range(3)]
    return [
        Unknown(f"{joint.name}.{letter}{label}", unit, joint, unit == "N", direction, at)
        for what, letter, unit in zip(HELD[joint.kind], "fm", ("N", "N m"), strict=True)
        for label, direction in _directions(what, frames.axes, parent, child)
    ]


def _directions(what: str, axes: Sequence[Vector], parent: arb_mat, child: arb_mat) -> list[tuple[str, Vector]]:
    """List the labels and world vectors of a joint's directions of the kind `what`, an entry of `HELD`."""
    world = [*zip("xyz", AXES, strict=True)]
    if what == "world":
        return world
    if what == "normal":
        return [("", normalize(cross(point(parent, axes[0], 0), point(child, axes[1], 0))))]
    parts = split(axes[-1])
    chosen = {"": [], "frame": world, "across": parts[:2], "along": parts[2:]}[what]
    return [(label, point(child, axis, 0)) for label, axis in chosen]


def actuator_units(linkage: Linkage, now: State) -> list[Unknown]:
    """List the actuators as unit forces or moments: first actuators along joint axes, then all others."""
    actuators, index = [], linkage.mechanism.body_index
    for joint in linkage.mechanism.actuators:
        frames = linkage.frames[joint.name]
        child = now.bodies[index[joint.child]][0] * frames.child
        axis, at = point(child, frames.axes[0], 0), [child[i, 3] for i in range(3)]
        actuators.append(Unknown(joint.name, "", joint, not joint.angles, axis, at))
    for column in linkage.mechanism.actuated_columns[len(actuators) :]:
        joint, turns, axis, at = linkage.exert(column, now.q, now.bodies)
        actuators.append(Unknown(linkage.mechanism.coordinates[column], "", joint, not turns, axis, at))
    return actuators


def balance_columns(linkage: Linkage, now: State, parts: Sequence[Unknown]) -> list[list[arb]]:
    """Return the effect of each unknown on each body: force, and moment about the centre of mass. (m, 6 n_body)."""
    index = linkage.mechanism.body_index
    com = [point(T[0], mass.com) for T, mass in zip(now.bodies[1:], linkage.masses, strict=True)]
    columns = []
    for part in parts:
        column = [arb(0)] * (6 * len(com))
        for side, sign in ((index[part.joint.child], 1), (index[part.joint.parent], -1)):
            if not side:
                continue
            moment = part.direction
            if part.is_force:
                moment = cross(difference(part.point, com[side - 1]), part.direction)
                column[6 * side - 6 : 6 * side - 3] = [x * sign for x in part.direction]
            column[6 * side - 3 : 6 * side] = [x * sign for x in moment]
        columns.append(column)
    return columns


def coupling_balances(linkage: Linkage, now: State) -> list[list[arb]]:
    """Return the wrenches of each coupling on bodies: 1 along its coordinate, minus the slope along the others."""
    q, columns = [x[0] for x in now.q], []
    for tie in linkage.ties:
        column = [arb(0)] * (6 * len(linkage.masses))
        for at, share in tie.shares(q):
            column = [a + share * b for a, b in zip(column, coordinate_wrenches(linkage, now, at), strict=True)]
        columns.append(column)
    return columns


def coordinate_wrenches(linkage: Linkage, now: State, column: int) -> list[arb]:
    """Return the wrenches of a unit force along a coordinate, see `balance_columns`. Shape (6 n_body,)."""
    joint, turns, direction, spot = linkage.exert(column, now.q, now.bodies)
    return balance_columns(linkage, now, [Unknown("", "", joint, not turns, direction, spot)])[0]


def required_wrenches(linkage: Linkage, now: State, gravity: Vector, loads: Sequence[BallLoad]) -> list[arb]:
    """Return the wrench that joints and actuators must exert on each body (Newton-Euler). Shape (6 n_body,)."""
    right: list[arb] = []
    for i, (mass, T) in enumerate(zip(linkage.masses, now.bodies[1:], strict=True), 1):
        F = [mass.mass * (2 * a - g) for a, g in zip(point(T[2], mass.com), gravity, strict=True)]
        R = arb_mat([row[:3] for row in T[0].tolist()[:3]])
        J = R * mass.tensor * R.transpose()
        w, b = spin(T, 1), spin(T, 2)
        Jw, Jb = ((J * arb_mat([[x] for x in v])).entries() for v in (w, b))
        M = [x + y for x, y in zip(Jb, cross(w, Jw), strict=True)]
        for body, place, force, torque in loads:
            if body == i:
                F, M = difference(F, force), difference(M, torque)
                if place is not None:
                    arm = point(T[0], difference(place, mass.com), 0)
                    M = difference(M, cross(arm, force))
        right += [*F, *M]
    for column, resisting in resisting_forces(linkage, now):
        right = [a + resisting * b for a, b in zip(right, coordinate_wrenches(linkage, now, column), strict=True)]
    return right


def newton_euler(
    linkage: Linkage, now: State, B: arb_mat, right: list[arb], idle: Sequence[int], *, axial: bool
) -> tuple[list[arb], arb_mat, list[arb]]:
    """Solve for reactions, coupling forces and actuator forces from the balance of all bodies (route 2).

    Minimum-norm actuator forces lie in the range of B, ``f = B z``. The unknowns are then z, and the system is square
    unless the mechanism is overconstrained. With the rule ``spherical_axial``, the unknowns are f, and the rule adds
    two rows. If redundant constraints leave reactions undetermined, one set of reactions that satisfies the balance
    is returned. Forces along undriven coordinates are also unknowns; their solutions must be zero.

    Args:
        B: Velocities of the actuators per unit velocity of the independent coordinates that they drive.
            Shape (n_actuator, k).
        right: Force and moment on each body, see `required_wrenches`.
        idle: Joint coordinates that nothing drives.
        axial: Whether redundant actuators obey the rule of eq. (56).

    Returns:
        Reaction components, f of shape (n_actuator, 1), and the forces along undriven coordinates.

    Raises:
        NotCertified: The system may be singular.
    """
    parts = unknowns(linkage, now)
    reactions = [*balance_columns(linkage, now, parts), *coupling_balances(linkage, now)]
    drives = arb_mat(balance_columns(linkage, now, actuator_units(linkage, now)))
    driven = drives if axial else B.transpose() * drives
    columns = [*reactions, *driven.tolist(), *(coordinate_wrenches(linkage, now, column) for column in idle)]
    if axial:
        for row in _axial_rows(linkage, now, [part.name for part in parts]):
            columns = [[*column, row.get(i, arb(0))] for i, column in enumerate(columns)]
            right = [*right, arb(0)]
    solution = _solve(columns, right, linkage.length)
    end = len(columns) - len(idle)
    forces = arb_mat([[x] for x in solution[len(reactions) : end]])
    return solution[: len(reactions)], forces if axial else B * forces, solution[end:]


def _solve(columns: Sequence[Sequence[arb]], right: Sequence[arb], length: float) -> list[arb]:
    """Solve for the coefficients of the columns; dependent columns are omitted, and their coefficients are zero."""
    chosen = list(range(len(columns)))
    if len(columns) > len(right):
        table = floats(arb_mat(columns)) / np.resize(np.repeat([1.0, length], 3), len(right))
        sizes = np.linalg.norm(table, axis=1, keepdims=True)
        chosen = independent_rows(table / np.where(sizes > 0.0, sizes, 1.0), len(right))
    system = arb_mat([columns[i] for i in chosen]).transpose()
    try:
        x = solve(system, arb_mat([[value] for value in right])).entries()
    except (ZeroDivisionError, ValueError):  # singular, or fewer unknowns than balances
        raise NotCertified("the force system may be singular", "", "keep the motion away from this pose") from None
    solution = [arb(0)] * len(columns)
    for i, value in zip(chosen, x, strict=True):
        solution[i] = value
    return solution


def _axial_rows(linkage: Linkage, now: State, names: Sequence[str]) -> list[dict[int, arb]]:
    """Return two rows that keep the joint's force along its line (eq. 56): column -> coefficient."""
    axial = linkage.axial
    if axial is None:
        raise NotCertified("the mechanism names no joint for the rule spherical_axial", "", "use min_norm")
    joint, direction = axial
    line = unit_vector(direction)
    k = min(range(3), key=lambda i: abs(float(line[i].mid())))
    first = normalize(cross(line, AXES[k]))
    child = now.bodies[linkage.mechanism.body_index[linkage.mechanism.joint(joint).child]][0]
    columns = [names.index(f"{joint}.f{axis}") for axis in "xyz"]
    return [dict(zip(columns, point(child, across, 0), strict=True)) for across in (first, cross(line, first))]
