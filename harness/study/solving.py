"""Solution of scenes and problems by engines: generates model files, and runs engines here or in separate processes.

Any error of an engine becomes a failure. For comparisons see `run`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from screwgauge.engines.features import refusal
from screwgauge.engines.registry import engine_names, get_engine
from screwgauge.models.generate import stem, write_models
from screwgauge.models.importing.model import description
from screwgauge.problem import ModelFiles, Problem, Progress, Report, quiet, silent
from screwgauge.quantities import Names
from screwgauge.reference.files import is_file
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution
from screwgauge.study.answers import declared_lacks, plain_answer
from screwgauge.study.fixed import with_fixed
from screwgauge.study.methods import (
    EngineTask,
    Method,
    check_components,
    check_whole,
    failure,
    missing_quantities,
    notes_on_lacks,
    sentence_on_missing,
)
from screwgauge.study.tables import answer_of_table

if TYPE_CHECKING:
    from screwgauge.study.isolation import Limits


def solve(
    scene: Scene, names: Iterable[str], quantities: Iterable[str], *, progress: Report = silent
) -> tuple[dict[str, Solution], dict[str, Failure]]:
    """Solve a scene with the given engines, without checking the scene or comparing the answers.

    Returns:
        Answers of engines that succeeded, and failures of all others.
    """
    wanted = frozenset(quantities)
    solutions, failures = dict[str, Solution](), dict[str, Failure]()
    with generated_models(scene) as folder:
        answers = ask_engines(scene, names, folder, wanted=wanted, progress=progress)
    for name, answer in answers.items():
        if isinstance(answer, Failure):
            failures[name] = answer
        elif lost := missing_quantities(wanted, answer):
            failures[name] = Failure(name, sentence_on_missing(lost))
        else:
            solutions[name] = answer
    return solutions, failures


@contextmanager
def generated_models(scene: Scene) -> Iterator[Path]:
    """Write the generated model files of a scene's mechanism to a temporary folder that exists within the context."""
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as name:
        write_scene_models(scene, Path(name))
        yield Path(name)


def write_scene_models(scene: Scene, folder: Path) -> None:
    """Write the model files of a scene's mechanism, and its description if it differs from the scene's file.

    Raises:
        OutputError: The folder cannot be written.
    """
    write_models(scene.mechanism, folder, gravity=scene.applied.g)
    if scene.changed:
        remark = f"Changed after it was read from {scene.mechanism_file.name}; numbers are rounded to doubles."
        text = description(scene.mechanism, [remark])
        (folder / f"{scene.mechanism.name}.toml").write_text(text, encoding="utf-8")


def description_file(scene: Scene, folder: Path) -> Path:
    """Return the description of a scene's mechanism: its file, or the one written by `write_scene_models`."""
    written = folder / f"{scene.mechanism.name}.toml"
    return written if written.is_file() else scene.mechanism_file


def model_files(scene: Scene, name: str, folder: Path) -> ModelFiles:
    """Return the model file of an engine, generated in `folder` or supplied by the user, and its loops file."""
    engine, given = get_engine(name), scene.models.get(name)
    if not engine.cut:
        return ModelFiles(given or description_file(scene, folder))
    base = stem(scene.mechanism.name, engine.cut)
    model = given or folder / f"{base}{engine.reads}"
    loops = model.with_suffix(".loops.toml")
    return ModelFiles(model, loops if is_file(loops) else folder / f"{base}.loops.toml")


class TooLongError(Exception):
    """Raised if a method took too long and was stopped."""


def time_limit(seconds: float) -> Progress:
    """Return a progress function that raises `TooLongError` if it is called after `seconds`."""
    begin = perf_counter()

    def progress(share: float) -> None:
        if perf_counter() - begin > seconds:
            raise TooLongError(f"stopped after {seconds:.3g} s, {share:.0%} done")

    return progress


def ask(method: Method, files: ModelFiles, problem: Problem, progress: Progress = quiet) -> Solution | Failure:
    """Load a model and solve a problem completely; any error except `TooLongError` becomes a failure."""
    entry = get_engine(method.engine) if method.engine in engine_names() else None
    try:
        if entry is None or not entry.apart:
            model = method.load(files)
            lacks = declared_lacks(model, entry)
            answer = plain_answer(model.solve(problem, progress), len(problem.task))
            return check_whole(problem, replace(answer, lacks=lacks))
        task = EngineTask(entry, files, problem, files.model.parent, (), settings=method.settings)
        (told,) = _ask_all({method.name: task}, None, lambda step, share: progress(share)).values()
        return told if isinstance(told, Failure) else check_whole(problem, told)
    except TooLongError:
        raise
    except (Exception, SystemExit) as error:
        return failure(error, method.name, files.model.parent, entry)


def ask_engines(
    scene: Scene,
    names: Iterable[str],
    folder: Path,
    *,
    wanted: Iterable[str],
    components: Names | None = None,
    progress: Report = silent,
    limits: Limits | None = None,
) -> dict[str, Solution | Failure]:
    """Query the tables, then the engines: sequentially in this process, or each in its own process.

    Args:
        folder: Folder of the generated model files.
        components: Quantity -> names and units of the components that an answer must have.
        limits: Limits of each engine in its own process; None to run in this process.

    Returns:
        The answer or failure of each table and engine, in the order of the names.

    Raises:
        ScrewgaugeError: One of the user's tables or model files is invalid.
    """
    wanted, expected = frozenset(wanted), components or {}
    questions, answers = dict[str, EngineTask](), dict[str, Solution | Failure]()
    names = list(names)
    for name in names:
        if name in scene.tables:
            answers[name] = answer_of_table(scene, name, expected, wanted)
        elif why := refusal(get_engine(name), scene.mechanism, scene.applied):
            answers[name] = Failure(name, why)
        else:
            files, problem = model_files(scene, name, folder), scene.problem(wanted, name)
            of_user, labels = scene if name in scene.models else None, tuple(scene.mechanism.independent)
            questions[name] = EngineTask(get_engine(name), files, problem, folder, labels, of_user)
    for name, answer in _ask_all(questions, limits, progress).items():
        answers[name] = answer
        if isinstance(answer, Solution):
            try:
                answers[name] = _complete(answer, scene, wanted, expected)
            except Exception as error:
                answers[name] = questions[name].failure(error)
    return {name: answers[name] for name in names}


def _complete(answer: Solution, scene: Scene, wanted: Collection[str], expected: Names) -> Solution:
    """Add coordinates of fixed joints and notes on missing values; arrange components in the description's order.

    Raises:
        Exception: The answer has different samples, components or units.
    """
    mechanism = scene.mechanism
    answer = replace(answer, values=with_fixed(mechanism, answer.values))
    check_components(answer, len(scene.t), expected, len(mechanism.coordinates))
    answer = replace(answer, notes=(*answer.notes, *notes_on_lacks(answer, wanted)))
    orders = {quantity: components for quantity, (components, _) in expected.items()}
    for quantity, values in answer.values.items():
        if quantity.startswith("tree_force") and {*values.components} <= {*mechanism.coordinates}:
            orders[quantity] = tuple(name for name in mechanism.coordinates if name in values.components)
    return answer.reorder(orders)


def _ask_all(
    questions: Mapping[str, EngineTask], limits: Limits | None, progress: Report
) -> dict[str, Solution | Failure]:
    """Return the answers of engines, in the given order; engines that must be isolated run only in workers."""
    others = {name: one for name, one in questions.items() if one.engine.apart}
    if limits is None and not others:
        return run_in_turn(questions, progress)
    from screwgauge.study import isolation

    if limits is not None:
        return isolation.run_isolated(questions, limits, progress)
    if isolation.is_worker():
        return run_in_turn(questions, progress)
    answers = run_in_turn({name: one for name, one in questions.items() if name not in others}, progress)
    answers |= isolation.run_isolated(others, isolation.Limits(), progress)
    return {name: answers[name] for name in questions}


def run_in_turn(questions: Mapping[str, EngineTask], progress: Report) -> dict[str, Solution | Failure]:
    """Run engines in this process, one after another."""
    answers: dict[str, Solution | Failure] = {}
    for name, question in questions.items():
        progress(name, 0.0)
        try:
            answers[name] = question(partial(progress, name))
        except MemoryError as error:
            answers[name] = question.failure(error)
    return answers
