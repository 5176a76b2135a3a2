"""One file read by two libraries: what they read otherwise, and what torques either computes itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.asked import answers
from screwgauge.diagnosis.common import STANDARD, states_of_b, velocity_map
from screwgauge.diagnosis.compare import STATES
from screwgauge.diagnosis.mapping import paired
from screwgauge.diagnosis.matrix import sentences_between
from screwgauge.diagnosis.reshape import ordered, renamed
from screwgauge.diagnosis.tree import draw, plant
from screwgauge.diagnosis.words import with_sides
from screwgauge.engines.plain import Answers
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array

#: A larger scaled difference of torques is one.
SAME = 1e-9


@dataclass(frozen=True, slots=True)
class TwoReaders:
    """What two libraries make of one file.

    Attributes:
        torque: Largest difference of their own inverse dynamics at random states, over the largest torque; NaN where
            they do not move alike.
        rigid: The same of inertia, gravity and velocities alone, without what joints add.
        causes: What they read or compute otherwise.
    """

    torque: float
    rigid: float
    causes: tuple[str, ...]


def compared(file: Path, one: Reading, two: Reading, seed: int = 0) -> TwoReaders:
    """Compares two readings of a file.

    Args:
        one, two: By libraries that have dynamics.
        seed: Of the random states.
    """
    pairing = paired(one, two)
    said = sentences_between(one, two, pairing)
    causes = [with_sides(sentence, f"as {one.library} reads it", f"as {two.library} reads it") for sentence in said]
    if pairing.only_a or pairing.only_b or not pairing.joints:
        return TwoReaders(math.nan, math.nan, tuple(causes))
    try:
        torque, rigid, omitted = _torques(file, one, two, pairing.joints, seed)
    except (ScrewgaugeError, ValueError, LookupError) as error:
        return TwoReaders(math.nan, math.nan, (*causes, f"no torques: {error}"))
    return TwoReaders(torque, rigid, (*omitted, *causes) if torque > SAME else tuple(causes))


def _torques(
    file: Path, one: Reading, two: Reading, joints: dict[str, str], seed: int
) -> tuple[float, float, list[str]]:
    """Both differences, and what either library leaves out."""
    a, b = (plant(replace(each, gravity=STANDARD if each.gravity is None else each.gravity)) for each in (one, two))
    states = draw(one, STATES, seed)
    first = answers(file, one.library, a, states)
    # B's joints in the order and by the names of A's; it is asked by its own names
    common = plant(ordered(renamed(b.reading, {"joints": {other: name for name, other in joints.items()}}), one.joints))
    own = plant(renamed(common.reading, {"joints": joints}))
    second = answers(file, two.library, own, states_of_b(a, common, states))
    C = velocity_map(a, common)
    rigid = [_rigid(each, qdd) for each, qdd in ((first, states.qdd), (second, states.qdd @ C.T))]
    torque = _apart(first.tau, second.tau @ C), _apart(rigid[0], rigid[1] @ C)
    return *torque, _omitted((first, second), (one, two))


def _rigid(said: Answers, qdd: Array) -> Array:
    """Inverse dynamics without damping, springs and the medium. Shape (n, n_freedom)."""
    return np.asarray((said.mass_matrix @ qdd[..., None])[..., 0] + said.bias)


def _apart(a: Array, b: Array) -> float:
    scale, off = float(np.abs(a).max()), float(np.abs(a - b).max())
    return off / scale if scale else off


def _omitted(said: tuple[Answers, Answers], readings: tuple[Reading, Reading]) -> list[str]:
    """What a reading has, and the inverse dynamics of its library has not."""
    found = []
    for i, reading in enumerate(readings):
        has = {what for joint in reading.joints.values() for what in ("damping", "stiffness") if getattr(joint, what)}
        has |= {"armature" for joint in reading.joints.values() if joint.armature}
        has |= {"medium"} if any(reading.medium) else set()
        # what neither has is no difference
        if left := sorted((has - said[i].covers) & said[1 - i].covers):
            found.append(f"inverse dynamics of {reading.library} leave out {', '.join(left)}")
    return found
