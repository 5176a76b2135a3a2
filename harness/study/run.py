"""Run of a scene: every engine solves its own model file, and all answers are compared and judged.

For simulations, observables are also computed and compared, including those of the known solution.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from screwgauge.engines.registry import ENGINES, check_engines, engine_names
from screwgauge.judging.allowance import Allowance, Integrated
from screwgauge.judging.assembly_modes import assembly_of, in_one_chart
from screwgauge.judging.compare import compare, empty_row
from screwgauge.judging.coverage import coverage
from screwgauge.judging.judge import judge, summands
from screwgauge.judging.residual import JUDGE_COLUMNS, PAIR_COLUMNS, SizedResidual, frame
from screwgauge.judging.trust import Refusal, integration_errors, integration_note, refusals
from screwgauge.problem import Problem, Report, silent, spread
from screwgauge.quantities import OF_MOTION, SIMULATED, Names, check_quantities, description_names
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.files import is_file
from screwgauge.reference.graph import Layout
from screwgauge.reference.mobility import Mobility, mobility
from screwgauge.scene.motion import Sampled
from screwgauge.scene.observables import Recorded
from screwgauge.scene.preflight import check_actuation, check_scene, doubts, far_from_home
from screwgauge.scene.rest import rest_warning
from screwgauge.scene.scene import Scene, check_scene_type
from screwgauge.scene.simulation import check_start
from screwgauge.solution import REFERENCE, Failure, Solution
from screwgauge.study.comparison import DOUBT, Comparison, provenance
from screwgauge.study.fixed import without_fixed
from screwgauge.study.leave import UNREAD, check_leave, idle_entries, unread_files
from screwgauge.study.left_out import LeftOutForces, without_left_out
from screwgauge.study.methods import missing_quantities, sentence_on_missing
from screwgauge.study.review import STANDIN, TableReview, reviews
from screwgauge.study.rounding import with_rounding
from screwgauge.study.simulations import MOTION, add_observables, early_ends, engines_in_doubt, loosen
from screwgauge.study.solving import ask_engines, description_file, generated_models, model_files
from screwgauge.study.tables import check_tables, judge_table

if TYPE_CHECKING:
    from screwgauge.study.isolation import Limits

Ask = Callable[[Scene, Iterable[str], Path], Mapping[str, Solution | Failure]]
"""Function that returns the answers of engines and tables to a scene, given the folder of the generated model files."""


@dataclass(frozen=True, slots=True, eq=False)
class _Asked:
    """A checked scene, and the problem for the engines.

    Attributes:
        problem: Problem with the wanted quantities of the scene.
        wanted: Names of the wanted quantities, in the user's order.
        components: Quantity -> names and units of its components.
        warnings: Warnings about the scene.
        lay: Layout of a simulated scene.
    """

    scene: Scene
    problem: Problem
    wanted: tuple[str, ...]
    components: Names
    mobility: Mobility
    warnings: tuple[str, ...]
    lay: Layout | None = None

    @property
    def requested(self) -> tuple[str, ...]:
        """Quantities requested from engines; for a simulation, the motion, which determines all other quantities."""
        if self.lay is None:
            return self.wanted
        measured = bool(self.scene.mechanism.left_out or self.scene.models)
        return tuple(name for name in MOTION if name in self.wanted or name == "joint_position" or measured)


@dataclass(frozen=True, slots=True, eq=False)
class _Answered:
    """Answers of engines and tables, without forces that no engine includes.

    Attributes:
        answers: Engine or table -> its answer, with notes on missing values.
        refused: Samples at which an engine returns no values for some quantities.
        lacking: The refused samples, plus quantities and samples that an engine omits completely.
        left_out: Forces that files contain but no engine includes.
    """

    answers: Mapping[str, Solution]
    failures: Mapping[str, Failure]
    refused: Sequence[Refusal]
    lacking: Sequence[Refusal]
    left_out: LeftOutForces


def run(
    scene: Scene,
    engines: Iterable[str] | None = None,
    quantities: Iterable[str] | None = None,
    *,
    progress: Report = silent,
    warn: Callable[[str], None] = lambda sentence: None,
    date: datetime | None = None,
    limits: Limits | None = None,
) -> Comparison:
    """Solve a scene with the engines, compare all pairs and judge each answer. Scenes with a start are integrated.

    Args:
        engines: Names of engines; by default as in the scene.
        quantities: Names of the quantities to compute; by default as in the scene.
        progress: Called with the current step and the completed share.
        warn: Called with a warning before a step that may take long or fail.
        date: Date of the report; now by default.
        limits: Limits of each engine in its own process; by default engines run in this process.

    Raises:
        ScrewgaugeError: The input is invalid. An engine that fails or stops early is reported in the results instead.
    """
    check_scene_type(scene, "run")
    names, wanted = _check_names(scene, engines, quantities)
    progress("preflight", 0.0)
    asked = _check(scene, wanted)
    check_leave(scene)
    remarks, unread = _remarks(asked), unread_files(scene, names)
    remarks |= {sentence: "" if key in scene.allow else UNREAD for key, sentence in unread.items()}
    for sentence in asked.warnings:  # later warnings can wait for the report
        warn(sentence)
    ask = partial(ask_engines, wanted=asked.requested, components=asked.components, progress=progress, limits=limits)
    with generated_models(scene) as folder:
        told = ask(scene, names, folder)
        record = provenance(scene, _files(scene, names, folder), description=description_file(scene, folder), date=date)
    progress("comparison", 0.0)
    answered = _prepare(asked, told)
    solutions, errors, pairs, judged = _compare_all(asked, answered, ask)
    stale = idle_entries(scene, solutions, answered.left_out, unread)
    return Comparison(
        scene=scene,
        solutions=solutions,
        failures=answered.failures,
        errors=errors,
        pairs=pairs,
        judge=judged,
        remarks=remarks | dict.fromkeys(stale, DOUBT),
        freedoms=asked.mobility,
        provenance=record,
        refusals=answered.lacking,
        left_out=answered.left_out,
        review=partial(_reviews, scene, solutions, answered.answers, (errors, judged)),
        cover=partial(coverage, scene.mechanism, asked.problem, answered.answers, asked.mobility, scene.tolerance),
    )


def review(table: Recorded, scene: Scene, quantities: Iterable[str] | None = None) -> TableReview:
    """Review a table by comparing it with `STANDIN` at its own times, see `screwgauge.review`."""
    check_scene_type(scene, "review")
    path = table.file
    name = re.sub(r"[^\w.-]", "-", path.stem) if path else "numbers"
    name = f"{name}-table" if name in {*engine_names(), REFERENCE} else name
    alone = replace(scene, models={}, tables={}, engines=(STANDIN,)).beside(**{name: table})
    return run(alone.at(table.t), (STANDIN, name), quantities).reviews[name]


def _check_names(
    scene: Scene, engines: Iterable[str] | None, quantities: Iterable[str] | None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Check the names of engines and quantities; return the engines, followed by tables, and the quantities."""
    where = str(scene.file or scene.name)
    check_tables(scene)
    if scene.models:
        check_engines(scene.models, f"{where}, models")
    for engine, file in scene.models.items():
        if not is_file(file):
            what = f"model file of {engine} does not exist or is not a regular file ('{file}')"
            raise DescriptionError(what, f"{where}, models", "check the path")
    named, where = (scene.engines, where) if engines is None else (engines, "")
    names = check_engines(named, where, type(scene.task), scene.tables)
    known = SIMULATED if scene.simulated else OF_MOTION
    wanted = check_quantities(scene.quantities if quantities is None else quantities, known=known)
    if scene.simulated and not scene.observables:
        if quantities is not None and "observable" in wanted:
            raise DescriptionError("the scene has no observables", scene.name, "add [[observables]]")
        wanted = tuple(name for name in wanted if name != "observable")
    return tuple(sorted(names, key=lambda name: name in scene.tables)), wanted


def _check(scene: Scene, wanted: tuple[str, ...]) -> _Asked:
    """Check a scene before engines run.

    Raises:
        ScrewgaugeError: The scene cannot be solved.
    """
    mechanism = scene.mechanism
    names = description_names(mechanism, scene.points)
    if scene.simulated:
        lay, warnings = check_start(scene)
        counts = mobility(lay, mechanism.home[None])
        return _Asked(
            scene, scene.problem(wanted), wanted, {name: names[name] for name in MOTION}, counts, warnings, lay
        )
    counts = check_scene(scene)
    wanted, left = check_actuation(scene, counts, wanted)
    # components of tree forces depend on the tree of each engine
    given = {name: named for name, named in names.items() if not name.startswith("tree_force")}
    sampled = scene.drive.doubts([*mechanism.independent]) if isinstance(scene.drive, Sampled) else ()
    missing = () if scene.grid is None else scene.grid.warnings
    warnings = (*left, *missing, *far_from_home(scene), *sampled, *rest_warning(scene))
    return _Asked(scene, scene.problem(wanted), wanted, given, counts, warnings)


def _remarks(asked: _Asked) -> dict[str, str]:
    """Return warning or remark -> its kind, for the scene and its mechanism; doubts come first."""
    scene, said = asked.scene, [*asked.scene.mechanism.remarks, *asked.warnings]
    if scene.changed:
        said.append(
            f"the mechanism was changed after it was read from {scene.mechanism_file.name}; the changes are included"
        )
    return dict.fromkeys(doubts(scene), DOUBT) | dict.fromkeys(said, "")


def _files(scene: Scene, names: Iterable[str], folder: Path) -> dict[str, Path]:
    """Return engine -> its model file, and table -> its file."""
    tables = {name: scene.tables[name].file for name in names if name in scene.tables}
    models = {name: model_files(scene, name, folder).model for name in names if name not in tables}
    return models | {name: file for name, file in tables.items() if file}


def _prepare(asked: _Asked, told: Mapping[str, Solution | Failure]) -> _Answered:
    """Prepare answers for comparison: estimate rounding, note missing values, and subtract forces that engines omit."""
    scene, problem = asked.scene, asked.problem
    failures = {name: one for name, one in told.items() if isinstance(one, Failure)}
    posed = replace(problem, wanted=frozenset(asked.requested))
    solved = {name: one for name, one in told.items() if isinstance(one, Solution)}
    answers = with_rounding(scene.mechanism, posed, solved)
    refused = [one for answer in answers.values() for one in refusals(scene.mechanism, problem, answer)]
    lacking = [*refused, *_missing_quantities(asked, answers), *_missing_samples(asked, answers)]
    noted = {name: _note_lacks(scene, answer, lacking) for name, answer in answers.items()}
    rigid, forces = without_left_out(scene, problem, noted)
    return _Answered(rigid, failures, refused, lacking, forces)


def _missing_quantities(asked: _Asked, answers: Mapping[str, Solution]) -> Iterator[Refusal]:
    """Yield the requested quantities for which engines return no values at all."""
    for name, answer in answers.items():
        if lost := missing_quantities(asked.requested, answer):
            yield Refusal(
                name, lost, np.arange(len(asked.scene.t)), sentence_on_missing(lost), sentence_on_missing(lost)
            )


def _missing_samples(asked: _Asked, answers: Mapping[str, Solution]) -> Iterator[Refusal]:
    """Yield the samples that engines omit although they declare no such limit."""
    t = asked.scene.t
    for name, answer in answers.items():
        if name in asked.scene.tables:
            continue
        due = spread(len(t), (ENGINES[name].most if name in ENGINES else 0) or len(t))
        rows = np.setdiff1d(due, due if answer.rows is None else answer.rows)
        if rows.size or answer.stopped:
            what = f"solved {len(due) - len(rows)} of {len(due)} samples"
            after = f", nothing after t = {t[rows[0] - 1]:g} s" if rows.size and answer.stopped else ""
            why = f"{after}: {answer.stopped}" if answer.stopped else ""
            yield Refusal(name, asked.wanted, rows, what, f"{what}{why}")


def _note_lacks(scene: Scene, answer: Solution, lacking: Sequence[Refusal]) -> Solution:
    """Add notes on missing values to an answer."""
    notes = [one.sentence for one in lacking if one.engine == answer.engine]
    if not (scene.simulated or answer.engine in scene.tables) and assembly_of(scene.mechanism, answer) is None:
        notes.append(
            "it returned no joint positions; its assembly mode is thus unknown, and none of its values can be judged"
        )
    return replace(answer, notes=(*answer.notes, *notes))


Looser = Mapping[str, Sequence[Solution]]
"""Engine -> its answers with looser tolerances."""


def _compare_all(
    asked: _Asked, answered: _Answered, ask: Ask
) -> tuple[dict[str, Solution], pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Compare all pairs and judge each answer; rerun simulations out of tolerance to estimate integration errors.

    Returns:
        Solutions; rows of component pairs; rows of pairs, including pairs with missing values; and rows of the judge.
    """
    scene, answers = asked.scene, answered.answers
    judged = {name: _judge_answer(asked, answered, name) for name in answers}
    solutions = _solutions_of(asked, answers)
    errors, pairs = _errors(asked, answered, solutions, {})
    if asked.lay is not None and (unsure := sorted(engines_in_doubt(pairs, judged.values()) & {*answers})):
        with generated_models(scene) as folder:
            runs = [ask(each, unsure, folder) for each in loosen(scene)]
        looser = {name: [one for told in runs if isinstance(one := told[name], Solution)] for name in unsure}
        judged |= {name: _judge_answer(asked, answered, name, again) for name, again in looser.items()}
        integration = dict[str, Integrated]()
        for name, again in looser.items():
            solutions[name], integration[name] = _estimate_integration(asked, asked.lay, solutions[name], again)
        errors, pairs = _errors(asked, answered, solutions, integration)
    if lost := [*_missing_rows(asked, answered, solutions)]:
        pairs = pd.concat([pairs, frame(lost, PAIR_COLUMNS)], ignore_index=True)
    return (
        solutions,
        errors,
        pairs,
        pd.concat(judged.values(), ignore_index=True) if judged else frame((), JUDGE_COLUMNS),
    )


def _judge_answer(asked: _Asked, answered: _Answered, name: str, again: Sequence[Solution] = ()) -> pd.DataFrame:
    """Judge an answer. `again`: answers of the same engine with looser tolerances."""
    scene, problem, answer = asked.scene, asked.problem, answered.answers[name]
    if name in scene.tables:
        return judge_table(scene, problem, answer, asked.components)
    refused, tolerance_of = answered.refused, scene.tolerance
    return judge(scene.mechanism, problem, answer, refused=refused, again=again, tolerance_of=tolerance_of)


def _solutions_of(asked: _Asked, answers: Mapping[str, Solution]) -> dict[str, Solution]:
    """Return answers in a common chart of joint angles; for a simulation, with its observables."""
    scene = asked.scene
    given = answers if asked.lay is None else add_observables(scene, asked.lay, answers, asked.wanted)
    return without_fixed(scene.mechanism, in_one_chart(scene.mechanism, given))


def _errors(
    asked: _Asked, answered: _Answered, solutions: Mapping[str, Solution], integration: Mapping[str, Integrated]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the rows of component pairs, and the rows of pairs."""
    scene = asked.scene
    whole = [each for name, each in answered.answers.items() if name not in scene.tables]  # tables may lack components
    allowance = Allowance(
        scene.tolerance,
        scene.tolerances if scene.simulated else (),
        {name: table.error for name, table in scene.tables.items()},
        integration,
        cache(partial(summands, scene.mechanism, asked.problem, whole)),
    )
    failed = {} if scene.simulated else answered.failures
    return compare(scene.mechanism, asked.problem, solutions, failed, asked.mobility, allowance, answered.refused)


def _estimate_integration(
    asked: _Asked, lay: Layout, solution: Solution, again: Sequence[Solution]
) -> tuple[Solution, Integrated]:
    """Estimate the integration error from runs with looser tolerances; return a solution with a note, and the error."""
    seen = add_observables(asked.scene, lay, {f"{k}": one for k, one in enumerate(again)}, asked.wanted)
    runs = {name: one for name, one in seen.items() if name != REFERENCE}
    mechanism = asked.scene.mechanism
    first, *others = without_fixed(mechanism, in_one_chart(mechanism, {"": solution, **runs})).values()
    estimate = integration_errors(first, others)
    return replace(first, notes=(*first.notes, integration_note(estimate))), estimate


def _missing_rows(asked: _Asked, answered: _Answered, solutions: Mapping[str, Solution]) -> Iterator[SizedResidual]:
    """Yield rows without values, for pairs in which one engine lacks a quantity or part of it."""
    scene, answers = asked.scene, answered.answers
    reasons = [
        (quantity, one.engine, f"{one.engine} {one.sentence}")
        for one in _missing_quantities(asked, answers)
        for quantity in one.quantities
    ]
    if asked.lay is not None:
        reasons += early_ends(scene, asked.wanted, answers, answered.failures)
    for quantity, name, reason in reasons:
        others = [other for other, one in solutions.items() if other != name and quantity in one.values]
        for other in others or [""]:
            a, b = (other, name) if other not in ("", REFERENCE) else (name, other)
            yield empty_row(quantity, a, b, reason, scene.tolerance(quantity))


def _reviews(
    scene: Scene, solutions: Mapping[str, Solution], answers: Mapping[str, Solution], rows: Sequence[pd.DataFrame]
) -> dict[str, TableReview]:
    """Review the tables of a scene by comparing them with engines that pass the judge's checks."""
    errors, judge = rows
    faulted = {*judge[~judge["ok"].astype(bool)]["engine"]}
    tables = {name: answers[name] for name in scene.tables if name in answers}
    return reviews(scene, solutions, tables, errors, faulted) if tables else {}
