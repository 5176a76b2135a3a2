"""Motion and forces of a closed mechanism at n samples, as float arrays, with singularity checks.

The package `equations` has the equations; the package `closed` computes the closed poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.applied import Applied, PointSpring
from screwgauge.reference.closed.assembly_mode import BranchPose
from screwgauge.reference.closed.loops import home_equations, loop_equations
from screwgauge.reference.equations.applied_forces import check_applied, distance
from screwgauge.reference.equations.closure import Loops
from screwgauge.reference.equations.forward import Forward
from screwgauge.reference.equations.kinematics import coordinates
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.equations.rounding import chart_conditions
from screwgauge.reference.equations.screws import Array
from screwgauge.reference.errors import ClosureError, DescriptionError, SingularPoseError
from screwgauge.reference.graph import Layout

#: Distance from home to the nearby pose [rad or mechanism lengths].
ASIDE = 0.05


class ClosedMotion(Forward):
    """A closed mechanism at n samples of a motion, in floating point; each quantity is computed on first access.

    A joint that closes a loop keeps the given coordinates; in gimbal lock, its rates are NaN.
    """

    def __init__(
        self, loops: Loops, q: Array, yd: Array, ydd: Array | None = None, applied: Applied | None = None, t: Any = 0.0
    ) -> None:
        """See `motion_at`."""
        super().__init__(loops, coordinates(q, NUMPY), yd, ydd, loops.folds(q), NUMPY, applied or Applied())
        self.t = t

    @property
    def condition(self) -> Array:
        """Condition number of the closed loops with respect to the independent coordinates. Shape (n,)."""
        return np.asarray(self.system.condition)

    @cached_property
    def charts(self) -> Array:
        """Condition number of the angles of each cut joint; infinite in gimbal lock. Shape (n, n_cut)."""
        return chart_conditions(self)

    @property
    def joint_position(self) -> Array:
        """Given coordinates of all joints. Shape (n, n_q)."""
        return self.q

    @cached_property
    def screws(self) -> Array:
        """Unit screws of all joints; NaN for a cut joint in gimbal lock. Shape (n, n_q, 6)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return super().screws

    def _with_cuts(self, tree: Array, of_cut: Any) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            joined = super()._with_cuts(tree, of_cut)
        for joint, chart in zip(self.loops.cuts, self.charts.T, strict=True):
            joined[np.ix_(~(chart <= linear.SINGULAR), self.loops.lay.columns[joint.name])] = np.nan
        return joined

    @cached_property
    def response(self) -> Array:
        """Second derivatives of the independent coordinates under all forces. Shape (n, k).

        The equations are projected onto the motion and do not contain reactions; therefore, undetermined reactions of
        redundant constraints do not matter.

        Raises:
            SingularPoseError: See `check`.
        """
        self.check()
        return super().response

    def check(self) -> None:
        """Reject poses at which forces do not determine the accelerations.

        Raises:
            SingularPoseError: The independent coordinates do not determine the motion, a combination of them does not
                move any mass, or the points of a spring coincide.
        """
        self._check_poses()
        if self.idle:
            self._check_idle()
        else:
            self._check_inertia()
        self.check_springs()

    def _check_poses(self) -> None:
        bad, mechanism = np.flatnonzero(~(self.condition < linear.SINGULAR)), self.mechanism
        if bad.size:
            raise SingularPoseError(
                "the independent coordinates do not determine the motion there "
                f"(condition number {self.condition[bad[0]]:.2g})",
                f"{mechanism.name} at {mechanism.pose_text(self.q[bad[0], mechanism.independent_columns], 9)}",
                "choose other coordinates or step over the pose",
            )

    def _check_inertia(self) -> None:
        """Reject a singular mass matrix; scale it to a unit diagonal, because coordinates may be in rad and m."""
        mechanism, d = self.mechanism, self._sizes
        for j, label in enumerate(mechanism.independent):
            if not (d[:, j] > 0.0).all():
                what = f"the coordinate '{label}' moves no mass"
                raise SingularPoseError(what, mechanism.name, "give its bodies inertia")
        if not (self._masses.condition < linear.SINGULAR).all():
            what = "some combination of the independent coordinates moves no mass"
            raise SingularPoseError(what, mechanism.name, "give the bodies inertia")

    def _check_idle(self) -> None:
        """Reject a motion that is not determined by driven coordinates and forces on the remaining coordinates."""
        steered, moved = self.steering.condition, self.idle_reluctance
        unmoved = "the forces do not determine the accelerations of coordinates without an actuator"
        for condition, what in (
            (steered, "the actuators do not drive all coordinates that have a given motion"),
            (moved, unmoved),
        ):
            if (bad := np.flatnonzero(~(condition < linear.SINGULAR))).size:
                where = self.mechanism.pose_text(self.q[bad[0], self.mechanism.independent_columns], 9)
                remedy = "keep the motion away from that pose"
                raise SingularPoseError(f"{what} (condition number {condition[bad[0]]:.2g})", where, remedy)

    def check_springs(self) -> None:
        """Reject poses at which the two points of a spring coincide."""
        for spring in self.applied.springs:
            if isinstance(spring, PointSpring) and not np.all(distance(self, spring) > 0.0):
                raise spring.no_direction()


def driven_at_home(lay: Layout, among: Sequence[int] = ()) -> list[int]:
    """Choose independent coordinates that actuators drive at home; actuated coordinates come first.

    If actuators drive fewer coordinates at home than at a pose near home, the latter pose is used.

    Args:
        among: Candidates; by default, all independent coordinates.
    """
    mechanism, k = lay.mechanism, len(lay.mechanism.independent)
    if "driven" not in lay.kept:
        lay.kept["driven"] = _rates_near_home(lay)
    rows, driven = lay.kept["driven"], list[int]()
    own = [column in mechanism.actuated_columns for column in mechanism.independent_columns]
    for i in sorted(among or range(k), key=lambda i: not own[i]):
        if linear.rank(rows[:, [*driven, i]]) > len(driven):
            driven.append(i)
    return driven


def _rates_near_home(lay: Layout) -> Array:
    """Return actuator rates per unit rate of each independent coordinate, see `driven_at_home`. Shape (n_act, k)."""
    mechanism, k = lay.mechanism, len(lay.mechanism.independent)
    most: Array = motion_at(lay, mechanism.home[None], np.zeros((1, k))).rates_of_actuators[0]
    if linear.rank(most) < min(most.shape):
        branch, columns = BranchPose(lay, mechanism.home), mechanism.independent_columns
        with suppress(ClosureError):
            branch.move(
                mechanism.home[columns] + ASIDE * branch.system.sizes[columns] * np.cos(1.0 + 1.7 * np.arange(k))
            )
            beside = motion_at(lay, branch.q[None], np.zeros((1, k))).rates_of_actuators[0]
            most = beside if linear.rank(beside) > linear.rank(most) else most
    return most


def motion_at(
    lay: Layout,
    q: Array,
    yd: Array,
    ydd: Array | None = None,
    applied: Applied | None = None,
    t: Any = 0.0,
    *,
    actuators: Array | None = None,
    joints: Array | None = None,
) -> ClosedMotion:
    """Build the motion of a mechanism at closed poses under applied forces.

    Args:
        q: All joint coordinates of closed poses, e.g. from `assembly_mode.positions` [rad or m]. Shape (n, n_q).
        yd, ydd: First and second derivatives of the independent coordinates, shape (n, k); if `ydd` is None, the second
            derivatives follow from the forces.
        applied: Applied forces; by default, only gravity.
        t: Times at which motors are evaluated [s]. Shape (n,), or a single time.
        actuators, joints: Given actuator forces, and forces along all joint coordinates, in addition to the applied
            forces [N or N m]. Shapes (n_actuator,) or (n, n_actuator), (n_q,) or (n, n_q).

    Raises:
        DescriptionError: An array of forces has the wrong shape.
        UnknownNameError: A spring refers to a body or coordinate that does not exist.
    """
    system = home_equations(lay)
    if not (q[:, system.fixed] == lay.mechanism.home[system.fixed]).all():
        system = loop_equations(lay)  # resting coordinates are fixed only on the home branch
    check_applied(lay.mechanism, applied or Applied())
    at = ClosedMotion(system, q, yd, ydd, applied, t)
    given = (
        ("actuator forces", actuators, lay.mechanism.actuated_columns),
        ("joint forces", joints, list(range(q.shape[1]))),
    )
    for what, values, columns in given:
        if values is not None:
            at.given_forces = np.zeros(q.shape) if at.given_forces is None else at.given_forces
            at.given_forces[:, columns] += _check_shape(what, values, len(q), len(columns), lay.mechanism.name)
    return at


def _check_shape(what: str, values: Array, n: int, m: int, where: str) -> Array:
    if np.shape(values) in ((m,), (n, m)):
        return values
    raise DescriptionError(
        f"{what} of shape {np.shape(values)} do not fit {m} coordinates at {n} poses",
        where,
        f"pass an array of shape ({m},) or ({n}, {m})",
    )
