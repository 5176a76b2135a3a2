"""A home in which all loops of a reading are closed, near its own and within the limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.models.importing.closing import Loops
from screwgauge.models.importing.motion import State, at_home, moved_home
from screwgauge.models.readings.reading import JointReading, Reading
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.rotations import Array

#: Starts beside home, and how far they lie from it at most [rad or lengths of the model].
STARTS, FARTHEST = 60, np.pi
#: Residual up to which loops of few printed digits count as closed [rad or lengths]: the rest is the file's rounding.
ROUNDED = 1e-5
#: Smallest singular value of the loop equations that is far from singular; below the second it is a redundant equation.
REGULAR, REDUNDANT = 2e-3, 1e-8
#: Room that coordinates keep to their limits, as a share of the range and at most [rad]: a motion needs some.
MARGIN, ROOM = 0.15, 0.3
CENTRINGS = 40


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """A reading whose home is closed.

    Attributes:
        moved: Joint -> how far it is from the home of the file [rad or m], where it is.
        opened: Largest residual of the file's own home [rad or lengths of the model].
        left: The same of the new home.
        beyond: Joints that are outside their limits even so.
    """

    reading: Reading
    moved: dict[str, float]
    opened: float
    left: float
    beyond: tuple[str, ...]


def assemble(reading: Reading, where: str) -> Assembled:
    """Finds the closed home nearest to that of the file, within limits and off singular poses if there is one.

    Raises:
        ClosureError: Some loops do not close from any start.
    """
    loops, home = Loops(reading), at_home(reading)
    state, error, rank = _nearest(loops, home, where)
    state, error = _centred(loops, state, error, rank)
    moved = {name: value - home.values[name] for name, value in state.values.items() if value != home.values[name]}
    opened = float(np.abs(loops.system(home)[0]).max(initial=0.0))
    beyond = tuple(name for name, joint in reading.joints.items() if outside(joint, state.values.get(name)))
    return Assembled(moved_home(reading, state), moved, opened, error, beyond)


def outside(joint: JointReading, value: float | None) -> bool:
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
        excess = sum(outside(joint, state.values.get(name)) for name, joint in loops.reading.joints.items())
        found.append((-rank, not clear, excess, _distance(loops, home, state), i, state, error))
        if clear and not excess:
            break
    if not found:
        raise _never(loops, *best, where)
    *_, state, error = min(found, key=lambda row: row[:5])
    return state, error, -min(found, key=lambda row: row[:5])[0]


def _distance(loops: Loops, home: State, state: State) -> float:
    """How far two states are apart, hinges and slides only, without dimension."""
    sizes = loops.size
    parts = loops.reading.freedoms
    way = [(value - home.values[name]) / sizes[parts[name]][0] for name, value in state.values.items()]
    return float(np.linalg.norm(way))


def _never(loops: Loops, state: State, error: float, where: str) -> ClosureError:
    residuals = {name: float(np.abs(r).max()) for name, r in loops.residuals(state).items()}
    worst = sorted(residuals, key=lambda name: -residuals[name])
    named = [f"'{name}' by {residuals[name]:.2g}" for name in worst if residuals[name] > ROUNDED]
    what = f"loops do not close from any of {STARTS} starts: {', '.join(named[:5])} (rad, or lengths of the model)"
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
        if not left <= max(error, 1e-9) or (rank and s[rank - 1] < REGULAR) or _lack(loops, trial) >= _lack(loops, state):
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
