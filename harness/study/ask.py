"""Puts scenes and problems to engines, each on its own model file; whatever one raises becomes a failure."""

from __future__ import annotations

import tempfile
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from screwgauge.engines.registry import Engine, Model, engine_names, get_engine, keep, load_entry, not_loaded
from screwgauge.models.generate import stem, write_models
from screwgauge.problem import ModelFiles, Problem, Progress, States, quiet
from screwgauge.reference.errors import DescriptionError, ModelFileError, UnknownNameError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution
from screwgauge.study.method import Method
from screwgauge.study.whole import Expected, check_components, check_whole, excepted, left_out, without

if TYPE_CHECKING:
    from screwgauge.study.apart import Limits

Report = Callable[[str, float], None]
"""Takes the name of a step and the share of it that is done, 0 to 1."""


def silent(step: str, share: float) -> None:
    """A report that nobody looks at."""


def solve(
    scene: Scene, names: Iterable[str], quantities: Iterable[str], *, progress: Report = silent
) -> tuple[dict[str, Solution], dict[str, Failure]]:
    """Puts a scene to the engines as it is: nothing is checked before, nothing compared after.

    Returns:
        What each engine answered, and why the others did not.
    """
    wanted = frozenset(quantities)
    with generated(scene) as folder:
        answers, failures = ask_engines(scene, names, wanted, folder, progress)
    for name, answer in [*answers.items()]:
        if lost := left_out(name, wanted, answer):
            failures[name] = Failure(name, without(lost))
            del answers[name]
    return answers, failures


@contextmanager
def generated(scene: Scene) -> Iterator[Path]:
    """A folder with the generated models of a scene's mechanism, as long as the context lasts."""
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as name:
        write_models(scene.mechanism, Path(name), gravity=scene.applied.g)
        yield Path(name)


def model_files(scene: Scene, name: str, folder: Path) -> ModelFiles:
    """The model file of an engine, generated in `folder` or the user's own, and its loops file."""
    engine, own = get_engine(name), scene.models.get(name)
    if not engine.cut:
        return ModelFiles(own or scene.mechanism_file)
    base = stem(scene.mechanism.name, engine.cut)
    model = own or folder / f"{base}{engine.reads}"
    beside = model.with_suffix(".loops.toml")
    return ModelFiles(model, beside if beside.is_file() else folder / f"{base}.loops.toml")


def missing(error: ImportError, engine: Engine | None = None) -> str:
    """What to install for a module that could not be imported."""
    package = engine.package if engine is not None else (error.name or "it").split(".")[0]
    return f"not installed ({error}); pip install {package}"


def failure(error: BaseException, name: str, folder: Path, engine: Engine | None = None) -> Failure:
    """What a method raised, in one line and without the folder of generated files, which goes with them."""
    said = str(error) or "nothing more is said"  # as Python does of memory
    reason = f"{type(error).__name__}: {' '.join(said.split()).replace(f'{folder}/', '')}"
    if isinstance(error, ImportError):
        reason = missing(error, engine)
    return Failure(name, reason, "".join(traceback.format_exception(error)))


class TooLongError(Exception):
    """A method that was stopped, as it took too long."""


def within(seconds: float) -> Progress:
    """A progress that raises `TooLongError` when it is called later than so many seconds from now."""
    begin = perf_counter()

    def progress(share: float) -> None:
        if perf_counter() - begin > seconds:
            raise TooLongError(f"stopped after {seconds:.3g} s, {share:.0%} of the way")

    return progress


def ask(method: Method, files: ModelFiles, problem: Problem, progress: Progress = quiet) -> Solution | Failure:
    """Loads a model and puts a problem to it, which has to be answered in full; only being stopped is raised."""
    try:
        return check_whole(method.engine, problem, method.load(files).solve(problem, progress))
    except TooLongError:
        raise
    except (Exception, SystemExit) as error:
        entry = get_engine(method.engine) if method.engine in engine_names() else None
        return failure(error, method.name, files.model.parent, entry)


@dataclass(frozen=True, slots=True, eq=False)
class _Question:
    """A problem for an engine, wherever it is asked. Data only; it pickles.

    Attributes:
        scene: What the problem is of.
        folder: Where the generated models are.
    """

    engine: Engine
    files: ModelFiles
    problem: Problem
    scene: Scene
    folder: Path

    @property
    def own(self) -> bool:
        """Whether the model file is the user's own: what is wrong with it is bad input."""
        return self.engine.name in self.scene.models

    def __call__(self, progress: Progress) -> Solution | Failure:
        """Loads the model and puts the problem to it; whatever the engine raises becomes a failure.

        Raises:
            ScrewgaugeError: The user's own model file is bad input.
            MemoryError: There is not enough memory.
        """
        try:
            model = self.engine.load(self.files)
            answer = replace(model.solve(self._ordered(model), progress), engine=self.engine.name)
            return self._told(answer) if self.own else answer
        except MemoryError:
            raise
        except (Exception, SystemExit) as error:
            return self.failure(error)

    def _told(self, answer: Solution) -> Solution:
        """The answer with what the user's own model file says otherwise than the description."""
        from screwgauge.study.departures import departures
        from screwgauge.study.otherwise import otherwise

        said = departures(self.scene, self.engine.name, self.files)
        physical = otherwise(self.scene, self.engine.name, self.files) if said else ()
        notes, warnings = (*answer.notes, *said), (*answer.warnings, *said)
        return replace(answer, notes=notes, warnings=warnings, otherwise=physical)

    def failure(self, error: BaseException) -> Failure:
        """What was raised, as a failure."""
        if self.own and isinstance(error, DescriptionError | ModelFileError | UnknownNameError):
            raise error
        return failure(error, self.engine.name, self.folder, self.engine)

    def _ordered(self, model: Model) -> Problem:
        """The problem with the independent coordinates in the order in which a model file of one's own lists them."""
        labels, own, task = list(self.scene.mechanism.independent), getattr(model, "independent", ()), self.problem.task
        if list(own) == labels or {*own} != {*labels} or isinstance(task, States):
            return self.problem
        return replace(self.problem, task=task.ordered([labels.index(label) for label in own]))


def ask_engines(
    scene: Scene,
    names: Iterable[str],
    wanted: Iterable[str],
    folder: Path,
    progress: Report,
    expected: Expected | None = None,
    limits: Limits | None = None,
) -> tuple[dict[str, Solution], dict[str, Failure]]:
    """Asks engines: one after the other in this process, or each in one of its own, at once as far as cores allow.

    Args:
        folder: Where the generated models are.
        expected: What an answer must have.
        limits: What each may take in a process of its own; None for this one.

    Returns:
        What each engine answered, and why the others did not.

    Raises:
        ScrewgaugeError: A model file of the user's own is bad input.
    """
    wanted = frozenset(wanted)
    questions: dict[str, _Question] = {}
    for name in names:
        files, problem = model_files(scene, name, folder), scene.problem(wanted, name)
        questions[name] = _Question(get_engine(name), files, problem, scene, folder)
    if limits is None:
        answers = in_turn(questions, progress)
    else:
        from screwgauge.study.apart import apart

        answers = apart(questions, limits, folder, progress)
    solutions: dict[str, Solution] = {}
    failures: dict[str, Failure] = {}
    for name, answer in answers.items():
        if isinstance(answer, Failure):
            failures[name] = answer
            continue
        try:
            check_components(answer, len(scene.t), expected or {})
            answer = replace(answer, notes=(*answer.notes, *excepted(name, wanted)))
            solutions[name] = answer.arranged(_orders(answer, scene.mechanism, expected or {}))
        except Exception as error:
            failures[name] = questions[name].failure(error)
    return solutions, failures


def load_engines(names: Iterable[str], limits: Limits, progress: Report) -> None:
    """Loads engines of other packages where they will be asked: their modules may do anything when imported."""
    from screwgauge.study.apart import apart

    entries = not_loaded(names)
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        works = {name: partial(_load_entry, entry) for name, entry in entries.items()}
        for name, engine in apart(works, limits, Path(folder), progress).items():
            keep(entries[name], None if isinstance(engine, Failure) else engine)


def _load_entry(entry: EntryPoint, progress: Progress) -> Engine | None:
    return load_entry(entry)


def in_turn(questions: Mapping[str, _Question], progress: Report) -> dict[str, Solution | Failure]:
    """Asks engines in this process, one after the other."""
    answers: dict[str, Solution | Failure] = {}
    for name, question in questions.items():
        progress(name, 0.0)
        try:
            answers[name] = question(partial(progress, name))
        except MemoryError as error:
            answers[name] = question.failure(error)
    return answers


def _orders(answer: Solution, mechanism: Mechanism, expected: Expected) -> Expected:
    """The order of components that all answers share, that of the description."""
    trees = {name: {*answer.values[name].components} for name in answer.values if name.startswith("tree_force")}
    orders = {name: tuple(c for c in mechanism.coordinates if c in has) for name, has in trees.items()}
    return {**expected, **{name: order for name, order in orders.items() if len(order) == len(trees[name])}}
