"""Whether forces balance: Newton and Euler for each body, power, virtual work. From one engine's output alone."""

from __future__ import annotations

import numpy as np

from screwgauge.judging.kinetics import Moving, walk
from screwgauge.judging.residual import Residual
from screwgauge.quantities import natural_scales
from screwgauge.reference.continuation import partial_rates
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.reactions import Reactions, reaction_components
from screwgauge.reference.rotations import Array
from screwgauge.reference.wrenches import State, applied_wrenches
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution

MOST = 201  # samples at which virtual work is asked for: it takes a walk for every joint coordinate


def required_wrenches(
    scene: Scene, solution: Solution, bodies: list[Moving]
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Force and moment about the centre of mass that joints must exert, and the largest term in each.

    From the engine's own body motions; only the attitudes come from its joint coordinates.

    Returns:
        (F, T), shape (n, n_body, 3) each; and (largest force, largest moment), shape (n_body,) each.
    """
    mechanism = scene.mechanism
    shape = len(scene.motion), len(mechanism.bodies), 3
    w, b, a = (
        solution.values[name].array.reshape(shape)
        for name in ("body_angular_velocity", "body_angular_acceleration", "com_acceleration")
    )
    F, T = np.empty(shape), np.empty(shape)
    springs = _springs_and_motors(scene, solution, bodies)
    sizes_F, sizes_T = np.zeros(shape[1]), np.zeros(shape[1])
    for i, body in enumerate(mechanism.bodies):
        R = bodies[i + 1].R
        J = R @ body.inertia @ R.swapaxes(1, 2)
        terms_F = [body.mass * a[:, i], np.tile(-body.mass * scene.gravity, (shape[0], 1))]
        terms_T = [(J @ b[:, i, :, None])[..., 0], np.cross(w[:, i], (J @ w[:, i, :, None])[..., 0])]
        for load in scene.loads:
            if load.body == body.name:
                terms_F.append(np.tile(-load.force, (shape[0], 1)))
                terms_T.append(np.tile(-load.torque, (shape[0], 1)))
                if load.point is not None:
                    terms_T.append(-np.cross(R @ (load.point - body.com), load.force))
        if springs is not None:
            wrench = springs[:, i + 1]
            terms_F.append(-wrench[:, :3])
            terms_T += [-wrench[:, 3:], np.cross(R @ body.com, wrench[:, :3])]
        F[:, i], T[:, i] = sum(terms_F), sum(terms_T)
        sizes_F[i], sizes_T[i] = (max(float(np.nanmax(np.abs(x))) for x in terms) for terms in (terms_F, terms_T))
    return (F, T), (sizes_F, sizes_T)


def _springs_and_motors(scene: Scene, solution: Solution, bodies: list[Moving]) -> Array | None:
    """Force and moment about its origin on each body, ground first, shape (n, b, 6); None if there are none."""
    if not (scene.springs or scene.motors):
        return None
    V = np.stack([np.concatenate([at.w, at.v], axis=1) for at in bodies], axis=1)
    R, p = (np.stack([getattr(at, name) for at in bodies], axis=1) for name in ("R", "p"))
    q, v = (solution.values[name].array for name in ("joint_position", "joint_velocity"))
    mechanism, index = scene.mechanism, scene.mechanism.body_index
    return applied_wrenches(
        mechanism.joints,
        scene.springs,
        scene.motors,
        State(scene.motion.t, R, p, V, q, v),
        index,
        lambda joint: (index[joint.parent], index[joint.child]),
    )


def newton_euler(
    scene: Scene,
    solution: Solution,
    bodies: list[Moving],
    required: tuple[Array, Array],
    largest: tuple[Array, Array],
) -> list[Residual]:
    """What the reported reactions and actuator forces leave over of the balance of each body."""
    mechanism, index = scene.mechanism, scene.mechanism.body_index
    F, T = -required[0], -required[1]
    largest_F, largest_T = largest[0].copy(), largest[1].copy()
    joints = mechanism.joints
    parts = reaction_components(
        joints,
        [bodies[index[joint.parent]].R for joint in joints],
        [bodies[index[joint.child]].R for joint in joints],
        [bodies[index[joint.child]].p for joint in joints],
    )
    com = [moving.p + moving.R @ body.com for moving, body in zip(bodies[1:], mechanism.bodies, strict=True)]
    for joint_at, f, m, point in _exerted(scene, solution, bodies, parts):
        for side, sign in ((joints[joint_at].child, 1.0), (joints[joint_at].parent, -1.0)):
            i = index[side] - 1
            if i >= 0:
                moment = m + np.cross(point - com[i], f)
                F[:, i] += sign * f
                T[:, i] += sign * moment
                largest_F[i] = max(largest_F[i], float(np.nanmax(np.abs(f), initial=0.0)))
                largest_T[i] = max(largest_T[i], float(np.nanmax(np.abs(moment), initial=0.0)))
    scales = natural_scales(mechanism)
    found = []
    for values, unit, label, size in ((F, "N", "f", largest_F), (T, "N m", "m", largest_T)):
        names = [f"{body.name}.{label}{axis}" for body in mechanism.bodies for axis in "xyz"]
        scale = np.repeat(np.maximum(size, 1e-6 * scales[unit]), 3)
        found.append(Residual("newton_euler", unit, names, values.reshape(len(F), -1), scale))
    return found


def _exerted(
    scene: Scene, solution: Solution, bodies: list[Moving], parts: Reactions
) -> list[tuple[int, Array, Array, Array]]:
    """(joint, force, moment, point) of every reaction component and every actuator, parent on child."""
    mechanism = scene.mechanism
    reaction, driving = solution.values["reaction"], solution.values["actuator_force"]
    found = []
    for k, name in enumerate(parts.names):
        value = reaction.array[:, [reaction.components.index(name)]]
        found.append((parts.joints[k], parts.force[:, k] * value, parts.moment[:, k] * value, parts.point[:, k]))
    for k, joint in enumerate(mechanism.actuators):
        moving = bodies[mechanism.body_index[joint.child]]
        direction = moving.R @ (joint.child_frame.R @ joint.axes[0])
        value, none = direction * driving.array[:, [k]], np.zeros_like(direction)
        point = moving.p + moving.R @ joint.child_frame.p
        turns = joint.kind == "R"
        found.append((mechanism.joints.index(joint), none if turns else value, value if turns else none, point))
    return found


def power_balance(scene: Scene, solution: Solution, bodies: list[Moving], required: tuple[Array, Array]) -> Residual:
    """Power of the actuators less what motion, gravity and loads take up."""
    mechanism = scene.mechanism
    columns = mechanism.actuated_columns
    powers = solution.values["actuator_force"].array * solution.values["joint_velocity"].array[:, columns]
    given, taken = np.sum(powers, axis=1), np.zeros(len(powers))
    largest = float(np.nanmax(np.abs(powers), initial=0.0))
    for i, (body, moving) in enumerate(zip(mechanism.bodies, bodies[1:], strict=True)):
        velocity = moving.v + np.cross(moving.w, moving.R @ body.com)
        terms = np.concatenate([required[0][:, i] * velocity, required[1][:, i] * moving.w], axis=1)
        taken += np.sum(terms, axis=1)
        # at a dead centre the sum is zero and only its terms tell how large rounding is
        largest = max(largest, float(np.nanmax(np.abs(terms), initial=0.0)))
    scale = max(largest, 1e-6 * natural_scales(mechanism)["W"])
    return Residual("power_balance", "W", ["all actuators"], (given - taken)[:, None], scale)


def virtual_work(scene: Scene, solution: Solution, required: tuple[Array, Array]) -> list[Residual]:
    """Generalised and actuator forces against the work of the required wrenches on every allowed motion.

    The allowed motions come from walking the mechanism with one joint rate at a time, at up to `MOST` samples.
    """
    rows = np.unique(np.linspace(0, len(scene.motion) - 1, MOST).astype(int))
    motions, of_bodies = allowed_motions(scene, solution.values["joint_position"].array[rows])
    needed = np.einsum("nbx,nbxj->nj", np.concatenate([required[0][rows], required[1][rows]], axis=2), of_bodies)
    mechanism = scene.mechanism
    units = [mechanism.units[column] for column in mechanism.independent_columns]
    given = []
    if "generalized_force" in solution.values:
        given.append(("", solution.values["generalized_force"].array[rows]))
    driven = motions[:, mechanism.actuated_columns]
    given.append((" by actuators", np.einsum("nkj,nk->nj", driven, solution.values["actuator_force"].array[rows])))
    found = []
    for unit in dict.fromkeys(units):
        columns = [k for k, own in enumerate(units) if own == unit]
        force = "N m" if unit == "rad" else "N"
        size = float(np.nanmax(np.abs(needed[:, columns]), initial=0.0))
        names = [f"{list(mechanism.independent)[k]}{how}" for how, _ in given for k in columns]
        values = np.concatenate([Q[:, columns] - needed[:, columns] for _, Q in given], axis=1)
        scale = max(size, 1e-6 * natural_scales(mechanism)[force])
        found.append(Residual("virtual_work", force, names, values, scale, scene.motion.t[rows]))
    return found


def allowed_motions(scene: Scene, q: Array) -> tuple[Array, Array]:
    """Joint rates per rate of y, shape (n, n_q, k), and what they make of the bodies, (n, n_body, 6, k).

    The bodies' part is the velocity of the centre of mass over the angular velocity.
    """
    mechanism, tree = scene.mechanism, spanning_tree(scene.mechanism)
    zero, gaps, moved = np.zeros_like(q), [], []
    for i in range(q.shape[1]):
        unit = zero.copy()
        unit[:, i] = 1.0
        bodies, closed = walk(mechanism, tree, q, unit, zero)
        children = [bodies[mechanism.body_index[joint.child]] for joint in tree.cuts]
        gap = [np.concatenate([via.w - at.w, via.v - at.v], axis=1) for at, via in zip(children, closed, strict=True)]
        gaps.append(np.concatenate([*gap, zero[:, :0]], axis=1))
        com = [at.R @ body.com for at, body in zip(bodies[1:], mechanism.bodies, strict=True)]
        speeds = [(at.v + np.cross(at.w, r), at.w) for at, r in zip(bodies[1:], com, strict=True)]
        moved.append(np.stack([np.concatenate(pair, axis=1) for pair in speeds], axis=1))
    selection = np.eye(q.shape[1])[mechanism.independent_columns]
    system = np.concatenate([np.stack(gaps, axis=2), np.tile(selection, (len(q), 1, 1))], axis=1)
    motions = partial_rates(system, len(selection))
    return motions, np.einsum("inbx,nij->nbxj", np.stack(moved), motions)
