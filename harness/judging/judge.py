"""Judges one engine's output without any other engine: do loops close, do bodies obey Newton and Euler?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from screwgauge.judging.balance import newton_euler, power_balance, required_wrenches, virtual_work
from screwgauge.judging.kinetics import Moving, walk
from screwgauge.judging.refusals import Refusal
from screwgauge.judging.residual import Residual
from screwgauge.quantities import SOLVED, length, natural_scales
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.rotations import Array, vee
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Values

COLUMNS = [
    *("engine", "residual", "unit", "max_abs", "max_scaled", "worst_component", "worst_t"),
    *("tolerance", "ok", "reason"),
]


def judge(
    scene: Scene, solution: Solution, tolerance: float = SOLVED, *, refused: Sequence[Refusal] = ()
) -> pd.DataFrame:
    """All residuals that the computed quantities allow. One row per residual and unit.

    Args:
        refused: Samples without numbers: what an engine does not say cannot be judged.
    """
    own = [one for one in refused if one.engine == solution.engine]
    if own:
        solved = np.arange(len(scene.motion)) if solution.rows is None else solution.rows
        left = np.setdiff1d(solved, np.concatenate([one.rows for one in own]))
        if not left.size:
            return pd.DataFrame(columns=COLUMNS)
        solution = replace(solution, rows=left)
    if solution.rows is not None:  # it solved some of the samples: these are judged
        scene, solution = replace(scene, motion=scene.motion.part(solution.rows)), _solved(solution)
    rows = [judged_row(solution.engine, residual, scene.motion.t, tolerance) for residual in residuals(scene, solution)]
    admitted = max((float(np.max(e, initial=0.0)) for e in solution.estimate.values()), default=0.0)
    for row in rows:
        if not row["ok"] and not row["reason"] and admitted >= float(str(row["max_scaled"])):
            row["reason"] = f"within the error that {solution.engine} admits by its conditioning"
    return pd.DataFrame(rows, columns=COLUMNS)


def _solved(solution: Solution) -> Solution:
    """The solution on its own samples only."""
    values = {
        name: Values(has.components, has.units, has.array[solution.rows]) for name, has in solution.values.items()
    }
    return replace(solution, values=values, rows=None)


def residuals(scene: Scene, solution: Solution) -> list[Residual]:
    """Residuals of every equation that the computed quantities allow, over all samples."""
    have = solution.values
    if "joint_position" not in have:
        return []
    q = have["joint_position"].array
    zero = np.zeros_like(q)
    qd = have["joint_velocity"].array if "joint_velocity" in have else zero
    qdd = have["joint_acceleration"].array if "joint_acceleration" in have else zero
    tree = spanning_tree(scene.mechanism)
    bodies, closed = walk(scene.mechanism, tree, q, qd, qdd)
    found = _loops(scene, solution, bodies, closed) + _body_motions(scene, solution, bodies)
    forces = {"body_angular_velocity", "body_angular_acceleration", "com_acceleration", "actuator_force"}
    sprung = bool(scene.springs or scene.motors)  # what they exert depends on rates
    if forces <= set(have) and ("joint_velocity" in have or not sprung):
        required, largest = required_wrenches(scene, solution, bodies)
        if "reaction" in have:
            found += newton_euler(scene, solution, bodies, required, largest)
        if "joint_velocity" in have:
            found.append(power_balance(scene, solution, bodies, required))
        found += virtual_work(scene, solution, required)
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
            for unit, gap in zip(units, difference(bodies[mechanism.body_index[joint.child]], via, order), strict=True):
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


def _body_motions(scene: Scene, solution: Solution, bodies: list[Moving]) -> list[Residual]:
    """Reported motions of the bodies less those that follow from the reported joint coordinates."""
    moving = list(zip(scene.mechanism.bodies, bodies[1:], strict=True))
    known = {
        "body_angular_velocity": ({"joint_velocity"}, [at.w for _, at in moving]),
        "body_angular_acceleration": ({"joint_velocity", "joint_acceleration"}, [at.b for _, at in moving]),
        "com_acceleration": (
            {"joint_velocity", "joint_acceleration"},
            [at.shifted(at.R @ body.com).a for body, at in moving],
        ),
    }
    found = []
    for quantity, (needs, expected) in known.items():
        if quantity in solution.values and needs <= set(solution.values):
            values = solution.values[quantity]
            unit = values.units[0]
            size = float(np.nanmax(np.abs(values.array), initial=0.0))
            scale = max(size, 1e-6 * natural_scales(scene.mechanism)[unit])
            difference = values.array - np.concatenate(expected, axis=1)
            found.append(Residual("body_motion", unit, values.components, difference, scale))
    return found


def _largest(values: Values, unit: str, L: float) -> float:
    """Largest rate in a unit, one of the other kind being turned into it by the length L [m]."""
    sizes = [0.0]
    for own, column in zip(values.units, values.array.T, strict=True):
        size = float(np.nanmax(np.abs(column), initial=0.0))
        sizes.append(size if own == unit else size * L if unit.startswith("m") else size / L)
    return max(sizes)


def difference(tree: Moving, via: Moving, order: int) -> tuple[Array, Array]:
    """Angular and linear difference of two motions of one body, of derivative `order`. Shape (n, 3) each."""
    if order == 0:
        return vee(via.R @ tree.R.swapaxes(1, 2)), via.p - tree.p
    if order == 1:
        return via.w - tree.w, via.v - tree.v
    return via.b - tree.b, via.a - tree.a


def judged_row(engine: str, residual: Residual, t: Array, tolerance: float) -> dict[str, object]:
    """The worst of a residual: how large, where, when."""
    t = t if residual.t is None else residual.t
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
