"""Closed poses for samples in any order: a region around the home pose, covered by anchors that spread from there.

Samples that are not reached or lie under two sheets are flagged. Poses do not depend on earlier calls, but
the set of reached samples may. `continuation` follows motions, whose samples are in order.
"""

from __future__ import annotations

import numpy as np

from screwgauge.reference.closed.anchors import FARTHEST, Flags, Indices
from screwgauge.reference.closed.continuation import Continuation, Poses
from screwgauge.reference.closed.walk import MOST, Blocked
from screwgauge.reference.rotations import TURN, Array, within_half_turn

#: Largest number of anchors to add in one call, and number of paths to try to each sample.
LARGEST, PATIENCE = 2000, 3
#: Multiple of home's beta above which poses are not explored, because they are near singular poses.
STEEP = 1e3


class Region(Continuation):
    """Closed poses of one assembly mode for samples in any order."""

    def reach(self, y: Array) -> tuple[Poses, Flags, Flags]:
        """Predict samples in any order from anchors of home's sheet, which spread until every sample lies in a ball.

        Args:
            y: Independent coordinates [rad or m]. Shape (n, k).

        Returns:
            Predictions; flags of samples that cannot be reached with at most `LARGEST` additional anchors, or without
            passing near a singular pose; and flags of samples that also lie under a different sheet, so that
            y alone does not determine the pose. Shape (n,) each.
        """
        y = y / self.size
        self._look_for_turns(y)
        anchor, self.floor = self._spread(y), np.inf
        return self._of_region(y, np.maximum(anchor, 0)), anchor < 0, self._flag_covered_twice(y, anchor)

    def _spread(self, y: Array) -> Indices:
        """Assign samples to anchors of home's sheet, adding anchors as needed; return -1 for samples out of reach."""
        anchors, self.floor = self.anchors, STEEP * self.anchors[0].beta
        most = len(anchors) + LARGEST  # independent of earlier calls
        covering, inside = anchors.cover(y, 0)
        rows = np.flatnonzero(~inside)
        near, tries = covering[rows], np.zeros(len(rows), dtype=int)
        far = anchors.distance(y[rows], near)
        while rows.size and len(anchors) < most:
            i, first = int(np.argmin(far)), len(anchors)
            reached = self._try(y[rows[i]], int(near[i]), int(tries[i]))
            if reached is not None:
                near[i], far[i] = reached, 0.0
            else:
                tries[i], far[i] = tries[i] + 1, max(4.0 * far[i], 1e3)
            home = anchors.sheet_of(0)
            for a in home[home >= first].tolist():
                distance = anchors.distance(y[rows], np.full(len(rows), a))
                closer = distance < far
                near[closer], far[closer] = a, distance[closer]
            covering[rows] = near
            rest = (far > 1.0) & (tries < PATIENCE)
            covering[rows[(far > 1.0) & ~rest]] = -1
            rows, near, far, tries = rows[rest], near[rest], far[rest], tries[rest]
        covering[rows] = -1
        return covering

    def _try(self, y: Array, nearest: int, i: int) -> int | None:
        """Try to reach y in home's sheet; start at the nearest anchor (i = 0), at home (1) or at another anchor (2)."""
        first = len(self.anchors)
        self.at, self.left = (nearest, 0, self._anchor_nearby(y, 3))[i], MOST
        try:
            self._walk(y)
            reached: int | None = self.at
        except Blocked:
            reached = None
        self._keep_straight(first)
        return None if reached is None or self.anchors.table["sheet"][reached] else reached

    def _flag_covered_twice(self, y: Array, anchor: Indices) -> Flags:
        """Flag reached samples that also lie in balls of a different sheet. Shape (n,)."""
        anchors, twice = self.anchors, np.zeros(len(y), dtype=bool)
        for sheet in range(1, anchors.sheets):
            if anchors.sheet_of(sheet).size:
                other, inside = anchors.cover(y, sheet)
                for i in np.flatnonzero(inside & (anchor >= 0)).tolist():
                    twice[i] |= not anchors.on_one_branch(int(anchor[i]), int(other[i]))
        return twice

    def _keep_straight(self, first: int) -> None:
        """Remove anchors numbered `first` or higher from home's sheet if the straight path from home misses them.

        Around a cusp, two paths lead to two poses; the choice between them must not depend on earlier calls.
        """
        anchors = self.anchors
        for a in [a for a in range(first, len(anchors)) if not anchors.table["sheet"][a]]:
            self.at, self.left = 0, MOST
            try:
                self._walk(anchors[a].y)
                led = self.at == a or anchors.on_one_branch(self.at, a)
            except Blocked:
                led = False
            if not led:
                anchors.move(a, 1)

    def _anchor_nearby(self, y: Array, i: int) -> int:
        """Return the i-th nearest anchor of home's sheet; i = 0 is the nearest."""
        kin = self.anchors.sheet_of(0)
        order = np.argsort(np.linalg.norm(self.anchors.difference(y, self.anchors.table["y"][kin]), axis=1))
        return int(kin[order[min(i, len(kin) - 1)]])

    def _of_region(self, y: Array, anchor: Indices) -> Poses:
        """Return predictions whose angles depend on y alone.

        With several independent coordinates, each angle is within half a turn of the value expected from y; with a
        single independent coordinate, each angle is continued from home.
        """
        anchors, table = self.anchors, self.anchors.table[: len(self.anchors)]
        z, home = anchors.predict(y, anchor), self.anchors[0]
        if self.loops:
            turned = np.rint((y - table["y"][anchor]) / TURN) * anchors.turning
            z += TURN * turned @ self.windings
        if y.shape[1] > 1:
            lag = np.abs(table["z"] - home.z - (table["y"] - home.y) @ self.windings)[:, anchors.angles]
            if lag.max(initial=0.0) > np.pi - FARTHEST:  # within a ball, no unknown moves farther
                expected = home.z + (y - home.y) @ self.windings
                z = np.where(anchors.angles, expected + within_half_turn(z - expected), z)
        return Poses(np.arange(float(len(y))), y, z, anchor, anchor, self)
