"""Units in which a tree engine's closing equations have no dimension: lengths of the mechanism, and radians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.tree.closure import Loops
from screwgauge.engines.tree.protocol import Tree
from screwgauge.models.loops import LoopsFile
from screwgauge.reference.mechanism import KINDS
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Sizes:
    """What each number is divided by.

    Attributes:
        length: Largest distance between bodies and closing points at home [m].
        q: Unit of each tree coordinate, 1 rad or that length. Shape (n_v,).
        turning: Which of them are angles. Shape (n_v,).
        y: Unit of each independent coordinate. Shape (k,).
        rows: Unit of each closing row, those of y last. Shape (m + k,).
    """

    length: float
    q: Array
    turning: NDArray[np.bool_]
    y: Array
    rows: Array


def make_sizes(tree: Tree, file: LoopsFile, loops: Loops, home: Array) -> Sizes:
    """Units for a tree whose home pose is known. `home`: its coordinates there, shape (n_v,)."""
    at = tree.poses(home[None])
    sides = [side for anchor in loops.anchors if not anchor.angular for side in anchor.sides]
    cloud = np.array([*at.p[0], *(at.p[0, body] + at.R[0, body] @ where for body, where in sides)])
    length = float(np.linalg.norm(cloud[:, None] - cloud[None], axis=2).max()) or 1.0
    turns = {name: turn for j in file.joints for name, turn in zip(j.coordinates, KINDS[j.kind], strict=True)}
    unit = {name: 1.0 if turn else length for name, turn in turns.items()}
    y = np.array([unit[name] for name in file.independent.values()])
    anchors = [1.0 if anchor.angular else length for anchor in loops.anchors for _ in range(3)]
    q = np.array([unit[name] for name in tree.coordinates])
    turning = np.array([turns[name] for name in tree.coordinates])
    return Sizes(length, q, turning, y, np.array([*anchors, *y]))
