"""The closed pose that follows independent coordinates wherever they go, always on the same branch."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.closed.continuation import REMEDY, no_further
from screwgauge.reference.closed.loops import home_equations, loop_equations
from screwgauge.reference.closed.newton import OPEN
from screwgauge.reference.equations.kinematics import Pose, pose
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import Array

STEP, SMALLEST = 0.1, 1e-5  # of the independent coordinates [rad or lengths of the mechanism]
#: How far the closed pose may lie from its prediction, over the way predicted. Another branch lies farther.
BEND = 0.3
#: Steps that a short way may take; where more are needed, the way ends at a pose that it cannot pass.
MOST = 40


class Branch:
    """Remembers the last closed pose; the next one is predicted from it by the velocity map dq/dy.

    A step may pass over a singular pose: the prediction goes straight on, where the branch that turns off there
    does not.
    """

    def __init__(self, lay: Layout, q: Array) -> None:
        """Starts at joint coordinates `q`, shape (n_q,), that close the loops nearly."""
        self.lay = lay
        self.columns = lay.mechanism.independent_columns
        self.system = home_equations(lay)
        if np.abs(q - lay.mechanism.home)[list(self.system.fixed)].max(initial=0.0) > OPEN:
            self.system = loop_equations(lay)  # another branch than that of the home pose
        self.size = self.system.size
        self.is_tree = not lay.cuts and len(self.columns) == len(q)
        self.q, self.y = q.copy(), q[self.columns]
        self.K = np.zeros((len(q), len(self.columns)))  # without dimension
        if not self.is_tree and not self._try(q, self.y):
            where = f"start of {lay.mechanism.name}"
            raise ClosureError("the loops do not close there", where, "correct the coordinates")

    def _try(self, predicted: Array, goal: Array, bend: float = np.inf) -> bool:
        """Newton's method from a prediction; keeps the pose if it closes and is where it should be."""
        corrected = self.system.correct(predicted / self.size, goal / self.size[self.columns])
        if corrected is None:
            return False
        q, K = corrected
        if np.abs(q - predicted / self.size)[self.system.unknown].max() > bend:
            return False
        self.q, self.y, self.K = q * self.size, goal.copy(), K
        return True

    def put(self, q: Array) -> None:
        """Puts the pose where joint coordinates `q`, shape (n_q,), close the loops already."""
        if self.is_tree or not self._try(q, q[self.columns]):
            self.q, self.y = q, q[self.columns]

    def move(self, y: Array) -> None:
        """Moves the pose to independent coordinates `y`, shape (k,), in steps of at most `STEP`.

        Raises:
            ClosureError: The loops cannot close on the way.
        """
        if self.is_tree:
            self.q[self.columns] = self.y = y.copy()
            return
        largest, unit = STEP, self.size[self.columns]
        for _ in range(MOST + int(4.0 * float(np.abs((y - self.y) / unit).max()) / STEP)):
            way = (y - self.y) / unit
            length = float(np.abs(way).max())
            if length == 0.0:
                return
            way = way * min(1.0, largest / length)
            step = self.K @ way
            goal = y if largest >= length else self.y + way * unit
            if self._try(self.q + step * self.size, goal, BEND * float(np.abs(step[self.system.unknown]).max()) + 1e-9):
                continue
            largest = 0.5 * min(largest, length)
            if largest < SMALLEST:
                break
        raise ClosureError(no_further(self.y), self.lay.mechanism.name, REMEDY)

    def poses(self, y: Array) -> Pose:
        """Closed poses for some independent coordinates in order. Shape (n, k)."""
        q = np.empty((len(y), len(self.q)))
        if self.is_tree:
            q[:, self.columns] = y
            return pose(self.lay, q)
        for row, goal in zip(q, y, strict=True):
            self.move(goal)
            row[:] = self.q
        return pose(self.lay, q)
