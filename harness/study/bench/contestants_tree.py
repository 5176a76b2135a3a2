"""What Pinocchio and MuJoCo have in common as contestants."""

from __future__ import annotations

from collections.abc import Callable

from screwgauge.engines.tree.closed_tree import solve_tree
from screwgauge.engines.tree.protocol import Tree
from screwgauge.models.loops import LoopsFile
from screwgauge.reference.rotations import Array
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestant import QUANTITIES, Contestant, Outcome, Task
from screwgauge.study.bench.projection import given

_GIVEN = "given motion"
Load = Callable[[Case], tuple[Tree, LoopsFile]]


def engine_paths(engine: str, loader: Load, what: str) -> list[Contestant]:
    """A tree engine that closes its own loops, one contestant a quantity."""

    def make(quantity: str) -> Contestant:
        def prepare(case: Case) -> Task:
            tree, file = loader(case)
            problem = case.problem(engine, (quantity,))

            def read(array: Array) -> dict[str, Outcome]:
                return {quantity: case.outcome(quantity, array)}

            return Task(lambda: solve_tree(problem, tree, file).values[quantity].array, read, len(case.times))

        covers = f"from y and its derivatives: {what}, as far as needed; model loaded"
        return Contestant("closes its own loops, minimal cut", (quantity,), covers, prepare, label="closes its loops")

    return [make(quantity) for quantity in QUANTITIES]


def inverse_projected(loader: Load, setting: str, what: str, label: str) -> Contestant:
    """Inverse dynamics of the open tree on the true joint motion, then projection on the actuators."""

    def prepare(case: Case) -> Task:
        start = given(case, *loader(case))

        def call() -> Array:
            return start.actuator_forces(start.tree.tree_force(start.q, start.v, start.a))

        def read(array: Array) -> dict[str, Outcome]:
            return {"actuator_force": case.outcome("actuator_force", array)}

        return Task(call, read, len(case.times))

    covers = f"from given joint motion: {what} sample by sample, Jacobians, projection of all samples at once"
    return Contestant(setting, ("actuator_force",), covers, prepare, given=True, series=_GIVEN, label=label)
