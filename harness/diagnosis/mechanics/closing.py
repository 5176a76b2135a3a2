"""How far the closures of a tree are from closed, and what they leave of its velocities."""

from __future__ import annotations

import numpy as np

from screwgauge.diagnosis.mechanics.tree import Motion, Tree, move
from screwgauge.diagnosis.mechanics.tree import home as at_home
from screwgauge.models.readings.reading import ClosureReading
from screwgauge.reference.rotations import Array, cross, rotation_vector


def gaps(tree: Tree, motion: Motion) -> dict[str, Array]:
    """Second frame of each closure against the first, world axes: of a weld the rotation vector, then the way [rad, m].

    Returns:
        Closure -> shape (n, 3) of points, (n, 6) of welds.
    """
    out = {}
    for name, closure in tree.reading.closures.items():
        (R1, p1), (R2, p2) = frames(tree, motion, closure)
        way = p2 - p1
        turn = [] if closure.kind == "point" else [rotation_vector(R2 @ np.swapaxes(R1, 1, 2))]
        out[name] = np.concatenate([*turn, way], axis=1)
    return out


def residual_at_home(tree: Tree) -> dict[str, float]:
    """Largest entry of each closure's gap at home [m, or rad of a welded turn]."""
    motion = move(tree, at_home(tree.reading))
    return {name: float(np.abs(gap).max()) for name, gap in gaps(tree, motion).items()}


def constraint_rows(tree: Tree, motion: Motion) -> dict[str, Array]:
    """Relative velocity of the second frame of each closure at its origin, world axes, at unit velocities.

    Returns:
        Closure -> shape (n, 3, n_freedom) of points, (n, 6, n_freedom) of welds.
    """
    out = {}
    for name, closure in tree.reading.closures.items():
        rows = np.zeros((*motion.screws.shape[:2], 6))
        for sign, body, (_, p) in zip(
            (-1.0, 1.0), (closure.first, closure.second), frames(tree, motion, closure), strict=True
        ):
            if body not in tree.reading.bodies:
                continue
            moves = tree.moves[list(tree.reading.bodies).index(body)]
            w, v = motion.screws[..., :3], motion.screws[..., 3:]
            rows += sign * moves[:, None] * np.concatenate([w, v + cross(w, np.broadcast_to(p[:, None], w.shape))], -1)
        out[name] = np.swapaxes(rows[..., 3:] if closure.kind == "point" else rows, 1, 2)
    return out


def frames(tree: Tree, motion: Motion, closure: ClosureReading) -> list[tuple[Array, Array]]:
    """Frames that a closure joins, in the world. Shapes (n, 3, 3), (n, 3)."""
    found, names = [], list(tree.reading.bodies)
    for body, frame in ((closure.first, closure.first_frame), (closure.second, closure.second_frame)):
        if body in tree.reading.bodies:
            i = names.index(body)
            R = motion.R[:, i]
            found.append((R @ frame[:3, :3], (R @ frame[:3, 3]) + motion.p[:, i]))
        else:
            n = len(motion.R)
            found.append((np.broadcast_to(frame[:3, :3], (n, 3, 3)), np.broadcast_to(frame[:3, 3], (n, 3))))
    return found
