"""A further engine in one file: the screw solver with a known error in one acceleration and one force."""

from __future__ import annotations

from dataclasses import replace

from screwgauge.engines.screw import inverse as screw
from screwgauge.problem import Problem
from screwgauge.solution import Solution, Values

ERROR = 1e-8
ACCELERATION, FORCE = "leg2.q3", "leg3"


def solve(problem: Problem) -> Solution:
    """Shifts one component of two quantities by `ERROR` of its quantity's largest value in that unit."""
    solution = screw.solve(problem)
    changed = dict(solution.values)
    for quantity, component in (("joint_acceleration", ACCELERATION), ("actuator_force", FORCE)):
        if quantity in changed:
            changed[quantity] = _shifted(changed[quantity], component)
    return replace(solution, values=changed)


def _shifted(values: Values, component: str) -> Values:
    k = values.components.index(component)
    same = [i for i, unit in enumerate(values.units) if unit == values.units[k]]
    array = values.array.copy()
    array[:, k] += ERROR * abs(array[:, same]).max()
    return Values(values.components, values.units, array)
