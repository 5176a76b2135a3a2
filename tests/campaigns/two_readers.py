"""One file read by two libraries: what they read in other ways, and what torques either computes itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.compare import STATES
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.differences.static import differences, distinct, sorted_by_size
from screwgauge.diagnosis.differences.words import with_sides
from screwgauge.diagnosis.library_dynamics import answers
from screwgauge.diagnosis.pairing.branches import missing
from screwgauge.diagnosis.pairing.common import brought, states_of_b, velocity_map, weighed
from screwgauge.diagnosis.pairing.mapping import Pairing, paired
from screwgauge.diagnosis.transformations import ordered
from screwgauge.engines.raw_queries import Answers
from screwgauge.models.kinematics import draw, plant
from screwgauge.models.readings.reading import Reading, renamed
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
    pairing = paired(one, two)
    found = sorted(_differences(one, two, pairing), key=lambda each: each.what in SILENT)
    by = [f"as {each.library} reads it" for each in (one, two)]
    causes = [with_sides(each.sentence, *by) for each in found]
    if pairing.only_a or pairing.only_b or not pairing.joints:
        return TwoReaders(math.nan, math.nan, tuple(causes))
    try:
        torque, rigid, omitted = _torques((file, floating), (one, two), pairing.joints)
    except (ScrewgaugeError, ValueError, LookupError) as error:
        return TwoReaders(math.nan, math.nan, (*causes, f"no torques: {error}"))
    omitted = omitted if torque > SAME else []
    return TwoReaders(torque, rigid, (*causes, *omitted) if rigid > SAME else (*omitted, *causes))


def _differences(one: Reading, two: Reading, pairing: Pairing) -> list[Difference]:
    """Differences of two readings: parts that one of them lacks, then the largest first."""
    lost = [*missing(one, two, pairing)]
    if not pairing.joints:
        return lost
    return lost + sorted_by_size(distinct(differences(brought(one, two, pairing))[0]))


def _torques(
    file: tuple[Path, bool], readings: tuple[Reading, Reading], joints: Mapping[str, str]
) -> tuple[float, float, list[str]]:
    """Both differences, and what either library leaves out.

    Args:
        file: It, and whether its base floats.
    """
    one, two = map(weighed, readings)
    path, floating = file
    a, states = plant(one), draw(one, STATES)
    first = answers(path, one.library, a, states, floating=floating)
    b, own = (plant(each) for each in _counterpart(one, two, joints))
    theirs, C = states_of_b(a, b, states), velocity_map(a, b)
    second = answers(path, two.library, own, theirs, floating=floating)
    rigid = _rigid(first, states.qdd), _rigid(second, theirs.qdd) @ C
    return _apart(first.tau, second.tau @ C), _apart(*rigid), _omitted((first, second), readings)


def _counterpart(a: Reading, b: Reading, joints: Mapping[str, str]) -> tuple[Reading, Reading]:
    """B with its joints in the order of A's, by the names of A and by its own.

    Args:
        joints: Name in A, all of them, -> name in B.
    """
    there = ordered(renamed(b, {"joints": {other: name for name, other in joints.items()}}), a.joints)
    return there, renamed(there, {"joints": joints})


def _rigid(answer: Answers, qdd: Array) -> Array:
    """Inverse dynamics without damping, springs and the medium. Shape (n, n_freedom)."""
    return np.asarray((answer.mass_matrix @ qdd[..., None])[..., 0] + answer.bias)


def _apart(a: Array, b: Array) -> float:
    scale, off = float(np.abs(a).max()), float(np.abs(a - b).max())
    return off / scale if scale else off


def _omitted(both: tuple[Answers, Answers], readings: tuple[Reading, Reading]) -> list[str]:
    """What a reading has, and the inverse dynamics of its library has not."""
    missing = []
    for i, reading in enumerate(readings):
        has = {what for joint in reading.joints.values() for what in ("damping", "stiffness") if getattr(joint, what)}
        has |= {"armature" for joint in reading.joints.values() if joint.armature}
        has |= {"medium"} if any(reading.medium) else set()
        # what neither has is no difference
        if left := sorted((has - both[i].covers) & both[1 - i].covers):
            missing.append(f"inverse dynamics of {reading.library} leave out {', '.join(left)}")
    return missing
