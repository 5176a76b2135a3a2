"""Judges an integrated motion without any other engine: do the loops close, do the accelerations follow from the
forces, does the energy balance?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from screwgauge.judging.balance import MOST, allowed_motions, required_wrenches
from screwgauge.judging.judge import COLUMNS, difference, judged_row
from screwgauge.judging.kinetics import Moving, walk
from screwgauge.judging.residual import Residual
from screwgauge.problem import Method, Motion
from screwgauge.quantities import G0, SOLVED, integrated_tolerance, length, natural_scales
from screwgauge.reference.applied import JointSpring, Spring
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import ForwardSolution, Solution, Values

_CLOSURE = (
    ("loop_closure", ("rad", "m")),
    ("loop_rate", ("rad/s", "m/s")),
    ("loop_acceleration", ("rad/s^2", "m/s^2")),
)


def judge_motion(scene: Scene, solution: ForwardSolution, times: Array, method: Method) -> pd.DataFrame:
    """Closure, virtual work, and balance of the energy if its work is known. One row per residual and unit.

    Args:
        times: Where the solution is [s]. Shape (m,).
    """
    tree = spanning_tree(scene.mechanism)
    bodies, closed = walk(scene.mechanism, tree, solution.q, solution.v, solution.a)
    rows = [
        judged_row(solution.engine, residual, times, SOLVED)
        for residual in [
            *_loops(scene, solution, bodies, closed),
            *_virtual_work(scene, solution, times, bodies),
        ]
    ]
    balance = energy_balance(scene, solution, bodies)
    if balance is not None:
        tolerance = integrated_tolerance(method.rtol, method.atol)
        rows.append(judged_row(solution.engine, balance, times, tolerance))
    return pd.DataFrame(rows, columns=COLUMNS)


def _loops(scene: Scene, solution: ForwardSolution, bodies: list[Moving], closed: list[Moving]) -> list[Residual]:
    """Closure of every cut joint in position, rate and acceleration."""
    mechanism, found = scene.mechanism, []
    cuts = spanning_tree(mechanism).cuts
    if not cuts:
        return []
    scales, L = natural_scales(mechanism), length(mechanism)
    names = [f"{joint.name}.{axis}" for joint in cuts for axis in "xyz"]
    for order, (name, units) in enumerate(_CLOSURE):
        gaps = [
            difference(bodies[mechanism.body_index[joint.child]], via, order)
            for joint, via in zip(cuts, closed, strict=True)
        ]
        angular = _angular(scene, (solution.q, solution.v, solution.a)[order], L) if order else 0.0
        for k, unit in enumerate(units):
            size = max(angular * L if unit.startswith("m") else angular, 1e-6 * scales[unit])
            scale = size if order else scales[unit]
            values = np.concatenate([pair[k] for pair in gaps], axis=1)
            found.append(Residual(name, unit, names, values, scale))
    return found


def _virtual_work(scene: Scene, solution: ForwardSolution, times: Array, bodies: list[Moving]) -> list[Residual]:
    """What the forces of inertia and all that acts work on every allowed motion: nothing, whatever the reactions.

    It is measured by the largest term. At up to `MOST` samples, as it takes a walk for every joint coordinate.
    """
    rows = np.unique(np.linspace(0, len(times) - 1, MOST).astype(int))
    moving = list(zip(scene.mechanism.bodies, (at.rows(rows) for at in bodies[1:]), strict=True))
    arrays = {
        "joint_position": solution.q[rows],
        "joint_velocity": solution.v[rows],
        "body_angular_velocity": np.concatenate([at.w for _, at in moving], axis=1),
        "body_angular_acceleration": np.concatenate([at.b for _, at in moving], axis=1),
        "com_acceleration": np.concatenate([at.shifted(at.R @ body.com).a for body, at in moving], axis=1),
    }
    blank = np.full((len(rows), len(scene.mechanism.independent)), np.nan)
    here = replace(scene, motion=Motion(times[rows], blank, blank, blank))
    said = Solution(
        solution.engine,
        "",
        {name: Values(("",) * a.shape[1], ("",) * a.shape[1], a) for name, a in arrays.items()},
        solution.condition[rows],
    )
    (F, T), (most_F, most_T) = required_wrenches(here, said, [at.rows(rows) for at in bodies])
    _, of_bodies = allowed_motions(here, solution.q[rows])
    work = np.einsum("nbx,nbxj->nj", np.concatenate([F, T], axis=2), of_bodies)
    terms = np.concatenate([np.tile(most_F[:, None], 3), np.tile(most_T[:, None], 3)], axis=1)
    sizes = np.einsum("bx,nbxj->nj", terms, np.abs(of_bodies)).max(axis=0)
    units = [scene.mechanism.units[column] for column in scene.mechanism.independent_columns]
    found = []
    for unit in dict.fromkeys(units):
        columns = [k for k, own in enumerate(units) if own == unit]
        names = [list(scene.mechanism.independent)[k] for k in columns]
        force = "N m" if unit == "rad" else "N"
        scale = np.maximum(sizes[columns], 1e-6 * natural_scales(scene.mechanism)[force])
        found.append(Residual("virtual_work", force, names, work[:, columns], scale, times[rows]))
    return found


def _angular(scene: Scene, rates: Array, L: float) -> float:
    """Largest rate of any coordinate, lengths being turned into angles by L [m]."""
    per = np.array([1.0 if unit == "rad" else 1.0 / L for unit in scene.mechanism.units])
    return float(np.nanmax(np.abs(rates) * per, initial=0.0))


def energy_balance(scene: Scene, solution: ForwardSolution, bodies: list[Moving]) -> Residual | None:
    """Energy less that of the start and the work done since [J]; None if that work is not known.

    It is measured by the largest of its parts: kinetic, gravity, springs, work.
    """
    work = solution.work
    if not (scene.motors or scene.loads or any(spring.damping for spring in scene.springs)):
        work = np.zeros(len(solution.q))
    if np.isnan(work).all():
        return None
    parts = [kinetic_energy(scene, bodies), _height_energy(scene, bodies), _stored(scene, solution.q, bodies)]
    gained = [part - part[0] for part in parts]
    floor = 1e-6 * scene.mechanism.mass * G0 * length(scene.mechanism)
    scale = max(float(np.nanmax(np.abs(part), initial=0.0)) for part in (parts[0], *gained, work))
    return Residual("energy_balance", "J", ["energy"], (sum(gained) - work)[:, None], max(scale, floor))


def kinetic_energy(scene: Scene, bodies: list[Moving]) -> Array:
    """[J]. Shape (m,)."""
    total = np.zeros(len(bodies[0].p))
    for body, moving in zip(scene.mechanism.bodies, bodies[1:], strict=True):
        velocity = moving.v + np.cross(moving.w, moving.R @ body.com)
        own = np.einsum("nji,nj->ni", moving.R, moving.w)
        total += 0.5 * (body.mass * np.sum(velocity**2, axis=1) + np.sum((own @ body.inertia) * own, axis=1))
    return total


def _height_energy(scene: Scene, bodies: list[Moving]) -> Array:
    total = np.zeros(len(bodies[0].p))
    for body, moving in zip(scene.mechanism.bodies, bodies[1:], strict=True):
        total -= body.mass * ((moving.p + moving.R @ body.com) @ scene.gravity)
    return total


def _stored(scene: Scene, q: Array, bodies: list[Moving]) -> Array:
    total = np.zeros(len(q))
    for spring in scene.springs:
        total += 0.5 * spring.stiffness * _stretch(scene, spring, q, bodies) ** 2
    return total


def _stretch(scene: Scene, spring: Spring, q: Array, bodies: list[Moving]) -> Array:
    if isinstance(spring, JointSpring):
        return np.asarray(q[:, scene.mechanism.coordinates.index(spring.coordinate)] - spring.rest)
    index = scene.mechanism.body_index
    first, second = (bodies[index[name]] for name in (spring.first, spring.second))
    way = second.p + second.R @ spring.second_point - first.p - first.R @ spring.first_point
    return np.asarray(np.linalg.norm(way, axis=1) - spring.rest)
