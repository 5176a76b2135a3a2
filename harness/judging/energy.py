"""Whether the energy of a motion balances: kinetic, of gravity, of springs, and the work put in."""

from __future__ import annotations

import numpy as np

from screwgauge.judging.answer import FLOOR, Answer
from screwgauge.judging.residual import Residual, largest
from screwgauge.reference.applied import JointSpring, Spring
from screwgauge.reference.rotations import Array


def energy_balance(answer: Answer, tolerance: float | None = None) -> Residual | None:
    """Energy gained since the first sample less the work done since [J]; None if that work is not known.

    It is measured by the largest of its parts: kinetic, gravity, springs, work.
    """
    applied, work = answer.applied, answer.work
    if not (applied.motors or applied.loads or any(spring.damping for spring in applied.springs)):
        work = np.zeros(len(answer.t))
    if work is None or np.isnan(work).all():
        return None
    work = work - work[0]  # an answer may begin after the start
    kinetic = kinetic_energy(answer)
    gained = [part - part[0] for part in (kinetic, _height_energy(answer), _spring_energy(answer))]
    scale = max(largest(kinetic, *gained, work), FLOOR * answer.scales["N m"])
    return Residual("energy_balance", "J", ["energy"], answer.t, (sum(gained) - work)[:, None], scale, tolerance)


def kinetic_energy(answer: Answer) -> Array:
    """[J]. Shape (n,)."""
    total = np.zeros(len(answer.t))
    for body, com in zip(answer.mechanism.bodies, answer.motions.com, strict=True):
        w = np.einsum("nji,nj->ni", com.R, com.w)  # in body axes
        total += 0.5 * (body.mass * np.sum(com.v**2, axis=1) + np.sum((w @ body.inertia) * w, axis=1))
    return total


def _height_energy(answer: Answer) -> Array:
    total = np.zeros(len(answer.t))
    for body, com in zip(answer.mechanism.bodies, answer.motions.com, strict=True):
        total -= body.mass * (com.p @ answer.applied.g)
    return total


def _spring_energy(answer: Answer) -> Array:
    total = np.zeros(len(answer.t))
    for spring in answer.applied.springs:
        total += 0.5 * spring.stiffness * _stretch(answer, spring) ** 2
    return total


def _stretch(answer: Answer, spring: Spring) -> Array:
    mechanism = answer.mechanism
    if isinstance(spring, JointSpring):
        return answer.array("joint_position")[:, mechanism.coordinates.index(spring.coordinate)] - spring.rest
    first, second = (answer.motions.bodies[mechanism.body_index[name]] for name in (spring.first, spring.second))
    way = second.p + second.R @ spring.second_point - first.p - first.R @ spring.first_point
    return np.asarray(np.linalg.norm(way, axis=1) - spring.rest)
