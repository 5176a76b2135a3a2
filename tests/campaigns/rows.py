"""Random mechanisms of all families put to work, a row each; rows that are there are kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.families.draw import families
from screwgauge.study.lifeline import hold, lifeline
from screwgauge.study.table import added_to, rows_in

TEXTS = Path(__file__).with_name("texts")


def rows_of_mechanisms(
    count: int,
    file: Path,
    work: Callable[[tuple[int, str]], dict[str, Any]],
    columns: Sequence[str],
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> pd.DataFrame:
    """Works on so many mechanisms, two at a time, family by family, seed 0 of all of them first.

    Args:
        file: CSV file that rows are added to as they come; those that it has already are kept.
        work: Makes a row of seed and family. It pickles.

    Returns:
        The table, sorted.
    """
    names = families()
    items = {(i // len(names), names[i % len(names)]) for i in range(count)}
    done = {(int(row["seed"]), row["family"]) for row in rows_in(file, columns, "random mechanisms")}
    with (
        added_to(file, columns) as add,
        ProcessPoolExecutor(2, get_context("spawn"), hold, (lifeline(),)) as pool,
    ):
        futures = [pool.submit(work, item) for item in sorted(items - done)]
        try:
            for i, future in enumerate(as_completed(futures), 1):
                add(row := future.result())
                progress(f"{row['family']} {row['seed']}", i / len(futures))
        finally:
            pool.shutdown(cancel_futures=True)
    return pd.read_csv(file, keep_default_na=False).sort_values(["family", "seed"], ignore_index=True)
