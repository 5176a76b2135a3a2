"""Planar linkages with bars of given lengths at given angles; a four-bar with its exact accelerations.

Bars lie along the x axes of their bodies, so that they have exactly the requested lengths. A ball joint closes the
four-bar, so that one of three closure equations is redundant and Pinocchio divides by zero if mu = 0. The accelerations
of the four-bar are computed for a planar chain of rods, with formulas that no engine uses.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.generate import write_models
from screwgauge.problem import ModelFiles, Problem, States
from screwgauge.reference.applied import Applied
from screwgauge.reference.rotations import Array
from screwgauge.solution import Values

Tables = dict[str, Any]
Point = tuple[float, float]


def pin(
    parent: str, child: str, at: Point, on: Point, home: float, *, driven: bool = False, slides: bool = False
) -> Tables:
    """Describe a joint between two bars of a planar linkage: a hinge, or a slide along the x axes of both bars.

    Args:
        parent, child: Names of bars, or ``ground``.
        at: Position on the parent, in the parent frame [m].
        on: Position on the child, in the child frame [m].
        home: Coordinate in the home pose [rad or m].
    """
    return {
        "kind": "P" if slides else "R",
        "parent": parent,
        "child": child,
        "axes": [[1, 0, 0] if slides else [0, 0, 1]],
        "home": [home],
        "parent_frame": {"position": [*at, 0.0]},
        "child_frame": {"position": [*on, 0.0]},
        "actuated": driven,
    }


def describe(bars: Mapping[str, float], pins: Mapping[str, Tables], *independent: str) -> Tables:
    """Describe a planar linkage without a name. Masses increase from bar to bar; centres of mass lie off the bars.

    Args:
        bars: Body -> x coordinate of its centre of mass [m].
        pins: Joint -> result of `pin`.
        independent: Names of joints.
    """
    bodies = {
        bar: {
            "mass": 1.0 + 0.5 * i,
            "com": [x, 0.01 - 0.03 * i, 0.0],
            "inertia": {"xx": 0.001, "yy": 0.02, "zz": 0.02},
        }
        for i, (bar, x) in enumerate(bars.items())
    }
    return {"independent": {q: q for q in independent}, "bodies": bodies, "joints": dict(pins)}


def four_bar(crank: float, coupler: float, rocker: float, base: float, angle: float, *, side: float = 1.0) -> Tables:
    """Describe a four-bar by lengths [m], home angle of the crank [rad], and side on which coupler and rocker meet."""
    tip = _polar(crank, angle)
    lean, swing = _triangle(tip, np.array([base, 0.0]), coupler, rocker, side)
    pins = {
        "a": pin("ground", "crank", (0.0, 0.0), (0.0, 0.0), angle, driven=True),
        "b": pin("crank", "coupler", (crank, 0.0), (0.0, 0.0), lean - angle),
        "c": pin("ground", "rocker", (base, 0.0), (0.0, 0.0), swing),
        "d": pin("coupler", "rocker", (coupler, 0.0), (rocker, 0.0), swing - lean),
    }
    return describe({"crank": crank / 2, "coupler": coupler / 2, "rocker": rocker / 2}, pins, "a")


def slider_crank(crank: float, rod: float, angle: float, *, offset: float = 0.0, driven: str = "a") -> Tables:
    """Describe a slider-crank by its lengths and the height of the slide above the crank's axis [m].

    Args:
        driven: Driven joint: ``a`` for the crank, or ``x`` for the slide.
    """
    lean = float(np.arcsin((offset - crank * np.sin(angle)) / rod))
    reach = float(crank * np.cos(angle) + rod * np.cos(lean))
    pins = {
        "a": pin("ground", "crank", (0.0, 0.0), (0.0, 0.0), angle, driven=driven == "a"),
        "b": pin("crank", "rod", (crank, 0.0), (0.0, 0.0), lean - angle),
        "c": pin("rod", "slider", (rod, 0.0), (0.0, 0.0), -lean),
        "x": pin("ground", "slider", (0.0, offset), (0.0, 0.0), reach, driven=driven == "x", slides=True),
    }
    return describe({"crank": crank / 2, "rod": rod / 2, "slider": 0.0}, pins, driven)


def five_bar(
    cranks: tuple[float, float], rods: tuple[float, float], base: float, angles: tuple[float, float], side: float = 1.0
) -> Tables:
    """Describe a five-bar with two driven cranks by its lengths [m] and the home angles of the cranks [rad]."""
    tips = _polar(cranks[0], angles[0]), np.array([base, 0.0]) + _polar(cranks[1], angles[1])
    left, right = _triangle(*tips, *rods, side)
    pins = {
        "a": pin("ground", "left", (0.0, 0.0), (0.0, 0.0), angles[0], driven=True),
        "b": pin("left", "left-rod", (cranks[0], 0.0), (0.0, 0.0), left - angles[0]),
        "c": pin("left-rod", "right-rod", (rods[0], 0.0), (rods[1], 0.0), right - left),
        "d": pin("right", "right-rod", (cranks[1], 0.0), (0.0, 0.0), right - angles[1]),
        "e": pin("ground", "right", (base, 0.0), (0.0, 0.0), angles[1], driven=True),
    }
    centres = zip(("left", "left-rod", "right-rod", "right"), (cranks[0], *rods, cranks[1]), strict=True)
    return describe({bar: length / 2 for bar, length in centres}, pins, "a", "e")


def _polar(length: float, angle: float) -> Array:
    return length * np.array([np.cos(angle), np.sin(angle)])


def _triangle(start: Array, end: Array, first: float, second: float, side: float) -> tuple[float, float]:
    """Return the angles of two bars that connect two points to a common end, left of their line if `side` is 1."""
    way = end - start
    d = float(np.hypot(*way))
    opening = np.arccos((first**2 + d**2 - second**2) / (2.0 * first * d))
    lean = float(np.arctan2(way[1], way[0]) + side * opening)
    meet = start + _polar(first, lean) - end
    return lean, float(np.arctan2(meet[1], meet[0]))


FILE = Path(__file__).with_name("four-bar.toml")
COORDINATES = ("q1", "q2", "q3")
LENGTHS, MASSES = np.array([0.3, 0.6, 0.4]), np.array([0.5, 1.1, 0.7])  # [m], [kg] crank, coupler, rocker
MOMENTS = MASSES * LENGTHS**2 / 12  # moments of inertia about the centres [kg m^2]
BASE, GRAVITY = 0.5, np.array([0.0, -9.81, 0.0])  # length of the base [m]; gravity [m/s^2]
SPEED, TORQUE = 10.0, 3.0  # angular velocity of the crank [rad/s], torque on it [N m]
FIRST, LAST = 0.8, 1.3  # first and last angle of the crank [rad]


def write_four_bar(folder: Path) -> ModelFiles:
    """Write the model files of the four-bar; return the files for Pinocchio."""
    mechanism = load_mechanism(FILE)
    write_models(mechanism, folder, gravity=GRAVITY)
    return ModelFiles(folder / f"{mechanism.name}.urdf", folder / f"{mechanism.name}.loops.toml")


def four_bar_states(n: int) -> tuple[Problem, Values]:
    """Return a problem with n closed states of the four-bar under a crank torque, and its exact accelerations."""
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
    """Return the angles of the rods relative to the base, given the crank angles (n,) [rad]. Shape (n, 3)."""
    p = LENGTHS[0] * np.stack([np.cos(crank), np.sin(crank)], axis=1)
    across = np.array([BASE, 0.0]) - p
    d = np.linalg.norm(across, axis=1)
    turn = np.arccos((LENGTHS[1] ** 2 + d**2 - LENGTHS[2] ** 2) / (2 * LENGTHS[1] * d))
    coupler = np.arctan2(across[:, 1], across[:, 0]) + turn
    rest = across - LENGTHS[1] * np.stack([np.cos(coupler), np.sin(coupler)], axis=1)
    return np.stack([crank, coupler, np.arctan2(rest[:, 1], rest[:, 0])], axis=1)


def _jacobian(angles: Array) -> Array:
    """Return the derivative of the chain's end point with respect to the angles of the rods [m]. Shape (n, 2, 3)."""
    return np.asarray(LENGTHS * np.stack([-np.sin(angles), np.cos(angles)], axis=1))


def _accelerations(angles: Array, spins: Array) -> Array:
    """Return angular accelerations of the rods [rad/s^2], solved for together with the pin force. Shape (n, 3)."""
    # derivative of the centre of rod i with respect to the angle of rod j
    reach = np.tril(np.tile(LENGTHS, (3, 1)), -1) + np.diag(0.5 * LENGTHS)
    coupled, apart = reach.T @ (MASSES[:, None] * reach), angles[:, :, None] - angles[:, None, :]
    J, system = _jacobian(angles), np.zeros((len(angles), 5, 5))
    system[:, :3, :3] = coupled * np.cos(apart) + np.diag(MOMENTS)
    system[:, :3, 3:], system[:, 3:, :3] = J.swapaxes(1, 2), J
    centrifugal = ((coupled * np.sin(apart)) @ (spins**2)[..., None])[..., 0]
    right = np.array([TORQUE, 0.0, 0.0]) - centrifugal + GRAVITY[1] * (MASSES @ reach) * np.cos(angles)
    closing = np.stack([(LENGTHS * spins**2 * f(angles)).sum(axis=1) for f in (np.cos, np.sin)], axis=1)
    return np.linalg.solve(system, np.concatenate([right, closing], axis=1)[..., None])[:, :3, 0]
