"""Joints as lines in space: how far apart two are, and which placement lays one set of lines onto another."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from screwgauge.diagnosis.differences.change import axis
from screwgauge.models.kinematics import moved, size
from screwgauge.models.readings.reading import JointReading, Reading
from screwgauge.reference.rotations import Array

#: Placements are compared by the joints that they lay onto each other so closely, relative to the size of the machine.
CLOSE = 1e-6
#: Frames of bodies that are tried as placements.
FRAMES = 8


def apart(a: JointReading, b: JointReading, length: float) -> float:
    """How far two joints are from turning or sliding alike, whichever way they count: angle plus way over a length."""
    if a.kind != b.kind:
        return float("inf")
    if a.kind == "free":
        return 0.0  # wherever its coordinates say
    if a.kind == "ball":
        return float(np.linalg.norm(a.centre - b.centre)) / length
    sign = 1.0 if axis(a) @ axis(b) >= 0.0 else -1.0
    off = float(np.linalg.norm(axis(a) - sign * axis(b)))
    if a.kind == "hinge":
        off += float(np.linalg.norm(np.cross(b.centre - a.centre, axis(a)))) / length
    return off


def fitting(
    a: Reading,
    b: Reading,
    pairs: Sequence[tuple[str, str]],
    bodies: Iterable[tuple[str, str]],
    also: Iterable[Array] = (),
) -> Array:
    """The placement of B's world in A's that lays most joints onto their partners; none where those at the ground fit.

    A base that stands elsewhere cannot be told from a first joint that counts from elsewhere, which is likelier.

    Args:
        pairs: Joints of A with those of B.
        bodies: Bodies of A with those of B.
        also: Further placements that are tried. Shape (4, 4) each.

    Returns:
        Shape (4, 4).
    """
    length, best, most = size(a), np.eye(4), -1.0
    pairs = [(i, j) for i, j in pairs if a.joints[i].kind != "free"]
    ground = {a.bodies[name].joints[0] for name in a.roots}
    stands = [a.fixed[name] @ np.linalg.inv(b.fixed[name]) for name in a.fixed if name in b.fixed]
    rooted = [apart(a.joints[i], b.joints[j], length) for i, j in pairs if i in ground]
    if (rooted and max(rooted) < CLOSE) or any(np.abs(T - best).max() < CLOSE for T in stands):
        return best
    frames = [a.bodies[name].pose @ np.linalg.inv(b.bodies[other].pose) for name, other in [*bodies][:FRAMES]]
    tried = [best, *frames, *also, *stands]
    if len({"free" in (joint.kind for joint in each.joints.values()) for each in (a, b)}) == 2:
        tried = [*tried[1:], best]  # a base that one model alone says is free stands where its coordinates say
    for T in tried:
        off = [apart(a.joints[i], moved(b.joints[j], T), length) for i, j in pairs]
        score = sum(each < CLOSE for each in off) - np.mean(np.minimum(off, 1.0)) if off else 0.0
        if score > most + 1e-3:
            best, most = T, float(score)
    return best
