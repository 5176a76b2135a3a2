"""Sentences on the assumed motion of coordinates that no actuator drives, and on its effect on actuator forces."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from screwgauge.problem import GivenMotion, Rows, spread
from screwgauge.reference.applied import Applied
from screwgauge.reference.closed.assembly_mode import AssemblyMode
from screwgauge.reference.closed_motion import ClosedMotion
from screwgauge.reference.equations.screws import times, transpose
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.idle import Freedom
from screwgauge.scene.scene import Scene

#: Number of samples examined; perturbation of their coordinates and rates [rad or lengths of the mechanism, per s].
MOST, AWAY = 8, 0.1
#: Largest relative change of forces that counts as zero.
NOTHING = 1e-9


def assumptions(scene: Scene) -> tuple[str, ...]:
    """Return a sentence for each coordinate that no actuator drives: start, motion, and effect on actuator forces."""
    if not scene.undriven:
        return ()
    numbers = tuple(one.number for one in scene.undriven)
    idle = _find_idle(scene.mechanism, scene.motion, scene.applied, numbers)
    return tuple(
        _sentence(scene, one) + " The actuator forces do not depend on it." * (one.number in idle)
        for one in scene.undriven
    )


def _sentence(scene: Scene, one: Freedom) -> str:
    mechanism = scene.mechanism
    unit = mechanism.units[mechanism.independent_columns[one.number]]
    at = f"{one.start:.6g} {unit}"
    if one.rests:
        return f"No actuator drives '{one.label}', which has no inertia and is therefore assumed to rest at {at}."
    if scene.grid is not None:
        return f"No actuator drives '{one.label}': it is at rest at {at} in each cell, where the forces accelerate it."
    start = f"{at} at {one.rate:.6g} {unit}/s, {'as set in the scene' if one.chosen else 'without momentum along it'}"
    return f"No actuator drives '{one.label}': its motion follows from the forces, starting from {start}."


def check_rest(scene: Scene) -> None:
    """Reject a force along a coordinate that is assumed to rest because it has no inertia.

    Raises:
        DescriptionError: A force acts along the coordinate, so that it cannot rest.
    """
    resting = [one for one in scene.undriven if one.rests]
    if not resting:
        return
    motion = scene.motion.part(spread(len(scene.motion), MOST))
    numbers = tuple(one.number for one in scene.undriven)
    along, size = _idle_forces(_close_motion(scene.mechanism, motion, scene.applied), numbers)
    for one in resting:
        force = np.abs(along[:, numbers.index(one.number)])
        if force.max() > NOTHING * size:
            what = f"'{one.label}' has no inertia and cannot rest: a force of {force.max():.3g} acts along it"
            where = f"t = {motion.t[int(np.argmax(force))]:g} s"
            raise DescriptionError(what, where, "give its bodies inertia, or remove the force")


@lru_cache(maxsize=1)  # the arguments are immutable
def _find_idle(mechanism: Mechanism, motion: GivenMotion, applied: Applied, numbers: tuple[int, ...]) -> frozenset[int]:
    """Select the coordinates along which no force acts and whose motion does not change any actuator force."""
    rows: Rows = spread(len(motion), MOST)
    some = motion.part(rows)
    at = _close_motion(mechanism, some, applied)
    (along, size), unit = _idle_forces(at, numbers), at.loops.sizes[at.loops.y_columns]
    resting = tuple(k for k in numbers if k not in motion.idle)

    def forces(y: Array, yd: Array) -> Array:
        moved = _close_motion(mechanism, GivenMotion(some.t, y, yd, some.ydd), applied)
        moved.idle, moved.resting = motion.idle, resting
        return np.asarray(moved.actuator_force)

    found, right = set[int](), forces(some.y, some.yd)
    for j, k in enumerate(numbers):
        way = AWAY * np.eye(len(unit))[k] * unit
        others = forces(some.y + way, some.yd), forces(some.y, some.yd + way)
        still = np.abs(along[:, j]).max() <= NOTHING * size
        if still and all(np.abs(other - right).max() <= NOTHING * np.abs(right).max() for other in others):
            found.add(k)
    return frozenset(found)


def _close_motion(mechanism: Mechanism, motion: GivenMotion, applied: Applied) -> ClosedMotion:
    """Close the loops along a motion, keeping the given accelerations."""
    mode = AssemblyMode(layout(mechanism))
    q = mode.motion(motion.y, motion.t, (motion.yd, motion.ydd))
    return ClosedMotion(mode.system, q, motion.yd, motion.ydd, applied, motion.t)


def _idle_forces(at: ClosedMotion, numbers: tuple[int, ...]) -> tuple[Array, float]:
    """Return forces along motions that move no actuator, assuming no acceleration along them, and the largest force."""
    ydd = at.ydd * ~np.isin(np.arange(at.ydd.shape[1]), numbers)
    still = ClosedMotion(at.loops, at.q, at.yd, ydd, at.applied, at.t)
    unit = at.loops.sizes[at.loops.y_columns]
    at.idle = numbers
    along = times(transpose(at.neutral), still.generalized_force) * unit[[*numbers]]
    size = np.abs(still.tau * still.loops.size).max(initial=0.0)
    return np.asarray(along), max(float(size), float(np.finfo(float).tiny))
