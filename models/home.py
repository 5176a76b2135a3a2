"""Checks that the loops of a description close at its home pose; solves for a home pose if they do not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from screwgauge.models.check import expected_reading, with_limits
from screwgauge.models.importing.homes import Home, Loops, few_of, measure, starts
from screwgauge.models.kinematics import tree_of
from screwgauge.models.straight import why_singular
from screwgauge.reference.applied import GRAVITY
from screwgauge.reference.closed.anchors import Flags
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.equations.kinematics import gaps, length
from screwgauge.reference.errors import ClosureError, DescriptionError, SingularPoseError, first_few
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.linear import EPS
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import check_independent
from screwgauge.reference.rotations import Array, nearest_turn
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import TreeStates

#: Largest gap of a closed loop [rad or mechanism lengths]: home poses are given in closed form or to ten digits.
CLOSED = 1e-9
#: Number of starts after which the search stops if a good pose is found, and bound on starts times coordinates: all
#: starts except the first serve to find further poses that close the loops.
FEW, WORK = 12, 240
#: Smallest singular value of the loop equations at a good pose; at a pose found next to a singular pose, the singular
#: value is about the square root of `CLOSED`.
CLEAR = 1e-4
#: Poses of bodies that differ by less count as equal [rad or lengths].
SAME = 1e-6
#: Number of further closing poses that a remark names.
NAMED = 3


def check_home(mechanism: Mechanism) -> Layout:
    """Reject a mechanism whose loops are open at the home pose, or whose independent coordinates are dependent.

    Raises:
        ClosureError: A loop is open at the home pose, or a coupling is violated there.
        DescriptionError: The independent coordinates do not determine the motion.
        SingularPoseError: The independent coordinates fail to determine the motion only at the home pose.
    """
    lay = layout(mechanism)
    check_closed(lay)
    try:
        check_independent(lay, mechanism.home[None])
    except DescriptionError as error:
        if not (why := why_singular(mechanism)):
            raise
        what = f"the home pose is singular: {why}"
        raise SingularPoseError(what, error.where, "choose another home pose, with bent legs or cranks") from None
    return lay


def check_closed(lay: Layout) -> None:
    """Reject a mechanism whose loops are open at the home pose.

    Raises:
        ClosureError: A loop is open, or a coupling is violated.
    """
    mechanism, size = lay.mechanism, np.array([1.0, length(lay)])[:, None]
    for joint, gap in zip(lay.cuts, np.abs(gaps(lay, mechanism.home[None])[0]).reshape(-1, 2, 3), strict=True):
        if not (gap / size <= CLOSED).all():
            wide = zip(gap.max(axis=1), (gap / size).max(axis=1), ("rad", "m"), strict=True)
            open_by = " and ".join(f"{most:.3g} {unit}" for most, scaled, unit in wide if not scaled <= CLOSED)
            raise ClosureError(
                f"the loop through joint '{joint.name}' stays open by {open_by} at the home pose",
                mechanism.where,
                "correct the placements or the home coordinates",
            )
    _check_couplings(mechanism, length(lay))


def _check_couplings(mechanism: Mechanism, length: float) -> None:
    rows = mechanism.coupling_rows
    for coupling, column, gap in zip(
        mechanism.couplings, rows.columns, np.abs(rows.residuals(mechanism.home[None])[0]), strict=True
    ):
        unit = mechanism.units[column]
        if not gap <= CLOSED * (1.0 if unit == "rad" else length):
            raise ClosureError(
                f"'{coupling.coordinate}' is off by {gap:.3g} {unit} at the home pose",
                coupling.where or mechanism.where,
                "correct the polynomial or the home coordinates",
            )


def at_closed_home(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism unchanged if its home pose closes the loops, or else with a solved home pose and a remark.

    Independent coordinates keep their values if a regular pose within limits closes the loops at these values; the
    remaining coordinates move as little as possible. A singular home pose with zero coordinates, e.g. with all links on
    a line, counts as unspecified.

    Raises:
        ClosureError: The loops do not close at any pose.
    """
    lay = layout(mechanism)
    try:
        check_closed(lay)
    except ClosureError:
        return _solve_home(mechanism)
    if mechanism.home.any() or not lay.cuts or _is_regular(mechanism):
        return mechanism
    moved = _solve_home(mechanism)
    return moved if _is_regular(moved) else mechanism


#: Largest change in a coordinate in one step towards changed parameters [rad or lengths], and the shortest step.
FAR, SHORTEST = 0.1, 1.0 / 64.0


def near_home(mechanism: Mechanism, changed: Callable[[float], Mechanism]) -> Mechanism:
    """Find the home pose for changed parameters in the same assembly mode, keeping the independent coordinates.

    Args:
        mechanism: Mechanism whose loops close at its home pose.
        changed: Function that returns the mechanism at a fraction (0 to 1) of the parameter change; its home pose need
            not close the loops.

    Raises:
        ClosureError: The assembly mode ends before the full change, or the loops do not close near the home pose.
    """
    home, reached, step = mechanism.home, 0.0, 1.0
    while reached < 1.0:
        goal = min(1.0, reached + step)
        system = loop_equations(layout(_at_home(changed(goal), home)))
        closed = system.correct(home, home[mechanism.independent_columns])
        if closed is not None and (np.abs(closed[0] - home) / system.sizes).max(initial=0.0) < FAR:
            home, reached = closed[0], goal
        elif (step := 0.5 * step) < SHORTEST:
            what = "no pose near the home pose closes the loops for these parameters"
            raise ClosureError(what, mechanism.where, "change the parameters less, or all of them at once")
    return _at_home(changed(1.0), home)


def _is_regular(mechanism: Mechanism) -> bool:
    """Return True if the independent coordinates determine the motion at the home pose."""
    try:
        check_independent(layout(mechanism), mechanism.home[None])
    except DescriptionError:
        return False
    return True


def _solve_home(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with the best pose that closes the loops as its home pose."""
    free = Loops(tree_of(with_limits(expected_reading(mechanism, "full", GRAVITY), mechanism)))
    held = replace(free, held=frozenset(mechanism.independent.values()))
    solved, open_by = list[tuple[int, Mechanism]](), list[str]()
    for loops in (held, free):
        poses, nearest = _closing_poses(loops, held)
        if not poses:
            open_by = loops.gaps(loops.newton(nearest)[0], CLOSED)
            continue
        homes = [_home(mechanism, loops, each.q) for each in poses]
        moved = _at_home(mechanism, _to_rounding(_at_home(mechanism, homes[0]), mechanism.home != homes[0]))
        remark = _remark(mechanism, moved.home, [] if loops is free else homes[1:])
        moved = replace(moved, remarks=(*mechanism.remarks, remark))
        if _is_fine(poses[0]) and _is_regular(moved):
            return moved
        solved.append((len(poses[0].beyond), moved))
    if solved:
        return min(solved, key=itemgetter(0))[1]
    what = f"no pose closes its loops: the smallest gap reached is {few_of(open_by)}"
    raise ClosureError(what, mechanism.where, "correct the lengths or placements")


def _closing_poses(loops: Loops, held: Loops) -> tuple[list[Home], Array]:
    """Find the poses that close all loops, best first, and the pose that comes closest to closing the loops.

    Args:
        held: The loops with independent coordinates locked; poses are ranked by the conditioning of these equations.
    """
    poses, nearest, smallest = list[Home](), loops.home, np.inf
    (first, *others), few = starts(loops, {}), min(FEW, 1 + WORK // len(loops.size))
    for count, (start, begin) in enumerate((first, *reversed(others)), 1):  # far starts find different poses
        q, error = loops.newton(begin)
        if (size := float(np.linalg.norm(loops.system(q)[0]))) < smallest:
            nearest, smallest = q, size
        if error <= CLOSED:
            poses.append(measure(held, start, _near_turns(loops, q), error))
        if count >= few and any(map(_is_fine, poses)):
            break
    distinct = list[Home]()
    for one in sorted(poses, key=partial(_rank, free=loops is not held)):
        away = (np.abs(_places(loops, one.q) - _places(loops, other.q)).max() for other in distinct)
        if all(far > SAME for far in away):
            distinct.append(one)
    return distinct, nearest


def _is_fine(pose: Home) -> bool:
    return pose.least > CLEAR and not pose.beyond


def _rank(pose: Home, *, free: bool) -> tuple[Any, ...]:
    """Return a sort key for poses: regularity, conditioning (if no coordinate is locked), distance from home."""
    *regular, condition, distance = pose.key()
    return (*regular, condition if free else 0.0, round(distance, 6), *np.round(-pose.q, 6))


def _near_turns(loops: Loops, q: Array) -> Array:
    """Move uncoupled hinges by whole turns to the angle nearest to the home angle, if limits allow this."""
    coupled = {name for one in loops.reading.couplings.values() for name in one.named}
    q = q.copy()
    for name, place in loops.tree.places.items():
        joint, near = loops.reading.joints[name], nearest_turn(q[place], loops.home[place])
        low, high = joint.limits
        if joint.kind == "hinge" and name not in coupled and low <= near <= high:
            q[place] = near
    return q


def _places(loops: Loops, q: Array) -> Array:
    """Return body orientations, and body origins divided by the mechanism's length. Shape (12 n_body,)."""
    rest = np.zeros((1, len(loops.size)))
    bodies = move(loops.tree, TreeStates(q[None], rest, rest)).bodies
    return np.concatenate([bodies.R.ravel(), bodies.p.ravel() / loops.length])


def _home(mechanism: Mechanism, loops: Loops, q: Array) -> Array:
    """Convert reading coordinates to mechanism coordinates; joints outside loops keep home values. Shape (n_q,)."""
    names, moved = [*loops.tree.places], mechanism.home.copy()
    values = np.where(loops.closing, q, loops.home)
    moved[mechanism.columns(mechanism.moving)] = values[[names.index(name) for name in mechanism.moving]]
    return moved


def _at_home(mechanism: Mechanism, q: Array) -> Mechanism:
    """Return the mechanism with the given joint coordinates, shape (n_q,), as its home pose."""
    joints = (replace(joint, home=q[mechanism.columns(joint.coordinates)]) for joint in mechanism.joints)
    return replace(mechanism, joints=tuple(joints))


def _to_rounding(mechanism: Mechanism, moved: Flags) -> Array:
    """Adjust the moved coordinates so that nearly closed loops close to rounding error. Shape (n_q,)."""
    system, home = loop_equations(layout(mechanism)), mechanism.home
    closed = system.correct(home, home[mechanism.independent_columns])
    home = home if closed is None else np.where(moved, closed[0], home)
    return np.where(moved & (np.abs(home) < EPS * system.sizes), 0.0, home)


def _remark(mechanism: Mechanism, home: Array, others: Sequence[Array]) -> str:
    """Report how far the home pose moved, and which other poses close all loops."""
    size, names = loop_equations(layout(mechanism)).sizes, mechanism.coordinates
    way = home - mechanism.home
    most = int(np.argmax(np.abs(way) / size))
    sentence = (
        f"the home pose was solved for; it moved by up to {abs(way[most]):.2g} {mechanism.units[most]} "
        f"('{names[most]}')"
    )
    if labels := [
        label for label, c in zip(mechanism.independent, mechanism.independent_columns, strict=True) if way[c]
    ]:
        as_written = mechanism.pose_text(mechanism.home[mechanism.independent_columns])
        sentence = (
            f"{sentence}, including {' and '.join(labels)}, because no regular pose within limits closes the loops "
            f"at {as_written}"
        )
    if others:
        apart = [(other, int(np.argmax(np.abs(other - home) / size))) for other in others]
        poses = [*dict.fromkeys(f"'{names[c]}' = {other[c]:.3g} {mechanism.units[c]}" for other, c in apart)]
        other, c = apart[0]
        joint = next(joint for joint in mechanism.joints if names[c] in joint.coordinates)
        written = ", ".join(f"{x:.3g}" for x in other[mechanism.columns(joint.coordinates)])
        found = f"to the nearest of {len(others) + 1} poses that close the loops (others have {first_few(poses, NAMED)}"
        sentence = f"{sentence}, {found}; to use the first of these, write home = [{written}] in joint '{joint.name}')"
    return sentence
