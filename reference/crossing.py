"""Joints that are walked over side by side: few calls on large arrays, not many on small ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.graph import Edge
from screwgauge.reference.rotations import Array, times

Index = NDArray[np.intp]
Step = tuple[Index | slice, Index, Array, bool, bool]


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """Joints that are walked over side by side, each from a body to the next (eq. 24, for any joint).

    Attributes:
        near, far: These bodies. Shape (m,).
        R_start, p_start: Frames of the joints in the first. Shapes (m, 3, 3), (m, 3).
        R_end, p_end: Those in the second, the rotation being the inverse one.
        steps: Of the first, second, ... freedom on the way: joints that have one, columns, axes (k, 3), and whether
            some of them turn, and some slide.
    """

    near: Index
    far: Index
    R_start: Array
    p_start: Array
    R_end: Array
    p_end: Array
    steps: tuple[Step, ...]

    def walk(
        self, R: Array, p: Array, moved: tuple[Array, Array], directions: Array, points: Array
    ) -> tuple[Array, Array]:
        """Poses of the second bodies from all that are known, shapes (n, m, 3, 3), (n, m, 3).

        Args:
            moved: See `pose.Layout.moved`.
            directions, points: Are given direction and point of each freedom's axis. Shape (n, n_q, 3).
        """
        (turned, slid), R = moved, R[:, self.near]
        p = p[:, self.near] + times(R, self.p_start)
        R = R @ self.R_start
        for joints, columns, axes, turning, sliding in self.steps:
            e = times(R[:, joints], axes)
            directions[:, columns], points[:, columns] = e, p[:, joints]
            if turning:
                R[:, joints] = R[:, joints] @ turned[:, columns]
            if sliding:
                p[:, joints] += e * slid[:, columns, None]
        R = R @ self.R_end
        return R, p - times(R, self.p_end)


def crossing(
    edges: Sequence[Edge], index: Mapping[str, int], columns: Mapping[str, list[int]], turns: NDArray[np.bool_]
) -> Crossing:
    """The crossing of some joints.

    Args:
        index: Numbers of the bodies.
        columns: Joint -> columns of its coordinates.
        turns: Which coordinates are angles. Shape (n_q,).
    """
    steps = list[Step]()
    ways = [list(zip(columns[edge.joint.name], edge.joint.freedoms, strict=True)) for edge in edges]
    ways = [way[::-1] if edge.reverse else way for way, edge in zip(ways, edges, strict=True)]
    for i in range(max(map(len, ways))):
        having = np.array([k for k, way in enumerate(ways) if len(way) > i], dtype=np.intp)
        place = np.array([ways[k][i][0] for k in having], dtype=np.intp)
        axes, turning = np.array([ways[k][i][1][1] for k in having]), turns[place]
        rows = having if len(having) < len(ways) else slice(None)
        steps.append((rows, place, axes, bool(turning.any()), not turning.all()))
    frames = [(edge.joint.parent_frame, edge.joint.child_frame)[:: -1 if edge.reverse else 1] for edge in edges]
    return Crossing(
        near=np.array([index[edge.near] for edge in edges], dtype=np.intp),
        far=np.array([index[edge.far] for edge in edges], dtype=np.intp),
        R_start=np.array([start.R for start, _ in frames]),
        p_start=np.array([start.p for start, _ in frames]),
        R_end=np.array([end.R.T for _, end in frames]),
        p_end=np.array([end.p for _, end in frames]),
        steps=tuple(steps),
    )
