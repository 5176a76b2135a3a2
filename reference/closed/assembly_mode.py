"""Computes closed poses in one assembly mode: along a motion, for samples in any order, or stepwise along a branch.

`AssemblyMode` starts at the home pose and follows motions (`Continuation`) or reaches samples in any order (`Region`);
`BranchPose` continues from the last closed pose, wherever it is; `positions` is a shortcut for a single motion.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from screwgauge.reference.closed.anchors import Flags
from screwgauge.reference.closed.continuation import REMEDY, Continuation, Poses, no_further
from screwgauge.reference.closed.loops import follow_cut_joints, home_equations, loop_equations, read
from screwgauge.reference.closed.newton import OPEN, Motion, Rates, newton
from screwgauge.reference.closed.region import Region
from screwgauge.reference.equations.closed_form import closed_form
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import TURN, Array


class AssemblyMode:
    """Closed poses in the assembly mode of the home pose.

    Attributes:
        system: Loop equations in which the coordinates that are constant in this mode are fixed.
    """

    def __init__(self, lay: Layout, *, strict: bool = False) -> None:
        """Start at the home pose. With `strict`, every pose is reached along the motion or a straight path, even where
        a closed form exists. By default, samples that do not form a motion may be reached along other paths.
        """
        self.lay, self.system, self.columns = lay, home_equations(lay), lay.mechanism.independent_columns
        self.unit, self.strict = self.system.sizes[self.columns], strict
        self.near = lay.mechanism.home[None]
        """Joint coordinates of the anchors that were visited last, in order. Shape (v, n_q)."""

    @cached_property
    def continuation(self) -> Continuation:
        """Continuation along motions, which keeps the anchors of earlier motions."""
        return self.system.walk(Continuation, strict=self.strict)

    @cached_property
    def region(self) -> Region:
        """Region that reaches samples in any order; its poses depend on y alone, because motions do not extend it."""
        return self.system.walk(Region)

    def predict(self, y: Array, t: Array, rates: Rates | None = None, drive: Motion | None = None) -> Poses:
        """Predict the samples of a motion that continues from earlier samples.

        Args:
            y: Independent coordinates [rad or m]. Shape (n, k).
            t: Times [s]. Shape (n,).
            rates, drive: Derivatives of y, and the motion between these times, see `Continuation.predict`.

        Raises:
            ClosureError: A loop cannot close, or every path crosses a singular pose.
        """
        if (poses := self.in_closed_form(y)) is not None:
            return poses
        poses = self.continuation.predict(y, t, rates, drive)
        self.near = self._follow_anchors(self.continuation.path, self.near[-1])
        return replace(poses, near=self.near)

    def reach(self, y: Array) -> tuple[Poses, Flags, Flags]:
        """Predict samples in any order; see `Region.reach`. Shape (n, k)."""
        if (poses := self.in_closed_form(y)) is not None:
            none = np.zeros(len(y), dtype=bool)
            return poses, none, none
        return self.region.reach(y)

    def restart(self) -> None:
        """Start the next motion at the home pose."""
        self.near = self.lay.mechanism.home[None]
        if "continuation" in vars(self):  # a motion is in progress
            self.continuation.restart()

    def avoid_singular(self, multiple: float) -> None:
        """End every path at the first pose at which |J^-1| exceeds a multiple of its value at home."""
        self.continuation.floor = multiple * self.continuation.anchors[0].beta

    def in_closed_form(self, y: Array) -> Poses | None:
        """Compute poses of open trees, and of legs that have a closed form in this mode; otherwise return None."""
        q, system, rows = self._in_closed_form(y), self.system, np.arange(len(y))
        if q is None:
            return None
        return Poses(rows.astype(float), y / self.unit, system.unknowns(q), rows, rows, near=q)

    def _in_closed_form(self, y: Array) -> Array | None:
        if len(self.system.unknown) == len(self.columns) and not self.lay.cuts:
            q = np.tile(self.lay.mechanism.home, (len(y), 1))
            q[:, self.columns] = y
            return q
        return None if self.strict else closed_form_positions(self.lay, y, self.system.fixed)

    def joints(self, poses: Poses) -> Array:
        """Return predicted joint coordinates [rad or m]; cut joints are near the intended angles. Shape (n, n_q)."""
        near = self._turn_home(poses.y) if poses.near is None else poses.near[poses.visit]
        near[:, self.columns] = poses.y * self.unit  # including given full turns
        return self.system.tree(poses.z, near)

    def rows(self, poses: Poses, columns: Sequence[int]) -> Array:
        """Return predicted tree coordinates, one row per given column [rad or m]. Shape (len(columns), n)."""
        places = [self.system.unknown.index(c) for c in columns]
        return np.ascontiguousarray(poses.z[:, places].T) * self.system.sizes[[*columns], None]

    def _turn_home(self, y: Array) -> Array:
        """Return home coordinates, shifted by the full turns that y implies. Shape (n, k) -> (n, n_q)."""
        home = self.lay.mechanism.home
        near = np.tile(home, (len(y), 1))
        for i, path in self.region.loops.items():
            winding = np.rint((self._follow_anchors(path, home)[-1] - home) / TURN) * self.lay.turns
            near += (y[:, i, None] - home[self.columns[i]]) * winding
        return near

    def _follow_anchors(self, z: Array, near: Array) -> Array:
        """Return joint coordinates of the anchors on a path starting near the pose `near`. Shapes (v, n_z), (n_q,)."""
        q = self.system.tree(z, np.tile(near, (len(z), 1)))
        return follow_cut_joints(self.lay, q, near)

    def refine(self, poses: Poses) -> Poses:
        """Improve poor predictions, see `Continuation.refine`."""
        return poses if poses.path is None else poses.path.refine(poses)

    def follow(self, poses: Poses) -> tuple[Array, ...]:
        """Compute the closed poses near the predictions; return the dimensionless result of `newton`.

        Raises:
            ClosureError: A loop cannot be closed.
        """
        if poses.path is not None:
            return poses.path.close(poses)
        solution = newton(self.system.evaluate, poses.z, poses.y)
        if not (solution[2] < OPEN).all():
            raise ClosureError("the closed form leaves loops open", self.lay.mechanism.name, "check the geometry")
        return solution

    def close(self, poses: Poses) -> Array:
        """Return joint coordinates of the closed poses near the predictions. Shape (n, n_q)."""
        return self.system.coordinates(self.follow(poses)[0], self.joints(poses))

    def motion(self, y: Array, t: Array, rates: Rates | None = None, drive: Motion | None = None) -> Array:
        """Return joint coordinates of the samples of a motion, see `predict`. Shape (n, n_q)."""
        return self.close(self.predict(y, t, rates, drive))


STEP, SMALLEST = 0.1, 1e-5  # steps of independent coordinates [rad or mechanism lengths]
#: Largest distance of a closed pose from its prediction, relative to the predicted step; other branches are farther.
BEND = 0.3
#: Largest number of steps for a short path; a path that needs more steps ends at a pose that it cannot pass.
MOST = 40


class BranchPose:
    """A pose that moves along its branch; each step is predicted with the velocity map dq/dy.

    A step may pass over a singular pose; the prediction continues straight ahead, even if a branch bends away there.
    """

    def __init__(self, lay: Layout, q: Array) -> None:
        """Start at joint coordinates `q`, shape (n_q,), that nearly close the loops."""
        self.lay = lay
        self.columns = lay.mechanism.independent_columns
        self.system = home_equations(lay)
        if np.abs(q - lay.mechanism.home)[self.system.fixed].max(initial=0.0) > OPEN:
            self.system = loop_equations(lay)  # not on the branch of the home pose
        self.is_tree = not lay.cuts and len(self.columns) == len(q)
        self.q, self.y = q.copy(), q[self.columns]
        self.K = np.zeros((len(q), len(self.columns)))
        if not self.is_tree and not self._try(q, self.y):
            where = f"start of {lay.mechanism.name}"
            raise ClosureError("the loops do not close there", where, "correct the coordinates")

    def _try(self, predicted: Array, goal: Array, bend: float = np.inf) -> bool:
        """Run Newton's method from a prediction; keep the pose if the loops close near the prediction."""
        corrected = self.system.correct(predicted, goal)
        if corrected is None or self._largest_change(corrected[0] - predicted) > bend:
            return False
        (self.q, self.K), self.y = corrected, goal.copy()
        return True

    def _largest_change(self, way: Array) -> float:
        """Return the largest dimensionless change of an unknown, given changes of joint coordinates, shape (n_q,)."""
        return float(np.abs(self.system.unknowns(way)).max())

    def set_pose(self, q: Array) -> None:
        """Set the pose to joint coordinates `q`, shape (n_q,), at which the loops are closed."""
        if self.is_tree or not self._try(q, q[self.columns]):
            self.q, self.y = q, q[self.columns]

    def move(self, y: Array) -> None:
        """Move the pose to independent coordinates `y`, shape (k,), in steps of at most `STEP`.

        Raises:
            ClosureError: The loops cannot close along the path.
        """
        if self.is_tree:
            self.q[self.columns] = self.y = y.copy()
            return
        largest, unit = STEP, self.system.sizes[self.columns]
        for _ in range(MOST + int(4.0 * float(np.abs((y - self.y) / unit).max()) / STEP)):
            way = y - self.y
            length = float(np.abs(way / unit).max())
            if length == 0.0:
                return
            way *= min(1.0, largest / length)
            step = self.K @ way
            goal = y if largest >= length else self.y + way
            if self._try(self.q + step, goal, BEND * self._largest_change(step) + 1e-9):
                continue
            largest = 0.5 * min(largest, length)
            if largest < SMALLEST:
                break
        raise ClosureError(no_further(self.y), self.lay.mechanism.name, REMEDY)

    def joints(self, y: Array) -> Array:
        """Compute closed poses for successive independent coordinates. Shape (n, k) -> (n, n_q)."""
        q = np.empty((len(y), len(self.q)))
        if self.is_tree:
            q[:, self.columns] = y
            return q
        for row, goal in zip(q, y, strict=True):
            self.move(goal)
            row[:] = self.q
        return q


def positions(lay: Layout, y: Array, t: Array, rates: Rates | None = None) -> Array:
    """Compute joint coordinates in the assembly mode of the home pose, see `AssemblyMode.motion`.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).
        t: Times [s]. Shape (n,).
        rates: Derivatives of y, used to follow the motion between samples. Shape (n, k) each.

    Returns:
        Coordinates of all joints [rad or m]. Shape (n, n_q).

    Raises:
        ClosureError: A loop cannot close, or every path crosses a singular pose.
    """
    return AssemblyMode(lay).motion(y, t, rates)


def closed_form_positions(lay: Layout, y: Array, fixed: Collection[int] | None = None) -> Array | None:
    """Return joint coordinates computed with `equations.closed_form`, or None if it fails. Shape (n, k) -> (n, n_q)."""
    coordinates = closed_form(lay, y, NUMPY, fixed)
    return None if coordinates is None else read(lay, coordinates.q, near=False)
