"""A mechanism with its spanning tree, and the paths and loops that follow from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.graph import SpanningTree, spanning_tree
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, eq=False)
class Layout:
    """A mechanism with its spanning tree and the paths that follow from it.

    The tree keeps the joints of the independent coordinates, so that these are unknowns of the tree itself.

    Attributes:
        path: +1 or -1 where a coordinate lies on the tree path from ground to a body. Shape (n_body + 1, n_q).
        loop: The same for the loop of each cut joint: parent's path + joint - child's path. (n_cut, n_q).
        kept: What was made of it once, as by `loops.loop_equations`.
    """

    mechanism: Mechanism
    tree: SpanningTree
    columns: dict[str, list[int]]
    path: Array
    loop: Array
    kept: dict[tuple[int, ...] | str, Any] = field(default_factory=dict)

    @cached_property
    def turns(self) -> NDArray[np.bool_]:
        """Which coordinates are angles. Shape (n_q,)."""
        return np.array([turn for joint in self.mechanism.joints for turn, _ in joint.freedoms])

    @cached_property
    def cut_columns(self) -> list[int]:
        """Coordinates of the cut joints, joint by joint."""
        return [column for joint in self.tree.cuts for column in self.columns[joint.name]]

    @cached_property
    def tree_columns(self) -> list[int]:
        """The other coordinates."""
        return [column for column in range(self.path.shape[1]) if column not in self.cut_columns]


def layout(mechanism: Mechanism, tree: SpanningTree | None = None) -> Layout:
    """Spanning tree, paths and loops of a mechanism.

    Args:
        tree: Another one than that which keeps the joints of the independent coordinates.
    """
    if tree is None:
        chosen = {*mechanism.independent.values()}
        tree = spanning_tree(mechanism, [j.name for j in mechanism.joints if chosen & {*j.coordinates}])
    index = mechanism.body_index
    columns = {joint.name: mechanism.columns(joint.coordinates) for joint in mechanism.joints}
    path = tree_path(mechanism, tree)
    loop = np.zeros((len(tree.cuts), path.shape[1]), dtype=path.dtype)
    for row, joint in zip(loop, tree.cuts, strict=True):
        row += path[index[joint.parent]] - path[index[joint.child]]
        row[columns[joint.name]] = 1.0
    return Layout(mechanism, tree, columns, path, loop)


def tree_path(mechanism: Mechanism, tree: SpanningTree) -> Array:
    """+1 or -1 where a coordinate lies on the way from ground to a body. Shape (n_body + 1, n_q)."""
    index = mechanism.body_index
    path = np.zeros((len(index), len(mechanism.coordinates)), dtype=mechanism.home.dtype)
    for edge in tree.edges:
        path[index[edge.far]] = path[index[edge.near]]
        path[index[edge.far], mechanism.columns(edge.joint.coordinates)] = -1.0 if edge.reverse else 1.0
    return path
