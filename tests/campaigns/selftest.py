"""The study: models changed at random, each put to a diagnosis, and as many that only look different; one row each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
import pandas as pd
from campaigns.judged import CLOSE, judged
from campaigns.kinds import KINDS
from campaigns.lookalikes import REWRITES
from campaigns.mutant import TURNED, CannotError
from campaigns.pools import Pool, pools

from screwgauge.diagnosis.diagnose import Diagnosis, diagnose
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.files import read_file
from screwgauge.study.table import added_to, rows_in

#: Changes, and pairs that are alike for each.
COUNT, PAIRS = 500, 0.4
SMALLEST, LARGEST = 1e-6, 0.1  # relative size of a change
#: A change of torques below it [of the largest torque] need not be found.
VISIBLE = 1e-9
CHANGED, ALIKE = "changed", "alike"
COLUMNS = (
    *("group", "number", "kind", "model", "public", "a", "b", "size", "effect", "detected", "right", "error"),
    *("left", "backfill", "cpu_s", "verdict", "first"),
)
#: Of these, numbers from 0 on.
SIZES = ("size", "effect", "error", "left", "cpu_s")


@dataclass(frozen=True, slots=True)
class Item:
    """One diagnosis to be made."""

    group: str
    number: int
    kind: str


def items(count: int, pairs: int, kinds: Sequence[str] = tuple(KINDS)) -> Iterator[Item]:
    """Kinds in turn, changes first."""
    for i in range(count):
        yield Item(CHANGED, i, kinds[i % len(kinds)])
    rewrites = tuple(REWRITES)
    for i in range(pairs):
        yield Item(ALIKE, i, rewrites[i % len(rewrites)])


def selftest(
    count: int,
    pairs: int,
    file: Path,
    *,
    seed: int = 0,
    quick: bool = False,
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> pd.DataFrame:
    """Diagnoses so many changed models and pairs that are alike.

    Args:
        file: CSV file that rows are added to as they come; those that it has already are kept.
        quick: Small models only.

    Returns:
        The table, sorted, columns `COLUMNS`.
    """
    done = {(row["group"], int(row["number"])) for row in rows_in(file, COLUMNS, "a self-test", ["number"], SIZES)}
    todo = [item for item in items(count, pairs) if (item.group, item.number) not in done]
    with TemporaryDirectory(prefix="screwgauge-") as folder, added_to(file, COLUMNS) as add:
        models = pools(Path(folder), quick)
        for i, item in enumerate(todo):
            add(row_of(item, models, Path(folder), seed))
            progress(f"{item.kind} {item.number}", (i + 1) / len(todo))
    return pd.read_csv(file, keep_default_na=False).sort_values(["group", "number"], ignore_index=True)


def row_of(item: Item, models: Sequence[Pool], folder: Path, seed: int) -> dict[str, Any]:
    """One row: the first of random models that has a place for the change, or that can be written so."""
    rng = np.random.default_rng([seed, item.group == ALIKE, item.number])
    size = float(10.0 ** rng.uniform(np.log10(SMALLEST), np.log10(LARGEST)))
    row: dict[str, Any] = {**dict.fromkeys(COLUMNS, ""), "group": item.group, "number": item.number, "kind": item.kind}
    reason = ""
    for i in rng.permutation(len(models)):
        pool = models[int(i)]
        (first, library_a), (second, library_b) = (pool.files[int(k)] for k in rng.integers(len(pool.files), size=2))
        text = read_file(second)
        try:
            if item.group == CHANGED:
                text, expected = KINDS[item.kind](text, rng, size)
                if first.suffix != second.suffix:  # the slip is made in an orientation that A does not write
                    expected = [replace(each, slip="turned by") if each.slip in TURNED else each for each in expected]
            else:
                text, expected = REWRITES[item.kind](text, rng), []
        except CannotError as error:
            reason = str(error)
            continue
        copy = folder / f"b-{second.name}"
        copy.write_text(text, encoding="utf-8")
        row |= {"model": pool.name, "public": pool.public, "a": f"{first.suffix[1:]} {library_a}"}
        row |= {"b": f"{second.suffix[1:]} {library_b}", "size": f"{size:.3g}" if item.group == CHANGED else ""}
        begin = process_time()
        try:
            found = diagnose(f"{first}@{library_a}", f"{copy}@{library_b}")
        except ScrewgaugeError as error:
            if not row["verdict"]:
                reason = f"{type(error).__name__}: {error.what}"
            continue
        row["cpu_s"] = f"{process_time() - begin:.3g}"
        return row | _alike(found) if item.group == ALIKE else row | _judged(found, expected)
    return row | {"verdict": "no place", "first": reason}


def _judged(found: Diagnosis, expected: Sequence[Any]) -> dict[str, Any]:
    result = judged(found, expected)
    why, proof = found.attribution, found.proof
    effect = why.before.scaled if why else np.inf
    imprecise = result.error > CLOSE
    verdict = "ok" if result.right and not imprecise else "imprecise" if result.right else "wrong"
    row = {"effect": f"{effect:.3g}", "detected": result.detected, "right": result.right, "first": result.first}
    row |= {"error": f"{result.error:.2g}" if np.isfinite(result.error) else ""}
    row |= {"verdict": verdict if result.detected else "missed"}
    return row | ({"left": f"{proof.left.scaled:.2g}", "backfill": proof.on} if proof else {})


def _alike(found: Diagnosis) -> dict[str, Any]:
    effect = found.attribution.before.scaled if found.attribution else np.inf
    quiet = found.same or found.undecided
    said = {"first": "", "verdict": "ok"} if quiet else {"first": found.verdict, "verdict": "false alarm"}
    return {"effect": f"{effect:.3g}", "detected": not quiet, **said}
