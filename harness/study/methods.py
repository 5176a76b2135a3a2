"""Methods, the problems put to them, and checks of what they answer. Imported by the processes of engines.

Engines of other packages return what they like. What gets past `sound` is plain data that can be compared, judged and
shown without another look, so that a bad answer costs its own row only; the checks at the end are for completeness.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from screwgauge.engines.registry import ENGINES, Engine, EngineModel, get_engine
from screwgauge.problem import ModelFiles, Problem, Progress, States
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.errors import DescriptionError, ModelFileError, ScrewgaugeError, UnknownNameError, first_few
from screwgauge.reference.rotations import Array
from screwgauge.solution import ROUNDING, Cost, Error, Failure, Solution, Timing, Values
from screwgauge.study.apart import CrashedError, apart

if TYPE_CHECKING:
    from screwgauge.scene.scene import Scene


TRACE = 20_000  # characters of a traceback that are kept, the last ones
DOUBTS = 3  # about the models or the engines, that a sentence names


def missing(error: ImportError, engine: Engine | None = None) -> str:
    """What to install for a module that is missing, or that was built for other versions."""
    package = engine.package if engine is not None else (error.name or "it").split(".")[0]
    if isinstance(error, ModuleNotFoundError):
        return f"not installed ({error}); pip install {package}"
    return f"cannot be loaded ({error}); pip install --force-reinstall {package}"


def failure(error: BaseException, name: str, folder: Path, engine: Engine | None = None) -> Failure:
    """An exception as a failure: one line, without the name of the temporary folder of generated files."""
    try:
        message = str(error) or "nothing more is said"  # as Python does of memory
    except Exception:  # an error of another package, which may be wrong, too
        message = "what it says cannot be read"
    message = shortened(" ".join(message[: 2 * LONG].split()).replace(f"{folder}/", ""), LONG)
    reason = f"{type(error).__name__}: {message}"
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
    """A problem for an engine, solved here or in a process of its own. Data only; it pickles.

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
            answer = self._solve(progress) if self.engine.name in ENGINES else self._ask_apart(progress)
            if isinstance(answer, Failure):
                return answer
            answer = replace(answer, engine=self.engine.name)
            return answer if self.scene is None else self._with_mismatch(answer, self.scene)
        except MemoryError:
            raise
        except (Exception, SystemExit) as error:
            return self.failure(error)

    def _solve(self, progress: Progress) -> Solution:
        with redirect_stdout(sys.stderr):  # what an engine prints is no output of a command
            model = self.engine.load(self.files)
            lacks = declared(model, self.engine)  # before it has met the problem
            answer = sound(model.solve(self._ordered(model), progress), len(self.problem.task))
            return replace(answer, lacks=lacks)

    def _ask_apart(self, progress: Progress) -> Solution | Failure:
        """Asks an engine of another package, whose answer is looked at where it cannot have changed who looks."""

        def ask() -> Solution | Failure:
            try:
                return self._solve(progress)
            except (MemoryError, ScrewgaugeError):
                raise
            except BaseException as error:
                return failure(error, self.engine.name, self.folder, self.engine)

        try:
            answer, printed = apart(ask)
        except CrashedError as error:
            return Failure(self.engine.name, shortened(str(error), LONG), "\n".join(error.__notes__)[-TRACE:])
        if not isinstance(answer, Failure):
            answer = sound(answer, len(self.problem.task))
            # what is derived, or proved, is so by engines of this package alone
            errors = {name: replace(one, source=ROUNDING, radius=None) for name, one in answer.errors.items()}
            return replace(answer, errors=errors)
        return sound_failure(replace(answer, traceback=f"{answer.traceback}{printed}"[-TRACE:]))

    def _with_mismatch(self, answer: Solution, scene: Scene) -> Solution:
        """The answer with notes on differences between the user's model file and the description."""
        from screwgauge.study.mismatches import mismatches
        from screwgauge.study.user_files import departures, left_out_of_file

        beyond = left_out_of_file(scene, self.engine, self.files.model)
        departing = departures(scene, self.engine.name, self.files)
        otherwise = mismatches(scene, self.engine.name, self.files) if departing else ()
        notes, warnings = (*answer.notes, *departing), (*answer.warnings, *departing)
        return replace(answer, notes=notes, warnings=warnings, otherwise=otherwise, left_out=beyond)

    def failure(self, error: BaseException) -> Failure:
        """An exception as a failure, with physical differences between the user's model file and the description."""
        if self.scene is not None and isinstance(error, DescriptionError | ModelFileError | UnknownNameError):
            raise error
        raised = failure(error, self.engine.name, self.folder, self.engine)
        if self.scene is None or not isinstance(error, ScrewgaugeError):
            return raised
        from screwgauge.study.mismatches import mismatches

        found = mismatches(self.scene, self.engine.name, self.files)
        differences = first_few((each.sentence for each in found), DOUBTS, "; ")
        return replace(raised, reason=f"{raised.reason} The models differ: {differences}.") if differences else raised

    def _ordered(self, model: EngineModel) -> Problem:
        """The problem with the independent coordinates in the order of the user's model file."""
        labels, order, task = list(self.labels), getattr(model, "independent", ()), self.problem.task
        if list(order) == labels or {*order} != {*labels} or isinstance(task, States):
            return self.problem
        return replace(self.problem, task=task.ordered([labels.index(label) for label in order]))


LONG, SHORT, MOST = 2000, 200, 100  # characters of a note, of a name; notes, timings


def sound(answer: object, n: int) -> Solution:
    """An answer for n samples, made of nothing but numbers and texts; long texts are cut, with a remark.

    Raises:
        TypeError, ValueError: It is no such answer; the message names what is wrong.
    """
    if not isinstance(answer, Solution):
        raise TypeError(f"its answer is of type {type(answer).__name__}, not a Solution")
    values = {name: _values(name, one, n) for name, one in _items("values", answer.values)}
    shapes = {name: one.array.shape for name, one in values.items()}
    return Solution(
        engine=shortened(answer.engine, SHORT),
        version=shortened(answer.version, SHORT),
        values=values,
        condition=_sizes("condition", answer.condition, n),
        timings=tuple(map(_timing, _some("timings", answer.timings))),
        notes=_texts("notes", answer.notes),
        errors={name: _error(name, one, n, shapes.get(name, ())) for name, one in _items("errors", answer.errors)},
        assembly=None if answer.assembly is None else _numbers("assembly", answer.assembly, (n, None)),
        rows=None if answer.rows is None else _rows(answer.rows, n),
        setting=shortened(answer.setting, LONG),
        work=None if answer.work is None else _numbers("work", answer.work, (n,)),
        stopped=shortened(answer.stopped, LONG),
        cost=None if answer.cost is None else _cost(answer.cost),
        warnings=_texts("warnings", answer.warnings),
        lacks={name: shortened(why, LONG) for name, why in _items("lacks", answer.lacks)},
    )


def sound_failure(failed: Failure) -> Failure:
    """A failure, made of texts that are not longer than those that are made here."""
    limits = {"engine": SHORT, "reason": 2 * LONG, "traceback": TRACE}
    return Failure(**{name: shortened(getattr(failed, name), most) for name, most in limits.items()})


def shortened(text: object, most: int) -> str:
    """A text of at most `most` characters, with the number of those cut off.

    Raises:
        TypeError: It is no text.
    """
    if not isinstance(text, str):
        raise TypeError(f"a text is of type {type(text).__name__}")
    return str(text) if len(text) <= most else f"{text[:most]}... ({len(text) - most} more characters)"


def _texts(what: str, texts: object) -> tuple[str, ...]:
    some = _some(what, texts)
    return tuple(shortened(text, LONG) for text in some)


def _some(what: str, items: object) -> list[Any]:
    """The items of a tuple or list of at most `MOST`."""
    if not isinstance(items, (tuple, list)):
        raise TypeError(f"its {what} are of type {type(items).__name__}, not a tuple")
    if len(items) > MOST:
        raise ValueError(f"{len(items)} {what}, more than {MOST}")
    return list(items)


def _items(what: str, table: object) -> Iterator[tuple[str, Any]]:
    """Entries of a mapping from quantities."""
    if not isinstance(table, Mapping):
        raise TypeError(f"its {what} are of type {type(table).__name__}, not a mapping")
    for name, value in table.items():
        if not isinstance(name, str) or len(name) > SHORT:
            raise ValueError(f"its {what} have '{name!s:.100}', which is no quantity")
        yield name, value


def _values(name: str, values: object, n: int) -> Values:
    if not isinstance(values, Values):
        raise TypeError(f"its {name} is of type {type(values).__name__}, not Values")
    array = _numbers(name, values.array, (None, None))
    if len(array) != n:
        raise ValueError(f"{len(array)} samples of {name} for {n} times")
    components, units = (_names(name, texts) for texts in (values.components, values.units))
    if len({*components}) < len(components):
        raise ValueError(f"two components of its {name} have one name")
    return Values(components, units, array)


def _names(what: str, texts: Iterable[object]) -> tuple[str, ...]:
    return tuple(shortened(text, SHORT) for text in texts)


def _numbers(what: str, array: object, shape: tuple[int | None, ...]) -> Array:
    """An array of doubles of a shape, in which None is any length."""
    if type(array) is not np.ndarray:  # of a masked one, say, some numbers do not count
        raise TypeError(f"its {what} is of type {type(array).__name__}, not an array of numbers")
    if array.dtype.kind not in "fiu":
        raise TypeError(f"its {what} is an array of {array.dtype.name}, not of real numbers")
    if array.ndim != len(shape) or any(m not in (None, k) for m, k in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("any" if m is None else str(m) for m in shape)
        raise ValueError(f"its {what} has shape {array.shape}, not ({wanted})")
    return array if array.dtype == np.float64 else array.astype(float)


def _sizes(what: str, array: object, n: int) -> Array:
    """A number for each sample, not negative, or NaN."""
    sizes = _numbers(what, array, (n,))
    if (sizes < 0.0).any():
        raise ValueError(f"its {what} has negative numbers")
    return sizes


def _size(what: str, number: Any) -> float:
    """A number that is not negative."""
    if not (size := float(number)) >= 0.0:
        raise ValueError(f"its {what} is {size}: no size, or negative")
    return size


def _error(name: str, error: object, n: int, shape: tuple[int, ...]) -> Error:
    """An error of a quantity whose values have some shape."""
    if not isinstance(error, Error):
        raise TypeError(f"its error of {name} is of type {type(error).__name__}, not an Error")
    radius, condition, what = error.radius, error.condition, f"of {name}"
    return Error(
        scaled=_sizes(f"error {what}", error.scaled, n),
        absolute={unit: _size(f"error {what}", size) for unit, size in _items(f"error {what}", error.absolute)},
        condition=None if condition is None else _sizes(f"condition {what}", condition, n),
        source=shortened(error.source, SHORT),
        radius=None if radius is None else _numbers(f"radius {what}", radius, shape),
    )


def _rows(rows: object, n: int) -> Any:
    """Indices of samples, ascending."""
    if type(rows) is not np.ndarray or rows.dtype.kind not in "iu" or rows.ndim != 1:
        raise TypeError("its rows are not an array of indices")
    if len(rows) and not (rows[0] >= 0 and rows[-1] < n and (np.diff(rows.astype(np.int64)) > 0).all()):
        raise ValueError(f"its rows are not ascending indices of {n} samples")
    return rows.astype(np.intp)


def _timing(timing: object) -> Timing:
    if not isinstance(timing, Timing):
        raise TypeError(f"a timing is of type {type(timing).__name__}")
    engine, setting, stage, n, least, median, covers = astuple(timing)
    engine, setting, stage, covers = (shortened(text, LONG) for text in (engine, setting, stage, covers))
    return Timing(engine, setting, stage, int(n), float(least), float(median), covers)


def _cost(cost: object) -> Cost:
    if not isinstance(cost, Cost):
        raise TypeError(f"its cost is of type {type(cost).__name__}")
    return Cost(float(cost.wall_s), float(cost.cpu_s), int(cost.steps), int(cost.evaluations))


Expected = Mapping[str, tuple[str, ...]]
"""Quantity -> component names that an answer must have."""


class LeftOutError(Exception):
    """An answer that lacks requested quantities."""


def declared(model: EngineModel, engine: Engine | None) -> dict[str, str]:
    """Quantities that an engine, or its loaded model, says that it does not give -> why not."""
    lacks = {**(engine.lacks if engine else {}), **dict(_items("lacks", getattr(model, "lacks", {})))}
    return {name: shortened(why, LONG) for name, why in lacks.items()}


def left_out(wanted: Collection[str], answer: Solution) -> tuple[str, ...]:
    """Requested quantities that an answer lacks, except those that its engine has excepted."""
    return tuple(q for q in QUANTITIES if q in wanted and q not in answer.values and q not in answer.lacks)


def without(quantities: Iterable[str]) -> str:
    """The sentence on an answer that lacks quantities."""
    return f"gives no {', '.join(quantities)}, though asked for"


def excepted(answer: Solution, wanted: Collection[str]) -> Iterator[str]:
    """Notes on requested quantities that an engine has excepted."""
    return (f"gives no {name}: {why}" for name, why in answer.lacks.items() if name in wanted)


def check_whole(problem: Problem, answer: Solution) -> Solution:
    """The answer, if it has all requested quantities.

    Raises:
        LeftOutError: It has not.
    """
    if lost := left_out(problem.wanted, answer):
        raise LeftOutError(without(lost))
    return answer


def check_components(answer: Solution, n: int, expected: Expected) -> None:
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


def check_units(answer: Solution, units: Mapping[str, Mapping[str, str]], coordinates: int) -> None:
    """Refuses an answer in other units than those of the description, or with an assembly of another mechanism.

    Args:
        units: Quantity -> component -> unit.
        coordinates: Of all joints.
    """
    for quantity in {*answer.values} & {*units}:
        values = answer.values[quantity]
        for name, unit in zip(values.components, values.units, strict=True):
            if unit != (wanted := units[quantity].get(name, unit)):
                raise ValueError(f"its {quantity} has {name} in '{unit}', not '{wanted}'")
    if answer.assembly is not None and answer.assembly.shape[1] != coordinates:
        raise ValueError(f"its assembly has {answer.assembly.shape[1]} coordinates, not {coordinates}")
