"""Runs a scene: every engine on its own model file, then comparison and judgement.

Of a simulation observables, conditions and the known solution are compared, too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from screwgauge.casebook.book import installed, suspects
from screwgauge.engines.registry import ENGINES, check_engines, engine_names
from screwgauge.engines.rounding import idle_errors, rounding_errors
from screwgauge.environment import environment
from screwgauge.judging.allowance import Allowance, Integrated
from screwgauge.judging.assembly_modes import assembly_of, in_one_chart
from screwgauge.judging.compare import compare, nothing
from screwgauge.judging.coverage import coverage
from screwgauge.judging.judge import judge, summands
from screwgauge.judging.residual import JUDGE_COLUMNS, PAIR_COLUMNS, SizedResidual, frame
from screwgauge.judging.trust import Refusal, integrated, integration_note, refusals
from screwgauge.problem import Report, silent, spread
from screwgauge.quantities import FLOAT64, OF_MOTION, SIMULATED, Names, check_quantities, described, number_type
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError
from screwgauge.reference.files import is_file
from screwgauge.reference.graph import Layout
from screwgauge.reference.mobility import Mobility, mobility
from screwgauge.reference.rotations import Array
from screwgauge.scene.motion import Sampled
from screwgauge.scene.observables import Recorded
from screwgauge.scene.preflight import check_actuation, check_scene, doubts, far_from_home
from screwgauge.scene.rest import rest_warning
from screwgauge.scene.scene import Scene, check_scene_type
from screwgauge.scene.simulation import check_start
from screwgauge.solution import REFERENCE, Failure, Solution
from screwgauge.study.comparison import Comparison, facts, provenance
from screwgauge.study.fixed import without_fixed
from screwgauge.study.leave import UNREAD, check_leave, idle_entries
from screwgauge.study.left_out import LeftOutForces, without_left_out
from screwgauge.study.methods import left_out, without
from screwgauge.study.review import STANDIN, TableReview, reviews
from screwgauge.study.simulations import MOTION, doubtful, ends, loosened, observed
from screwgauge.study.solving import ask_engines, description_file, generated, model_files
from screwgauge.study.user_files import check_tables, judge_table, recorded

if TYPE_CHECKING:
    from screwgauge.study.isolation import Limits


@dataclass(frozen=True, slots=True)
class _Checked:
    """What is known of a scene before engines run.

    Attributes:
        components: Quantity -> names and units of its components.
        wanted: Quantities to compare.
        warnings: Sentences on the scene.
        lay: The layout of a simulated scene.
    """

    mobility: Mobility
    components: Names
    wanted: tuple[str, ...]
    warnings: tuple[str, ...]
    lay: Layout | None = None


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
    """Puts a scene to the engines, compares all pairs and judges each. Where there is a start, it is integrated.

    Args:
        engines: Names; those of the scene by default.
        quantities: Names; those of the scene by default. Nothing else is computed.
        progress: Called as work goes on.
        warn: Called with a sentence on what may take long or go wrong, before it begins.
        date: That the report bears; now by default.
        limits: What each engine may take in a process of its own; by default they run in this one.

    Raises:
        ScrewgaugeError: Bad input. An engine that fails or stops early is no error but a row of the results.
    """
    check_scene_type(scene, "run")
    names, wanted = _requested(scene, engines, quantities)
    check_engines(names, str(scene.file or scene.name) if engines is None else "", type(scene.task), scene.tables)
    progress("preflight", 0.0)
    checked = _check_simulated(scene, wanted) if scene.simulated else _check_given(scene, wanted)
    check_leave(scene)
    unread, doubted = _unread(scene, names), doubts(scene)
    warnings = (*doubted, *scene.mechanism.remarks, *checked.warnings, *_changed(scene), *unread.values())
    for sentence in checked.warnings:  # all others can wait for the report
        warn(sentence)
    tables = {name: recorded(scene, name, checked.components, checked.wanted) for name in names if name in scene.tables}
    solving = [name for name in names if name not in tables]
    steps = _RunSteps(scene, checked, progress, limits)
    with generated(scene) as folder:
        answers, steps.failures = steps.solve(scene, solving, folder)
        files = {name: model_files(scene, name, folder).model for name in solving}
        files |= {name: file for name in tables if (file := scene.tables[name].file)}
        judged_files = provenance(scene, files, description=description_file(scene, folder), date=date)
    progress("comparison", 0.0)
    steps.judge_all(answers, tables)
    errors, pairs = steps.compare()
    judge = pd.concat(steps.judged.values(), ignore_index=True) if steps.judged else frame((), JUDGE_COLUMNS)
    faulted = {*judge[~judge["ok"].astype(bool)]["engine"]}
    stale = tuple(idle_entries(scene, steps.solutions, steps.left_out, unread))
    return Comparison(
        scene=scene,
        solutions=steps.solutions,
        failures=steps.failures,
        errors=errors,
        pairs=pairs,
        judge=judge,
        mobility=facts(checked.mobility),
        environment=environment(),
        warnings=(*warnings, *stale),
        doubts=(*doubted, *stale),
        unread=tuple(sentence for key, sentence in unread.items() if key not in scene.allow),
        refusals=(*steps.refused, *steps.missing, *steps.short),
        cover=partial(coverage, scene.mechanism, steps.problem, steps.answers, checked.mobility, scene.tolerance),
        known=[*_known(pairs, steps.solutions)],
        provenance=judged_files,
        undetermined=checked.mobility.undetermined,
        left_out=steps.left_out,
        reviews=reviews(scene, steps.solutions, steps.tables, errors, faulted) if tables else {},
    )


def review(table: Recorded, scene: Scene, quantities: Iterable[str] | None = None) -> TableReview:
    """Reviews a table beside `STANDIN` at its own times, see `screwgauge.review`."""
    check_scene_type(scene, "review")
    path = table.file
    name = re.sub(r"[^\w.-]", "-", path.stem) if path else "numbers"
    name = f"{name}-table" if name in {*engine_names(), REFERENCE} else name
    alone = replace(scene, models={}, tables={}, engines=(STANDIN,)).beside(**{name: table})
    return run(alone.at(table.t), (STANDIN, name), quantities).reviews[name]


class _RunSteps:
    """Answers to a checked scene on their way to a comparison.

    Attributes:
        answers: Engine or table -> its answer, with notes on what it lacks.
        solutions: What is compared: answers in one chart of joint angles; of a simulation, with its observables.
        judged: Engine or table -> rows of the judge.
        refused, missing, short: What an engine gives no number of: some quantities at some samples, whole quantities,
            whole samples.
        left_out: What acts in files and in no engine.
    """

    def __init__(self, scene: Scene, checked: _Checked, progress: Report, limits: Limits | None) -> None:
        self.scene, self.checked, self.progress, self.limits = scene, checked, progress, limits
        self.problem, wanted = scene.problem(checked.wanted), checked.wanted
        # in a simulation observables and conditions of poses follow from positions
        measured = bool(scene.mechanism.left_out or scene.models)
        motion = tuple(name for name in MOTION if name in wanted or name == "joint_position" or measured)
        self.requested = wanted if checked.lay is None else motion
        posed = replace(self.problem, wanted=frozenset(self.requested))
        self._rounding = cache(partial(rounding_errors, scene.mechanism, posed))
        self._idle_errors = cache(partial(idle_errors, scene.mechanism, posed))
        self.answers, self.solutions = dict[str, Solution](), dict[str, Solution]()
        self.failures, self.judged = dict[str, Failure](), dict[str, pd.DataFrame]()
        self.tables: Mapping[str, Solution] = {}
        self.refused, self.missing, self.short = list[Refusal](), list[Refusal](), list[Refusal]()
        self.integration = dict[str, Integrated]()
        self.left_out = LeftOutForces()

    def solve(self, scene: Scene, names: Iterable[str], folder: Path) -> tuple[dict[str, Solution], dict[str, Failure]]:
        """Puts the scene, or the same with other tolerances, to engines."""
        components = self.checked.components
        expected = {quantity: named for quantity, (named, _) in components.items()}
        given = {} if scene.simulated else components
        units = {quantity: dict(zip(*named, strict=True)) for quantity, named in given.items()}
        return ask_engines(scene, names, self.requested, folder, self.progress, expected, self.limits, units)

    def judge_all(self, answers: Mapping[str, Solution], tables: Mapping[str, Solution]) -> None:
        """Judges answers of engines and tables of the user's own."""
        scene, problem = self.scene, self.problem
        answers = {name: self._rounded(answer) for name, answer in answers.items()}
        self.refused = [one for answer in answers.values() for one in refusals(scene.mechanism, problem, answer)]
        self.missing = list(_missing(self.requested, answers, len(scene.t)))
        self.short = list(_short(self.checked.wanted, answers, scene.t))
        lacking = [*self.refused, *self.missing, *self.short]
        noted = {name: _noted(scene, answer, lacking) for name, answer in answers.items()}
        every, self.left_out = without_left_out(scene, problem, noted, tables)
        self.answers, tables = ({name: every[name] for name in some} for some in (noted, tables))
        self.judged = {name: self.judge(answer) for name, answer in self.answers.items()}
        self.judged |= {
            name: judge_table(scene, problem, each, self.checked.components) for name, each in tables.items()
        }
        self.answers |= tables
        self.tables = dict(tables)

    def _rounded(self, answer: Solution) -> Solution:
        """An answer with what its number type makes of it, if that is not float64, whatever it says itself."""
        if (kind := number_type(answer.engine)) is FLOAT64:
            return self._with_idle(answer)
        try:
            errors = self._rounding(kind)
        except ScrewgaugeError as error:
            return replace(answer, errors={}, notes=(*answer.notes, f"what {kind.name} rounds is not known: {error}"))
        return replace(answer, errors={name: one for name, one in errors.items() if name in answer.values})

    def _with_idle(self, answer: Solution) -> Solution:
        """An answer with what rounding makes of accelerations of idle coordinates where that is more than it admits."""
        errors = dict(answer.errors)
        for name, units in self._idle_errors().items() if errors else ():
            if name in errors:
                own = errors[name].absolute
                most = {unit: max(size, own.get(unit, 0.0)) for unit, size in units.items()}
                errors[name] = replace(errors[name], absolute={**own, **most})
        return replace(answer, errors=errors)

    def judge(self, answer: Solution, again: Sequence[Solution] = ()) -> pd.DataFrame:
        """Judges an answer. `again`: of the same engine with looser tolerances."""
        scene, refused = self.scene, self.refused
        return judge(scene.mechanism, self.problem, answer, refused=refused, again=again, tolerance_of=scene.tolerance)

    def compare(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Errors by component and by pair, the latter with rows of what is missing."""
        scene, lay, answers = self.scene, self.checked.lay, self.answers
        given = answers if lay is None else observed(scene, lay, answers, self.checked.wanted)
        self.solutions = without_fixed(scene.mechanism, in_one_chart(scene.mechanism, given))
        errors, pairs = self._compared()
        if lay is not None and (unsure := sorted(doubtful(pairs, self.judged.values()) & {*answers})):
            self._estimate_integration(lay, unsure)
            errors, pairs = self._compared()
        reasons = [
            (name, one.engine, f"{one.engine} {one.sentence}") for one in self.missing for name in one.quantities
        ]
        if lay is not None:
            reasons += ends(scene, self.checked.wanted, answers, self.failures)
        if lost := list(_lost(scene, reasons, self.solutions)):
            pairs = pd.concat([pairs, frame(lost, PAIR_COLUMNS)], ignore_index=True)
        return errors, pairs

    def _compared(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        scene = self.scene
        engines = [each for name, each in self.answers.items() if name not in self.tables]  # tables may lack components
        allowance = Allowance(
            scene.tolerance,
            scene.tolerances if scene.simulated else (),
            {name: table.error for name, table in scene.tables.items()},
            self.integration,
            cache(partial(summands, scene.mechanism, self.problem, engines)),
        )
        failed = {} if scene.simulated else self.failures
        held = failed, self.checked.mobility, allowance, self.refused
        return compare(scene.mechanism, self.problem, self.solutions, *held)

    def _estimate_integration(self, lay: Layout, unsure: Sequence[str]) -> None:
        """Estimates the error of integration by runs with looser tolerances, for solutions and judgement."""
        scene = self.scene
        with generated(scene) as folder:
            looser = [self.solve(each, unsure, folder)[0] for each in loosened(scene)]
        seen = [observed(scene, lay, runs, self.checked.wanted) for runs in looser]
        for name in unsure:
            self.judged[name] = self.judge(self.answers[name], [runs[name] for runs in looser if name in runs])
            runs = {f"{k}": run[name] for k, run in enumerate(seen) if name in run}
            alike = in_one_chart(scene.mechanism, {"": self.solutions[name], **runs})
            first, *again = without_fixed(scene.mechanism, alike).values()
            self.integration[name] = integrated(first, again)
            self.solutions[name] = replace(first, notes=(*first.notes, integration_note(self.integration[name])))


def _known(pairs: pd.DataFrame, solutions: Mapping[str, Solution]) -> Iterator[str]:
    """Discrepancies of the casebook that the installed versions show and that touch what is out of tolerance."""
    bad = pairs[~pairs["ok"].astype(bool)]
    wrong, packages = {*bad["quantity"]}, {ENGINES[name].package for name in {*solutions} & {*ENGINES}}
    for case in suspects(wrong, {*pairs["quantity"]} - wrong, packages) if wrong else ():
        symptom = case.sentence.rstrip(".")
        engines = case.named(installed(case) or ())
        yield f"Known of {engines}: {symptom[0].lower()}{symptom[1:]} (casebook: {case.id})."


def _noted(scene: Scene, answer: Solution, refused: Sequence[Refusal]) -> Solution:
    """An answer with notes on what it lacks."""
    notes = [one.sentence for one in refused if one.engine == answer.engine]
    if not scene.simulated and assembly_of(scene.mechanism, answer) is None:
        notes.append("its assembly is not known, as it gives no joint positions: nothing of it can be judged")
    return replace(answer, notes=(*answer.notes, *notes))


def _changed(scene: Scene) -> Iterator[str]:
    if scene.changed:
        whose = scene.mechanism_file.name
        yield f"the mechanism is not that of {whose}: it was changed, and is run as it is now"


def _unread(scene: Scene, names: Collection[str]) -> dict[str, str]:
    """Files that a scene names and that none of these engines reads: key in `Scene.allow` -> sentence."""
    found = {}
    for name in (name for name in scene.models if name not in names):
        model = f"{scene.models[name]} (models.{name})"
        found[f"models.{name}.{UNREAD}"] = f"{model} is not read, as {name} does not run"
    for name in (name for name in scene.tables if name not in names):
        table = f"{scene.tables[name].file or 'an array'} (tables.{name})"
        found[f"tables.{name}.{UNREAD}"] = f"{table} is not compared, as no engine of that name is asked for"
    return found


def _requested(
    scene: Scene, engines: Iterable[str] | None, quantities: Iterable[str] | None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of engines and quantities, checked."""
    where = str(scene.file or scene.name)
    check_tables(scene)
    if scene.models:
        check_engines(scene.models, f"{where}, models")
    for engine, file in scene.models.items():
        if not is_file(file):
            what = f"model file of {engine} does not exist, or is no regular file ('{file}')"
            raise DescriptionError(what, f"{where}, models", "check the path")
    named, where = (scene.engines, where) if engines is None else (engines, "")
    names = check_engines(named, where, others=scene.tables)
    known = SIMULATED if scene.simulated else OF_MOTION
    wanted = check_quantities(scene.quantities if quantities is None else quantities, known=known)
    if scene.simulated and not scene.observables:
        if quantities is not None and "observable" in wanted:
            raise DescriptionError("there is no observable", scene.name, "add [[observables]]")
        wanted = tuple(name for name in wanted if name != "observable")
    return names, wanted


def _check_given(scene: Scene, wanted: tuple[str, ...]) -> _Checked:
    counted, mechanism = check_scene(scene), scene.mechanism
    wanted, left = check_actuation(scene, counted, wanted)
    # those of a tree are the engine's own
    every = described(mechanism, scene.points)
    given = {name: named for name, named in every.items() if not name.startswith("tree_force")}
    sampled = scene.drive.doubts([*mechanism.independent]) if isinstance(scene.drive, Sampled) else ()
    missing = () if scene.grid is None else scene.grid.warnings
    return _Checked(counted, given, wanted, (*left, *missing, *far_from_home(scene), *sampled, *rest_warning(scene)))


def _check_simulated(scene: Scene, wanted: tuple[str, ...]) -> _Checked:
    lay, warnings = check_start(scene)
    counted = mobility(lay, scene.mechanism.home[None])
    given = dict.fromkeys(MOTION, (scene.mechanism.coordinates, scene.mechanism.units))
    return _Checked(counted, given, wanted, warnings, lay)


def _missing(requested: Sequence[str], answers: Mapping[str, Solution], n: int) -> Iterator[Refusal]:
    """Requested quantities that engines give at none of the n samples."""
    for name, answer in answers.items():
        if lost := left_out(requested, answer):
            yield Refusal(name, lost, np.arange(n), without(lost), without(lost))


def _short(wanted: Iterable[str], answers: Mapping[str, Solution], t: Array) -> Iterator[Refusal]:
    """Samples that engines do not answer, though they do not say beforehand that they answer fewer."""
    for name, answer in answers.items():
        asked = spread(len(t), (ENGINES[name].most if name in ENGINES else 0) or len(t))
        rows = np.setdiff1d(asked, asked if answer.rows is None else answer.rows)
        if rows.size or answer.stopped:
            what = f"answers {len(asked) - len(rows)} of {len(asked)} samples"
            after = f", nothing after t = {t[rows[0] - 1]:g} s" if rows.size and answer.stopped else ""
            why = f"{after}: {answer.stopped}" if answer.stopped else ""
            yield Refusal(name, tuple(wanted), rows, what, f"{what}{why}")


def _lost(
    scene: Scene, reasons: Iterable[tuple[str, str, str]], solutions: Mapping[str, Solution]
) -> Iterator[SizedResidual]:
    """Rows without numbers: pairs of engines that have a quantity with one that has not, or not all of it."""
    for quantity, name, reason in reasons:
        others = [other for other, one in solutions.items() if other != name and quantity in one.values]
        for other in others or [""]:
            a, b = (other, name) if other not in ("", REFERENCE) else (name, other)
            yield nothing(quantity, a, b, reason, scene.tolerance(quantity))
