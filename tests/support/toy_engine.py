"""A further engine in one file: the screw solver with a known error in one acceleration and one force."""

from __future__ import annotations

from dataclasses import dataclass, replace

from screwgauge.engines.registry import Engine, EngineModel
from screwgauge.engines.screw import model as screw
from screwgauge.problem import GivenMotion, ModelFiles, Problem, Progress, quiet
from screwgauge.reference.errors import DescriptionError
from screwgauge.solution import Solution, Values

ERROR = 1e-8
ACCELERATION, FORCE = "leg2.q3", "leg3"
TOY = Engine("toy", "a toy", f"{__name__}:load", frozenset((GivenMotion,)), "screwgauge")


def load(files: ModelFiles, error: float = ERROR) -> ToyModel:
    """Loads a description."""
    return ToyModel(screw.load(files), error)


@dataclass(frozen=True)
class ToyModel:
    """Shifts one component of two quantities by `error` of its quantity's largest value in that unit."""

    right: EngineModel
    error: float

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        if not isinstance(problem.task, GivenMotion):
            raise DescriptionError("this engine supports only given motions", "toy", "choose another engine")
        solution = self.right.solve(problem, progress)
        changed = dict(solution.values)
        for quantity, component in (("joint_acceleration", ACCELERATION), ("actuator_force", FORCE)):
            if quantity in changed:
                changed[quantity] = self._shifted(changed[quantity], component)
        return replace(solution, values=changed)

    def _shifted(self, values: Values, component: str) -> Values:
        k = values.components.index(component)
        same = [i for i, unit in enumerate(values.units) if unit == values.units[k]]
        array = values.array.copy()
        array[:, k] += self.error * abs(array[:, same]).max()
        return Values(values.components, values.units, array)
