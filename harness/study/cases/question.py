"""A question: a problem put to methods, with what is right. One loop turns questions into findings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from textwrap import shorten

import numpy as np

from screwgauge.judging.judge import judge
from screwgauge.judging.refusals import refusals
from screwgauge.problem import GivenMotion, InitialValue, Integration, ModelFiles, Problem
from screwgauge.reference.mechanism import Mechanism
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution, Values
from screwgauge.study.cases.case import GOOD, SILENT, Finding
from screwgauge.study.methods import Method
from screwgauge.study.reference import Reference, deviation, sizes
from screwgauge.study.solving import ask, model_files

OWN = "screw"  # the engine that answers for our own solver
LONGEST = 500  # letters of a reason: some errors name a whole state


UNKNOWN = Reference("", {}, "", {})


def answered(question: Question, solution: Solution) -> Mapping[str, Values]:
    """What a solution says, as it says it."""
    return solution.values


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """A problem put to methods, and what is right. Data only; it pickles.

    Attributes:
        files: Engine -> its model.
        quantities: What is measured, in this order.
        right: Their true values, those components that are compared; `UNKNOWN` where there is no truth: then the
            judge measures.
        read: Takes the measured quantities from a solution. A function of a module.
        cause: Why a method other than ours is wrong where nothing says so; ``{notes}`` stands for what it notes.
        remarks: Quantity -> what is said of it whatever comes out.
        admitted: Quantity -> scaled error that is admitted, whatever a method estimates of its own.
        by: What admits an error, in words.
        condition: Condition number of the closed loops, where that of what a method solves is not meant.
        refused: Why it is put to no method.
        unanswerable: Why no number is right: a method has to refuse it.
    """

    mechanism: Mechanism
    files: Mapping[str, ModelFiles]
    problem: Problem
    methods: tuple[Method, ...]
    quantities: tuple[str, ...]
    right: Reference
    read: Callable[[Question, Solution], Mapping[str, Values]] = answered
    cause: str = ""
    remarks: Mapping[str, str] = field(default_factory=dict)
    admitted: Mapping[str, float] = field(default_factory=dict)
    by: str = "its error estimate"
    condition: float | None = None
    refused: str = ""
    unanswerable: str = ""

    @property
    def known(self) -> bool:
        """Whether it is known what is right."""
        return bool(self.right.values)


def put(
    scene: Scene, folder: Path, problem: Problem, methods: tuple[Method, ...], names: tuple[str, ...], right: Reference
) -> Question:
    """A question about quantities of a scene, whose models have been generated in a folder."""
    return Question(scene.mechanism, files_of(scene, folder, methods), problem, methods, names, right)


def files_of(scene: Scene, folder: Path, methods: tuple[Method, ...]) -> dict[str, ModelFiles]:
    """The models of a scene in a folder, generated there already."""
    return {method.engine: model_files(scene, method.engine, folder) for method in methods}


def integrated(question: Question, integration: Integration) -> Question:
    """The same question about a simulation, by another method or tolerance."""
    task = question.problem.task
    if not isinstance(task, InitialValue):
        raise TypeError("the task is no simulation")
    return replace(question, problem=replace(question.problem, task=replace(task, integration=integration)))


def findings(question: Question) -> Iterator[Finding]:
    """What every method makes of every quantity: the error, what is admitted, and why."""
    for method in question.methods:
        yield from _of(question, method)


def _of(question: Question, method: Method) -> Iterator[Finding]:
    blank = Finding("", a=method.name, tolerance=GOOD, own=method.engine == OWN)
    solution: Solution | Failure = Failure(method.name, question.refused)
    if not question.refused:
        solution = ask(method, question.files[method.engine], question.problem)
    if isinstance(solution, Failure):
        refused = solution.reason
    else:  # what an engine warned of while it made steps went into every step after it
        warned = solution.warnings if isinstance(question.problem.task, InitialValue) else ()
        refused = solution.stopped or "; ".join(warned)
    if refused or isinstance(solution, Failure):
        for quantity in question.quantities:
            yield replace(blank, quantity=quantity, reason=shorten(refused, LONGEST, placeholder=" ..."))
        return
    blank = replace(blank, time_s=_time(solution))
    if question.unanswerable:
        for quantity in question.quantities:
            yield replace(blank, quantity=quantity, error=math.inf, reason=question.unanswerable)
        return
    if not question.known:
        yield _judged(question, solution, blank)
        return
    values, excuses = question.read(question, solution), _excuses(question, solution)
    for quantity in question.quantities:
        yield _measured(question, solution, replace(blank, quantity=quantity), values[quantity], excuses)


def scaled_error(values: Values, right: Values, scales: Mapping[str, float]) -> float:
    """Largest error over its scale S; NaN where there is no number, infinite where that is infinite.

    Samples for which the reference itself has no number are left out.

    Args:
        values: Of at least the components of `right`, in any order.
        scales: Unit -> S.
    """
    largest = sizes(deviation(values.pick(right.components), right))
    return float(np.max([size / scales[unit] for unit, size in largest.items()])) if largest else math.nan


def _measured(
    question: Question, solution: Solution, blank: Finding, values: Values, excuses: Mapping[str, str]
) -> Finding:
    """Error, what is admitted, and why."""
    quantity, right = blank.quantity, question.right
    error = scaled_error(values, right.values[quantity], right.scales[quantity])
    scales, own = right.scales[quantity], solution.tolerances.get(quantity, {})
    bound = max([_estimated(solution, quantity), *(own.get(unit, 0.0) / scales[unit] for unit in scales)])
    bound = max(GOOD, question.admitted.get(quantity, bound))
    condition = float(np.max(solution.condition)) if question.condition is None else question.condition
    finding = replace(blank, error=error, tolerance=bound, condition=condition)
    admits = f"{question.by} admits {bound:.1e}" if bound > GOOD else ""
    if math.isinf(bound):
        admits = f"by {question.by} not one digit may be right"
    if math.isnan(error):  # only what the engine says of it counts
        return replace(finding, reason=excuses.get(quantity, "") or excuses.get("", "") or admits)
    silent = finding.verdict == SILENT and not finding.own
    cause = question.cause.replace("{notes}", "; ".join(solution.notes)) if silent else ""
    return replace(finding, reason="; ".join(filter(None, (cause, question.remarks.get(quantity, ""), admits))))


def _judged(question: Question, solution: Solution, blank: Finding) -> Finding:
    """Where there is no truth, the largest residual of the judge stands for all quantities."""
    table = judge(question.mechanism, question.problem, solution)
    return replace(
        blank,
        quantity="judge",
        error=float(table["max_scaled"].max(skipna=False)),
        tolerance=max([GOOD, *(_estimated(solution, quantity) for quantity in solution.estimate)]),
        condition=float(np.nanmax(solution.condition)),
        reason="largest residual of the judge: no truth could be had",
    )


def _excuses(question: Question, solution: Solution) -> dict[str, str]:
    """Quantity -> which singularity is the reason that there is no number; under no name what is noted of all."""
    if not isinstance(question.problem.task, GivenMotion):
        return {}
    refused = refusals(question.mechanism, question.problem, solution)
    return {"": "; ".join(solution.notes), **{quantity: one.what for one in refused for quantity in one.quantities}}


def _estimated(solution: Solution, quantity: str) -> float:
    """Largest error that the engine estimates for a quantity; what cannot be estimated may be anything."""
    if quantity not in solution.estimate:
        return 0.0
    return float(np.nan_to_num(solution.estimate[quantity], nan=np.inf, posinf=np.inf).max(initial=0.0))


def _time(solution: Solution) -> float:
    if solution.cost is not None:
        return solution.cost.wall_s
    return sum(timing.min_s for timing in solution.timings)
