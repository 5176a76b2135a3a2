"""Inverse dynamics programs whose inputs include parameters of the mechanism and its applied forces.

Loops are closed with Newton's method from a prediction, even if the mechanism has a closed form, and no coordinate is
assumed to be at rest if placements change. Derivatives are computed through the nodes of a trace at a closed pose; the
implicit function theorem yields the derivatives of the loops, ``dq/dp = -M^-1 dr/dp``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.reference.applied import Applied
from screwgauge.reference.equations.closure import Closed, Loops
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.kinematics import coordinates
from screwgauge.reference.equations.ops import TRACE
from screwgauge.reference.equations.rounding import squares
from screwgauge.reference.graph import Edge, Layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.parameters import applied_with, geometric, mechanism_with
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.derivatives import adjoints
from screwgauge.reference.traced.program import Program, program
from screwgauge.reference.traced.trace import Node, Scalar, Trace
from screwgauge.reference.traced.tracing import dependent

#: Checks of every sample, as dimensionless squares: the first two steps of Newton's method, the last step, the step
#: that would follow, and the residual of all rows.
CHECKS = ("first", "second", "step", "next", "open")
#: Number of Newton steps with a new matrix; further steps reuse the last matrix, which is then accurate enough.
NEWTON = 2
#: Largest number of nodes of a trace: derivatives need several times as many nodes as quantities.
MOST = 1_000_000


@dataclass(frozen=True, slots=True, eq=False)
class ClosedSamples:
    """Closed poses and motion of the nominal machine.

    Attributes:
        t: Times [s]. Shape (n,).
        y, yd, ydd: Independent coordinates and their derivatives. Shape (n, k).
        q: All joint coordinates, which close the loops. Shape (n, n_q).
    """

    t: Array
    y: Array
    yd: Array
    ydd: Array
    q: Array

    def __len__(self) -> int:
        return len(self.q)

    @property
    def given(self) -> Array:
        """y, yd, ydd and time of each sample, the inputs of `Symbols` before the joint coordinates. (n, 3 k + 1)."""
        return np.concatenate([self.y, self.yd, self.ydd, self.t[:, None]], axis=1)


class Symbols:
    """A trace of the equations at poses near the nominal poses, with parameters of the machine as inputs.

    Inputs are y, yd, ydd, time, the dependent coordinates from which Newton's method starts, angles of cut joints,
    which select among equivalent angles, and the parameters.

    Attributes:
        loops: Loops of the symbolic machine; no coordinate is at rest if placements are among the parameters.
        predicted, near: Columns of the dependent coordinates, and of the angles of cut joints.
        at: Motion and forces of the machine after all Newton steps.
    """

    def __init__(
        self,
        loops: Loops,
        applied: Applied,
        nominal: Mapping[str, float],
        anchors: ClosedSamples,
        *,
        steps: int,
        axial: bool = False,
    ) -> None:
        """Trace the equations.

        Args:
            loops: Loops of the nominal machine.
            nominal: Parameters that become inputs, and their nominal values.
            anchors: Samples at which pivots are chosen.
            steps: Number of Newton steps; 0 if the pose is already closed.
        """
        n, self.trace = len(anchors), Trace(MOST)
        self.trace.kept = np.ones(n, dtype=bool)
        if any(map(geometric, nominal)):
            loops = Loops(loops.lay, ())
        self.predicted, mechanism = dependent(loops), loops.lay.mechanism
        self.y, self.yd, self.ydd = (self._inputs(array.T) for array in (anchors.y, anchors.yd, anchors.ydd))
        (self.t,) = self._inputs(anchors.t[None])
        self.near = [c for c in loops.owner if loops.lay.turns[c]]
        self.start, near = (self._inputs(anchors.q[:, columns].T) for columns in (self.predicted, self.near))
        self.numbers = self._inputs(
            np.full((len(nominal), n), [[x] for x in nominal.values()]).reshape(len(nominal), n)
        )
        values = dict(zip(nominal, self.numbers, strict=True))
        loads = tuple(load.at(self.t, TRACE.cos, TRACE.sin) for load in applied.loads)
        acting = applied_with(replace(applied, loads=loads), values, symbolic=True)
        self.loops = _of_symbols(loops, mechanism_with(mechanism, values, symbolic=True))
        self.folds = [float(x.flat[0]) for x in loops.folds(anchors.q)]
        self.steps = list[Array]()
        q = mechanism.home.astype(object)
        q[self.predicted], q[loops.y_columns] = self.start, self.y
        solver: Closed | None = None
        for step in range(steps if self.predicted else 0):
            at = Closed(self.loops, coordinates(q, TRACE), self.folds, TRACE)
            solver = solver if solver is not None and step >= NEWTON else at
            self.steps.append(at.spread(solver.system.solve(-at.residual(self.y))))
            q = q + self.steps[-1]
        self.at = Dynamics(self.loops, coordinates(q, TRACE), self.yd, self.ydd, self.folds, TRACE, acting)
        self.at.near, self.at.axial, self.at.t = dict(zip(self.near, near, strict=True)), axial, self.t

    def _inputs(self, rows: Array) -> Array:
        return np.array([self.trace.input(np.ascontiguousarray(row)) for row in rows], dtype=object)

    @property
    def reached(self) -> list[Scalar]:
        """Dependent coordinates after all steps."""
        return [self.at.q[c] for c in self.predicted]

    def checks(self) -> list[Scalar]:
        """Return the checks of the Newton steps, see `CHECKS`."""
        if not self.predicted:
            return [0.0] * len(CHECKS)
        loops, residual = self.loops, self.at.residual(self.y)
        moving = loops.columns[: loops.moving]
        following = self.at.spread(self.at.system.solve(-residual))
        steps = [*self.steps[:2], *self.steps[-1:], following]
        sizes = [squares(step[moving], loops.sizes[moving]) for step in steps]
        return [*[0.0] * (len(CHECKS) - 1 - len(sizes)), *sizes, squares(residual, loops.unit)]

    def program(self, outputs: Sequence[Scalar]) -> Program:
        return program(len(self.trace.inputs), outputs)


def _of_symbols(loops: Loops, mechanism: Mechanism) -> Loops:
    """Copy the loops for a mechanism with different parameters; keep the nominal mechanism's length scale and units."""
    joints, lay = {joint.name: joint for joint in mechanism.joints}, loops.lay
    edges = tuple(Edge(joints[edge.joint.name], edge.near) for edge in lay.edges)
    other = Layout(mechanism, edges, tuple(joints[joint.name] for joint in lay.cuts))
    vars(other).update(path=lay.path, loop=lay.loop, columns=lay.columns, turns=lay.turns)
    made = copy(loops)
    made.lay, made.cuts = other, other.cuts
    return made


def residual_slopes(symbols: Symbols) -> Program:
    """Differentiate loop residuals with respect to the parameters, at a closed pose (`Symbols` without steps).

    Returns:
        A program whose outputs are the slopes, residual by residual.
    """
    slopes, numbers = list[Scalar](), [*symbols.numbers]
    for row in symbols.at.residual(symbols.y):
        slopes += adjoints([(row, 1.0)], numbers) if isinstance(row, Node) else [0.0] * len(numbers)
    return symbols.program(slopes)


def gradient(symbols: Symbols, values: Sequence[Scalar], weights: Sequence[Scalar]) -> list[Scalar]:
    """Differentiate a weighted sum of quantities with respect to the parameters, with loops kept closed.

    By the implicit function theorem, ``dr/dq dq/dp = -dr/dp``; therefore, one solution of the transposed loop
    equations, with the known factors, accounts for the change in q.

    Args:
        symbols: Trace at a closed pose, without Newton steps.
    """
    numbers, start = [*symbols.numbers], [*symbols.start]
    pairs = [*zip(values, weights, strict=True)]
    slopes = adjoints(pairs, numbers + start)
    direct, by_pose = slopes[: len(numbers)], slopes[len(numbers) :]
    if not start:
        return direct
    loops, residual = symbols.loops, symbols.at.residual(symbols.y)
    right = np.zeros(len(symbols.at.q), dtype=object)
    right[symbols.predicted] = by_pose
    back = symbols.at.system.solve_transposed(right[loops.columns])
    through = adjoints([(row, -x) for row, x in zip(residual, back, strict=True)], numbers)
    return [a + b for a, b in zip(direct, through, strict=True)]
