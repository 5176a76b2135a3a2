"""The runner: tasks become rows that are kept as they come; scenes and problems are put to engines.

Whatever an engine raises becomes a failure.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import monotonic, perf_counter
from typing import TYPE_CHECKING, Any, TypeVar

import pandas as pd

from screwgauge.engines.registry import engine_names, get_engine, keep, load_entry, not_loaded
from screwgauge.models.generate import stem, write_models
from screwgauge.models.importing.write import description
from screwgauge.problem import ModelFiles, Problem, Progress, quiet
from screwgauge.reference.errors import OutputError
from screwgauge.reference.files import is_file, replace_file
from screwgauge.reference.mechanism import Mechanism
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution
from screwgauge.study.completeness import (
    Expected,
    check_components,
    check_units,
    check_whole,
    excepted,
    left_out,
    without,
)
from screwgauge.study.journal import Journal
from screwgauge.study.methods import EngineTask, Method, failure
from screwgauge.study.sound import sound
from screwgauge.study.table import TableFile

if TYPE_CHECKING:
    from screwgauge.study.executors import Executor, Report, Task
    from screwgauge.study.isolation import Limits

Row = TypeVar("Row")
#: Ending of the file of rows that an interrupted table goes on from.
PARTIAL = ".partial.jsonl"


def silent(step: str, share: float) -> None:
    """A report that nobody looks at."""


def run_tasks(
    tasks: Iterable[Task],
    execute: Executor,
    kept: Journal,
    *,
    lost: Callable[[str, str], Row],
    record: Callable[[Row], Mapping[str, Any]] = dict,  # type: ignore[assignment]
    restored: Callable[[Mapping[str, Any]], Row] = dict,  # type: ignore[assignment]
    progress: Report = silent,
    lenient: bool = False,
) -> list[Row]:
    """The rows of all tasks, in their order; those that a journal has are not made again.

    Args:
        lost: Makes a row of the name of a task that crashed, met a limit or raised something, and of the reason.
        record: Makes JSON of a row, and `restored` a row of that.
        progress: Takes what is under way with the rate and the time that is left, and the share that is done.
        lenient: Rows that cannot be kept are returned all the same.

    Raises:
        ScrewgaugeError: Raised by a task, or a row cannot be kept.
    """
    named = {task.name: task for task in tasks}
    keys = {name: task.key or name for name, task in named.items()}
    rows = {name: restored(kept.results[key]) for name, key in keys.items() if key in kept.results}
    todo = {name: task for name, task in named.items() if name not in rows}
    pace = TaskRate(len(todo))

    def keep(name: str, result: Row | Failure) -> None:
        if isinstance(result, Failure):
            step = f"{result.engine}: " * (result.engine != name)
            result = lost(name, f"{step}{result.reason}")
        rows[name] = result
        pace.done += 1
        with suppress(*[OutputError] * lenient):
            kept.keep(keys[name], record(result))

    execute(todo, keep, lambda step, share: progress(pace.shown(step), share))
    return [rows[name] for name in named]


def grow_table(
    table: TableFile,
    tasks: Iterable[Task],
    execute: Executor,
    lost: Callable[[str, str], Mapping[str, Any]],
    progress: Report = silent,
) -> None:
    """Adds rows to a CSV file, those that it has not. Until all are there, a journal beside it has the new ones.

    Args:
        tasks: Each returns a list of rows.
        lost: As `run_tasks` takes it.

    Raises:
        ScrewgaugeError: The file is something else, or cannot be written.
    """
    before = table.rows()
    done = {table.key(row) for row in before}
    kept = Journal(table.file.with_suffix(PARTIAL), " ".join(table.columns))
    rows = run_tasks(
        [task for task in tasks if task.name not in done],
        execute,
        kept,
        lost=lambda name, reason: [lost(name, reason)],
        record=lambda rows: {"rows": rows},
        restored=lambda record: record["rows"],
        progress=progress,
    )
    found = pd.DataFrame([*before, *(row for each in rows for row in each)], columns=[*table.columns])
    replace_file(table.file, found.to_csv(index=False))
    kept.remove()


class TaskRate:
    """How fast tasks are done."""

    def __init__(self, n: int, clock: Callable[[], float] = monotonic) -> None:
        self.n, self.clock, self.done, self.began = n, clock, 0, clock()

    def shown(self, step: str) -> str:
        """What is under way, with the rate and the time that is left once there are some."""
        passed = self.clock() - self.began
        if self.done < 2 or passed <= 0.0:
            return step
        rate = self.done / passed
        return f"{step} ({self.done} of {self.n}, {rate:.2g}/s, {_duration((self.n - self.done) / rate)} left)"


def _duration(seconds: float) -> str:
    for unit, size in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"


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
        write_scene_models(scene, Path(name))
        yield Path(name)


def write_scene_models(scene: Scene, folder: Path) -> None:
    """Writes the models of a scene's mechanism, and its description where its file says another one.

    Raises:
        OutputError: The folder cannot be written.
    """
    write_models(scene.mechanism, folder, gravity=scene.applied.g)
    if scene.changed:
        remark = f"Changed since it was read from {scene.mechanism_file.name}; numbers are those of its doubles."
        text = description(scene.mechanism, [remark])
        (folder / f"{scene.mechanism.name}.toml").write_text(text, encoding="utf-8")


def description_file(scene: Scene, folder: Path) -> Path:
    """The description of a scene's mechanism: its file, or what `write_scene_models` left in a folder."""
    written = folder / f"{scene.mechanism.name}.toml"
    return written if written.is_file() else scene.mechanism_file


def model_files(scene: Scene, name: str, folder: Path) -> ModelFiles:
    """The model file of an engine, generated in `folder` or the user's own, and its loops file."""
    engine, own = get_engine(name), scene.models.get(name)
    if not engine.cut:
        return ModelFiles(own or description_file(scene, folder))
    base = stem(scene.mechanism.name, engine.cut)
    model = own or folder / f"{base}{engine.reads}"
    beside = model.with_suffix(".loops.toml")
    return ModelFiles(model, beside if is_file(beside) else folder / f"{base}.loops.toml")


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
        answer = sound(method.load(files).solve(problem, progress), len(problem.task))
        return check_whole(method.engine, problem, answer)
    except TooLongError:
        raise
    except (Exception, SystemExit) as error:
        entry = get_engine(method.engine) if method.engine in engine_names() else None
        return failure(error, method.name, files.model.parent, entry)


def ask_engines(
    scene: Scene,
    names: Iterable[str],
    wanted: Iterable[str],
    folder: Path,
    progress: Report,
    expected: Expected | None = None,
    limits: Limits | None = None,
    units: Mapping[str, Mapping[str, str]] | None = None,
) -> tuple[dict[str, Solution], dict[str, Failure]]:
    """Asks engines: one after the other in this process, or each in one of its own, at once as far as cores allow.

    Args:
        folder: Where the generated models are.
        expected: What an answer must have.
        limits: What each may take in a process of its own; None for this one.
        units: Quantity -> component -> unit.

    Returns:
        What each engine answered, and why the others did not.

    Raises:
        ScrewgaugeError: A model file of the user's own is bad input.
    """
    wanted = frozenset(wanted)
    questions: dict[str, EngineTask] = {}
    for name in names:
        files, problem = model_files(scene, name, folder), scene.problem(wanted, name)
        own, labels = scene if name in scene.models else None, tuple(scene.mechanism.independent)
        questions[name] = EngineTask(get_engine(name), files, problem, folder, labels, own)
    if limits is None:
        answers = in_turn(questions, progress)
    else:
        from screwgauge.study.isolation import isolated

        answers = isolated(questions, limits, progress)
    solutions: dict[str, Solution] = {}
    failures: dict[str, Failure] = {}
    for name, answer in answers.items():
        if isinstance(answer, Failure):
            failures[name] = answer
            continue
        try:
            check_components(answer, len(scene.t), expected or {})
            check_units(answer, units or {}, len(scene.mechanism.coordinates))
            answer = replace(answer, notes=(*answer.notes, *excepted(name, wanted)))
            solutions[name] = answer.arranged(_orders(answer, scene.mechanism, expected or {}))
        except Exception as error:
            failures[name] = questions[name].failure(error)
    return solutions, failures


def load_engines(names: Iterable[str], limits: Limits, progress: Report) -> None:
    """Loads engines of other packages where they will be asked: their modules may do anything when imported."""
    from screwgauge.study.isolation import isolated_calls

    entries = not_loaded(names)
    works = {name: partial(load_entry, entry) for name, entry in entries.items()}
    for name, engine in isolated_calls(works, limits, progress).items():
        keep(entries[name], None if isinstance(engine, Failure) else engine)


def in_turn(questions: Mapping[str, EngineTask], progress: Report) -> dict[str, Solution | Failure]:
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
