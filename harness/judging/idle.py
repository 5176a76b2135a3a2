"""Undriven (idle) coordinates: residuals that compare their given motion with the motion that forces produce.

The witness solves for the accelerations of these coordinates independently. Integrated over a few steps, these
accelerations must reproduce the change in velocity of the given motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.judging import residuals
from screwgauge.judging.answer import Answer
from screwgauge.judging.residual import Residuals
from screwgauge.problem import GivenMotion, given_columns
from screwgauge.quantities import BODY_MOTION, FORCE, G0, arm
from screwgauge.reference.rotations import Array
from screwgauge.scene.grid import GridMotion
from screwgauge.witness.constraints import AdmissibleMotion, admissible_motion, residual

#: Number of steps examined, and number of points in each step at which accelerations are solved.
STEPS, POINTS = 5, 8
#: Largest step as a fraction of the time in which any joint turns by a radian; eight points then leave only rounding.
SHARE = 0.05
#: Largest number of times that steps are shortened, and the fraction of the accelerations above which their last
#: Legendre term requires shorter steps.
SHORTER, FINE = 12, 1e-10
#: Steps of Newton's method from the pose of a sample.
NEWTON = 6
#: Fraction of the largest force that counts as a term of the work on motions without this force: some units in the last
#: place, divided by the tolerance of residuals.
ROUNDED = 1e-3
_ABOUT = ("joint_acceleration", *BODY_MOTION.values())


def neutral_motions(answer: Answer, admissible: AdmissibleMotion, idle: Sequence[int]) -> Array:
    """Return, for each idle coordinate, a motion of y that moves no actuator. Shape (n, k, m)."""
    B = admissible.partial[:, answer.mechanism.actuated_columns]
    given = given_columns(B.shape[2], idle)
    N = np.zeros((len(B), B.shape[2], len(idle)))
    N[:, [*idle]] = np.eye(len(idle))
    N[:, given] = -np.linalg.pinv(B[..., given], rcond=1e-9) @ B[..., [*idle]]
    return N


def accelerations_from_bodies(answer: Answer, admissible: AdmissibleMotion, idle: Sequence[int]) -> Array:
    """Return the joint accelerations due to idle coordinates, found from the engine's body motions. Shape (n, n_q).

    Args:
        answer: Answer in which idle coordinates have their given accelerations.
    """
    n, m, missing, columns = len(answer.t), len(idle), list[Array](), list[Array]()
    for what, part, size in (("a", slice(0, 3), answer.scales["m"]), ("b", slice(3, 6), 1.0)):
        if answer.has(name := BODY_MOTION[what]):
            missing.append((answer[name] - residuals.body_motion(answer, what).reshape(n, -1)) / size)
            columns.append(admissible.bodies[:, :, part][..., [*idle]].reshape(n, -1, m) / size)
    if not missing:
        return np.zeros_like(answer.q)
    x = np.linalg.pinv(np.concatenate(columns, axis=1)) @ np.concatenate(missing, axis=1)[..., None]
    return np.asarray((admissible.partial[..., [*idle]] @ x)[..., 0])


def least_inertia(answer: Answer, admissible: AdmissibleMotion, idle: Sequence[int]) -> float:
    """Return the smallest inertia of the idle coordinates at any sample [kg m^2]."""
    mechanism, L = answer.mechanism, answer.scales["m"]
    size = np.array([arm(mechanism.units[column], L) for column in mechanism.independent_columns])
    own = np.diagonal(residuals.inertia_of(answer, admissible), axis1=1, axis2=2) * size**2
    return max(float(own[:, [*idle]].min()), float(np.finfo(float).tiny))


def idle_residuals(answer: Answer, given: GivenMotion) -> Residuals:
    """Yield residuals of the engine's accelerations of idle coordinates, and of their given motion.

    Args:
        answer: Answer with all joint coordinates, rates and accelerations.
        given: The motion at the same samples.
    """
    if given.idle:
        if any(answer.has(name) for name in _ABOUT):
            yield from _balance(answer, given.idle)
        if given.drive is not None and not isinstance(given.drive, GridMotion):  # a grid's coordinates are at rest
            yield from _motion(answer, given, given.drive)


def _balance(answer: Answer, idle: Sequence[int]) -> Residuals:
    """Yield the work of the required wrenches on motions that move no actuator; this work must vanish."""
    missing, terms = _work(answer, admissible_motion(answer.motion), idle)
    mechanism = answer.mechanism
    labels, columns = [*mechanism.independent], mechanism.independent_columns
    units = [mechanism.units[columns[k]] for k in idle]
    for unit in dict.fromkeys(units):
        some = [j for j, has in enumerate(units) if has == unit]
        names = [labels[idle[j]] for j in some]
        yield answer.residual("idle_balance", FORCE[unit], names, missing[:, some], float(terms[some].max()), _ABOUT)


def _work(answer: Answer, admissible: AdmissibleMotion, idle: Sequence[int]) -> tuple[Array, Array]:
    """Return the work of required wrenches on motions that move no actuator, (n, m), and the largest terms, (m,).

    The terms include a fraction of the largest force, because rounding errors in these motions do work against the
    whole weight, even if only the bearings carry this weight, as for a spinning rod.
    """
    required, sizes = residuals.required_wrenches(answer)
    load = residuals.level_sizes(sizes, answer.scales["m"])[:, 1].max(initial=0.0)
    bodies = admissible.bodies @ neutral_motions(answer, admissible, idle)[:, None]
    terms = np.einsum("bx,nbxj->nj", np.repeat(sizes, 3, axis=1), np.abs(bodies))
    columns = [answer.mechanism.independent_columns[k] for k in idle]
    arms = np.array([arm(answer.mechanism.units[column], answer.scales["m"]) for column in columns])
    return np.einsum("nbx,nbxj->nj", required, bodies), np.maximum(terms.max(axis=0), ROUNDED * load / arms)


def _motion(answer: Answer, given: GivenMotion, drive: Callable[[Array], GivenMotion]) -> Residuals:
    """Yield the change in the rates of idle coordinates over a step minus the integral of their accelerations."""
    rows = np.unique(np.linspace(0, len(given) - 1, STEPS).astype(int))
    h = _steps(answer, given)[rows]
    x, weights = np.polynomial.legendre.leggauss(POINTS)
    last = weights * (POINTS - 0.5) * np.polynomial.legendre.legvander(x, POINTS - 1)[:, -1]
    for _ in range(SHORTER):
        inside = replace(drive((given.t[rows] + 0.5 * h * (1.0 + x[:, None])).ravel()), idle=given.idle)
        a, push = _accelerations(_answer_at(answer, inside, np.tile(rows, POINTS)), inside)
        a = a.reshape(POINTS, len(rows), -1)
        if (np.abs(np.einsum("p,prm->rm", last, a)) <= FINE * np.maximum(np.abs(a).max(axis=(0, 1)), push)).all():
            break
        h = 0.25 * h  # accelerations vary faster than the rates suggest
    gained = 0.5 * h[:, None] * np.einsum("p,prm->rm", weights, a)
    missing = (drive(given.t[rows] + h).yd - given.yd[rows])[:, [*given.idle]] - gained
    mechanism, some = answer.mechanism, replace(answer, t=given.t[rows])
    labels, units = [*mechanism.independent], [mechanism.units[column] for column in mechanism.independent_columns]
    for unit in dict.fromkeys(units[k] for k in given.idle):
        part = [j for j, k in enumerate(given.idle) if units[k] == unit]
        size = max(answer.fastest(1, f"{unit}/s"), float(np.abs(h).max() * push[part].max()))
        names = [labels[given.idle[j]] for j in part]
        yield some.residual("idle_motion", f"{unit}/s", names, missing[:, part], size, ())


def _steps(answer: Answer, given: GivenMotion) -> Array:
    """Return the step from each sample [s], at most to the next sample; negative at the last sample. Shape (n,)."""
    fall = (G0 / answer.scales["m"]) ** 0.5
    speed = max(fall, answer.fastest(1, "rad/s"), answer.fastest(2, "rad/s^2") ** 0.5)
    h = np.full(len(given), SHARE / speed)
    if len(given) > 1:
        gaps = np.diff(given.t)
        h = np.minimum(h, np.append(gaps, gaps[-1]))
        h[-1] *= -1.0
    return h


def _answer_at(answer: Answer, given: GivenMotion, rows: Array) -> Answer:
    """Build the answer at other states of a motion; close the loops from the poses at samples `rows`, shape (n,)."""
    mechanism = answer.mechanism
    joints = np.zeros((3, len(rows), len(mechanism.coordinates)))
    joints[0] = answer.q[rows]
    other = replace(answer, t=given.t, values={}).with_joints(joints)
    for _ in range(NEWTON):
        gaps = residual(other.motion)
        missing = given.y - other.q[:, mechanism.independent_columns]
        joints[0] += admissible_motion(other.motion).joints(missing, gaps)
        other = other.with_joints(joints)
    admissible = admissible_motion(other.motion)
    joints[1] = admissible.joints(given.yd)
    other = other.with_joints(joints)
    still = given.ydd * ~np.isin(np.arange(given.ydd.shape[1]), given.idle)
    joints[2] = admissible.joints(still, residual(other.motion, 2))
    return other.with_joints(joints)


def _accelerations(answer: Answer, given: GivenMotion) -> tuple[Array, Array]:
    """Solve for accelerations of idle coordinates, shape (n, m); also return their largest terms, shape (m,)."""
    idle, admissible = [*given.idle], admissible_motion(answer.motion)
    missing, terms = _work(answer, admissible, idle)
    M = residuals.inertia_of(answer, admissible)[..., idle]
    own = np.diagonal(M[:, idle], axis1=1, axis2=2).min(axis=0)
    back = neutral_motions(answer, admissible, idle).swapaxes(1, 2)
    x = -np.linalg.solve(back @ M, missing[..., None])[..., 0]
    return np.asarray(x, dtype=float), np.asarray(terms / np.maximum(own, np.finfo(float).tiny))
