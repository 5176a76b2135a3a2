"""Positions, velocities and accelerations of all joints and bodies (sections 3 and 4 of the paper).

The loops of any graph stand for the chains of the paper: ``G w = 0`` says for every loop what ``S w = V``
(eq. 15) says for two chains that carry the same body.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference import linear, screws
from screwgauge.reference.closed.assembly_mode import AssemblyMode, Rates
from screwgauge.reference.closed.constant_coordinates import home_equations
from screwgauge.reference.closed.cut_coordinates import read
from screwgauge.reference.closed.loops import LoopEquations, loop_equations
from screwgauge.reference.equations import closed_form as forms
from screwgauge.reference.equations.kinematics import Bracket, coordinates
from screwgauge.reference.equations.motion import Motion
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.layout import Layout
from screwgauge.reference.pose import Pose, constraint_matrix, pose
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Velocities:
    """Velocities of a closed mechanism.

    Attributes:
        pose: The pose they belong to.
        K: Velocity map, dq/dy. Shape (n, n_q, n_independent).
        A: The equations that were solved, without dimension, see `LoopEquations.matrix`. Shape (n, m + k, n_unknown).
        w: Joint velocities [rad/s or m/s]. Shape (n, n_q).
        V: Twist of each body at O, eq. (4). Shape (n, n_body + 1, 6).
        system: Whose equations these are.
        orientation: Condition number of the orientation coordinates of each cut joint. Shape (n, n_cut).
    """

    pose: Pose
    K: Array
    A: Array
    w: Array
    V: Array
    system: LoopEquations
    orientation: Array

    def rows(self, rows: NDArray[np.intp]) -> Velocities:
        """The same for some of the samples."""
        arrays = self.K[rows], self.A[rows], self.w[rows], self.V[rows]
        return Velocities(self.pose.rows(rows), *arrays, self.system, self.orientation[rows])


def closure_system(lay: Layout, at: Pose) -> Array:
    """What must vanish over the selection of y: ``[G; E] w = [0; yd]``. Shape (n, 6 n_cut + n_coupling + k, n_q)."""
    selection = np.eye(at.q.shape[1], dtype=at.q.dtype)[lay.mechanism.independent_columns]
    E = np.broadcast_to(selection, (len(at.q), *selection.shape))
    return np.concatenate([constraint_matrix(lay, at), E], axis=1)


def positions(lay: Layout, y: Array, t: Array, rates: Rates | None = None) -> Pose:
    """Poses on the assembly mode of home, see `AssemblyMode.motion`.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).
        t: Times [s]. Shape (n,).
        rates: Derivatives. Shape (n, k) each.
    """
    return pose(lay, AssemblyMode(lay).motion(y, t, rates))


def closed_form(lay: Layout, y: Array, fixed: Collection[int] | None = None) -> Array | None:
    """Joint coordinates in closed form, if there is one, see `equations.closed_form`. Shape (n, k) -> (n, n_q)."""
    found = forms.closed_form(lay, y, NUMPY, fixed)
    return None if found is None else read(lay, found.q, near=False)


def _system(lay: Layout, at: Pose) -> LoopEquations:
    """The loop equations at poses; what never moves on the home branch is fixed only on that branch."""
    system = home_equations(lay)
    fixed = list(system.fixed)
    return system if (at.q[:, fixed] == lay.mechanism.home[fixed]).all() else loop_equations(lay)


def _motion(system: LoopEquations, q: Array, yd: Array, ydd: Array) -> Motion:
    return Motion(system.loops, coordinates(q, NUMPY), yd, ydd, system.loops.folds(q), NUMPY)


def velocities(lay: Layout, at: Pose, yd: Array) -> Velocities:
    """Velocities from the closed loops and those given of y. `yd`: shape (n, k) [rad/s or m/s].

    In gimbal lock those of a cut joint are not numbers.
    """
    system = _system(lay, at)
    motion, charts = _motion(system, at.q, yd, 0.0 * yd), system.chart_conditions(at.q)
    with np.errstate(divide="ignore", invalid="ignore"):
        K, w = motion.joint_map, motion.joint_velocity
    for cut, locked in zip(motion.cuts, ~(charts.T <= linear.SINGULAR), strict=True):
        some = np.ix_(locked, lay.columns[cut.at.joint.name])
        w[some], K[some] = np.nan, np.nan
    return Velocities(at, K, system.matrix_of(motion), w, motion.V, system, charts)


def lie_matrix(S: Array) -> Array:
    """Brackets of all pairs of screws, eq. (48): entry (i, j) is [S_i, S_j] for i < j, else zero.

    Args:
        S: Screw matrix. Shape (n, 6, m).

    Returns:
        Shape (n, m, m, 6).
    """
    columns = S.swapaxes(1, 2)
    i, j = np.triu_indices(columns.shape[1], 1)
    S_L = np.zeros((len(S), columns.shape[1], columns.shape[1], 6))
    S_L[:, i, j] = screws.lie_bracket(columns[:, i], columns[:, j])
    return S_L


def chain_acceleration(S: Array, w: Array, beta: Array) -> Array:
    """Acceleration screw of the end of a serial chain, eq. (44): ``S beta + w^T S_L w``. Shape (n, 6)."""
    return np.asarray(np.einsum("nxi,ni->nx", S, beta) + np.einsum("ni,nijx,nj->nx", w, lie_matrix(S), w))


def accelerations(lay: Layout, rate: Velocities, ydd: Array, bracket: Bracket | None = None) -> tuple[Array, Array]:
    """Joint accelerations and acceleration screws of all bodies, eqs. (44), (48).

    Args:
        rate: Velocities of the closed mechanism.
        ydd: Second derivatives of the independent coordinates. Shape (n, k).
        bracket: In place of the Lie bracket, to see what a part of it does.

    Returns:
        Joint accelerations [rad/s^2 or m/s^2], shape (n, n_q), and screws, shape (n, n_body + 1, 6).
    """
    motion = _motion(rate.system, rate.pose.q, (rate.w[:, lay.mechanism.independent_columns]), ydd)
    if bracket is not None:
        motion.bracket = bracket
    with np.errstate(divide="ignore", invalid="ignore"):
        beta = motion.joint_acceleration
    for cut, locked in zip(motion.cuts, ~(rate.orientation.T <= linear.SINGULAR), strict=True):
        beta[np.ix_(locked, lay.columns[cut.at.joint.name])] = np.nan
    return beta, motion.A
