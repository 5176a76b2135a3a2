"""What leaving out buys: run time with less asked for, and proof that the remaining numbers stay the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.models.generate import stem, write_models
from screwgauge.models.mjcf import PARTS
from screwgauge.problem import OldProblem
from screwgauge.quantities import QUANTITIES, SOLVED
from screwgauge.solution import Solution, Values
from screwgauge.study.bench.case import Case

COLUMNS = [
    *("engine", "group", "setting", "n_sample", "time_s", "median_s", "ratio", "max_difference", "unchanged"),
    *("status", "reason"),
]
ENGINES = ("screw", "pinocchio", "mujoco")
EVERYTHING = "everything"
#: What each row adds to the one before.
STEPS = {
    "positions only": ("joint_position",),
    "+ velocities": ("joint_velocity", "body_angular_velocity"),
    "+ accelerations": ("joint_acceleration", "body_angular_acceleration", "com_acceleration"),
    "+ generalised forces": ("generalized_force",),
    "+ actuator forces": ("actuator_force",),
    "+ reactions": ("reaction",),
}
MOTION = frozenset(name for step in list(STEPS)[:3] for name in STEPS[step])


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One row. `compared`: quantities that must not change against everything; all that it has, by default."""

    engine: str
    group: str
    setting: str
    problem: Callable[[Case], OldProblem]
    compared: frozenset[str] = frozenset(QUANTITIES)

    @property
    def key(self) -> str:
        return f"leaving out | {self.engine} | {self.group} | {self.setting}"


def trials(engines: Sequence[str]) -> list[Trial]:
    """All rows of some engines; the first of each engine is everything."""
    found = []
    for engine in engines:
        found += [
            Trial(engine, "", EVERYTHING, _problem(engine, frozenset(QUANTITIES))),
            *_depth(engine),
            *_absent(engine),
        ]
        if engine != "screw":
            found += _parts(engine)
            everything = frozenset(QUANTITIES)
            # joint forces of another tree are other forces
            same = everything - {"tree_force", "tree_force_soft"}
            found.append(
                Trial(engine, "cut", "full cut instead of minimal", _problem(f"{engine}-full", everything), same)
            )
    return found


def _problem(engine: str, quantities: frozenset[str], **changes: Any) -> Callable[[Case], OldProblem]:
    return lambda case: replace(case.problem(engine, tuple(quantities)), **changes)


def _depth(engine: str) -> list[Trial]:
    found, asked = [], frozenset[str]()
    for step, names in STEPS.items():
        asked |= set(names)
        found.append(Trial(engine, "asked for", step, _problem(engine, asked)))
    alone = frozenset({"actuator_force"})
    return [*found, Trial(engine, "asked for", "actuator forces alone", _problem(engine, alone))]


def _absent(engine: str) -> list[Trial]:
    """Forces change without gravity or load; motion must not."""
    everything, none = frozenset(QUANTITIES), np.zeros(3)
    return [
        Trial(engine, "absent", "gravity", _problem(engine, everything, gravity=none), MOTION),
        Trial(engine, "absent", "load", _problem(engine, everything, loads=()), MOTION),
    ]


def _parts(engine: str) -> list[Trial]:
    """Parts of the model file that mechanics does not need; URDF has only limits."""

    def problem(part: str) -> Callable[[Case], OldProblem]:
        def make(case: Case) -> OldProblem:
            folder = case.folder / f"with-{part}"
            whole = frozenset(PARTS) if part == "all of them" else frozenset({part})
            write_models(case.scene.mechanism, folder, gravity=case.scene.gravity, include=whole)
            bare = case.problem(engine, tuple(QUANTITIES))
            name = stem(case.scene.mechanism.name, "minimal")
            return replace(bare, model=folder / f"{name}{bare.model.suffix}", loops=folder / f"{name}.loops.toml")

        return make

    parts = (*PARTS, "all of them") if engine == "mujoco" else ("limits",)
    names = {"geoms": "visuals"}
    return [Trial(engine, "in the model", names.get(part, part), problem(part)) for part in parts]


def load(problem: OldProblem, engine: str, case: Case) -> Callable[[], Solution]:
    """A call that solves the problem with a model that is loaded."""
    if engine == "screw":
        from screwgauge.engines.screw.inverse import solve_layout
        from screwgauge.reference.pose import layout

        lay = layout(case.scene.mechanism)
        return lambda: solve_layout(problem, lay)
    from screwgauge.engines.tree.closed_tree import solve_tree
    from screwgauge.models.loops import read_loops

    make = {"pinocchio": "PinocchioTree", "mujoco": "MujocoTree"}[engine]
    if problem.loops is None:
        raise ValueError("a tree engine needs a loops file")
    file = read_loops(problem.loops)
    tree = getattr(import_module(f"screwgauge.engines.{engine}.tree"), make)(problem.model, file, problem.gravity)
    return lambda: solve_tree(problem, tree, file)


def difference(
    found: Mapping[str, Values], everything: Mapping[str, Values], compared: frozenset[str]
) -> tuple[float, str]:
    """Largest difference of a shared quantity, over the largest magnitude of its unit; and that quantity."""
    worst = 0.0, ""
    for name in compared & set(found) & set(everything):
        a, b = everything[name], found[name]
        columns = [b.components.index(component) for component in a.components]
        for unit in dict.fromkeys(a.units):
            mine = [i for i, u in enumerate(a.units) if u == unit]
            gap = np.abs(a.array[:, mine] - b.array[:, [columns[i] for i in mine]]).max()
            worst = max(worst, (float(gap) / (float(np.abs(a.array[:, mine]).max()) or 1.0), name))
    return worst


def table(
    shown: Sequence[Trial], results: Mapping[str, Mapping[str, Any]], times: Mapping[str, Sequence[float]]
) -> pd.DataFrame:
    """The rows of ``leaving_out.csv``."""
    body = []
    for trial in shown:
        result, seconds = results.get(trial.key, {}), list(times.get(trial.key, []))
        whole = min(times.get(_everything(trial.engine), []), default=float("nan"))
        gap = result.get("difference")
        best = min(seconds, default=float("nan"))
        median = float(np.median(seconds)) if seconds else float("nan")
        status = result.get("status", "cut short")
        if status == "ok" and not seconds:
            status = "cut short"
        body.append(
            (
                trial.engine,
                trial.group,
                trial.setting,
                result.get("n_sample", 0),
                best,
                median,
                best / whole,
                float("nan") if gap is None else gap,
                gap is not None and gap <= SOLVED,
                status,
                result.get("reason", ""),
            )
        )
    return pd.DataFrame(body, columns=COLUMNS)


def _everything(engine: str) -> str:
    return f"leaving out | {engine} |  | {EVERYTHING}"
