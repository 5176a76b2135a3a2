"""Methods and problems that are put to them, wherever they run, and why one fails. Imported by processes of engines."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge.engines.registry import Engine, EngineModel, get_engine
from screwgauge.problem import ModelFiles, Problem, Progress, States
from screwgauge.reference.errors import DescriptionError, ModelFileError, ScrewgaugeError, UnknownNameError, first_few
from screwgauge.solution import Failure, Solution
from screwgauge.study.sound import LONG, shortened, sound

if TYPE_CHECKING:
    from screwgauge.scene.scene import Scene


TRACE = 20_000  # characters of a traceback that are kept, the last ones
DOUBTS = 3  # about the models or the engines, that a sentence names


def missing(error: ImportError, engine: Engine | None = None) -> str:
    """What to install for a module that is not there, or was not built for what is there."""
    package = engine.package if engine is not None else (error.name or "it").split(".")[0]
    if isinstance(error, ModuleNotFoundError):
        return f"not installed ({error}); pip install {package}"
    return f"cannot be loaded ({error}); pip install --force-reinstall {package}"


def failure(error: BaseException, name: str, folder: Path, engine: Engine | None = None) -> Failure:
    """What a method raised, in one line and without the folder of generated files, which goes with them."""
    try:
        said = str(error) or "nothing more is said"  # as Python does of memory
    except Exception:  # an error of another package, which may be wrong, too
        said = "what it says cannot be read"
    said = shortened(" ".join(said[: 2 * LONG].split()).replace(f"{folder}/", ""), LONG)
    reason = f"{type(error).__name__}: {said}"
    if isinstance(error, ImportError):
        reason = missing(error, engine)
    return Failure(name, shortened(reason, LONG), "".join(traceback.format_exception(error))[-TRACE:])


@dataclass(frozen=True, slots=True)
class Method:
    """An engine with settings.

    Attributes:
        engine: Its name in the registry.
        settings: See the engine's folder.
        label: What rows call it; the engine's name if empty.
    """

    engine: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""

    @property
    def name(self) -> str:
        """What rows call it."""
        return self.label or self.engine

    def load(self, files: ModelFiles) -> EngineModel:
        """Loads a model file with the settings.

        Raises:
            ImportError: The engine's package is not installed.
            ScrewgaugeError: The file cannot be loaded.
        """
        return get_engine(self.engine).load(files, **self.settings)


@dataclass(frozen=True, slots=True, eq=False)
class EngineTask:
    """A problem for an engine, wherever it is asked. Data only; it pickles.

    Attributes:
        folder: Where the generated models are.
        labels: Of the independent coordinates, in the order of the problem.
        scene: What the problem is of, where the model file is the user's own: what is wrong with it is bad input. Where
            it was generated, None: a process that answers has no need to know what scenes are.
    """

    engine: Engine
    files: ModelFiles
    problem: Problem
    folder: Path
    labels: tuple[str, ...]
    scene: Scene | None = None

    def __call__(self, progress: Progress) -> Solution | Failure:
        """Loads the model and puts the problem to it; whatever the engine raises becomes a failure.

        Raises:
            ScrewgaugeError: The user's own model file is bad input.
            MemoryError: There is not enough memory.
        """
        try:
            with redirect_stdout(sys.stderr):  # what an engine prints is no part of what a command says
                model = self.engine.load(self.files)
                answer = model.solve(self._ordered(model), progress)
            answer = replace(sound(answer, len(self.problem.task)), engine=self.engine.name)
            return answer if self.scene is None else self._with_mismatch(answer, self.scene)
        except MemoryError:
            raise
        except (Exception, SystemExit) as error:
            return self.failure(error)

    def _with_mismatch(self, answer: Solution, scene: Scene) -> Solution:
        """The answer with what the user's own model file says otherwise than the description."""
        from screwgauge.study.model_mismatch import departures, physical_mismatch

        said = departures(scene, self.engine.name, self.files)
        physical = physical_mismatch(scene, self.engine.name, self.files) if said else ()
        notes, warnings = (*answer.notes, *said), (*answer.warnings, *said)
        return replace(answer, notes=notes, warnings=warnings, otherwise=physical)

    def failure(self, error: BaseException) -> Failure:
        """What was raised, as a failure, with what the user's own model file says otherwise than the description."""
        if self.scene is not None and isinstance(error, DescriptionError | ModelFileError | UnknownNameError):
            raise error
        found = failure(error, self.engine.name, self.folder, self.engine)
        if self.scene is None or not isinstance(error, ScrewgaugeError):
            return found
        from screwgauge.study.model_mismatch import physical_mismatch

        said = first_few(physical_mismatch(self.scene, self.engine.name, self.files), DOUBTS, "; ")
        return replace(found, reason=f"{found.reason} The models differ: {said}." if said else found.reason)

    def _ordered(self, model: EngineModel) -> Problem:
        """The problem with the independent coordinates in the order in which a model file of one's own lists them."""
        labels, own, task = list(self.labels), getattr(model, "independent", ()), self.problem.task
        if list(own) == labels or {*own} != {*labels} or isinstance(task, States):
            return self.problem
        return replace(self.problem, task=task.ordered([labels.index(label) for label in own]))
