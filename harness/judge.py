"""Judges one engine's output without any other engine: do loops close, do bodies obey Newton and Euler?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from screwgauge.kinetics import Moving, walk
from screwgauge.quantities import SOLVED, length, natural_scales
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.reactions import Reactions, reaction_components
from screwgauge.reference.rotations import Array, vee
from screwgauge.scene import Scene
from screwgauge.solution import Solution, Values

COLUMNS = [
    *("engine", "residual", "unit", "max_abs", "max_scaled", "worst_component", "worst_t"),
    *("tolerance", "ok", "reason"),
]


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """A residual over time: `values` (n, m) against `scale`, one number or one for each component (m,)."""

    name: str
    unit: str
    components: Sequence[str]
    values: Array
    scale: float | Array


def judge(scene: Scene, solution: Solution, tolerance: float = SOLVED) -> pd.DataFrame:
    """All residuals that the computed quantities allow. One row per residual and unit."""
    if solution.rows is not None:  # it solved some of the samples: these are judged
        scene, solution = replace(scene, motion=scene.motion.part(solution.rows)), _solved(solution)
    rows = [
        _row(solution.engine, residual, scene.motion.t, tolerance) for residual in residuals(scene, solution)
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


def _solved(solution: Solution) -> Solution:
    """The solution on its own samples only."""
    values = {
        name: Values(has.components, has.units, has.array[solution.rows])
        for name, has in solution.values.items()
    }
    return replace(solution, values=values, rows=None)


def residuals(scene: Scene, solution: Solution) -> list[Residual]:
    """Residuals with their components, largest detail."""
    have = solution.values
    if "joint_position" not in have:
        return []
    q = have["joint_position"].array
    zero = np.zeros_like(q)
    qd = have["joint_velocity"].array if "joint_velocity" in have else zero
    qdd = have["joint_acceleration"].array if "joint_acceleration" in have else zero
    tree = spanning_tree(scene.mechanism)
    bodies, closed = walk(scene.mechanism, tree, q, qd, qdd)
    found = _loops(scene, solution, bodies, closed)
    forces = {"body_angular_velocity", "body_angular_acceleration", "com_acceleration", "actuator_force"}
    if forces <= set(have):
        required, largest = _required(scene, solution, bodies)
        if "reaction" in have:
            found += _newton_euler(scene, solution, bodies, required, largest)
        if "joint_velocity" in have:
            found.append(_power(scene, solution, bodies, required))
    return found


def _loops(scene: Scene, solution: Solution, bodies: list[Moving], closed: list[Moving]) -> list[Residual]:
    """Closure of every loop in position, rate and acceleration, and whether y follows what was asked for."""
    mechanism, motion = scene.mechanism, scene.motion
    cuts = spanning_tree(mechanism).cuts
    scales = natural_scales(mechanism)
    orders = (
        ("loop_closure", "joint_position", ("rad", "m"), motion.y),
        ("loop_rate", "joint_velocity", ("rad/s", "m/s"), motion.yd),
        ("loop_acceleration", "joint_acceleration", ("rad/s^2", "m/s^2"), motion.ydd),
    )
    found = []
    for order, (name, quantity, units, asked) in enumerate(orders):
        if quantity not in solution.values:
            continue
        values = solution.values[quantity]
        parts: dict[str, list[tuple[str, Array]]] = {unit: [] for unit in units}
        for joint, via in zip(cuts, closed, strict=True):
            for unit, gap in zip(
                units, _gap(bodies[mechanism.body_index[joint.child]], via, order), strict=True
            ):
                parts[unit] += [(f"{joint.name}.{axis}", gap[:, k]) for k, axis in enumerate("xyz")]
        for k, (label, coordinate) in enumerate(mechanism.independent.items()):
            column = values.components.index(coordinate)
            parts[values.units[column]].append((f"{label} as asked", values.array[:, column] - asked[:, k]))
        for unit, rows in parts.items():
            if rows:
                scale = scales[unit]
                if order:  # rates and accelerations are measured against the largest of the motion
                    scale = max(_largest(values, unit, length(mechanism)), 1e-6 * scale)
                names, arrays = zip(*rows, strict=True)
                found.append(Residual(name, unit, names, np.stack(arrays, axis=1), scale))
    return found


def _largest(values: Values, unit: str, L: float) -> float:
    """Largest rate in a unit, one of the other kind being turned into it by the length L [m]."""
    sizes = [0.0]
    for own, column in zip(values.units, values.array.T, strict=True):
        size = float(np.nanmax(np.abs(column), initial=0.0))
        sizes.append(size if own == unit else size * L if unit.startswith("m") else size / L)
    return max(sizes)


def _gap(tree: Moving, via: Moving, order: int) -> tuple[Array, Array]:
    """Angular and linear difference of two motions of one body, of derivative `order`. Shape (n, 3) each."""
    if order == 0:
        return vee(via.R @ tree.R.swapaxes(1, 2)), via.p - tree.p
    if order == 1:
        return via.w - tree.w, via.v - tree.v
    return via.b - tree.b, via.a - tree.a


def _required(
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
        F[:, i], T[:, i] = sum(terms_F), sum(terms_T)
        sizes_F[i], sizes_T[i] = (
            max(float(np.nanmax(np.abs(x))) for x in terms) for terms in (terms_F, terms_T)
        )
    return (F, T), (sizes_F, sizes_T)


def _newton_euler(
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
        found.append(
            (parts.joints[k], parts.force[:, k] * value, parts.moment[:, k] * value, parts.point[:, k])
        )
    for k, joint in enumerate(mechanism.actuators):
        moving = bodies[mechanism.body_index[joint.child]]
        direction = moving.R @ (joint.child_frame.R @ joint.axes[0])
        value, none = direction * driving.array[:, [k]], np.zeros_like(direction)
        point = moving.p + moving.R @ joint.child_frame.p
        turns = joint.kind == "R"
        found.append(
            (mechanism.joints.index(joint), none if turns else value, value if turns else none, point)
        )
    return found


def _power(scene: Scene, solution: Solution, bodies: list[Moving], required: tuple[Array, Array]) -> Residual:
    """Power of the actuators less what motion, gravity and loads take up."""
    mechanism = scene.mechanism
    columns = mechanism.actuated_columns
    given = np.sum(
        solution.values["actuator_force"].array * solution.values["joint_velocity"].array[:, columns], axis=1
    )
    taken = np.zeros_like(given)
    for i, (body, moving) in enumerate(zip(mechanism.bodies, bodies[1:], strict=True)):
        velocity = moving.v + np.cross(moving.w, moving.R @ body.com)
        taken += np.sum(required[0][:, i] * velocity + required[1][:, i] * moving.w, axis=1)
    scale = max(float(np.nanmax(np.abs(given), initial=0.0)), 1e-6 * natural_scales(mechanism)["W"])
    return Residual("power_balance", "W", ["all actuators"], (given - taken)[:, None], scale)


def _row(engine: str, residual: Residual, t: Array, tolerance: float) -> dict[str, object]:
    scaled = np.abs(residual.values) / residual.scale
    bad = ~np.isfinite(scaled)
    i, k = divmod(int(np.argmax(np.where(bad, np.inf, scaled))), scaled.shape[1])
    worst = float(scaled[i, k])
    return {
        "engine": engine,
        "residual": residual.name,
        "unit": residual.unit,
        "max_abs": float(np.abs(residual.values).max()),
        "max_scaled": worst,
        "worst_component": residual.components[k],
        "worst_t": float(t[i]),
        "tolerance": tolerance,
        "ok": bool(worst <= tolerance),
        "reason": f"not a number at t = {t[i]:g} s" if bad.any() else "",
    }
