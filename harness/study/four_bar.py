"""A planar four-bar closed by a ball: one of its three closing rows is redundant, so that mu = 0 divides by zero.

Its exact accelerations are those of a chain of rods in a plane, from formulas that no engine has.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.generate import write_models
from screwgauge.problem import ModelFiles, Problem, States
from screwgauge.reference.applied import Applied
from screwgauge.reference.rotations import Array
from screwgauge.solution import Values

FILE = Path(__file__).with_name("four-bar.toml")
COORDINATES = ("q1", "q2", "q3")
LENGTHS, MASSES = np.array([0.3, 0.6, 0.4]), np.array([0.5, 1.1, 0.7])  # [m], [kg] crank, coupler, rocker
MOMENTS = MASSES * LENGTHS**2 / 12  # [kg m^2] about their centres
BASE, GRAVITY = 0.5, np.array([0.0, -9.81, 0.0])  # [m], [m/s^2]
SPEED, TORQUE = 10.0, 3.0  # [rad/s], [N m] at the crank
FIRST, LAST = 0.8, 1.3  # angles of the crank [rad]


def write_four_bar(folder: Path) -> ModelFiles:
    """Writes its model files; returns those of Pinocchio."""
    mechanism = load_mechanism(FILE)
    write_models(mechanism, folder, gravity=GRAVITY)
    return ModelFiles(folder / f"{mechanism.name}.urdf", folder / f"{mechanism.name}.loops.toml")


def four_bar_states(n: int) -> tuple[Problem, Values]:
    """The question for accelerations at closed states under a torque at the crank, and the exact ones. n samples."""
    angles = _angles(np.linspace(FIRST, LAST, n))
    J = _jacobian(angles)
    rest = np.linalg.solve(J[..., 1:], -SPEED * J[..., 0, None])[..., 0]
    spins = np.concatenate([np.full((n, 1), SPEED), rest], axis=1)
    q, v, a = (np.diff(x, axis=1, prepend=0.0) for x in (angles, spins, _accelerations(angles, spins)))
    states = States(COORDINATES, q, v, tau=np.tile([TORQUE, 0.0, 0.0], (n, 1)))
    return Problem(Applied(gravity=GRAVITY), states, frozenset(("joint_acceleration",))), Values(
        COORDINATES, ("rad/s^2",) * 3, a
    )


def _angles(crank: Array) -> Array:
    """Angles of the rods against the base for those of the crank, (n,) [rad]. Shape (n, 3)."""
    p = LENGTHS[0] * np.stack([np.cos(crank), np.sin(crank)], axis=1)
    across = np.array([BASE, 0.0]) - p
    d = np.linalg.norm(across, axis=1)
    turn = np.arccos((LENGTHS[1] ** 2 + d**2 - LENGTHS[2] ** 2) / (2 * LENGTHS[1] * d))
    coupler = np.arctan2(across[:, 1], across[:, 0]) + turn
    rest = across - LENGTHS[1] * np.stack([np.cos(coupler), np.sin(coupler)], axis=1)
    return np.stack([crank, coupler, np.arctan2(rest[:, 1], rest[:, 0])], axis=1)


def _jacobian(angles: Array) -> Array:
    """Derivative of the end point by the angles of the rods [m]. Shape (n, 2, 3)."""
    return np.asarray(LENGTHS * np.stack([-np.sin(angles), np.cos(angles)], axis=1))


def _accelerations(angles: Array, spins: Array) -> Array:
    """Angular accelerations of the rods, the pin's force being the other unknown [rad/s^2]. Shape (n, 3)."""
    # how far the centre of rod i moves with the angle of rod j
    reach = np.tril(np.tile(LENGTHS, (3, 1)), -1) + np.diag(0.5 * LENGTHS)
    coupled, apart = reach.T @ (MASSES[:, None] * reach), angles[:, :, None] - angles[:, None, :]
    J, system = _jacobian(angles), np.zeros((len(angles), 5, 5))
    system[:, :3, :3] = coupled * np.cos(apart) + np.diag(MOMENTS)
    system[:, :3, 3:], system[:, 3:, :3] = J.swapaxes(1, 2), J
    centrifugal = ((coupled * np.sin(apart)) @ (spins**2)[..., None])[..., 0]
    right = np.array([TORQUE, 0.0, 0.0]) - centrifugal + GRAVITY[1] * (MASSES @ reach) * np.cos(angles)
    closing = np.stack([(LENGTHS * spins**2 * f(angles)).sum(axis=1) for f in (np.cos, np.sin)], axis=1)
    return np.linalg.solve(system, np.concatenate([right, closing], axis=1)[..., None])[:, :3, 0]
