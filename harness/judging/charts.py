"""Joint coordinates of several engines in one chart: angles that mean the same orientation read the same.

A spherical joint has two triples of angles for each orientation, any angle has its whole turns, and in gimbal lock only
a sum of two angles means anything. Which of them an engine reads depends on how it follows the motion and where it cuts
the loops, not on how the mechanism moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from screwgauge.quantities import QUANTITIES
from screwgauge.reference import linear
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.rotations import Array, cross, nearest_angles, nearest_turn
from screwgauge.solution import Solution, Values

#: Angles that stay farther apart in any reading [rad] mean another orientation, or are no angles: they stay.
NEAR = 0.1

_POSITION = "joint_position"
#: What turns its sign with the middle axis of a triple: rates, and forces along coordinates of a tree.
_ALONG = tuple(name for name in QUANTITIES if QUANTITIES[name].of in ("joint", "tree") and name != _POSITION)


def in_one_chart(mechanism: Mechanism, solutions: Mapping[str, Solution]) -> dict[str, Solution]:
    """The solutions with their joint angles, and the rates and forces along these, as the reference would read them.

    The reference is the first that has all joint positions, the truth before others.

    Args:
        solutions: Name -> solution, in the order asked for.

    Returns:
        The same in the same order. Where an engine's angles were the other triple, its notes say so.
    """
    ordered = sorted(solutions.values(), key=lambda one: not one.radius)
    complete = (one for one in ordered if _POSITION in one.values and _has(one.values[_POSITION], mechanism))
    if (reference := next(complete, None)) is None:
        return {**solutions}
    return {name: one if one is reference else _rewritten(mechanism, reference, one) for name, one in solutions.items()}


def _has(values: Values, mechanism: Mechanism) -> bool:
    return {*mechanism.coordinates} <= {*values.components}


def _rewritten(mechanism: Mechanism, reference: Solution, one: Solution) -> Solution:
    """One solution in the chart of the reference."""
    arrays = {name: one.values[name].array.copy() for name in (_POSITION, *_ALONG) if name in one.values}
    place = {name: {c: k for k, c in enumerate(one.values[name].components)} for name in arrays}
    own, theirs = _coordinates(mechanism, one), reference.values[_POSITION].pick(mechanism.coordinates).array
    notes = list[str]()
    for joint in mechanism.joints:
        names = _angles(joint)
        columns = [mechanism.coordinates.index(name) for name in names]
        read, swapped = _read(joint, own[:, columns], theirs[:, columns])
        near = _near(read, theirs[:, columns])
        read, swapped = np.where(near[:, None], read, own[:, columns]), swapped & near
        for name, angles in zip(names, read.T, strict=True):
            if name in place.get(_POSITION, ()):
                arrays[_POSITION][:, place[_POSITION][name]] = angles
        for rate in _ALONG if swapped.any() else ():
            if names[1] in place.get(rate, ()):
                arrays[rate][swapped, place[rate][names[1]]] *= -1.0
        if swapped.any():
            notes.append(
                f"the angles of {joint.name}, their rates and forces are written as {reference.engine} reads them; it "
                f"has the other triple of the same orientation at {swapped.sum()} of {len(swapped)} samples"
            )
    values = {name: replace(one.values[name], array=array) for name, array in arrays.items()}
    return replace(one, values={**one.values, **values}, notes=(*one.notes, *notes))


def _coordinates(mechanism: Mechanism, one: Solution) -> Array:
    """All joint coordinates as far as a solution has them, NaN elsewhere. Shape (n, n_q)."""
    given = one.values.get(_POSITION)
    if given is None and one.assembly is not None:
        return one.assembly
    some = given or next(iter(one.values.values()))
    found = np.full((len(some.array), len(mechanism.coordinates)), np.nan)
    if given is not None:
        found[:, mechanism.columns(given.components)] = given.array
    return found


def _angles(joint: Joint) -> list[str]:
    """Names of a joint's angles: the last three of a joint of six freedoms."""
    return [name for name, (turns, _) in zip(joint.coordinates, joint.freedoms, strict=True) if turns]


def _read(joint: Joint, angles: Array, near: Array) -> tuple[Array, NDArray[np.bool_]]:
    """A joint's angles as others read them, and where that is the other triple. Shapes (n, m) and (n,)."""
    known = np.isfinite(near)
    read, swapped = nearest_angles(angles, np.where(known, near, angles))
    if angles.shape[1] < 3:
        return read, swapped
    # in gimbal lock first and last axis are one line: only the sum or the difference of their angles means anything
    hand = np.sign(joint.axes[2] @ cross(joint.axes[0], joint.axes[1]))
    locked = (np.abs(np.cos(read[:, 1])) * linear.SINGULAR < 1.0) & known.all(axis=1)
    more = np.where(locked, read[:, 0] - near[:, 0], 0.0)
    last = read[:, 2] + hand * np.sign(np.sin(read[:, 1])) * more
    last = np.where(locked, nearest_turn(last, near[:, 2]), last)
    return np.stack([read[:, 0] - more, read[:, 1], last], axis=1), swapped


def _near(read: Array, near: Array) -> NDArray[np.bool_]:
    """Samples at which angles differ by little. Shape (n, m) -> (n,)."""
    return np.asarray((np.abs(read - near) < NEAR).all(axis=1))
