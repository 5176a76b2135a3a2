"""Problems, engines that answer them, and answers."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from screwgauge import Scene
from screwgauge.engines import registry
from screwgauge.engines.registry import ENGINES, Engine, check_engines, engines, get_engine
from screwgauge.engines.screw import model as screw
from screwgauge.models.catalog import mechanism_path
from screwgauge.models.generate import stem
from screwgauge.problem import ModelFiles, Problem, Progress, Task, quiet, silent
from screwgauge.reference.applied import Applied
from screwgauge.reference.rotations import Array
from screwgauge.solution import REFERENCE, Clock, Cost, Error, Failure, Solution, Timing, Values, common_rows
from screwgauge.study.isolation import run_isolated
from screwgauge.study.methods import Method
from screwgauge.study.solving import ask as put
from screwgauge.study.solving import run_in_turn, solve

#: All that compute in doubles, of both cuts.
IN_DOUBLES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full")
MOTION = frozenset(("joint_position", "joint_velocity", "joint_acceleration"))


def model_files(mechanism: str, engine: str, folder: Path | None = None) -> ModelFiles:
    entry = get_engine(engine)
    if not entry.cut:
        return ModelFiles(mechanism_path(mechanism))
    base = stem(mechanism, entry.cut)
    folder = folder or mechanism_path(mechanism).parent
    return ModelFiles(folder / f"{base}{entry.reads}", folder / f"{base}.loops.toml")


def ask(engine: str, files: ModelFiles, problem: Problem, progress: Progress = quiet, **settings: Any) -> Solution:
    return get_engine(engine).load(files, **settings).solve(problem, progress)


def unwatched(works: Any, limits: Any, report: Any, *, keep: Any = lambda name, answer: None, **more: Any) -> Any:
    """In the place of `isolation.run_isolated`: works in this process, as nobody else is to be protected."""
    answers = run_in_turn(works, lambda name, share, *at: report(name, share))  # a check says what it is at, too
    for name, answer in answers.items():
        keep(name, answer)
    return answers


@contextmanager
def further_engines(sources: Mapping[str, str]) -> Iterator[None]:
    entries = EntryPoints(EntryPoint(name, source, registry.GROUP) for name, source in sources.items())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "entry_points", lambda group: entries.select(group=group))
        registry.further_entries.cache_clear()
        yield
    registry.further_entries.cache_clear()


@dataclass(frozen=True)
class Simulated:
    engine: str
    q: Array
    v: Array
    a: Array
    work: Array
    condition: Array
    stopped: str
    notes: tuple[str, ...]


def simulate(
    engine: str, files: ModelFiles, applied: Applied, task: Task, progress: Progress = quiet, **settings: Any
) -> Simulated:
    solution = ask(engine, files, Problem(applied, task, MOTION), progress, **settings)
    rows = slice(0, solution.n_solved)
    q, v, a = (solution.values[name].array[rows] for name in ("joint_position", "joint_velocity", "joint_acceleration"))
    return Simulated(
        solution.engine,
        *(q, v, a, solution.work[rows], solution.condition[rows]),
        stopped=solution.stopped,
        notes=solution.notes,
    )


def simulate_scene(engine: str, scene: Scene, **settings: Any) -> Simulated:
    return simulate(engine, model_files(scene.mechanism.name, engine), scene.applied, scene.start, **settings)


def stopped_after(solution: Solution, n: int, why: str) -> Solution:
    def cut(array: Array) -> Array:
        array = array.copy()
        array[n:] = np.nan
        return array

    return replace(
        solution,
        values={name: replace(values, array=cut(values.array)) for name, values in solution.values.items()},
        condition=cut(solution.condition),
        work=cut(solution.work),
        rows=np.arange(n),
        stopped=why,
    )


def arrays(solution: Solution) -> dict[str, Array]:
    found = {f"values {name}": values.array for name, values in solution.values.items()}
    for field in fields(solution):
        held = getattr(solution, field.name)
        if isinstance(held, np.ndarray):
            found[field.name] = held
    for name, error in solution.errors.items():
        each = {"scaled": error.scaled, "condition": error.condition, "radius": error.radius, **error.absolute}
        found |= {f"{what} of {name}": np.asarray(x) for what, x in each.items() if x is not None}
    return found


def check_same(one: Solution, other: Solution) -> None:
    one, other = arrays(one), arrays(other)
    assert one.keys() == other.keys()
    for name, array in one.items():
        assert np.array_equal(array, other[name], equal_nan=True), name
