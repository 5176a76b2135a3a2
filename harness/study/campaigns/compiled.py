"""Compiled programs against the array solver, sample by sample: no number is wrong by more than its estimate.

``python -m screwgauge.study.campaigns.compiled OUT.csv --states 40000 --random 200`` adds a row for each mechanism and
backend; rows that are there are kept.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from screwgauge.engines.screw.array_work import ArrayWork
from screwgauge.engines.screw.bounds import examined
from screwgauge.engines.screw.compiled import Solver
from screwgauge.families.draw import families, random
from screwgauge.models.catalog import load_mechanism, mechanism_names
from screwgauge.problem import GivenMotion
from screwgauge.quantities import GIVEN
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.pose import layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.study.table import added_to, rows_in

COLUMNS = ("case", "seed", "backend", "samples", "by_program", "worst", "quantity", "ok", "reason")
#: Samples compared at a time, and of a random mechanism's motion.
PART, SAMPLES = 2000, 60
#: Farthest random states [rad]: beyond the leg singularity of the 3-UPS-UPU-S.
REACH = 0.9
#: Forty four-bars take minutes by the array solver.
LEFT_OUT = ("a02-fourbar-40",)


def states(count: int, seed: int = 0) -> GivenMotion:
    """Random states of the paper's mechanism on both sides of its leg singularity."""
    rng = np.random.default_rng(seed)
    y, yd, ydd = rng.uniform(-REACH, REACH, (count, 2)), rng.normal(size=(count, 2)), rng.normal(size=(count, 2))
    return GivenMotion(np.arange(float(count)), y, yd, ydd)


def built_in(name: str) -> Scene:
    """A built-in mechanism near its home pose."""
    mechanism = load_mechanism(name)
    rng, k, t = np.random.default_rng(5), len(mechanism.independent), np.linspace(0.0, 1.0, 60)
    size, w = 0.02 * rng.uniform(0.5, 1.0, k), rng.uniform(1.0, 4.0, k)
    arm, home = np.sin(np.outer(t, w)), mechanism.home[mechanism.independent_columns]
    motion = GivenMotion(t, home + size * arm, size * w * np.cos(np.outer(t, w)), -size * w * w * arm)
    return replace(load_scene("3ups-upu-s").under(loads=()), mechanism=mechanism, task=motion, drive=None, text={})


def compared(scene: Scene, motion: GivenMotion, backend: str) -> dict[str, Any]:
    """The row of a mechanism; pivots are chosen along the scene's own motion.

    ``worst`` is the largest difference over what both solvers say their errors are, 1 at most where they are right.
    """
    solver = Solver(scene, GIVEN, backend, 1, mode=(False, True))
    theirs = ArrayWork(layout(scene.mechanism), scene.problem(GIVEN), motion, "compared")
    row: dict[str, Any] = {"samples": len(motion), "backend": backend, "reason": "; ".join(solver.notes)}
    worst, left = (0.0, ""), 0
    for first in range(0, len(motion), PART):
        some = motion.part(slice(first, first + PART))
        mine, part = solver(some.y, some.yd, some.ydd, estimates=True), theirs.part(some)
        left += sum(mine.by_array.values())
        errors = examined(part, theirs.units, theirs.length)
        column = 0
        for name, units in theirs.units.items():
            for i, unit in enumerate(dict.fromkeys(units)):
                places = [c for c, u in enumerate(units) if u == unit]
                a, b = mine[name][:, places], part.values[name][:, places]
                share = beyond(a, b, mine.estimate[name][:, i] + errors[:, column], angle=unit == "rad")
                worst, column = max(worst, (share, f"{name} [{unit}]")), column + 1
    said = {"by_program": len(motion) - left, "worst": f"{worst[0]:.2g}", "quantity": worst[1]}
    return row | said | {"ok": worst[0] <= 1.0}


def beyond(a: Array, b: Array, bound: Array, *, angle: bool) -> float:
    """Largest difference over its bound; numbers that only one of them has are infinitely far. (n, m), (n, m), (n,)."""
    away = np.abs(a - b)
    if angle:  # a whole turn is none
        away = np.minimum(away, np.abs(away - 2.0 * np.pi))
    away[np.isnan(a) & np.isnan(b)] = 0.0
    share = np.divide(away.max(axis=1, initial=0.0), bound, out=np.zeros(len(a)), where=np.isfinite(bound))
    return float(np.nan_to_num(share, nan=np.inf).max(initial=0.0))


def cases(count: int, drawn: int) -> Iterator[tuple[str, int]]:
    """Name and seed of each case: random states, built-in mechanisms, and random ones family by family."""
    if count:
        yield "states", 0
    yield from ((f"built-in {name}", 0) for name in mechanism_names() if name not in LEFT_OUT)
    yield from ((families()[i % len(families())], i // len(families())) for i in range(drawn))


def measured(case: str, seed: int, backend: str, count: int) -> dict[str, Any]:
    """The row of a case."""
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        try:
            if case == "states":
                scene, motion = load_scene("3ups-upu-s"), states(count, seed)
            else:
                built = case.removeprefix("built-in ")
                scene = built_in(built) if built != case else random(seed, case, Path(folder))
                scene = scene.at(np.linspace(scene.t[0], scene.t[-1], SAMPLES)) if built == case else scene
                motion = scene.motion
            row = compared(scene, motion, backend)
        except ScrewgaugeError as error:
            row = {"ok": "refused", "reason": f"{type(error).__name__}: {error.what}"}
    return {"case": case, "seed": seed, "backend": backend, **row}


def main() -> None:
    """Adds the rows to a file, and says how many of them are right."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--states", type=int, default=2000)
    parser.add_argument("--random", type=int, default=len(families()))
    parser.add_argument("--backends", default="numpy,llvm")
    asked = parser.parse_args()
    done = {(row["case"], int(row["seed"]), row["backend"]) for row in rows_in(asked.out, COLUMNS, "programs")}
    with added_to(asked.out, COLUMNS) as add:
        for case, seed in cases(asked.states, asked.random):
            for backend in asked.backends.split(","):
                if (case, seed, backend) not in done:
                    add(measured(case, seed, backend, asked.states))
    rows = rows_in(asked.out, COLUMNS, "programs")
    wrong = [f"{row['case']} {row['seed']} {row['backend']}" for row in rows if row["ok"] == "False"]
    refused = sum(row["ok"] == "refused" for row in rows)
    print(f"{len(rows) - len(wrong) - refused} right, {refused} refused, {len(wrong)} wrong: {', '.join(wrong)}")


if __name__ == "__main__":
    main()
