"""The loops of a mechanism by their own size.

A row that closes a loop changes with the coordinates as that loop is long, however long the mechanism is; of the
mechanism's length is only what the poses of its bodies are rounded to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.layout import Layout
from screwgauge.reference.pose import length, pose
from screwgauge.reference.rotations import Array, widest


@dataclass(frozen=True, slots=True, eq=False)
class Extent:
    """How long the loops are, and which coordinates count for which.

    Attributes:
        loops: Largest distance between joint points around each loop at home [m], see `Layout.loop`. Shape (n_cut,).
        size: Unit of each joint coordinate: 1 for angles, for distances the shortest of its loops. Shape (n_q,).
        owner: Of each joint coordinate the first loop that it is part of, 0 if there is none. Shape (n_q,).
        stretch: Length of the mechanism over that of its shortest loop.
    """

    loops: Array
    size: Array
    owner: NDArray[np.intp]
    stretch: float


def extent(lay: Layout) -> Extent:
    """Worked out once a layout."""
    if "extent" not in lay.kept:
        lay.kept["extent"] = _extent(lay)
    found: Extent = lay.kept["extent"]
    return found


def _extent(lay: Layout) -> Extent:
    mechanism, L, around = lay.mechanism, length(lay), lay.loop != 0.0
    if not len(around):
        return Extent(np.zeros(0), np.where(lay.turns, 1.0, L), np.zeros(len(lay.turns), dtype=np.intp), 1.0)
    at, index, loops = pose(lay, mechanism.home[None]), mechanism.body_index, []
    for loop in around:
        joints = [joint for joint in mechanism.joints if loop[lay.columns[joint.name]].any()]
        ends = [(index[body], frame.p) for joint in joints for body, frame in joint.sides]
        loops.append(widest([at.p[0, body] + at.R[0, body] @ point for body, point in ends]) or L)
    shortest = np.where(around, np.array(loops)[:, None], np.inf).min(axis=0)
    size = np.where(lay.turns, 1.0, np.where(np.isfinite(shortest), shortest, L))
    return Extent(np.array(loops), size, np.argmax(around, axis=0), L / min(loops))
