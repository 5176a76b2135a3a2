"""A campaign: random mechanisms of all families put to engines, one row each; rows that are there are kept."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.families.draw import families, random
from screwgauge.judging.answer import largest
from screwgauge.judging.assembly import assembly_of, other_assemblies
from screwgauge.reference.errors import LoaderError, ScrewgaugeError, check_choice
from screwgauge.scene.scene import Scene
from screwgauge.study.comparison import Comparison
from screwgauge.study.lifeline import hold, lifeline
from screwgauge.study.run import run
from screwgauge.study.table import added_to, rows_in

ENGINES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full")
TRUTH, CERTIFIED = "truth", "certified"
EXPLAINED = "within the error"  # how the comparison begins where an estimate admits what differs
TRUTH_EVERY = 10  # seeds
COLUMNS = (
    *("family", "seed", "redrawn", "bodies", "joints", "freedoms", "loops", "engines", "verdict"),
    *("max_scaled", "tolerance", "quantity", "pair", "component", "estimate", "judge", "branch", "reason"),
    *("truth", "cpu_s", *(f"{engine}_s" for engine in ENGINES)),
)
#: Columns of any campaign that hold numbers from 0 on.
SIZES = {"bodies", "joints", "freedoms", "loops", "redrawn", "max_scaled", "tolerance", "estimate", "error", "cpu_s"}
SIZES |= {f"{engine}_s" for engine in ENGINES}


def campaign(
    count: int,
    file: Path,
    *,
    seed: int = 0,
    only: Sequence[str] | None = None,
    workers: int = 2,
    progress: Callable[[str, float], None] = lambda step, share: None,
    work: Callable[[tuple[int, str]], dict[str, Any]] | None = None,
    columns: Sequence[str] = COLUMNS,
) -> pd.DataFrame:
    """Puts so many mechanisms to the engines, family by family, and the next seed of each when all had their turn.

    Args:
        file: CSV file that rows are added to as they come; those that it has already are kept.
        seed: The first one. Seeds that `TRUTH_EVERY` divides are put to the engine ``truth``, too.
        only: Families; all by default.
        workers: Processes.
        work: Makes a row of seed and family; `measured` by default. It pickles.

    Returns:
        The table, sorted.

    Raises:
        LoaderError: A process was killed, or crashed; all rows that were finished are in the file.
    """
    names = families() if only is None else check_choice("family", only, families())
    items = [(seed + i // len(names), names[i % len(names)]) for i in range(count)]
    sizes = [name for name in columns if name in SIZES]
    done = {(int(row["seed"]), row["family"]) for row in rows_in(file, columns, "random mechanisms", ["seed"], sizes)}
    todo = [item for item in items if item not in done]
    lost = None
    with (
        added_to(file, columns) as add,
        ProcessPoolExecutor(workers, initializer=hold, initargs=(lifeline(),)) as pool,
    ):
        try:
            for i, future in enumerate(as_completed([pool.submit(work or measured, item) for item in todo])):
                if isinstance(future.exception(), BrokenProcessPool):  # others have finished all the same
                    lost = future.exception()
                    continue
                add(row := future.result())
                progress(f"{row['family']} {row['seed']}", (i + 1) / len(todo))
        finally:
            pool.shutdown(cancel_futures=True)
    if lost is not None:
        what, remedy = "a process of the campaign was killed, or crashed", "run the same command again to go on"
        raise LoaderError(what, str(file), remedy) from lost
    return pd.read_csv(file, keep_default_na=False).sort_values(["family", "seed"], ignore_index=True)


def measured(item: tuple[int, str]) -> dict[str, Any]:
    """The row of one mechanism, by seed and family."""
    seed, family = item
    row: dict[str, Any] = {**dict.fromkeys(COLUMNS, ""), "family": family, "seed": seed}
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        scene = random(seed, family, Path(folder))
        mechanism = scene.mechanism
        row["redrawn"] = re.findall(r"\d+(?= draws)", scene.description)[0]
        row["bodies"], row["joints"] = len(mechanism.bodies), len(mechanism.joints)
        row["freedoms"], row["loops"] = len(mechanism.independent), len(mechanism.joints) - len(mechanism.bodies)
        begin = process_time()
        try:
            row |= judged(run(scene, ENGINES))
        except ScrewgaugeError as error:
            row |= {"verdict": "refused", "reason": f"{type(error).__name__}: {error.what}"}
        row["cpu_s"] = f"{process_time() - begin:.3g}"
        if seed % TRUTH_EVERY == 0 and row["verdict"] != "refused":
            row["truth"] = _certified(scene)
    return row


def _certified(scene: Scene) -> str:
    """``certified`` if ``screw`` is right by the truth at every sample, else what is wrong."""
    results = run(scene, (TRUTH, ENGINES[0]))
    if TRUTH in results.failures:
        return str(results.failures[TRUTH].reason)
    truth = results.solutions[TRUTH]
    if truth.rows is not None:
        return f"{len(truth.rows)} of {len(scene.t)} samples certified"
    found = judged(results)
    return CERTIFIED if found["verdict"] in ("agree", "estimated") else f"{found['verdict']} by {found['max_scaled']}"


def judged(results: Comparison) -> dict[str, Any]:
    """Verdict and worst pair of a comparison.

    ``agree``, ``estimated`` (out of tolerance, but within what an engine admits), ``differ``, ``judged`` (pairs agree
    and a residual of an engine is out of tolerance), ``failed`` (an engine gave no answer).
    """
    row: dict[str, Any] = {"engines": " ".join(results.solutions), "verdict": "agree"}
    for name, solution in results.solutions.items():
        row[f"{name}_s"] = f"{sum(timing.min_s for timing in solution.timings):.3g}"
    pairs = [dict[Any, Any](pair) for pair in results.pairs.to_dict("records")]
    mechanism, solutions = results.scene.mechanism, results.solutions
    apart = other_assemblies(mechanism, results.scene.problem(()), solutions.values())
    unknown = [name for name, solution in solutions.items() if assembly_of(mechanism, solution) is None]
    row["branch"] = f"unknown for {', '.join(unknown)}" if unknown else next(iter(apart.values()), "same")
    # the tolerance of soft constraints follows their stiffness, and what is zero is told by its summands
    ranked = [
        pair
        for pair in pairs
        if not pair["ok"] or (pair["quantity"] != "tree_force_soft" and pair["max_scaled"] <= pair["tolerance"])
    ]
    if numbers := [pair for pair in ranked if np.isfinite(pair["max_scaled"])]:
        worst = max(numbers, key=lambda pair: pair["max_scaled"] / pair["tolerance"])
        estimates = (solutions[worst[side]].estimate.get(worst["quantity"]) for side in "ab")
        row |= {key: f"{worst[key]:.2g}" for key in ("max_scaled", "tolerance")}
        row |= {"quantity": worst["quantity"], "pair": f"{worst['a']} - {worst['b']}"}
        row |= {"component": worst["worst_component"]}
        row |= {"estimate": f"{max((largest(one) for one in estimates if one is not None), default=0.0):.2g}"}
    if beyond := [dict[Any, Any](residual) for residual in results.judge.to_dict("records") if not residual["ok"]]:
        worst = max(beyond, key=lambda residual: float(np.nan_to_num(residual["max_scaled"], nan=np.inf)))
        row |= {"judge": f"{worst['engine']} {worst['residual']} {worst['max_scaled']:.2g}", "verdict": "judged"}
    if wrong := [pair["reason"] for pair in pairs if not pair["ok"]]:
        open_ = [reason for reason in wrong if not reason.startswith(EXPLAINED)]
        row |= {"reason": (open_ or wrong)[0], "verdict": "differ" if open_ else "estimated"}
    if results.failures:
        reasons = (f"{name}: {failure.reason}" for name, failure in results.failures.items())
        row |= {"reason": "; ".join(reasons), "verdict": "failed"}
    return row
