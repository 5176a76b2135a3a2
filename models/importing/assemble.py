"""A home in which all loops of a reading are closed, near its own and within the limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.models.importing.closing import CLOSED, Loops
from screwgauge.models.importing.motion import State, at_home, moved_home
from screwgauge.models.readings.reading import JointReading, Reading
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


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """A reading whose home is closed.

    Attributes:
        said: What was moved and why, a sentence each.
    """

    reading: Reading
    said: tuple[str, ...]


def assemble(reading: Reading, where: str) -> Assembled:
    """Finds the closed home nearest to that of the file, within limits and off singular poses if there is one.

    Raises:
        ClosureError: Some loops do not close from any start.
    """
    loops, home = Loops(reading), at_home(reading)
    state, error, rank = _nearest(loops, home, where)
    state, error = _centred(loops, state, error, rank)
    free = {
        name: replace(joint, limits=FREE) for name, joint in reading.joints.items() if name in _beyond(loops, state)
    }
    reading = replace(reading, joints={**reading.joints, **free})
    return Assembled(moved_home(reading, state), _said(loops, home, state, error))


def _said(loops: Loops, home: State, state: State, error: float) -> tuple[str, ...]:
    moved = {name: value - home.values[name] for name, value in state.values.items() if value != home.values[name]}
    said, opened = [], loops.gaps(home, CLOSED)
    if moved:
        most = max(moved, key=lambda name: abs(moved[name]))
        aim = "closed loops nearest to that of the file" if opened else "room to the limits"
        what = f"{len(moved)} coordinates are moved, '{most}' most, by {moved[most]:.3g}"
        said.append(f"Home is a pose with {aim}: {what}.")
    if opened:
        said.append(f"At the file's own home loops are open: {some(opened)}.")
    if error > CLOSED:
        rounding = some(loops.gaps(state, CLOSED))
        said.append(f"By the rounding of the file loops close nearly only; frames are moved to close them: {rounding}.")
    if beyond := _beyond(loops, state):
        said.append(f"Loops or couplings keep {some(beyond)} beyond limits, which are left out.")
    return tuple(said)


def _beyond(loops: Loops, state: State) -> list[str]:
    """Joints that are outside their limits."""
    joints = loops.reading.joints.items()
    return [name for name, joint in joints if _outside(joint, state.values.get(name))]


def some(phrases: Sequence[str]) -> str:
    """The first of some phrases, and how many more there are."""
    return first_few(phrases, SHOWN)


def _outside(joint: JointReading, value: float | None) -> bool:
    """Whether a coordinate is beyond the limits of its joint."""
    low, high = joint.limits
    return value is not None and low < high and not low <= value <= high


def _nearest(loops: Loops, home: State, where: str) -> tuple[State, float, int]:
    """The best closed state: regular, within limits, near; its residual and the rank of its loop equations."""
    rng, found, best = np.random.default_rng(0), [], (home, np.inf)
    closing = loops.closing  # whatever is on no loop stays
    for i in range(STARTS):
        reach = FARTHEST * i / (STARTS - 1)
        start = loops.stepped(home, closing * reach * rng.uniform(-1.0, 1.0, len(closing))) if i else home
        state, error = loops.newton(start)
        best = min(best, (state, error), key=lambda pair: pair[1])
        if not error <= ROUNDED:
            continue
        s = np.linalg.svd(loops.system(state)[1], compute_uv=False)
        rank = int(np.sum(s > REDUNDANT))
        clear = not rank or s[rank - 1] > REGULAR
        excess = sum(_outside(joint, state.values.get(name)) for name, joint in loops.reading.joints.items())
        found.append((-rank, not clear, excess, _distance(loops, home, state), i, state, error))
        if (clear and not excess) or len(found) == ENOUGH:
            break
    if not found:
        raise _never(loops, best[0], where)
    *_, state, error = min(found, key=lambda row: row[:5])
    return state, error, -min(found, key=lambda row: row[:5])[0]


def _distance(loops: Loops, home: State, state: State) -> float:
    """How far two states are apart, hinges and slides only, without dimension."""
    sizes = loops.size
    parts = loops.reading.freedoms
    way = [(value - home.values[name]) / sizes[parts[name]][0] for name, value in state.values.items()]
    return float(np.linalg.norm(way))


def _never(loops: Loops, state: State, where: str) -> ClosureError:
    what = f"loops do not close from any of {STARTS} starts: nearest are {some(loops.gaps(state, ROUNDED))}"
    return ClosureError(what, where, "check the frames that they join, or name fewer loops")


def _centred(loops: Loops, state: State, error: float, rank: int) -> tuple[State, float]:
    """The state moved, with its loops closed, until coordinates have room to their limits, as far as they can."""
    for _ in range(CENTRINGS):
        wish = _wish(loops, state)
        if not wish.any():
            break
        J = loops.system(state)[1]
        if len(J):
            Vt = np.linalg.svd(J)[2]
            wish = Vt[rank:].T @ (Vt[rank:] @ wish)
        wish *= min(1.0, 0.3 / max(float(np.abs(wish).max()), 1e-300))
        if np.abs(wish).max() < 1e-6:
            break
        trial, left = loops.newton(loops.stepped(state, wish))
        s = np.linalg.svd(loops.system(trial)[1], compute_uv=False)
        if (
            not left <= max(error, 1e-9)
            or (rank and s[rank - 1] < REGULAR)
            or _lack(loops, trial) >= _lack(loops, state)
        ):
            break
        state, error = trial, left
    return state, error


def _wish(loops: Loops, state: State) -> Array:
    """The step by which all coordinates would have room to their limits, without dimension. Shape (n,)."""
    wish = np.zeros(len(loops.size))
    for name, part in loops.reading.freedoms.items():
        joint = loops.reading.joints[name]
        low, high = joint.limits
        if name not in state.values or not low < high:
            continue
        room = MARGIN * (high - low)
        room = room if joint.kind == "slide" and np.isfinite(room) else min(room, ROOM)
        wish[part] = float(np.clip(state.values[name], low + room, high - room)) - state.values[name]
    return wish / loops.size


def _lack(loops: Loops, state: State) -> float:
    return float(np.linalg.norm(_wish(loops, state)))
