"""Answer of one engine at the judged samples, and residuals of equations for this answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from screwgauge.judging.allowance import NARROW
from screwgauge.judging.residual import JUDGE, SizedResidual
from screwgauge.problem import GivenMotion, InitialValue, Problem, Rows, States
from screwgauge.quantities import FLOAT64, FLOOR, SOLVED, NumberType, arm, natural_scales, number_type
from screwgauge.reference.applied import Applied
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.points import Point
from screwgauge.reference.rotations import Array
from screwgauge.solution import SOFTNESS, Solution, Values
from screwgauge.witness.joints import MechanismTree, mechanism_tree
from screwgauge.witness.kinematics import TreeMotion, move
from screwgauge.witness.tree import TreeStates

_DERIVATIVES = ("joint_position", "joint_velocity", "joint_acceleration")


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """Answer of one engine at n samples.

    Attributes:
        applied: Applied forces other than actuator forces.
        rule: Rule that fixes redundant actuation.
        t: Times [s]. Shape (n,).
        values: Quantity -> values.
        work: Work of motors, loads and dampers [J], shape (n,); None if unknown.
        motion: Motion of the tree; missing joint coordinates or derivatives are zero.
        scales: Natural scale of each unit.
        tolerance: Scaled residual up to which an equation holds.
        admitted: Largest scaled error that the engine estimates for any of its values.
        kind: Number type that the scene or command names.
        softness: Unit -> effect of the engine's soft constraints on a force of its tree.
        looser: Quantity -> scaled error allowed by the scene, if larger than `tolerance`.
        points: Named points.
    """

    engine: str
    applied: Applied
    rule: str
    t: Array
    values: Mapping[str, Values]
    work: Array | None
    motion: TreeMotion[MechanismTree]
    scales: Mapping[str, float]
    tolerance: float
    admitted: float = 0.0
    kind: NumberType = FLOAT64
    softness: Mapping[str, float] = field(default_factory=dict)
    looser: Mapping[str, float] = field(default_factory=dict)
    points: tuple[Point, ...] = ()

    def __getitem__(self, quantity: str) -> Array:
        """Return the values of a quantity. Shape (n, n_component)."""
        return self.values[quantity].array

    @property
    def tree(self) -> MechanismTree:
        """Tree of the mechanism."""
        return self.motion.tree

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism."""
        return self.tree.mechanism

    @property
    def states(self) -> TreeStates:
        """Joint coordinates and their derivatives."""
        return self.motion.states

    @property
    def joints(self) -> tuple[Array, Array, Array]:
        """All joint coordinates and their first two derivatives. Shape (n, n_q) each."""
        return self.q, self.states.qd, self.states.qdd

    @property
    def q(self) -> Array:
        """All joint coordinates [rad or m]. Shape (n, n_q)."""
        return self.states.q

    def has(self, *quantities: str) -> bool:
        """Return True if the answer has all of these quantities."""
        return set(quantities) <= set(self.values)

    def loose_scale(self, quantity: str, unit: str) -> float:
        """Return a quantity's largest magnitude in a unit if the scene loosens the quantity's tolerance, else 0."""
        if quantity not in self.looser or not self.has(quantity):
            return 0.0
        values = self.values[quantity]
        return largest(values.array[:, [has == unit for has in values.units]])

    def fastest(self, order: int, unit: str) -> float:
        """Return the largest derivative of any joint coordinate in a unit, or the natural scale for order 0.

        For accelerations, squared velocities are included. The mechanism's length converts between angles and lengths.
        """
        if not order:
            return self.scales[unit]
        L = self.scales["m"]
        per = [1.0 / arm(has, L) for has in self.mechanism.units]
        size, rate = largest(self.joints[order] * per), largest(self.joints[1] * per)
        return arm(unit, L) * (max(size, rate**2) if order == 2 else size)

    def with_joints(self, joints: Array) -> Answer:
        """Replace joint coordinates and derivatives. Shape (3, n, n_q)."""
        return replace(self, motion=move(self.tree, TreeStates(*joints)))

    def residual(
        self, name: str, unit: str, components: Sequence[str], missing: Array, size: float | Array, of: Sequence[str]
    ) -> SizedResidual:
        """Return the largest residual of an equation, with component and time.

        Args:
            components: Names of the columns of `missing`.
            missing: Residual of the equation. Shape (n, m).
            size: Scale of the residual, namely its largest term: a number, or an array with a value per component,
                shape (m,).
            of: Quantities in the equation. If the scene allows a larger error in any of these quantities, this error
                becomes the tolerance.
        """
        tolerance = max([self.tolerance, *(self.looser[name] for name in of if name in self.looser)])
        scaled = np.abs(missing) / np.maximum(size, FLOOR * self.scales[unit])
        lost, limit = ~np.isfinite(scaled), self.kind.limit
        rounding = self.admitted if self.admitted <= limit else self.kind.sure
        conditioned = tolerance < rounding and not lost.any() and scaled.max(initial=0.0) > tolerance
        tolerance = rounding if conditioned else tolerance
        open_at = ((scaled > tolerance) & ~lost).any(axis=1)
        i, k = divmod(int(np.argmax(np.where(lost, np.inf, scaled))), len(components))
        worst, t = float(scaled[i, k]), float(self.t[i])
        undecided = int(open_at.sum()) if worst <= self.admitted and self.admitted > limit else 0
        return SizedResidual(
            name,
            unit,
            self.engine,
            JUDGE,
            error=worst,
            tolerance=tolerance,
            reason=self._reason(t, lost=bool(lost.any()), undecided=undecided, conditioned=conditioned),
            ok=worst <= tolerance,
            undecided=undecided,
            component=components[k],
            t=t,
            max_abs=float(np.abs(missing).max()),
        )

    def _reason(self, t: float, *, lost: bool, undecided: int, conditioned: bool) -> str:
        """Explain why a residual is out of tolerance, or why its tolerance was raised."""
        if lost:
            return f"not a number at t = {t:g} s"
        if undecided:
            return f"within the error that {self.engine} estimates from its conditioning"
        if self.kind is not FLOAT64 and conditioned:
            return f"{NARROW} {self.kind.name}: within rounding times the condition number"
        return (
            f"within {self.admitted:.2g}, rounding times the condition number of {self.engine}" if conditioned else ""
        )


def answer_at(
    mechanism: Mechanism,
    problem: Problem,
    solution: Solution,
    rows: Rows,
    tolerance: float = SOLVED,
    looser: Mapping[str, float] | None = None,
) -> Answer:
    """Build the answer at some samples; the solution must contain joint positions or the assembly."""
    values = {name: values.at(rows) for name, values in solution.values.items()}
    scales = natural_scales(mechanism)
    tree = mechanism_tree(mechanism, spanning_tree(mechanism), scales["m"])
    joints = np.zeros((3, len(rows), len(mechanism.coordinates)))
    if solution.assembly is not None:
        joints[0] = solution.assembly[rows]
    for derivative, name in zip(joints, _DERIVATIVES, strict=True):
        if name in values:
            derivative[:] = values[name].array
    return Answer(
        engine=solution.engine,
        applied=problem.applied,
        rule=problem.rule,
        t=motion_task(problem).t[rows],
        points=problem.points,
        values=values,
        work=None if solution.work is None else solution.work[rows],
        motion=move(tree, TreeStates(*joints)),
        scales={**scales, "J": scales["N m"]},
        tolerance=tolerance,
        admitted=max((error.largest for error in solution.errors.values()), default=0.0),
        kind=number_type(solution.engine),
        softness=next((error.absolute for error in solution.errors.values() if error.source == SOFTNESS), {}),
        looser=looser or {},
    )


def motion_task(problem: Problem) -> GivenMotion | InitialValue:
    """Return the problem's task; raise TypeError unless it is a motion over time."""
    if isinstance(problem.task, States):
        raise TypeError("states of an open tree are not a motion over time and cannot be compared or judged")
    return problem.task


def largest(*arrays: Array) -> float:
    """Return the largest magnitude, ignoring NaN; 0 for empty arrays."""
    return max((float(np.nanmax(np.abs(array), initial=0.0)) for array in arrays), default=0.0)
