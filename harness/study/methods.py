"""Methods, the problems that they solve, and checks that answers are complete. Engine processes import this module."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge.engines.registry import ENGINES, Engine, EngineModel, get_engine
from screwgauge.problem import ModelFiles, Problem, Progress, States
from screwgauge.quantities import QUANTITIES, Names
from screwgauge.reference.errors import (
    DescriptionError,
    ModelFileError,
    ScrewgaugeError,
    UnknownNameError,
    first_few,
    remedy_of_import,
)
from screwgauge.solution import ROUNDING, Failure, Solution
from screwgauge.study.answers import LONG, TRACE, declared_lacks, plain_answer, plain_failure, truncate
from screwgauge.study.apart import CrashedError, call_in_fork

if TYPE_CHECKING:
    from screwgauge.scene.scene import Scene


DOUBTS = 3  # largest number of differences between models that a sentence lists


def describe_import_error(error: ImportError, engine: Engine | None = None) -> str:
    """Describe an import error (a module is missing, or was built for different versions), and what to install."""
    module = (error.name or "it").split(".")[0]
    package = module if engine is None else engine.requirement
    if engine is not None and engine.name not in ENGINES and engine.installed and not engine.source.startswith(module):
        package = module  # the engine's package is installed, but does not declare all its requirements
    what = "not installed" if isinstance(error, ModuleNotFoundError) else "cannot be loaded"
    return f"{what} ({error}); {remedy_of_import(error, package)}"


def failure(error: BaseException, name: str, folder: Path, engine: Engine | None = None) -> Failure:
    """Convert an exception to a failure with a one-line reason, from which the temporary folder's name is removed."""
    try:
        message = str(error) or "no message"  # e.g. Python's MemoryError has no message
    except Exception:  # formatting the error of an external package may fail, too
        message = "its message cannot be read"
    message = truncate(" ".join(message[: 2 * LONG].split()).replace(f"{folder}/", ""), LONG)
    reason = f"{type(error).__name__}: {message}"
    if isinstance(error, ImportError):
        reason = describe_import_error(error, engine)
    return Failure(name, truncate(reason, LONG), "".join(traceback.format_exception(error))[-TRACE:])


@dataclass(frozen=True, slots=True)
class Method:
    """Engine with settings.

    Attributes:
        engine: Name in the registry.
        settings: Settings, see the engine's folder.
        label: Name in rows; the engine's name if empty.
        loader: Function that loads a model in place of the engine's own loader, e.g. for a variant of the engine.
    """

    engine: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""
    loader: Callable[..., EngineModel] | None = None

    @property
    def name(self) -> str:
        """Name in rows."""
        return self.label or self.engine

    def load(self, files: ModelFiles) -> EngineModel:
        """Load a model file with the settings.

        Raises:
            ImportError: The engine's package is not installed.
            ScrewgaugeError: The file cannot be loaded.
        """
        return (self.loader or get_engine(self.engine).load)(files, **self.settings)


@dataclass(frozen=True, slots=True, eq=False)
class EngineTask:
    """Problem for an engine, which solves it in this or a separate process. Plain data that can be pickled.

    Attributes:
        folder: Folder of the generated model files.
        labels: Independent coordinates, in the order of the problem.
        scene: Scene of the problem if the user supplied the model file, so that its faults are bad input; None if the
            file was generated, so that the process does not need to import scenes.
        settings: Settings of the engine.
    """

    engine: Engine
    files: ModelFiles
    problem: Problem
    folder: Path
    labels: tuple[str, ...]
    scene: Scene | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self, progress: Progress) -> Solution | Failure:
        """Load the model and solve the problem; any error of the engine becomes a failure.

        Raises:
            ScrewgaugeError: The user's own model file is invalid.
            MemoryError: There is not enough memory.
        """
        try:
            answer = self._solve(progress) if not self.engine.apart else self._ask_apart(progress)
            if isinstance(answer, Failure):
                return answer
            answer = replace(answer, engine=self.engine.name)
            return answer if self.scene is None else self._with_mismatch(answer, self.scene)
        except MemoryError:
            raise
        except (Exception, SystemExit) as error:
            return self.failure(error)

    def _solve(self, progress: Progress) -> Solution:
        with redirect_stdout(sys.stderr):  # output of an engine must not mix with output of the command
            model = self.engine.load(self.files, **self.settings)
            lacks = declared_lacks(model, self.engine)  # before the engine sees the problem
            answer = plain_answer(model.solve(self._reorder(model), progress), len(self.problem.task))
            return replace(answer, lacks=lacks)

    def _ask_apart(self, progress: Progress) -> Solution | Failure:
        """Run an engine in a fork; check its answer outside, because in the fork it could tamper with the checks."""

        def ask() -> Solution | Failure:
            try:
                return self._solve(progress)
            except (MemoryError, ScrewgaugeError):
                raise
            except BaseException as error:
                return failure(error, self.engine.name, self.folder, self.engine)

        try:
            answer, printed = call_in_fork(ask)
        except CrashedError as error:
            return Failure(self.engine.name, truncate(str(error), LONG), "\n".join(error.__notes__)[-TRACE:])
        if not isinstance(answer, Failure):
            answer = plain_answer(answer, len(self.problem.task))
            # only engines that run in this process may derive quantities or prove bounds
            errors = {name: replace(one, source=ROUNDING, radius=None) for name, one in answer.errors.items()}
            return replace(answer, errors=errors)
        return plain_failure(replace(answer, traceback=f"{answer.traceback}{printed}"[-TRACE:]))

    def _with_mismatch(self, answer: Solution, scene: Scene) -> Solution:
        """Add notes on differences between the user's model file and the description to an answer."""
        from screwgauge.study.mismatches import departures, left_out_of_file, mismatches

        beyond = left_out_of_file(scene, self.engine, self.files.model)
        departing = departures(scene, self.engine.name, self.files)
        otherwise = mismatches(scene, self.engine.name, self.files) if departing else ()
        notes, warnings = (*answer.notes, *departing), (*answer.warnings, *departing)
        return replace(answer, notes=notes, warnings=warnings, otherwise=otherwise, left_out=beyond)

    def failure(self, error: BaseException) -> Failure:
        """Convert an exception to a failure, adding physical differences between the user's file and the scene."""
        if self.scene is not None and isinstance(error, DescriptionError | ModelFileError | UnknownNameError):
            raise error
        raised = failure(error, self.engine.name, self.folder, self.engine)
        if self.scene is None or not isinstance(error, ScrewgaugeError):
            return raised
        from screwgauge.study.mismatches import mismatches

        found = mismatches(self.scene, self.engine.name, self.files)
        differences = first_few((each.sentence for each in found), DOUBTS, "; ")
        return replace(raised, reason=f"{raised.reason} The models differ: {differences}.") if differences else raised

    def _reorder(self, model: EngineModel) -> Problem:
        """Return the problem with the independent coordinates in the order of the user's model file."""
        labels, order, task = list(self.labels), getattr(model, "independent", ()), self.problem.task
        if list(order) == labels or {*order} != {*labels} or isinstance(task, States):
            return self.problem
        return replace(self.problem, task=task.reorder([labels.index(label) for label in order]))


class LeftOutError(Exception):
    """Raised for an answer that lacks requested quantities."""


def missing_quantities(wanted: Collection[str], answer: Solution) -> tuple[str, ...]:
    """Return requested quantities that an answer lacks, except those that its engine declares it does not compute."""
    return tuple(q for q in QUANTITIES if q in wanted and q not in answer.values and q not in answer.lacks)


def sentence_on_missing(quantities: Iterable[str]) -> str:
    """Return a sentence on an answer that lacks quantities."""
    return f"did not return the requested {', '.join(quantities)}"


def notes_on_lacks(answer: Solution, wanted: Collection[str]) -> Iterator[str]:
    """Yield notes on requested quantities that an engine declares it does not compute."""
    return (f"does not compute {name}: {why}" for name, why in answer.lacks.items() if name in wanted)


def check_whole(problem: Problem, answer: Solution) -> Solution:
    """Return an answer if it contains all requested quantities.

    Raises:
        LeftOutError: A requested quantity is missing.
    """
    if lost := missing_quantities(problem.wanted, answer):
        raise LeftOutError(sentence_on_missing(lost))
    return answer


def check_components(answer: Solution, n: int, names: Names, coordinates: int) -> None:
    """Reject answers whose samples, components, units or number of coordinates differ from the description.

    Args:
        n: Number of times.
        names: Quantity -> names and units of its components, if known.
        coordinates: Number of all joint coordinates.
    """
    for quantity, values in answer.values.items():
        if len(values.array) != n:
            raise ValueError(f"{quantity} has {len(values.array)} samples, not one for each of {n} times")
        components, units = names.get(quantity, (values.components, values.units))
        odd = [name for name in {*values.components} ^ {*components} if name]
        if odd:
            raise ModelFileError(
                f"its components of {quantity} differ from those of the description: '{min(odd)}'",
                f"model of {answer.engine}",
                "describe the same joints, bodies and actuators in the model, its loops file and the description",
            )
        wanted = dict(zip(components, units, strict=True))
        for name, unit in zip(values.components, values.units, strict=True):
            if unit != wanted.get(name, unit):
                raise ValueError(f"its {quantity} has {name} in '{unit}', not '{wanted[name]}'")
    if answer.assembly is not None and answer.assembly.shape[1] != coordinates:
        raise ValueError(f"its assembly has {answer.assembly.shape[1]} coordinates, not {coordinates}")
