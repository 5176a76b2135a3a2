"""What one engine answered at the samples that are judged, and the motion of the bodies that follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from screwgauge.judging.kinetics import Motions, walk
from screwgauge.problem import GivenMotion, InitialValue, Problem, Rows, States
from screwgauge.quantities import natural_scales
from screwgauge.reference.applied import Applied
from screwgauge.reference.graph import SpanningTree, spanning_tree
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Values

#: Motion of the bodies: quantity -> field of `Moving`, and the joint quantities that it follows from.
BODY_MOTION = {
    "body_angular_velocity": ("w", {"joint_velocity"}),
    "body_angular_acceleration": ("b", {"joint_velocity", "joint_acceleration"}),
    "com_acceleration": ("a", {"joint_velocity", "joint_acceleration"}),
}
#: Share of its natural scale below which no magnitude is the measure of a residual.
FLOOR = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """One engine's answer at n samples.

    Attributes:
        applied: What acts besides actuators.
        t: Times [s]. Shape (n,).
        values: Quantity -> values.
        work: What motors, loads and dampers have put in [J], shape (n,); None if it is not known.
        motions: Of all bodies, by the joint coordinates; derivatives that were not answered count as zero.
        scales: Natural scale of each unit.
    """

    mechanism: Mechanism
    applied: Applied
    tree: SpanningTree
    t: Array
    values: Mapping[str, Values]
    work: Array | None
    motions: Motions
    scales: Mapping[str, float]

    def array(self, quantity: str) -> Array:
        """Shape (n, n_component)."""
        return self.values[quantity].array

    def has(self, *quantities: str) -> bool:
        return set(quantities) <= set(self.values)

    def walked(self, quantity: str) -> Array:
        """One of `BODY_MOTION` by the joint coordinates. Shape (n, 3 n_body)."""
        return np.concatenate([getattr(at, BODY_MOTION[quantity][0]) for at in self.motions.com], axis=1)


def timed(problem: Problem) -> GivenMotion | InitialValue:
    """The task, if it is a motion over time.

    Raises:
        TypeError: It is none.
    """
    if isinstance(problem.task, States):
        raise TypeError("states of an open tree are no motion over time: there is nothing to compare or to judge")
    return problem.task


def answer_at(mechanism: Mechanism, problem: Problem, solution: Solution, rows: Rows) -> Answer:
    """The answer at some samples. It must have joint positions."""
    values = {name: Values(has.components, has.units, has.array[rows]) for name, has in solution.values.items()}
    q = values["joint_position"].array
    zero = np.zeros_like(q)
    qd, qdd = (values[name].array if name in values else zero for name in ("joint_velocity", "joint_acceleration"))
    tree = spanning_tree(mechanism)
    return Answer(
        mechanism=mechanism,
        applied=problem.applied,
        tree=tree,
        t=timed(problem).t[rows],
        values=values,
        work=None if solution.work is None else solution.work[rows],
        motions=walk(mechanism, tree, q, qd, qdd),
        scales=natural_scales(mechanism),
    )
