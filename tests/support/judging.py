"""How answers are compared, judged and flagged."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import pandas as pd

from screwgauge import Results, Scene
from screwgauge.judging.allowance import LIMIT, Allowance, Integrated
from screwgauge.judging.answer import answer_at
from screwgauge.judging.assembly_modes import in_one_chart
from screwgauge.judging.compare import compare
from screwgauge.judging.coverage import NOTHING, coverage
from screwgauge.judging.judge import judge
from screwgauge.judging.left_out import measured_parts
from screwgauge.quantities import GIVEN
from screwgauge.solution import Solution
from screwgauge.study import left_out as measure
from screwgauge.study.reference_values import Reference, deviation, reference_values, score
from screwgauge.witness.constraints import admissible_motion
from screwgauge.witness.wrenches import constrained_directions as exerted
from support.freedoms import mobility_at_home


def agreed(results: Results) -> Results:
    assert not results.failures, results.failures
    assert results.ok, results.pairs[~results.pairs["ok"]].to_string() + results.judge.to_string()
    return results


def compared(
    scene: Scene, solutions: Mapping[str, Solution], integration: Mapping[str, Integrated] = MappingProxyType({})
) -> tuple[pd.DataFrame, pd.DataFrame]:
    counts, allowance = mobility_at_home(scene.mechanism), Allowance(scene.tolerance, integration=integration)
    return compare(scene.mechanism, scene.problem(()), solutions, {}, counts, allowance)


def faults(scene: Scene, solution: Solution, quantity: str, name: str) -> set[str]:
    values = solution.values[quantity]
    array = values.array.copy()
    array[:, values.components.index(name)] += 1e-6
    wrong = replace(solution, values={**solution.values, quantity: replace(values, array=array)})
    rows = judge(scene.mechanism, scene.problem(GIVEN), wrong)
    return {*rows["residual"][~rows["ok"]]}
