"""Compiled programs against truth and the array solver, sample by sample: no number is wrong by more than its estimate.

A row for each mechanism and backend. The array solver answers all samples, truth some.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from campaigns.rows import grown, keep

from screwgauge.engines.registry import get_engine
from screwgauge.engines.screw.compiled import CompiledSolution, Solver
from screwgauge.engines.screw.inverse import Work
from screwgauge.engines.screw.programs import estimate_errors
from screwgauge.families.draw import families, random
from screwgauge.models.catalog import load_mechanism, mechanism_names, mechanism_path
from screwgauge.problem import GivenMotion, ModelFiles, Rows
from screwgauge.quantities import GIVEN
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.graph import layout
from screwgauge.reference.mobility import mobility
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene

COLUMNS = (
    *("case", "seed", "backend", "samples", "by_program", "worst", "quantity", "certified", "true_worst"),
    *("true_quantity", "ok", "reason"),
)
#: Samples compared at a time, of a motion, and those of them that are put to truth.
PART, SAMPLES, CERTIFIED = 2000, 300, 40
#: Farthest random states [rad]: beyond the leg singularity of the 3-UPS-UPU-S.
REACH = 0.9
#: Random mechanisms, and random states of the paper's for each of them.
DRAWN, STATES = 200, 200
BACKENDS = ("numpy", "llvm")
#: Forty four-bars take minutes by the array solver.
LEFT_OUT = ("a02-fourbar-40",)


def states(count: int, seed: int = 0) -> GivenMotion:
    rng = np.random.default_rng(seed)
    y, yd, ydd = rng.uniform(-REACH, REACH, (count, 2)), rng.normal(size=(count, 2)), rng.normal(size=(count, 2))
    return GivenMotion(np.arange(float(count)), y, yd, ydd)


def near_home(name: str | Path, n: int = SAMPLES) -> Scene:
    mechanism = load_mechanism(name)
    rng, k, t = np.random.default_rng(5), len(mechanism.independent), np.linspace(0.0, 1.0, n)
    size, w = 0.02 * rng.uniform(0.5, 1.0, k), rng.uniform(1.0, 4.0, k)
    arm, home = np.sin(np.outer(t, w)), mechanism.home[mechanism.independent_columns]
    motion = GivenMotion(t, home + size * arm, size * w * np.cos(np.outer(t, w)), -size * w * w * arm)
    bare = load_scene("3ups-upu-s").under(loads=())
    return replace(bare, mechanism=mechanism, mechanism_file=mechanism_path(name), task=motion, drive=None, text={})


#: Quantity -> its numbers, and what their errors are at most. Shapes (n, m).
Answers = Mapping[str, tuple[Array, Array]]


def spread(errors: Array, units: Sequence[str]) -> Array:
    kinds = [*dict.fromkeys(units)]
    return errors[:, [kinds.index(unit) for unit in units]]


def by_array(scene: Scene, motion: GivenMotion) -> Answers:
    work = Work(layout(scene.mechanism), scene.problem(GIVEN))
    some = [motion.part(slice(i, i + PART)) for i in range(0, len(motion), PART)]
    parts = [work.part(one, work.close(one, work.predict(one))) for one in some]
    units = {name: units for name, (_, units) in work.names().items() if name in parts[0].values}
    errors = np.concatenate([estimate_errors(part, units, work.loops.length) for part in parts])
    each = np.split(errors, np.cumsum([len({*one}) for one in units.values()]), axis=1)
    values = {name: np.concatenate([part.values[name] for part in parts]) for name in units}
    return {name: (values[name], spread(e, units[name])) for name, e in zip(values, each, strict=False)}


def by_truth(scene: Scene, motion: GivenMotion) -> tuple[Rows, Answers]:
    """Samples that truth could certify, and its answers there; what redundancy leaves open has no bound.

    Raises:
        ScrewgaugeError: There is none.
    """
    rows: Rows = np.unique(np.linspace(0, len(motion) - 1, CERTIFIED).astype(np.intp))
    problem = replace(scene, task=motion.part(rows), drive=None, text={}).problem(GIVEN)
    truth = get_engine("truth").load(ModelFiles(scene.mechanism_file)).solve(problem)
    done = np.arange(len(rows)) if truth.rows is None else truth.rows
    answers = {name: (x.array[done], truth.errors[name].radius[done].copy()) for name, x in truth.values.items()}
    if "reaction" in answers:
        lay, three = layout(scene.mechanism), motion.part(rows[done[[0, len(done) // 2, -1]]])
        q = positions(lay, three.y, three.t, (three.yd, three.ydd))
        some = [mobility(lay, q[[i]]).determined[: answers["reaction"][0].shape[1]] for i in range(3)]
        answers["reaction"][1][:, ~np.all(some, axis=0)] = np.inf
    return rows[done], answers


def by_program(solver: Solver, motion: GivenMotion) -> tuple[int, Answers]:
    left, parts = 0, list[CompiledSolution]()
    for first in range(0, len(motion), PART):
        some = motion.part(slice(first, first + PART))
        parts.append(solver(some.y, some.yd, some.ydd, estimates=True))
        left += sum(parts[-1].by_array.values())
    return len(motion) - left, {
        name: (
            np.concatenate([part[name] for part in parts]),
            spread(np.concatenate([part.estimate[name] for part in parts]), units),
        )
        for name, units in solver.first.units.items()
    }


def compared(scene: Scene, motion: GivenMotion, backends: Iterable[str]) -> Iterator[dict[str, Any]]:
    """The rows of a mechanism; pivots are chosen along the scene's own motion.

    ``worst`` is the largest difference over what both solvers say their errors are, 1 at most where they are right.
    """
    arrays, every, why = by_array(scene, motion), np.arange(len(motion)), ""
    try:
        certified, truths = by_truth(scene, motion)
    except ScrewgaugeError as error:
        certified, truths, why = every[:0], {}, f"no truth: {error.what}"
    for backend in backends:
        solver = Solver(scene, GIVEN, backend, 1, mode=(False, True))
        n, mine = by_program(solver, motion)
        (worst, where), (true_worst, true_where) = (
            furthest({name: (x[rows], bound[rows]) for name, (x, bound) in mine.items()}, others, solver.first.units)
            for rows, others in ((every, arrays), (certified, truths))
        )
        counts = {"samples": len(motion), "by_program": n, "certified": len(certified)}
        shares = {
            "worst": f"{worst:.2g}",
            "quantity": where,
            "true_worst": f"{true_worst:.2g}",
            "true_quantity": true_where,
        }
        ok, reason = max(worst, true_worst) <= 1.0, "; ".join(filter(None, [*solver.notes, why]))
        yield {"backend": backend, **counts, **shares, "ok": ok, "reason": reason}


def furthest(mine: Answers, others: Answers, units: Mapping[str, Sequence[str]]) -> tuple[float, str]:
    worst = 0.0, ""
    for name, (b, radius) in others.items():
        a, estimate = mine[name]
        for unit in dict.fromkeys(units[name]):
            of = np.array([u == unit for u in units[name]])
            share = beyond(a[:, of], b[:, of], (estimate + radius)[:, of], angle=unit == "rad")
            worst = max(worst, (share, f"{name} [{unit}]"))
    return worst


def beyond(a: Array, b: Array, bound: Array, *, angle: bool) -> float:
    """Largest difference over its bound; numbers that only one of them has are infinitely far. Shape (n, m) each."""
    away = np.abs(a - b)
    if angle:  # a whole turn is none
        away = np.minimum(away, np.abs(away - 2.0 * np.pi))
    away[np.isnan(a) & np.isnan(b)] = 0.0
    # what is nowhere away needs no bound: both say zero of what is at rest
    share = np.divide(away, bound, out=np.zeros(a.shape), where=~np.isinf(bound) & (away != 0.0))
    return float(np.nan_to_num(share, nan=np.inf).max(initial=0.0))


def cases(count: int | None) -> Iterator[tuple[str, int]]:
    yield "states", 0
    yield from [(f"built-in {name}", 0) for name in mechanism_names() if name not in LEFT_OUT][:count]
    yield from ((families()[i % len(families())], i // len(families())) for i in range(count or DRAWN))


def measured(case: str, seed: int, backends: Sequence[str], count: int) -> list[dict[str, Any]]:
    """The rows of a case."""
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        try:
            if case == "states":
                scene, motion = load_scene("3ups-upu-s"), states(count, seed)
            else:
                built = case.removeprefix("built-in ")
                scene = near_home(built) if built != case else random(seed, case, Path(folder))
                scene = scene.at(np.linspace(scene.t[0], scene.t[-1], SAMPLES)) if built == case else scene
                motion = scene.motion
            rows = [*compared(scene, motion, backends)]
        except ScrewgaugeError as error:
            why = f"{type(error).__name__}: {error.what}"
            rows = [{"backend": backend, "ok": "refused", "reason": why} for backend in backends]
    return [{"case": case, "seed": seed, **row} for row in rows]


def compiled(file: Path, count: int | None) -> pd.DataFrame:
    states = STATES * (count or DRAWN)
    works = {f"{case} {seed}": partial(measured, case, seed, BACKENDS, states) for case, seed in cases(count)}
    text = grown(file, COLUMNS, works, lambda name, why: {"case": name, "ok": "failed", "reason": why}, [states])
    keep(file, text)
    return pd.read_csv(StringIO(text), dtype=str, keep_default_na=False)
