"""Assembly modes of the engines' solutions, and conversion of joint angles between charts.

Two engines in different assembly modes solve different problems, which is reported in a single message rather than as a
difference in forces. A spherical joint has two triples of angles for each orientation, angles may differ by full turns,
and in gimbal lock only the sum or difference of two angles is meaningful. An engine's choice depends on how it follows
the motion and where it cuts the loops, not on how the mechanism moves. Angles of the same orientation are therefore
converted to the same values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from screwgauge.problem import GivenMotion, InitialValue, Problem, States
from screwgauge.quantities import QUANTITIES
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import AssemblyMode
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.equations.kinematics import gaps
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.rotations import Array, cross, nearest_angles, nearest_turn, rotation, within_half_turn
from screwgauge.solution import Solution, Values, common_rows, reference_first

#: Difference above which two positions of a joint are distinct [rad or mechanism lengths]. It is far above rounding,
#: which leaves 1e-4 rad at 1e-12 rad from a singular pose, and far below the distance between assembly modes.
APART = 1e-3
#: Loop residual above which the geometry differs from the description [rad or mechanism lengths].
CLOSED = 1e-8


def joint_places(joint: Joint, q: Array, length: float) -> Array:
    """Return a joint's relative placement, independent of angle charts: rotation, then displacement divided by a
    length.

    Args:
        q: Coordinates of the joint. Shape (n, m).

    Returns:
        Shape (n, 12).
    """
    R, p = np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3))
    for (turns, axis), values in zip(joint.freedoms, q.T, strict=True):
        if turns:
            R = R @ rotation(axis, values)
        else:
            p = p + R @ axis * values[:, None] / length
    return np.concatenate([R.reshape(-1, 9), p], axis=1)


def assembly_of(mechanism: Mechanism, solution: Solution) -> Array | None:
    """Return joint coordinates that identify the assembly mode, with NaN at unsolved samples; None if unknown."""
    if solution.assembly is not None:
        return solution.assembly
    given = solution.values.get("joint_position")
    if given is None or given.components not in (mechanism.coordinates, mechanism.moving):
        return None
    q = np.zeros((len(given.array), len(mechanism.coordinates)))  # coordinates of fixed joints may be missing
    q[:, mechanism.columns(given.components)] = given.array
    return q


def other_assemblies(
    mechanism: Mechanism, problem: Problem, solutions: Iterable[Solution]
) -> Mapping[frozenset[str], str]:
    """Return a message for each pair of engines in different assembly modes, or with an engine not in the home mode.

    Joint positions that do not close the description's loops are ignored, because they belong to a different geometry.
    """
    if isinstance(problem.task, States):
        return {}
    known = [(one, q) for one in solutions if (q := assembly_of(mechanism, one)) is not None]
    apart = _away_from_home(mechanism, problem.task, known)
    for (a, q_a), (b, q_b) in combinations(known, 2):
        rows = common_rows(len(problem.task), a, b)
        if isinstance(problem.task, InitialValue):  # compare only where both simulations reach the same coordinates
            columns = mechanism.independent_columns
            rows = rows[(np.abs(q_a[rows] - q_b[rows])[:, columns] < APART).all(axis=1)]
        if when := _describe_difference(mechanism, problem.task.t[rows], (q_a[rows], q_b[rows])):
            apart[frozenset((a.engine, b.engine))] = (
                f"{b.engine} is in a different assembly mode from {a.engine} {when}"
            )
    return apart


def _away_from_home(
    mechanism: Mechanism, task: GivenMotion | InitialValue, known: Sequence[tuple[Solution, Array]]
) -> dict[frozenset[str], str]:
    """Return a message for each pair with an engine that is not in the home assembly mode in a given motion.

    The engine `screw` follows that mode, so nothing is checked if it took part. Simulations are not checked, because
    they may leave the mode: where the independent coordinates do not determine the motion, inertia determines it.
    """
    if isinstance(task, InitialValue) or any(one.engine == "screw" for one, _ in known):
        return {}
    mode, sentences = AssemblyMode(layout(mechanism), strict=True), dict[frozenset[str], str]()
    try:
        home = mode.motion(task.y, task.t, (task.yd, task.ydd), task.drive)
    except ScrewgaugeError:  # preflight reports this error
        return {}
    for one, q in known:
        rows = np.arange(len(task)) if one.rows is None else one.rows
        if when := _describe_difference(mechanism, task.t[rows], (home[rows], q[rows])):
            sentence = f"{one.engine} is not in the home assembly mode {when}"
            sentences |= {frozenset((one.engine, other.engine)): sentence for other, _ in known if other is not one}
    return sentences


def _describe_difference(mechanism: Mechanism, t: Array, pair: tuple[Array, Array]) -> str:
    """Describe when and where the joint placements of two engines differ; empty if they agree."""
    lay = layout(mechanism)
    length, turns = loop_equations(lay).length, lay.turns
    difference = np.where(turns, within_half_turn(pair[1] - pair[0]), (pair[1] - pair[0]) / length)
    rows = np.flatnonzero((np.abs(difference) > APART).any(axis=1))
    if not rows.size:
        return ""
    q_a, q_b = (q[rows] for q in pair)
    far = {
        joint.name: np.abs(
            joint_places(joint, q_b[:, columns], length) - joint_places(joint, q_a[:, columns], length)
        ).max(axis=1)
        for joint in mechanism.joints
        for columns in [lay.columns[joint.name]]
    }
    open_by = np.concatenate([gaps(lay, q).reshape(len(q), -1, 2, 3) for q in (q_a, q_b)], axis=1)
    closed = (np.abs(open_by) / np.array([1.0, length])[:, None] < CLOSED).all(axis=(1, 2, 3))
    held = closed & (np.max(list(far.values()), axis=0) > APART)
    if not held.any():
        return ""
    first = int(np.flatnonzero(held)[0])
    name = next(name for name, by in far.items() if by[first] > APART)
    c = max(lay.columns[name], key=lambda column: abs(float(difference[rows[first], column])))
    coordinate = mechanism.coordinates[c].rpartition(".")[2]
    start = f"t = {t[rows[first]]:.6g} s"
    lasts = held.sum() == len(t) - rows[first]
    when = f"from {start} on" if lasts else f"at {held.sum()} of {len(t)} samples, first at {start}"
    return f"{when}: {name} ({coordinate} {q_b[first, c]:.4g} against {q_a[first, c]:.4g})"


#: Difference above which angles [rad] are not converted, because they belong to different orientations or are not
#: angles.
NEAR = 0.1

_POSITION = "joint_position"
#: Quantities that change sign with the middle axis of a triple: rates, and forces along coordinates.
_ALONG = tuple(name for name in QUANTITIES if QUANTITIES[name].of in ("joint", "tree", "axis") and name != _POSITION)


def in_one_chart(mechanism: Mechanism, solutions: Mapping[str, Solution]) -> dict[str, Solution]:
    """Convert joint angles, and the corresponding rates and forces, to the reference's chart.

    The reference is the truth if it has all joint positions, or else the first solution that has them.

    Args:
        solutions: Name -> solution, in the order of the run.

    Returns:
        The converted solutions in the same order, with a note on each solution whose angles were converted from the
        equivalent triple.
    """
    ordered = reference_first(solutions.values())
    complete = (one for one in ordered if _POSITION in one.values and _has(one.values[_POSITION], mechanism))
    if (reference := next(complete, None)) is None:
        return {**solutions}
    return {name: one if one is reference else _convert(mechanism, reference, one) for name, one in solutions.items()}


def _has(values: Values, mechanism: Mechanism) -> bool:
    return {*mechanism.moving} <= {*values.components}


def _convert(mechanism: Mechanism, reference: Solution, one: Solution) -> Solution:
    """Convert a solution to the reference's chart."""
    arrays = {name: one.values[name].array.copy() for name in (_POSITION, *_ALONG) if name in one.values}
    place = {name: {c: k for k, c in enumerate(one.values[name].components)} for name in arrays}
    own, theirs = _coordinates(mechanism, one), _coordinates(mechanism, reference)
    notes = list[str]()
    for joint in mechanism.joints:
        names = _angles(joint)
        columns = [mechanism.coordinates.index(name) for name in names]
        read, swapped = _read_angles(joint, own[:, columns], theirs[:, columns])
        near = _nearly_equal(read, theirs[:, columns])
        read, swapped = np.where(near[:, None], read, own[:, columns]), swapped & near
        for name, angles in zip(names, read.T, strict=True):
            if name in place.get(_POSITION, ()):
                arrays[_POSITION][:, place[_POSITION][name]] = angles
        for rate in _ALONG if swapped.any() else ():
            if names[1] in place.get(rate, ()):
                arrays[rate][swapped, place[rate][names[1]]] *= -1.0
        if swapped.any():
            notes.append(
                f"the angles of {joint.name}, with their rates and forces, were converted to the triple of "
                f"{reference.engine} at {swapped.sum()} of {len(swapped)} samples"
            )
    values = {name: replace(one.values[name], array=array) for name, array in arrays.items()}
    return replace(one, values={**one.values, **values}, notes=(*one.notes, *notes))


def _coordinates(mechanism: Mechanism, one: Solution) -> Array:
    """Return the known joint coordinates of a solution, with NaN elsewhere. Shape (n, n_q)."""
    given = one.values.get(_POSITION)
    if given is None and one.assembly is not None:
        return one.assembly
    some = given or next(iter(one.values.values()))
    coordinates = np.full((len(some.array), len(mechanism.coordinates)), np.nan)
    if given is not None:
        coordinates[:, mechanism.columns(given.components)] = given.array
    return coordinates


def _angles(joint: Joint) -> list[str]:
    """Return the names of a joint's angular coordinates."""
    return [name for name, (turns, _) in zip(joint.coordinates, joint.freedoms, strict=True) if turns]


def _read_angles(joint: Joint, angles: Array, near: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Convert a joint's angles to the chart of `near`, and flag samples with swapped triples. Shapes (n, m), (n,)."""
    known = np.isfinite(near)
    read, swapped = nearest_angles(angles, np.where(known, near, angles))
    if angles.shape[1] < 3:
        return read, swapped
    # in gimbal lock the first and last axes coincide: only the sum or difference of their angles is meaningful
    hand = np.sign(joint.axes[2] @ cross(joint.axes[0], joint.axes[1]))
    locked = (np.abs(np.cos(read[:, 1])) * linear.SINGULAR < 1.0) & known.all(axis=1)
    more = np.where(locked, read[:, 0] - near[:, 0], 0.0)
    last = read[:, 2] + hand * np.sign(np.sin(read[:, 1])) * more
    last = np.where(locked, nearest_turn(last, near[:, 2]), last)
    return np.stack([read[:, 0] - more, read[:, 1], last], axis=1), swapped


def _nearly_equal(read: Array, near: Array) -> NDArray[np.bool_]:
    """Flag samples at which angles nearly agree. Shape (n, m) -> (n,)."""
    return np.asarray((np.abs(read - near) < NEAR).all(axis=1))
