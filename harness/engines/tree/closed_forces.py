"""Forces of the closed mechanism: projected tree forces, and multipliers for the remaining forces.

Joint reactions follow from the wrenches that the engine transmits through its tree and from the multipliers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwgauge.engines.kit.projection import along_line, min_norm
from screwgauge.engines.tree.closed_tree import ClosedTree, TreeLoops
from screwgauge.engines.tree.protocol import BodyPoses
from screwgauge.problem import Problem
from screwgauge.quantities import RULED
from screwgauge.reference.equations.joint_types import JointPose
from screwgauge.reference.equations.screws import times
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import Joint, by_role
from screwgauge.reference.resistance import ROTORS, resistances
from screwgauge.reference.rotations import Array, across_direction, cross


def closed_forces(
    closed: ClosedTree,
    given: tuple[Problem, Sequence[int]],
    at: BodyPoses,
    system: tuple[Array, Array],
    motion: tuple[Array, Array, Array, Array],
    exerted: tuple[Array, Array],
) -> tuple[dict[str, Array], dict[str, Array], Array]:
    """Compute generalised and actuator forces by projection, and reactions from multipliers of the closing rows.

    Args:
        given: The problem, and indices of the independent coordinates that no actuator drives.
        system: Inverse of the dimensionless closing system, shape (n, n_v, m + k), and tree velocities per unit
            velocity of y, shape (n, n_v, k).
        motion: Coordinates, velocities, accelerations and forces of the open tree. Shape (n, n_v) each.
        exerted: Wrenches of loads, springs and motors, see `applied_wrenches`.

    Returns:
        Quantity -> values, (n, m); quantity -> condition number of the equations solved for it, if any, (n,); and the
        largest force along a coordinate, whether loads are included or not, with moments divided by the mechanism's
        length [N], (n,).
    """
    (problem, idle), (inverse, K), (acting, along) = given, system, exerted
    tau, wanted, units = motion[3], problem.wanted, closed.units
    need = tau - at.forces_along(acting)
    Q = (K.swapaxes(1, 2) @ need[..., None])[..., 0]
    largest = (np.maximum(np.abs(need), np.abs(tau)) * units).max(axis=1) / closed.length
    values = {"generalized_force": Q}
    if not wanted & RULED:
        return values, {}, largest
    driven = closed.driven
    f, condition = min_norm(K[:, driven], Q, idle)
    conditions = dict.fromkeys(("actuator_force", "axis_moment"), condition)
    if problem.rule == "spherical_axial":
        alone = closed.tree.transmitted(at, *motion[:3], acting)
        f, condition = axial_forces(closed, at, closed.jacobian(motion[0], at), need, alone)
        conditions = dict.fromkeys(RULED, condition)
    values["actuator_force"], values["axis_moment"] = f, along.copy()
    values["axis_moment"][:, [closed.names.index(closed.tree.coordinates[k]) for k in driven]] += f
    for one in resistances(closed.file.joints, ROTORS):  # rotors are on tree coordinates
        place = closed.tree.coordinates.index(one.coordinate)
        values["axis_moment"][:, one.column] -= one.amount * motion[2][:, place]
    if "reaction" not in wanted:
        return values, conditions, largest
    rest = need.copy()
    rest[:, driven] -= f
    # the force that actuators do not supply does no work on motions of y, so the rows of y get none of it
    m = inverse.shape[2] - K.shape[2]
    multipliers = ((rest * units)[:, None] @ inverse[..., :m])[:, 0] / closed.row_units[:m]
    transmitted = closed.tree.transmitted(at, *motion[:3], acting + closed.loops.wrenches(at, multipliers))
    values["reaction"] = joint_reactions(closed, at, transmitted, multipliers)
    return values, conditions, largest


def axial_forces(closed: ClosedTree, at: BodyPoses, G: Array, need: Array, alone: Array) -> tuple[Array, Array]:
    """Solve for actuator forces that keep the spherical joint's force along its line (eq. 56).

    Args:
        G: Derivative of the closing rows. Shape (n, m, n_v).
        need: Joint forces that actuators and closures must supply together. Shape (n, n_v).
        alone: Wrench on each body from its tree parent without closures. Shape (n, n_body + 1, 6).

    Returns:
        Actuator forces, shape (n, n_actuator), and the condition number of the equations, (n,).

    Raises:
        ModelFileError: The loops file lacks the table ``[spherical_axial]``, which names the joint.
    """
    loops, driven = closed.loops, closed.driven
    if closed.file.axial is None:
        raise ModelFileError("the loops file has no [spherical_axial]", "rule spherical_axial", "add the table")
    name, direction = closed.file.axial
    joint = next(joint for joint in closed.file.joints if joint.name == name)
    constant, shares = _force(joint, closed, alone)
    across = across_direction(at.R[:, loops.index[joint.child]], direction)
    m, anchored = G.shape[1], 3 * len(loops.anchors)
    line = np.zeros((len(G), 2, m))
    line[:, :, :anchored] = (shares[:, None] * across[:, :, None]).reshape(len(G), 2, -1)
    drive = np.broadcast_to(np.eye(G.shape[2])[driven], (len(G), len(driven), G.shape[2]))
    return along_line(drive, G, need, line, -(across @ constant[..., None])[..., 0])


def _force(joint: Joint, closed: ClosedTree, alone: Array) -> tuple[Array, Array]:
    """Return a joint's force on one of its bodies without closures [N], (n, 3), and its change per unit force of each
    anchor, (n_anchor,)."""
    loops = closed.loops
    if joint in loops.cut:
        return np.zeros((len(alone), 3)), np.array([float(anchor.joint == joint.name) for anchor in loops.anchors])
    body = _outer_body(joint, closed)
    beyond = [float(body in closed.ancestry(side)) for side in range(alone.shape[1])]
    shares = [0.0 if anchor.angular else beyond[anchor.parent] - beyond[anchor.child] for anchor in loops.anchors]
    return alone[:, body, :3], np.array(shares)


def _outer_body(joint: Joint, closed: ClosedTree) -> int:
    """Return the outer body of a tree joint."""
    parent, child = closed.loops.sides(joint)
    return child if child and closed.ancestry(child)[1] == parent else parent


def joint_reactions(closed: ClosedTree, at: BodyPoses, transmitted: Array, multipliers: Array) -> Array:
    """Compute the reaction components of every joint, whether in the tree or cut, and of every coupling.

    Args:
        transmitted: Wrench on each body from its tree parent, about its origin. Shape (n, n_body + 1, 6).
        multipliers: Forces of the anchors on their child side, then forces along coupled coordinates.
            Shape (n, 3 n_anchor + n_coupling).

    Returns:
        Components in the order of `reaction_names` [N or N m]. Shape (n, m).
    """
    loops, reactions = closed.loops, list[Array]()
    for joint in by_role(closed.file.joints):
        _, child = loops.sides(joint)
        if joint in loops.cut:
            wrench, body = _anchor_wrench(joint, loops, at, multipliers), child
        else:
            body = _outer_body(joint, closed)
            wrench = transmitted[:, body] * (1.0 if body == child else -1.0)
        reactions.append(components(closed.joint_pose(joint, at), wrench, at.p[:, body]))
    return np.concatenate([*reactions, multipliers[:, 3 * len(loops.anchors) :]], axis=1)


def components(at: JointPose, wrench: Array, about: Array) -> Array:
    """Project a wrench on a joint's child onto the joint's constrained directions. (n, 6), (n, 3) -> (n, m)."""
    force = wrench[:, :3]
    moment = wrench[:, 3:] - cross(at.p_child - about, force)
    return np.concatenate([times(at.type.forces(at), force), times(at.type.moments(at), moment)], axis=1)


def _anchor_wrench(joint: Joint, loops: TreeLoops, at: BodyPoses, multipliers: Array) -> Array:
    """Return the wrench that a cut joint's anchors exert on its child, about the child's origin. Shape (n, 6)."""
    out = np.zeros((len(at.p), 6))
    for k, anchor in enumerate(loops.anchors):
        if anchor.joint == joint.name:
            f = multipliers[:, 3 * k : 3 * k + 3]
            out[:, :3] += f
            out[:, 3:] += cross(at.R[:, anchor.child] @ anchor.at_child, f)
    return out
