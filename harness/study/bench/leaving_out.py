"""What leaving out buys: run time with less asked for, and proof that the remaining numbers stay the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.models.generate import write_models
from screwgauge.models.mjcf import PARTS
from screwgauge.quantities import GIVEN, SOLVED
from screwgauge.solution import Values
from screwgauge.study.ask import model_files
from screwgauge.study.bench.questions import Asked
from screwgauge.study.bench.rows import CUT, OK
from screwgauge.study.method import Method
from screwgauge.study.posed import Posed

COLUMNS = [
    *("engine", "group", "setting", "n_sample", "time_s", "median_s", "ratio", "max_difference", "unchanged"),
    *("status", "reason"),
]
ENGINES = ("screw", "pinocchio", "mujoco")
EVERYTHING = "everything"
ALL_PARTS = "all of them"
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
WHOLE = frozenset(GIVEN)


@dataclass(frozen=True, slots=True)
class Trial:
    """One row.

    Attributes:
        wanted: What is asked for.
        absent: ``gravity`` or ``load``, which does not act; empty for neither.
        part: Part that the model file has beyond the mechanics; empty for none.
        full: All joints are in the engine's tree.
        compared: Quantities that must not change against everything.
    """

    engine: str
    group: str
    setting: str
    wanted: frozenset[str] = WHOLE
    absent: str = ""
    part: str = ""
    full: bool = False
    compared: frozenset[str] = WHOLE

    @property
    def key(self) -> str:
        """Identifies the trial within a bench."""
        return f"leaving out | {self.engine} | {self.group} | {self.setting}"

    @property
    def method(self) -> Method:
        """What is put to the test."""
        return Method(f"{self.engine}-full" if self.full else self.engine)

    def ask(self, posed: Posed) -> Asked:
        """Its question on a scene."""
        problem, folder, scene = posed.problem(*self.wanted), posed.folder, posed.scene
        if self.absent == "gravity":
            problem = replace(problem, applied=replace(problem.applied, gravity=np.zeros(3)))
        if self.absent == "load":
            problem = replace(problem, applied=replace(problem.applied, loads=()))
        if self.part:
            folder = folder / f"with-{self.part}"
            include = frozenset(PARTS) if self.part == ALL_PARTS else frozenset({self.part})
            write_models(scene.mechanism, folder, gravity=scene.applied.g, include=include)
        files = model_files(scene, self.method.engine, folder)
        return Asked(files, (problem,), len(posed.t), posed.reference)


def trials(engines: Sequence[str]) -> list[Trial]:
    """All rows of some engines; the first of each engine is everything."""
    return [trial for engine in engines for trial in _trials(engine)]


def everything(engine: str) -> Trial:
    """What the other rows of an engine are compared with."""
    return Trial(engine, "", EVERYTHING)


def _trials(engine: str) -> list[Trial]:
    asked, depth = frozenset[str](), []
    for step, names in STEPS.items():
        asked |= set(names)
        depth.append(Trial(engine, "asked for", step, asked))
    found = [
        everything(engine),
        *depth,
        Trial(engine, "asked for", "actuator forces alone", frozenset({"actuator_force"})),
        # forces change without gravity or load; motion must not
        Trial(engine, "absent", "gravity", absent="gravity", compared=MOTION),
        Trial(engine, "absent", "load", absent="load", compared=MOTION),
    ]
    if engine == "screw":
        return found
    # parts of the model file that mechanics does not need; URDF has only limits
    parts = (*PARTS, ALL_PARTS) if engine == "mujoco" else ("limits",)
    found += [Trial(engine, "in the model", {"geoms": "visuals"}.get(part, part), part=part) for part in parts]
    # joint forces of another tree are other forces
    same = WHOLE - {"tree_force", "tree_force_soft"}
    return [*found, Trial(engine, "cut", "full cut instead of minimal", full=True, compared=same)]


def result(trial: Trial, answer: Mapping[str, Values], whole: Mapping[str, Values]) -> dict[str, Any]:
    """How far the answer of a trial is from that of everything, and in which quantity if that is more than rounding."""
    gap, worst = difference(answer, whole, trial.compared)
    return {"difference": gap, "reason": f"changes {worst}" if gap > SOLVED else ""}


def difference(
    answer: Mapping[str, Values], whole: Mapping[str, Values], compared: frozenset[str]
) -> tuple[float, str]:
    """Largest difference of a shared quantity, over the largest magnitude of its unit; and that quantity."""
    worst = 0.0, ""
    for name in compared & set(answer) & set(whole):
        a, b = whole[name], answer[name].pick(whole[name].components)
        for unit in dict.fromkeys(a.units):
            columns = [i for i, u in enumerate(a.units) if u == unit]
            gap = float(np.abs(a.array[:, columns] - b.array[:, columns]).max())
            worst = max(worst, (gap / (float(np.abs(a.array[:, columns]).max()) or 1.0), name))
    return worst


def table(
    shown: Sequence[Trial], results: Mapping[str, Mapping[str, Any]], times: Mapping[str, Sequence[float]]
) -> pd.DataFrame:
    """The rows of ``leaving_out.csv``."""
    nan, body = float("nan"), []
    for trial in shown:
        found, seconds = results.get(trial.key, {}), list(times.get(trial.key, []))
        whole = min(times.get(everything(trial.engine).key, []), default=nan)
        best, median = min(seconds, default=nan), float(np.median(seconds)) if seconds else nan
        gap, status = found.get("difference", nan), found.get("status", CUT)
        if status == OK and not seconds:
            status = CUT
        measured = (found.get("n_sample", 0), best, median, best / whole, gap, gap <= SOLVED)
        body.append((trial.engine, trial.group, trial.setting, *measured, status, found.get("reason", "")))
    return pd.DataFrame(body, columns=COLUMNS)
