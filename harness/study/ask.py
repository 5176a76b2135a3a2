"""Puts a scene to engines, each on its own model file; whatever an engine raises becomes a row."""

from __future__ import annotations

import tempfile
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from screwgauge.engines.registry import Engine, get_engine
from screwgauge.models.generate import stem, write_models
from screwgauge.problem import ModelFiles
from screwgauge.reference.errors import DescriptionError, ModelFileError, UnknownNameError
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution

Report = Callable[[str, float], None]
"""Takes the name of a step and the share of it that is done, 0 to 1."""

Expected = Mapping[str, tuple[str, ...]]
"""Quantity -> component names that an answer must have."""


def silent(step: str, share: float) -> None:
    """A report that nobody looks at."""


def solve(
    scene: Scene, engines: Iterable[str], quantities: Iterable[str], *, progress: Report = silent
) -> tuple[dict[str, Solution], dict[str, Failure]]:
    """Puts a scene to the engines as it is: nothing is checked before, nothing compared after.

    Returns:
        What each engine answered, and why the others did not.
    """
    with generated(scene) as folder:
        return ask(scene, tuple(engines), tuple(quantities), {}, folder, progress)


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


def ask(
    scene: Scene,
    names: Sequence[str],
    wanted: Sequence[str],
    expected: Expected,
    folder: Path,
    progress: Report,
) -> tuple[dict[str, Solution], dict[str, Failure]]:
    """Asks engines one after the other.

    Args:
        expected: What an answer must have.
        folder: Where the generated models are.

    Returns:
        What each engine answered, and why the others did not.
    """
    solutions: dict[str, Solution] = {}
    failures: dict[str, Failure] = {}
    for name in names:
        progress(name, 0.0)
        engine = get_engine(name)
        try:
            files = model_files(scene, name, folder)
            # a model file of one's own keeps its own gravity, if its format has one: that, too, is judged
            problem = scene.problem(wanted, own_gravity=name in scene.models and engine.reads == ".xml")
            answer = engine.load(files).solve(problem, partial(progress, name))
            answer = replace(answer, engine=name)
            _check_answer(answer, len(scene.t), expected)
            solutions[name] = answer
        except Exception as error:  # whatever an engine raises becomes a row, so that the others go on
            failures[name] = _failed(scene, engine, error, folder)
    return solutions, failures


def _failed(scene: Scene, engine: Engine, error: Exception, folder: Path) -> Failure:
    """The row of an engine that raised.

    Raises:
        ScrewgaugeError: The error itself, if the user's own model file is bad input.
    """
    where = "".join(traceback.format_exception(error))
    if isinstance(error, ImportError):
        return Failure(engine.name, missing(error, engine), where)
    if engine.name in scene.models and isinstance(error, DescriptionError | ModelFileError | UnknownNameError):
        raise error
    text = " ".join(str(error).split()).replace(f"{folder}/", "")  # generated files go with the folder
    return Failure(engine.name, f"{type(error).__name__}: {text}", where)


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
