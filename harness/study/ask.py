"""Puts scenes and problems to engines, each on its own model file; whatever one raises becomes a failure."""

from __future__ import annotations

import tempfile
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter

from screwgauge.engines.registry import Engine, Model, engines, get_engine
from screwgauge.models.generate import stem, write_models
from screwgauge.problem import ModelFiles, Problem, Progress, States, quiet
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.errors import DescriptionError, ModelFileError, UnknownNameError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution
from screwgauge.study.method import Method

Report = Callable[[str, float], None]
"""Takes the name of a step and the share of it that is done, 0 to 1."""

Expected = Mapping[str, tuple[str, ...]]
"""Quantity -> component names that an answer must have."""


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


def failure(error: BaseException, method: Method, folder: Path) -> Failure:
    """What a method raised, in one line and without the folder of generated files, which goes with them."""
    reason = f"{type(error).__name__}: {' '.join(str(error).split()).replace(f'{folder}/', '')}"
    if isinstance(error, ImportError):
        reason = missing(error, get_engine(method.engine))
    return Failure(method.name, reason, "".join(traceback.format_exception(error)))


def left_out(engine: str, wanted: Collection[str], answer: Solution) -> tuple[str, ...]:
    """Quantities that an engine was asked for and does not give, other than those that its entry excepts."""
    return tuple(q for q in QUANTITIES if q in wanted and q not in answer.values and q not in _lacks(engine))


def _lacks(engine: str) -> Mapping[str, str]:
    """What the entry of an engine excepts; nothing of a method that has no entry, such as the paper's scheme."""
    return engines()[engine].lacks if engine in engines() else {}


def without(quantities: Iterable[str]) -> str:
    """What is said of an answer that has no such quantities."""
    return f"gives no {', '.join(quantities)}, though asked for"


class LeftOutError(Exception):
    """An answer without all that was asked for."""


def check_whole(engine: str, problem: Problem, answer: Solution) -> Solution:
    """The answer, if it has all that was asked for.

    Raises:
        LeftOutError: It has not.
    """
    if lost := left_out(engine, problem.wanted, answer):
        raise LeftOutError(without(lost))
    return answer


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
        return failure(error, method, files.model.parent)


def ask_engines(
    scene: Scene,
    names: Iterable[str],
    wanted: Iterable[str],
    folder: Path,
    progress: Report,
    expected: Expected | None = None,
) -> tuple[dict[str, Solution], dict[str, Failure]]:
    """Asks engines one after the other.

    Args:
        folder: Where the generated models are.
        expected: What an answer must have.

    Returns:
        What each engine answered, and why the others did not.

    Raises:
        ScrewgaugeError: A model file of the user's own is bad input.
    """
    solutions: dict[str, Solution] = {}
    failures: dict[str, Failure] = {}
    wanted = frozenset(wanted)
    for name in names:
        progress(name, 0.0)
        method, own = Method(name), name in scene.models
        try:
            problem = scene.problem(wanted, name)
            model = method.load(model_files(scene, name, folder))
            answer = model.solve(_ordered(problem, scene, model), partial(progress, name))
            answer = replace(answer, engine=name)
            answer = replace(answer, notes=(*answer.notes, *_excepted(name, wanted)))
            _check_answer(answer, len(scene.t), expected or {})
            solutions[name] = answer.arranged(_orders(answer, scene.mechanism, expected or {}))
        except (Exception, SystemExit) as error:  # whatever an engine raises becomes a row, so that the others go on
            if own and isinstance(error, DescriptionError | ModelFileError | UnknownNameError):
                raise
            failures[name] = failure(error, method, folder)
    return solutions, failures


def _excepted(engine: str, wanted: Collection[str]) -> Iterator[str]:
    """What an engine says of quantities that were asked for and that it cannot give."""
    return (f"gives no {name}: {why}" for name, why in _lacks(engine).items() if name in wanted)


def _orders(answer: Solution, mechanism: Mechanism, expected: Expected) -> Expected:
    """The order of components that all answers share, that of the description."""
    trees = {name: {*answer.values[name].components} for name in answer.values if name.startswith("tree_force")}
    orders = {name: tuple(c for c in mechanism.coordinates if c in has) for name, has in trees.items()}
    return {**expected, **{name: order for name, order in orders.items() if len(order) == len(trees[name])}}


def _ordered(problem: Problem, scene: Scene, model: Model) -> Problem:
    """The problem with the independent coordinates in the order in which a model file of one's own lists them."""
    labels, own = list(scene.mechanism.independent), getattr(model, "independent", ())
    if list(own) == labels or {*own} != {*labels} or isinstance(problem.task, States):
        return problem
    return replace(problem, task=problem.task.ordered([labels.index(label) for label in own]))


def _check_answer(answer: Solution, n: int, expected: Expected) -> None:
    """Refuses an answer with other samples or components than the description has."""
    for quantity, values in answer.values.items():
        if len(values.array) != n:
            raise ValueError(f"{len(values.array)} samples of {quantity} for {n} times")
        odd = [name for name in {*values.components} ^ {*expected.get(quantity, values.components)} if name]
        if odd:
            raise ModelFileError(
                f"its {quantity} and that of the description differ in '{min(odd)}'",
                f"model of {answer.engine}",
                "describe the same joints, bodies and actuators in the model, its loops file and the description",
            )
