"""A home in which all loops of a reading are closed, near its own and within the limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from screwgauge.models.importing.closing import CLOSED, Loops
from screwgauge.models.kinematics.home import rehomed
from screwgauge.models.kinematics.tree import plant
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.rotations import Array
from screwgauge.reference.wording import first_few

#: Starts beside home, and how far they lie from it at most [rad or lengths of the model].
STARTS, FARTHEST = 40, np.pi
ENOUGH = 8  # closed poses, where none is without fault
#: Residual up to which loops of few printed digits count as closed [rad or lengths]: the rest is the file's rounding.
ROUNDED = 1e-5
#: Smallest singular value of the loop equations that is far from singular; below the second it is a redundant equation.
REGULAR, REDUNDANT = 2e-3, 1e-8
#: Room that coordinates keep to their limits, as a share of the range and at most [rad]: a motion needs some.
MARGIN, ROOM = 0.15, 0.3
CENTRINGS = 40
#: How many closures or joints a sentence names.
SHOWN = 5
#: Limits of a joint that has none.
FREE = (-np.inf, np.inf)


def assemble(reading: Reading, where: str) -> tuple[Reading, tuple[str, ...]]:
    """Finds the closed home nearest to that of the file, within limits and off singular poses if there is one.

    Returns:
        The reading with that home, and what was moved and why, a sentence each.

    Raises:
        ClosureError: Some loops do not close from any start.
    """
    loops = Loops(plant(reading))
    q, error, rank = _nearest(loops, where)
    q, error = _centred(loops, q, error, rank)
    free = {name: replace(joint, limits=FREE) for name, joint in reading.joints.items() if name in _beyond(loops, q)}
    reading = replace(reading, joints={**reading.joints, **free})
    there = {name: q[place] for name, place in loops.tree.places.items() if (q != loops.home)[place].any()}
    return rehomed(reading, there)[0], _said(loops, q, error)


def _said(loops: Loops, q: Array, error: float) -> tuple[str, ...]:
    home = loops.values(loops.home)
    moved = {name: value - home[name] for name, value in loops.values(q).items() if value != home[name]}
    said, opened = [], loops.gaps(loops.home, CLOSED)
    if moved:
        most = max(moved, key=lambda name: abs(moved[name]))
        aim = "closed loops nearest to that of the file" if opened else "room to the limits"
        what = f"{len(moved)} coordinates are moved, '{most}' most, by {moved[most]:.3g}"
        said.append(f"Home is a pose with {aim}: {what}.")
    if opened:
        said.append(f"At the file's own home loops are open: {some(opened)}.")
    if error > CLOSED:
        rounding = some(loops.gaps(q, CLOSED))
        said.append(f"By the rounding of the file loops close nearly only; frames are moved to close them: {rounding}.")
    if tight := [f"'{name}'" for name, (low, high) in _limits(loops) if not low < high]:
        said.append(f"Limits of {some(tight)} leave no room, and are left out.")
    if beyond := _beyond(loops, q):
        said.append(f"Loops or couplings keep {some(beyond)} beyond limits, which are left out.")
    return tuple(said)


def _limits(loops: Loops) -> list[tuple[str, tuple[float, float]]]:
    return [(name, joint.limits) for name, joint in loops.reading.joints.items()]


def _beyond(loops: Loops, q: Array) -> list[str]:
    """Joints that are outside their limits."""
    at = loops.values(q)
    return [name for name, (low, high) in _limits(loops) if name in at and low < high and not low <= at[name] <= high]


def some(phrases: Sequence[str]) -> str:
    """The first of some phrases, and how many more there are."""
    return first_few(phrases, SHOWN)


def _nearest(loops: Loops, where: str) -> tuple[Array, float, int]:
    """The best closed state: regular, within limits, near; its residual and the rank of its loop equations."""
    rng, found, best = np.random.default_rng(0), [], (loops.home, np.inf)
    closing = loops.closing  # whatever is on no loop stays
    for i in range(STARTS):
        reach = FARTHEST * i / (STARTS - 1)
        start = loops.stepped(loops.home, closing * reach * rng.uniform(-1.0, 1.0, len(closing))) if i else loops.home
        q, error = loops.newton(start)
        best = min(best, (q, error), key=lambda pair: pair[1])
        if not error <= ROUNDED:
            continue
        s = np.linalg.svd(loops.system(q)[1], compute_uv=False)
        rank = int(np.sum(s > REDUNDANT))
        clear = not rank or s[rank - 1] > REGULAR
        excess = len(_beyond(loops, q))
        found.append((-rank, not clear, excess, _distance(loops, q), i, q, error))
        if (clear and not excess) or len(found) == ENOUGH:
            break
    if not found:
        what = f"loops do not close from any of {STARTS} starts: nearest are {some(loops.gaps(best[0], ROUNDED))}"
        raise ClosureError(what, where, "check the frames that they join, or name fewer loops")
    rank, *_, q, error = min(found, key=lambda row: row[:5])
    return q, error, -rank


def _distance(loops: Loops, q: Array) -> float:
    """How far coordinates are from home, hinges and slides only, without dimension."""
    home, parts = loops.values(loops.home), loops.tree.freedoms
    way = [(value - home[name]) / loops.size[parts[name]][0] for name, value in loops.values(q).items()]
    return float(np.linalg.norm(way))


def _centred(loops: Loops, q: Array, error: float, rank: int) -> tuple[Array, float]:
    """Coordinates moved, with the loops closed, until they have room to their limits, as far as they can."""
    for _ in range(CENTRINGS):
        wish = _wish(loops, q)
        if not wish.any():
            break
        J = loops.system(q)[1]
        if len(J):
            Vt = np.linalg.svd(J)[2]
            wish = Vt[rank:].T @ (Vt[rank:] @ wish)
        wish *= min(1.0, 0.3 / max(float(np.abs(wish).max()), 1e-300))
        if np.abs(wish).max() < 1e-6:
            break
        trial, left = loops.newton(loops.stepped(q, wish))
        s = np.linalg.svd(loops.system(trial)[1], compute_uv=False)
        if not left <= max(error, 1e-9) or (rank and s[rank - 1] < REGULAR) or _lack(loops, trial) >= _lack(loops, q):
            break
        q, error = trial, left
    return q, error


def _wish(loops: Loops, q: Array) -> Array:
    """The step by which all coordinates would have room to their limits, without dimension. Shape (n,)."""
    wish = np.zeros(len(loops.size))
    for name, x in loops.values(q).items():
        joint = loops.reading.joints[name]
        low, high = joint.limits
        if not low < high:
            continue
        room = MARGIN * (high - low)
        room = room if joint.kind == "slide" and np.isfinite(room) else min(room, ROOM)
        wish[loops.tree.freedoms[name]] = float(np.clip(x, low + room, high - room)) - x
    return wish / loops.size


def _lack(loops: Loops, q: Array) -> float:
    return float(np.linalg.norm(_wish(loops, q)))
