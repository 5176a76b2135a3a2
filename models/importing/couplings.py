"""Chooses the dependent joint of each coupling; avoids driven joints, repeated joints and cycles."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.models.importing.joints import few_names
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.couplings import PolynomialSum, find_cycle
from screwgauge.reference.rotations import Array

Couplings = Mapping[str, CouplingReading]
#: Costs of making a joint dependent that differs from the file's choice, drives the machine, or cannot be dependent.
_OTHER, _LEADS, _CANNOT = 1.0, 1e3, 1e9
#: Coefficients below this share of the largest coefficient are rounding errors of zero.
_NOTHING = 1e-12


def solve_couplings(couplings: Couplings, leading: Collection[str]) -> tuple[Couplings, list[str]]:
    """Solve couplings for a different joint if the file's choice is driven or cannot be dependent; report changes.

    Args:
        leading: Joints that should not depend on other joints: driven and independent joints.
    """
    if not couplings:
        return couplings, []
    new = _solve_each(couplings, leading)
    if new is None or any(find_cycle(one.joint, _leads(new)) for one in new.values()):
        new = _solve_linear(couplings, leading)
    other = [one.joint for name, one in new.items() if one.joint != couplings[name].joint]
    solved = f"Couplings are solved for {few_names(other)}, and for driven or independent joints only if necessary."
    sentences = [solved] if other else []
    if gone := [name for name in couplings if name not in new]:
        sentences.append(f"Redundant couplings are left out: {few_names(gone)}.")
    return new, sentences


def _leads(couplings: Couplings) -> dict[str, Collection[str]]:
    return {one.joint: one.function.terms for one in couplings.values()}


def _solve_each(couplings: Couplings, leading: Collection[str]) -> Couplings | None:
    """Solve each coupling for a separate joint; return None if this is impossible."""
    from scipy.optimize import linear_sum_assignment

    joints = list(dict.fromkeys(joint for one in couplings.values() for joint in one.named))
    cost = np.full((len(couplings), len(joints)), _CANNOT)
    for row, one in zip(cost, couplings.values(), strict=True):
        for joint in one.named:
            if joint == one.joint or one.function.is_linear_in(joint):
                row[joints.index(joint)] = _OTHER * (joint != one.joint) + _LEADS * (joint in leading)
    if len(joints) < len(couplings):
        return None
    rows, columns = linear_sum_assignment(cost)
    if cost[rows, columns].max() >= _CANNOT:
        return None
    follow = [joints[column] for column in columns.tolist()]
    return {name: one.solve_for(joint) for (name, one), joint in zip(couplings.items(), follow, strict=True)}


def _solve_linear(couplings: Couplings, leading: Collection[str]) -> Couplings:
    """Solve linear couplings so that dependent joints depend only on independent joints; drop redundant couplings."""
    linear = [name for name, one in couplings.items() if one.function.linear]
    kept = {one.joint for one in couplings.values() if not one.function.linear}
    joints = list(dict.fromkeys(joint for name in linear for joint in couplings[name].named))
    system = np.zeros((len(linear), len(joints) + 1))  # rows of joint = function, with constants in the last column
    for row, name in zip(system, linear, strict=True):
        one = couplings[name]
        for joint, share in {one.joint: -1.0, **one.function.slopes}.items():
            row[joints.index(joint)] = share
        row[-1] = one.function.constant
    pivots = _reduce(system, [[joint not in kept, joint not in leading] for joint in joints])
    new = dict(couplings)
    for name, row, pivot in zip(linear, system, pivots, strict=True):
        if pivot < 0:
            del new[name]
            continue
        terms = {joint: np.array([-row[k]]) for k, joint in enumerate(joints) if row[k] and k != pivot}
        new[name] = replace(couplings[name], joint=joints[pivot], function=PolynomialSum(float(-row[-1]), terms))
    return new


def _reduce(system: Array, ranks: Sequence[Sequence[bool]]) -> list[int]:
    """Reduce rows to echelon form in place; the pivot of a row is its largest entry in a column of the highest rank.

    Args:
        system: Equations; the last column has the constants. Shape (m, n + 1).
        ranks: Rank of each column except the last.

    Returns:
        Pivot column of each row; -1 for a row that vanishes.
    """
    pivots = []
    sizes = np.abs(system[:, :-1]).max(axis=1)
    for i, row in enumerate(system):
        row[np.abs(row) < _NOTHING * sizes[i]] = 0.0
        places = np.flatnonzero(row[:-1]).tolist()
        pivots.append(max(places, key=lambda k: (*ranks[k], abs(row[k])), default=-1))
        if places:
            row /= row[pivots[-1]]
            others = [j for j in range(len(system)) if j != i]
            system[others] -= np.outer(system[others, pivots[-1]], row)
            system[others, pivots[-1]] = 0.0
    shares = system[:, :-1]
    shares[np.abs(shares) < _NOTHING * np.abs(shares).max(axis=1, keepdims=True)] = 0.0
    return pivots
