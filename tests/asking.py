"""How tests put problems to engines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from screwgauge import Scene
from screwgauge.engines.screw.integrate import integrate as integrate_task
from support.engines import ModelFiles, Problem, Progress, Solution, get_engine, quiet, registry
from support.geometry import Array
from support.mechanism import mechanism_path
from support.models import read_loops, stem
from support.scene import InitialValue, Integration, Task
from support.solve import Applied, Forces, Layout, Trajectory
from support.trees import INTEGRATORS, MujocoTree, PinocchioTree, make_loops

MOTION = frozenset(("joint_position", "joint_velocity", "joint_acceleration"))
TREES = {".urdf": PinocchioTree, ".xml": MujocoTree}


def model_files(mechanism: str, engine: str, folder: Path | None = None) -> ModelFiles:
    """Model files of an engine: those kept beside a built-in mechanism, or those written to a folder."""
    entry = get_engine(engine)
    if not entry.cut:
        return ModelFiles(mechanism_path(mechanism))
    base = stem(mechanism, entry.cut)
    folder = folder or mechanism_path(mechanism).parent
    return ModelFiles(folder / f"{base}{entry.reads}", folder / f"{base}.loops.toml")


def ask(engine: str, files: ModelFiles, problem: Problem, progress: Progress = quiet, **settings: Any) -> Solution:
    """Loads a model and puts one problem to it."""
    return get_engine(engine).load(files, **settings).solve(problem, progress)


@dataclass(frozen=True)
class Simulated:
    """A motion as an engine integrated it, the times that it reached only."""

    engine: str
    q: Array
    v: Array
    a: Array
    work: Array
    condition: Array
    stopped: str
    notes: tuple[str, ...]


@contextmanager
def further_engines(sources: Mapping[str, str]) -> Iterator[None]:
    """As if packages with these engines were installed: name -> ``module:object``, one entry point each."""
    entries = EntryPoints(EntryPoint(name, source, registry.GROUP) for name, source in sources.items())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "entry_points", lambda group: entries.select(group=group))
        registry._plugins.cache_clear()
        yield
    registry._plugins.cache_clear()


def simulate(
    engine: str, files: ModelFiles, applied: Applied, task: Task, progress: Progress = quiet, **settings: Any
) -> Simulated:
    """Integrates a motion: joint coordinates, rates and accelerations of the description, work, condition."""
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
    """The same for a scene with a start, from the kept model files of its mechanism."""
    return simulate(engine, model_files(scene.mechanism.name, engine), scene.applied, scene.start, **settings)


def integrate(
    lay: Layout,
    forces: Forces | Callable[[float], Forces],
    times: Array,
    start: Array | None = None,
    yd: Array | None = None,
    **integration: Any,
) -> Trajectory:
    """Integrates by the screw solver, from home and from rest if nothing else is said; `integration` as in
    `Integration`."""
    mechanism = lay.mechanism
    home = mechanism.home[mechanism.independent_columns]
    start, yd = home if start is None else start, np.zeros_like(home) if yd is None else yd
    return integrate_task(lay, InitialValue(start, yd, float(times[0]), times, Integration(**integration)), forces)


def stopped_after(solution: Solution, n: int, why: str) -> Solution:
    """A simulation as it would be had it stopped after n samples."""

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


def opening(files: ModelFiles, q: Array, names: tuple[str, ...]) -> Array:
    """Largest distance of points that should meet, closures by points as in the minimal cut [m].

    Args:
        q: Joint coordinates of those names. Shape (n, n_q).

    Returns:
        Shape (n,).
    """
    file = read_loops(files.loops)
    tree = TREES[files.model.suffix](files.model, file)
    loops = make_loops(tree, file)
    apart = loops.gaps(tree.poses(q[:, [names.index(name) for name in tree.coordinates]]))
    points = np.repeat(np.array([not anchor.angular for anchor in loops.anchors], dtype=bool), 3)
    return np.linalg.norm(apart[:, points].reshape(len(q), -1, 3), axis=2).max(axis=1, initial=0.0)


def arrays(solution: Solution) -> dict[str, Array]:
    """Everything that was computed; times and words may differ."""
    found = {f"values {name}": values.array for name, values in solution.values.items()}
    for field in fields(solution):
        held = getattr(solution, field.name)
        if isinstance(held, np.ndarray):
            found[field.name] = held
        elif field.name in ("radius", "estimate", "conditions"):
            found |= {f"{field.name} {name}": value for name, value in held.items()}
        elif field.name == "tolerances":
            found |= {f"{field.name} {name} {unit}": np.asarray(x) for name in held for unit, x in held[name].items()}
    return found


def check_same(one: Solution, other: Solution) -> None:
    one, other = arrays(one), arrays(other)
    assert one.keys() == other.keys()
    for name, array in one.items():
        assert np.array_equal(array, other[name], equal_nan=True), name


def has_integrator(name: str) -> bool:
    """Whether this version of MuJoCo has an integrator."""
    return hasattr(mujoco.mjtIntegrator, INTEGRATORS[name])
