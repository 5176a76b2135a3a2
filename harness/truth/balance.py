"""Route 2: every reaction and actuator force from the balance of all bodies, as one system in balls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import arb, arb_mat

from screwgauge.truth.certify import NotCertified, floats, independent_rows
from screwgauge.truth.exact import Vector, cross, normalized, solve, unit_vector
from screwgauge.truth.forces import WORLD, BallLoad, balances, driving, required, unknowns
from screwgauge.truth.kinematics import State, point
from screwgauge.truth.linkage import Linkage


def newton_euler(
    linkage: Linkage, now: State, B: arb_mat, gravity: Vector, loads: Sequence[BallLoad], axial: bool
) -> tuple[list[arb], arb_mat]:
    """All reaction components and the actuator forces.

    Least-norm actuator forces lie in the range of B, ``f = B z``: then z is unknown, and the system is square where
    nothing is overconstrained. The rule ``spherical_axial`` leaves f unknown and adds its own rows. Where redundant
    constraints leave reactions open, one choice that balances is returned.

    Args:
        B: Velocities of the actuators per velocity of the independent coordinates. Shape (n_actuator, k).

    Returns:
        Reaction components, and f of shape (n_actuator, 1).

    Raises:
        NotCertified: The system may be singular.
    """
    parts = unknowns(linkage, now)
    reactions = balances(linkage, now, parts)
    drives = arb_mat(balances(linkage, now, driving(linkage, now)))
    driven = drives if axial else B.transpose() * drives
    columns = [*reactions, *driven.tolist()]
    right = required(linkage, now, gravity, loads)
    if axial:
        for row in _axial_rows(linkage, now, [part.name for part in parts]):
            columns = [[*column, row.get(i, arb(0))] for i, column in enumerate(columns)]
            right = [*right, arb(0)]
    solution = _solve(columns, right, linkage.length)
    forces = arb_mat([[x] for x in solution[len(reactions) :]])
    return solution[: len(reactions)], forces if axial else B * forces


def _solve(columns: Sequence[Sequence[arb]], right: Sequence[arb], length: float) -> list[arb]:
    """Solves for the coefficients of the columns; of dependent ones, those that are left out are zero."""
    chosen = list(range(len(columns)))
    if len(columns) > len(right):
        table = floats(arb_mat(columns)) / np.resize(np.repeat([1.0, length], 3), len(right))
        sizes = np.linalg.norm(table, axis=1, keepdims=True)
        chosen = independent_rows(table / np.where(sizes > 0.0, sizes, 1.0), len(right))
    system = arb_mat([columns[i] for i in chosen]).transpose()
    try:
        x = solve(system, arb_mat([[value] for value in right])).entries()
    except (ZeroDivisionError, ValueError):  # singular, or fewer unknowns than balances
        raise NotCertified("the force system may be singular", "", "keep the motion away from this pose") from None
    solution = [arb(0)] * len(columns)
    for i, value in zip(chosen, x, strict=True):
        solution[i] = value
    return solution


def _axial_rows(linkage: Linkage, now: State, names: Sequence[str]) -> list[dict[int, arb]]:
    """Two directions across the line on which the joint's force must lie (eq. 56): column -> coefficient."""
    axial = linkage.axial
    if axial is None:
        raise NotCertified("the mechanism names no joint for the rule spherical_axial", "", "use min_norm")
    joint, direction = axial
    line = unit_vector(direction)
    k = min(range(3), key=lambda i: abs(float(line[i].mid())))
    first = normalized(cross(line, WORLD[k]))
    child = now.bodies[linkage.mechanism.body_index[linkage.mechanism.joint(joint).child]][0]
    columns = [names.index(f"{joint}.f{axis}") for axis in "xyz"]
    return [dict(zip(columns, point(child, across, 0), strict=True)) for across in (first, cross(line, first))]
