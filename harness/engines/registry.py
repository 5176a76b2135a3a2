"""The registry of engines, with an entry for each engine. Other packages register an `Engine` in the entry point group
``screwgauge.engines``."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from importlib import import_module
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, version
from inspect import Parameter, signature
from typing import Any, Protocol, cast

from screwgauge.problem import GivenMotion, InitialValue, ModelFiles, Problem, Progress, States, Task, quiet
from screwgauge.processes import python, safe_path
from screwgauge.quantities import AS, FLOAT64, NUMBER_TYPES
from screwgauge.reference.errors import DescriptionError, UnknownNameError, check_choice
from screwgauge.solution import Solution
from screwgauge.truth import LACKS, MOST

GROUP = "screwgauge.engines"
TEXT = 1000  # largest number of characters in a string of an engine's description
LONGEST = 300.0  # time limit [s] for importing an engine's module; GPU libraries take a minute on a busy machine
CUTS = ("", "minimal", "full")
_WORDS: dict[type[Task], str] = {
    GivenMotion: "solve given motions",
    InitialValue: "integrate",
    States: "evaluate given states",
}


class EngineModel(Protocol):
    """A loaded model file that solves any number of problems.

    It may have an attribute `independent`, the labels of its independent coordinates if their order differs from the
    description's, and an attribute `lacks`, which maps quantities that it cannot compute for this model to reasons.
    """

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Solve a problem.

        Raises:
            ScrewgaugeError: The problem does not fit the model, or cannot be solved.
        """


@dataclass(frozen=True, slots=True)
class Engine:
    """Registry entry of an engine.

    Attributes:
        meaning: Description in a few words.
        source: ``module:function``, imported only when used; ``function(files, **settings) -> EngineModel``.
            Settings are the function's keyword arguments, or the fields of ``Settings`` in its module.
        tasks: The kinds of task that it accepts.
        package: Distribution that must be installed.
        reads: File extension of its model file.
        cut: Generated model that it reads, ``minimal`` or ``full``; empty if it reads the description.
        lacks: Quantity that the engine cannot compute -> reason. The engine must compute all other quantities.
        most: Largest number of samples that it solves, see `problem.spread`; 0 for all. Ignored for engines of other
            packages, which must solve all samples.
        refuses: Unsupported item -> reason. An item is a task, or an entry of `features.FEATURES` such as a kind of
            joint; the engine is never given a mechanism with such a feature.
        extra: Extra of Screwgauge that installs its package; empty if `package` itself is to be installed.
        apart: True if each problem is solved in its own process, so that anything a library prints, changes or breaks
            affects only that problem's answer. Engines of other packages always run in separate processes.
        precisions: Number types in which it can solve given motions, see `NUMBER_TYPES`. If a method name requests a
            type other than float64, as in ``mjx@float32``, the function receives it as the setting `precision`.
        precision: The requested number type.
    """

    name: str
    meaning: str
    source: str
    tasks: frozenset[type[Task]]
    package: str
    reads: str = ".toml"
    cut: str = ""
    lacks: Mapping[str, str] = field(default_factory=dict)
    refuses: Mapping[str, str] = field(default_factory=dict)
    most: int = 0
    extra: str = ""
    apart: bool = False
    precisions: tuple[str, ...] = (FLOAT64.name,)
    precision: str = FLOAT64.name

    @property
    def requirement(self) -> str:
        """Requirement string to pass to pip."""
        return f"'screwgauge[{self.extra}]'" if self.extra else self.package

    @property
    def installed(self) -> bool:
        """True if the engine's package is installed."""
        try:
            return bool(version(self.package))
        except PackageNotFoundError:
            return False

    def load(self, files: ModelFiles, **settings: Any) -> EngineModel:
        """Load a model file.

        Args:
            settings: The engine's own settings, see its module.

        Raises:
            ImportError: The engine's package is not installed.
            UnknownNameError: The engine has no such setting.
            ScrewgaugeError: The file cannot be loaded.
        """
        if self.precision != FLOAT64.name:
            settings = {"precision": self.precision, **settings}
        module, _, function = self.source.partition(":")
        source = import_module(module)
        load = getattr(source, function)
        if settings:
            self._check_settings(settings, getattr(source, "Settings", load))
        return cast(EngineModel, load(files, **settings))

    @property
    def methods(self) -> dict[str, str]:
        """Method name -> number type: the bare name means float64, and ``mjx@float32`` means float32."""
        return {self.name if each == FLOAT64.name else f"{self.name}{AS}{each}": each for each in self.precisions}

    def in_precision(self, name: str, where: str = "") -> Engine:
        """Return the engine in the number type that a name such as ``mjx@float32`` requests.

        With a type other than float64, the engine accepts only given motions.

        Raises:
            DescriptionError: The engine does not compute in that type.
        """
        if name not in self.methods:
            what = f"engine '{self.name}' only computes in {' or '.join(self.precisions)}"
            raise DescriptionError(what, where or name, f"use {' or '.join(map(repr, self.methods))}")
        if name == self.name:
            return self
        return replace(self, name=name, precision=self.methods[name], tasks=self.tasks & {GivenMotion})

    def _check_settings(self, names: Iterable[str], takes: Callable[..., Any]) -> None:
        """Reject settings that are not parameters of the class or function that receives them."""
        parameters = signature(takes).parameters.values()
        if any(parameter.kind is Parameter.VAR_KEYWORD for parameter in parameters):
            return
        known = [parameter.name for parameter in parameters if parameter.name != "files"]
        for name in names:
            if name not in known:
                raise UnknownNameError("setting", name, known, f"engine {self.name}")


_HERE = "screwgauge.engines"
_ALL: frozenset[type[Task]] = frozenset((GivenMotion, InitialValue, States))
_GIVEN: frozenset[type[Task]] = frozenset((GivenMotion,))
_PINOCCHIO = (f"{_HERE}.pinocchio.model:load", "pin", ".urdf")
_MUJOCO = (f"{_HERE}.mujoco.model:load", "mujoco", ".xml")


def _tree_engine(name: str, meaning: str, code: tuple[str, str, str], cut: str) -> Engine:
    """Build the entry of an open-tree engine; `code` is its source, package and file extension."""
    source, package, reads = code
    if cut == "minimal":
        return Engine(name, meaning, source, _ALL, package, reads, cut)
    why = "the engine with the minimal cut simulates the same mechanism with fewer coordinates"
    return Engine(
        name, meaning, source, _ALL - {InitialValue}, package, reads, cut, refuses={InitialValue.__name__: why}
    )


def _port(name: str, meaning: str, package: str, precisions: tuple[str, ...]) -> Engine:
    """Build the entry of a MuJoCo port."""
    source = f"{_HERE}.mujoco.ports:load_{name}"
    refuses = {
        "InitialValue": "its simulations support only soft constraints",
        "States": "it solves only given motions",
    }
    more: dict[str, Any] = {"extra": name, "apart": True, "precisions": precisions, "refuses": refuses}
    return Engine(name, meaning, source, _GIVEN, package, ".xml", "minimal", **more)


def _treeless(name: str, meaning: str, why: str, package: str, **more: Any) -> Engine:
    """Build the entry of an engine that supports only given motions and has no open tree; `why` is the reason."""
    lacks = dict.fromkeys(("tree_force", "tree_force_soft"), why)
    refuses = {"InitialValue": _GIVEN_ONLY, "States": why}
    return Engine(name, meaning, f"{_HERE}.{name}:load", _GIVEN, package, lacks=lacks, refuses=refuses, **more)


_TRUTH = "ball arithmetic with rigorous radii, on request"
_NO_TREE = "it has no tree: each body has separate coordinates"
_ALL_JOINTS = "it has no tree: its unknowns are the coordinates of all joints"
_GIVEN_ONLY = "it solves only given motions"
ENGINES: dict[str, Engine] = {
    engine.name: engine
    for engine in (
        Engine(
            "screw",
            "the screw-based solver of this project",
            f"{_HERE}.screw.model:load",
            _ALL,
            "screwgauge",
            precisions=tuple(NUMBER_TYPES),
        ),
        _tree_engine("pinocchio", "Pinocchio on the URDF, minimal cut", _PINOCCHIO, "minimal"),
        _tree_engine("mujoco", "MuJoCo on the MJCF, minimal cut", _MUJOCO, "minimal"),
        _tree_engine("pinocchio-full", "Pinocchio, all joints in the tree", _PINOCCHIO, "full"),
        _tree_engine("mujoco-full", "MuJoCo, all joints in the tree", _MUJOCO, "full"),
        _port("mjx", "MJX, MuJoCo in JAX, on the MJCF, minimal cut", "mujoco-mjx", ("float64", "float32")),
        _port("mjwarp", "MuJoCo Warp on the MJCF, minimal cut, in float32", "mujoco-warp", ("float32",)),
        _treeless(
            "lagrange", "Lagrange's equations from derivatives of positions, on request", _ALL_JOINTS, "screwgauge"
        ),
        Engine(
            "truth",
            _TRUTH,
            "screwgauge.truth.engine:load",
            _GIVEN,
            "python-flint",
            lacks=LACKS,
            refuses={
                "springs": "it encloses the effects of forces along joints and on bodies, but not of springs",
                "InitialValue": "it computes enclosures for given motions, but not for simulations",
                "States": "it closes loops itself and has no open tree",
            },
            most=MOST,
            extra="truth",
        ),
        _treeless(
            "exudyn", "EXUDYN, absolute coordinates, no tree and no cut", _NO_TREE, "exudyn", extra="exudyn", apart=True
        ),
        Engine(
            "drake",
            "Drake on the URDF, minimal cut",
            f"{_HERE}.drake:load",
            _GIVEN,
            "drake",
            ".urdf",
            "minimal",
            refuses=dict.fromkeys(("InitialValue", "States"), _GIVEN_ONLY),
            extra="drake",
            apart=True,
        ),
    )
}


@lru_cache(maxsize=1)
def further_entries() -> Mapping[str, EntryPoint]:
    """Return the entry points of other packages' engines by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP) if entry.name not in ENGINES}


def engine_names() -> tuple[str, ...]:
    """List the names of all engines without loading any engine; engines of other packages come last."""
    return (*ENGINES, *further_entries())


def engines() -> dict[str, Engine]:
    """Return all engines by name."""
    return {name: _find(name) for name in engine_names()}


def get_engine(name: str, where: str = "") -> Engine:
    """Return an engine by name; a name such as ``mjx@float32`` also selects its number type.

    If the description of another package's engine is invalid, loading the engine raises an error with the reason.

    Raises:
        UnknownNameError: No engine has that name.
        DescriptionError: The engine does not compute in that number type.
    """
    return _find(name.partition(AS)[0]).in_precision(name, where)


def _find(name: str) -> Engine:
    if name in ENGINES:
        return ENGINES[name]
    if name not in further_entries():
        raise UnknownNameError("engine", name, engine_names())
    return _load_description(further_entries()[name])


#: Loads an engine in a process where its module can do no harm, then prints its description.
_DESCRIBE = """
import json, os, sys
sys.path[:], value, said = json.loads(sys.argv[1]), sys.argv[2], os.dup(1)
os.dup2(2, 1)
from screwgauge.engines.registry import description
text = description(value)
os.write(said, text.encode())
os._exit(0)
"""


@lru_cache
def _load_description(entry: EntryPoint) -> Engine:
    """Return the engine of another package, using the description printed by a separate process.

    For an invalid description, return an engine whose `load` raises an error.
    """
    try:
        command = python("-c", _DESCRIBE, json.dumps(safe_path()), entry.value)
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, check=True, timeout=LONGEST, start_new_session=True
        )
        told = json.loads(done.stdout)
        kinds = {kind.__name__: kind for kind in _ALL}
        told["tasks"] = frozenset(kinds[name] for name in told["tasks"])
        told["precisions"] = tuple(told["precisions"])
        return replace(
            _check_description(Engine(**told)), name=entry.name, extra="", apart=True, precision=FLOAT64.name
        )
    except (OSError, subprocess.SubprocessError, ValueError, TypeError, KeyError, RecursionError):
        package = entry.dist.name if entry.dist else entry.module
        return Engine(entry.name, "cannot be loaded", entry.value, _ALL, package, apart=True)


def description(value: str) -> str:
    """Return the description of an engine as JSON.

    Args:
        value: ``module:object`` of the engine's entry point.
    """
    engine = _check_description(EntryPoint("", value, GROUP).load())
    told = {each.name: getattr(engine, each.name) for each in fields(engine)}
    tables = {"lacks": dict(engine.lacks), "refuses": dict(engine.refuses)}
    return json.dumps({**told, **tables, "tasks": [kind.__name__ for kind in engine.tasks]})


def _check_description(engine: object) -> Engine:
    """Return the engine if its description is complete and printable; reject it if not.

    Raises:
        TypeError, ValueError: The description is incomplete or not printable.
    """
    if not isinstance(engine, Engine):
        raise TypeError(f"expected an Engine, got {type(engine).__name__}")
    texts = (
        engine.name,
        engine.meaning,
        engine.source,
        engine.package,
        engine.reads,
        *engine.lacks,
        *engine.lacks.values(),
        *engine.refuses,
        *engine.refuses.values(),
    )
    if not all(isinstance(text, str) and len(text) <= TEXT for text in texts):
        raise ValueError(f"names, reasons and other entries must be strings of at most {TEXT} characters")
    if engine.cut not in CUTS or not engine.tasks <= _ALL:
        raise ValueError("unknown cut or task")
    if not engine.precisions or not {*engine.precisions} <= {*NUMBER_TYPES}:
        raise ValueError(f"precisions must be among {', '.join(NUMBER_TYPES)}")
    return engine


def check_engines(
    names: Iterable[str], where: str = "", task: type[Task] | None = None, others: Collection[str] = ()
) -> tuple[str, ...]:
    """Check names of engines and return them in the given order without repetitions.

    Args:
        task: A kind of task that all engines must accept.
        others: Further allowed names that are not engines.

    Raises:
        ScrewgaugeError: The list is empty, a name is neither an engine nor in `others`, or an engine does not accept
            the task.
    """
    named = names if isinstance(names, str) or not isinstance(names, Iterable) else [*names]
    bases = named if named is names else [str(name).partition(AS)[0] for name in named]
    check_choice("engine", bases, (*engine_names(), *others), where)
    wanted = tuple(dict.fromkeys(named))
    for name in wanted:
        engine = None if name in others else get_engine(name, where)
        if task is not None and engine is not None and task not in engine.tasks:
            able = ", ".join(other for other, engine in engines().items() if task in engine.tasks)
            raise DescriptionError(f"engine '{name}' does not {_WORDS[task]}", where, f"choose from {able}")
    return wanted
