"""A planar four-bar closed by a 3D point: one of its three closure rows is redundant, and mu = 0 divides by zero."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.reference.rotations import Array
from screwgauge.solution import Values
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestant import Contestant, Outcome, Task, count

LENGTHS = np.array([0.3, 0.6, 0.4])  # [m] crank, coupler, rocker
MASSES = (0.5, 1.1, 0.7)  # [kg] uniform rods
BASE = 0.5  # [m]
SPEED, TORQUE = 10.0, 3.0  # [rad/s], [N m] at the crank
_NAME = "joint_acceleration"


def contestants(quick: bool) -> list[Contestant]:
    """The default settings, and the smallest that cure them."""
    settings = [(0.0, 1, "default: mu = 0, 1 iteration"), (1e-10, 1, ""), (1e-10, 2, "")]
    return [_contestant(mu, k, text or f"mu = {mu:g}, {count(k, 'iteration')}") for mu, k, text in settings]


def _contestant(mu: float, iterations: int, text: str) -> Contestant:
    def prepare(case: Case) -> Task:
        n = len(case.times)
        q, v = states(n)
        model, data, models, datas = make_model()
        settings = pin.ProximalSettings(0.0, 0.0, mu, iterations) if mu else pin.ProximalSettings()
        tau = np.array([TORQUE, 0.0, 0.0])
        names = ("q1", "q2", "q3")
        reference = Values(names, ("rad/s^2",) * 3, accelerations(model, data, q, v))
        scales = {"rad/s^2": float(np.abs(reference.array).max())}

        def call() -> Array:
            return np.array(
                [pin.constraintDynamics(model, data, q[i], v[i], tau, models, datas, settings) for i in range(n)]
            )

        def read(array: Array) -> dict[str, Outcome]:
            return {_NAME: Outcome(Values(names, reference.units, array), reference, scales)}

        hint = "the closure rows have rank 2 of 3, so that mu = 0 divides by zero; nothing is raised"
        return Task(call, read, n, hint)

    covers = "from given q, v and torque: pin.constraintDynamics sample by sample, on a planar four-bar"
    return Contestant(f"planar four-bar closed by a 3D contact, {text}", (_NAME,), covers, prepare, drawn=False)


def make_model() -> tuple[Any, Any, Any, Any]:
    model, joint, at = pin.Model(), 0, pin.SE3.Identity()
    for k, (length, mass) in enumerate(zip(LENGTHS, MASSES, strict=True)):
        joint = model.addJoint(joint, pin.JointModelRZ(), at, f"q{k + 1}")
        moment = mass * length**2 / 12
        inertia = pin.Inertia(mass, np.array([length / 2, 0.0, 0.0]), np.diag([1e-4, moment, moment]))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        at = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
    model.gravity.linear[:] = [0.0, -9.81, 0.0]
    pivot = pin.SE3(np.eye(3), np.array([BASE, 0.0, 0.0]))
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    models.append(
        pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, 3, at, 0, pivot, pin.ReferenceFrame.LOCAL)
    )
    datas.append(models[0].createData())
    data = model.createData()
    pin.initConstraintDynamics(model, data, models, datas)
    return model, data, models, datas


def states(n: int) -> tuple[Array, Array]:
    """Closed poses and rates, the crank over half a radian. Shape (n, 3) each."""
    crank = np.linspace(0.8, 1.3, n)
    p = LENGTHS[0] * np.stack([np.cos(crank), np.sin(crank)], axis=1)
    across = np.array([BASE, 0.0]) - p
    d = np.linalg.norm(across, axis=1)
    turn = np.arccos((LENGTHS[1] ** 2 + d**2 - LENGTHS[2] ** 2) / (2 * LENGTHS[1] * d))
    coupler = np.arctan2(across[:, 1], across[:, 0]) + turn
    end = p + LENGTHS[1] * np.stack([np.cos(coupler), np.sin(coupler)], axis=1)
    rest = np.array([BASE, 0.0]) - end
    rocker = np.arctan2(rest[:, 1], rest[:, 0])
    absolute = np.stack([crank, coupler, rocker], axis=1)
    q = np.diff(absolute, axis=1, prepend=0.0)
    return q, SPEED * _partial(_jacobian(q))


def _jacobian(q: Array) -> Array:
    """Derivative of the end point in the plane. Shape (n, 2, 3)."""
    angle = np.cumsum(q, axis=1)
    arms = LENGTHS * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    return np.asarray(np.cumsum(arms[..., ::-1], axis=2)[..., ::-1])


def _partial(J: Array) -> Array:
    """Rates per rate of the crank. Shape (n, 3)."""
    rest = np.linalg.solve(J[..., 1:], -J[..., :1])[..., 0]
    return np.concatenate([np.ones((len(J), 1)), rest], axis=1)


def accelerations(model: Any, data: Any, q: Array, v: Array) -> Array:
    """Exact joint accelerations: the equation of motion projected on the one freedom in the plane."""
    J, out = _jacobian(q), np.empty_like(q)
    N = _partial(J)
    angle, spin = np.cumsum(q, axis=1), np.cumsum(v, axis=1)
    drift = -np.stack([(LENGTHS * spin**2 * f(angle)).sum(axis=1) for f in (np.cos, np.sin)], axis=1)
    still = np.zeros_like(q)
    still[:, 1:] = np.linalg.solve(J[..., 1:], -drift[..., None])[..., 0]
    for i in range(len(q)):
        upper = np.triu(pin.crba(model, data, q[i]))
        M = upper + np.triu(upper, 1).T
        need = np.array([TORQUE, 0.0, 0.0]) - pin.nle(model, data, q[i], v[i]) - M @ still[i]
        out[i] = still[i] + N[i] * (N[i] @ need) / (N[i] @ M @ N[i])
    return out
