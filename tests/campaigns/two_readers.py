"""One file read by two libraries: what they read in other ways, and what torques either computes itself."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.answer import differences_of
from screwgauge.diagnosis.explanation import compare_readings as told
from screwgauge.diagnosis.libraries import ask_library
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.motion import follow, partners_of
from screwgauge.diagnosis.shares import STATES, with_gravity
from screwgauge.engines.raw_queries import Answers
from screwgauge.models.kinematics import draw, tree_of
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array

#: Properties that no torque shows; they are named last.
SILENT = ("limits", "actuator", "gear", "closure", "coupling", "polynomial")
#: A larger scaled difference of torques is one.
SAME = 1e-9


@dataclass(frozen=True, slots=True)
class TwoReaders:
    """What two libraries make of one file.

    Attributes:
        torque: Largest difference of their own inverse dynamics at random states, over the largest torque; NaN where
            they do not move alike.
        rigid: The same of inertia, gravity and velocities alone, without what joints add.
        causes: What they read or compute in another way.
    """

    torque: float
    rigid: float
    causes: tuple[str, ...]


def compared(file: Path, one: Reading, two: Reading, *, floating: bool = False) -> TwoReaders:
    """Compares two readings of a file.

    Args:
        one, two: By libraries that have dynamics.
        floating: The base of a URDF was read as moving freely.
    """
    found = told(one, two)
    pair = found.pair
    ordered = sorted(differences_of(pair, found.facts), key=lambda each: (each.what in SILENT, -each.size))
    by = f"(A: as {one.library} reads it, B: as {two.library} reads it)"
    causes = [f"{each.sentence} {by}" for each in ordered]
    if pair.only_a or pair.only_b or not pair.joints:
        return TwoReaders(math.nan, math.nan, tuple(causes))
    try:
        torque, rigid, omitted = _torques(file, pair, floating=floating)
    except (ScrewgaugeError, ValueError, LookupError) as error:
        return TwoReaders(math.nan, math.nan, (*causes, f"no torques: {error}"))
    omitted = omitted if torque > SAME else []
    return TwoReaders(torque, rigid, (*causes, *omitted) if rigid > SAME else (*omitted, *causes))


def _torques(file: Path, pair: Pair, *, floating: bool) -> tuple[float, float, list[str]]:
    """Both differences, and what either library leaves out.

    Raises:
        ValueError: One does not move as the other one does.
    """
    one, two = (with_gravity(machine.reading) for machine in (pair.a, pair.b))
    a, b, states = tree_of(one), tree_of(two), draw(one, STATES)
    there, velocities, fits = follow(a, states, b, partners_of(pair))
    if not fits.all():
        raise ValueError("bodies do not move alike")
    first = ask_library(file, one.library, a, states, floating=floating)
    second = ask_library(file, two.library, b, there, floating=floating)
    rigid = _rigid(first, states.qdd), _along(_rigid(second, there.qdd), velocities)
    apart = _apart(first.tau, _along(second.tau, velocities))
    return apart, _apart(*rigid), _omitted((first, second), (one, two))


def _along(tau: Array, velocities: Array) -> Array:
    return np.asarray((np.swapaxes(velocities, 1, 2) @ tau[..., None])[..., 0])


def _rigid(answer: Answers, qdd: Array) -> Array:
    """Inverse dynamics without damping, springs and the medium. Shape (n, n_freedom)."""
    return np.asarray((answer.mass_matrix @ qdd[..., None])[..., 0] + answer.bias)


def _apart(a: Array, b: Array) -> float:
    scale, off = float(np.abs(a).max()), float(np.abs(a - b).max())
    return off / scale if scale else off


def _omitted(both: tuple[Answers, Answers], readings: tuple[Reading, Reading]) -> list[str]:
    missing = []
    for i, reading in enumerate(readings):
        has = {what for joint in reading.joints.values() for what in ("damping", "stiffness") if getattr(joint, what)}
        has |= {"armature" for joint in reading.joints.values() if joint.armature}
        has |= {"medium"} if any(reading.medium) else set()
        # what neither has is no difference
        if left := sorted((has - both[i].covers) & both[1 - i].covers):
            missing.append(f"inverse dynamics of {reading.library} leave out {', '.join(left)}")
    return missing
