"""What leaving out buys: run time with less asked for, and proof that the remaining numbers stay the same."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
import pandas as pd

from screwgauge.models.generate import write_models
from screwgauge.models.mjcf import PARTS
from screwgauge.quantities import GIVEN, OF_BODIES, OF_JOINTS, QUANTITIES, SOLVED
from screwgauge.study.bench.contestant import Contestant
from screwgauge.study.bench.questions import Asked
from screwgauge.study.bench.rows import FAILED, BenchRow
from screwgauge.study.methods import Method
from screwgauge.study.reference import PreparedScene, Reference, sizes
from screwgauge.study.solving import model_files

#: Family of these contestants, which have a table of their own.
LEAVING_OUT = "leaving-out"
COLUMNS = [
    *("engine", "group", "setting", "n_sample", "time_s", "median_s", "ratio", "max_difference", "unchanged"),
    *("status", "reason"),
]
ENGINES = ("screw", "pinocchio", "mujoco")
EVERYTHING = "everything"
ALL_PARTS = "all of them"
#: What each row adds to the one before.
STEPS = {
    **{
        what: tuple(name for name in (*OF_JOINTS, *OF_BODIES) if QUANTITIES[name].needs == needs)
        for what, needs in (("positions only", "q"), ("+ velocities", "v"), ("+ accelerations", "a"))
    },
    "+ generalised forces": ("generalized_force",),
    "+ actuator forces": ("actuator_force",),
    "+ reactions": ("reaction",),
}
MOTION = tuple(name for step in list(STEPS)[:3] for name in STEPS[step])


def less(
    posed: PreparedScene,
    engine: str,
    wanted: Sequence[str],
    *,
    asked: Sequence[str] = GIVEN,
    absent: str = "",
    part: str = "",
) -> Asked:
    """The given motion with less asked for, or less about it, measured by everything that the engine says of it.

    Args:
        asked: Quantities that are computed.
        absent: ``gravity`` or ``load``, which does not act; empty for neither.
        part: Part that the model file has beyond the mechanics; empty for none.
    """
    problem, folder, scene = posed.problem(*asked), posed.folder, posed.scene
    if absent == "gravity":
        problem = replace(problem, applied=replace(problem.applied, gravity=np.zeros(3)))
    if absent == "load":
        problem = replace(problem, applied=replace(problem.applied, loads=()))
    if part:
        folder = folder / f"with-{part}"
        include = frozenset(PARTS) if part == ALL_PARTS else frozenset({part})
        write_models(scene.mechanism, folder, gravity=scene.applied.g, include=include)
    whole = _everything(posed, engine.removesuffix("-full"))
    return Asked(model_files(scene, engine, folder), (problem,), len(posed.t), whole)


@lru_cache(maxsize=len(ENGINES))
def _everything(posed: PreparedScene, engine: str) -> Reference:
    """All that an engine says of a scene, measured by the largest magnitude of each unit."""
    values = Method(engine).load(posed.files(engine)).solve(posed.problem(*GIVEN)).values
    scales = {name: {unit: size or 1.0 for unit, size in sizes(has).items()} for name, has in values.items()}
    return Reference(engine, values, "", scales)


def contestants() -> Iterator[Contestant]:
    """All rows; the first of each engine is everything."""
    for engine in ENGINES:
        covers = f"from y and its derivatives: the engine {engine}, model loaded"
        any_engine = partial(Contestant, LEAVING_OUT, LEAVING_OUT, covers=covers, drawn=False)
        trial = partial(any_engine, method=Method(engine))
        yield trial(EVERYTHING, question=less, quantities=GIVEN)
        asked: tuple[str, ...] = ()
        for step, names in STEPS.items():
            asked += names
            yield trial(step, question=partial(less, asked=asked), quantities=asked, series="asked for")
        alone = ("actuator_force",)
        yield trial("actuator forces alone", question=partial(less, asked=alone), quantities=alone, series="asked for")
        for absent in ("gravity", "load"):  # forces change without them; motion must not
            yield trial(absent, question=partial(less, absent=absent), quantities=MOTION, series="absent")
        # parts of the model file that mechanics does not need; URDF has only limits
        for part in {"screw": (), "pinocchio": ("limits",), "mujoco": (*PARTS, ALL_PARTS)}[engine]:
            setting = "visuals" if part == "geoms" else part
            yield trial(setting, question=partial(less, part=part), quantities=GIVEN, series="in the model")
        if engine != "screw":  # joint forces of another tree are other forces
            same, cut = tuple(name for name in GIVEN if not name.startswith("tree_force")), Method(f"{engine}-full")
            yield any_engine("full cut instead of minimal", cut, less, same, series="cut")


def table(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """The rows of ``leaving_out.csv``, from one for each quantity that must not change."""
    groups: dict[Contestant, list[BenchRow]] = {}
    for row in rows:
        groups.setdefault(row.contestant, []).append(row)
    whole = {c.method.engine: same[0].time_s for c, same in groups.items() if c.setting == EVERYTHING}
    body = []
    for contestant, same in groups.items():
        engine = contestant.method.engine.removesuffix("-full")
        worst = max(same, key=lambda row: np.nan_to_num(row.error, nan=np.inf))
        unchanged, reason = worst.error <= SOLVED, worst.reason if worst.status == FAILED else ""
        if np.isfinite(worst.error) and not unchanged:
            reason = f"changes {worst.quantity}"
        times = (worst.time_s, worst.median_s, worst.time_s / whole.get(engine, np.nan))
        found = (worst.error, unchanged, worst.status, reason)
        body.append((engine, contestant.series, contestant.setting, worst.n_sample, *times, *found))
    return pd.DataFrame(body, columns=COLUMNS)
