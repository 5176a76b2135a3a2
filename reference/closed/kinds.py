"""What the rows are that close the loops: the wrenches reciprocal to the freedoms of each cut joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.pose import Layout
from screwgauge.reference.reactions import reaction_components
from screwgauge.reference.rotations import Array


class Kinds(NamedTuple):
    """The m rows, in the order of `reaction_components`.

    Attributes:
        owner: Among the cut joints.
        force: Whether each is a force; otherwise a moment.
        carried: What its direction turns with: 1 for the child, -1 for the parent, 0 for neither. Forces on what slides
            turn with the parent, along whose axes they are off: only then is the matrix the residuals' derivative.
        normal: Whether it is the moment of a U joint.
        own: Directions, in the axes of the joint where they are carried. Shape (m, 3).
    """

    owner: list[int]
    force: NDArray[np.bool_]
    carried: NDArray[np.intp]
    normal: NDArray[np.bool_]
    own: Array
    names: tuple[str, ...]


def kinds(lay: Layout) -> Kinds:
    """The rows of a layout."""
    cuts, dtype = lay.tree.cuts, lay.path.dtype
    upright, origin = [np.eye(3, dtype=dtype)[None]] * len(cuts), [np.zeros((1, 3), dtype=dtype)] * len(cuts)
    found = reaction_components(cuts, upright, upright, origin)
    owner, own = list(found.joints), (found.force + found.moment)[0].astype(dtype)
    each = [(unit == "N", cuts[c].kind) for unit, c in zip(found.units, owner, strict=True)]
    carried = [(-1 if force else 1) if kind in "PC" else int(kind == "R" and not force) for force, kind in each]
    for row in np.flatnonzero(carried):
        own[row] = cuts[owner[row]].child_frame.R.T @ own[row]
    force, normal = ([*flags] for flags in ((f for f, _ in each), (not f and k == "U" for f, k in each)))
    return Kinds(owner, np.array(force, bool), np.array(carried, np.intp), np.array(normal, bool), own, found.names)
