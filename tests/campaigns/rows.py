"""Rows of campaigns by the runner; those of random mechanisms of all families are kept from run to run."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.families.draw import families
from screwgauge.study.runner import Executor, InTurn, Processes, Task, grow_table, run_tasks
from screwgauge.truth.cache import code_version

TEXTS = Path(__file__).with_name("texts")
#: Of campaigns: their rows depend on it besides that of the package.
CODE = code_version(Path(__file__).parent)


def rows_in_turn(works: Iterable[tuple[str, Callable[[], Any]]], progress: Callable[[str, float], None]) -> list[Any]:
    tasks = [Task(f"{number}: {name}", partial(_made, work)) for number, (name, work) in enumerate(works, 1)]
    return run_tasks(tasks, InTurn(), lost=_raised, progress=progress)


def _made(work: Callable[[], Any], progress: Any) -> Any:
    return work()


def _raised(name: str, reason: str) -> Any:
    raise AssertionError(f"{name}: {reason}")


def rows_of_mechanisms(
    count: int,
    file: Path,
    work: Callable[[tuple[int, str]], dict[str, Any]],
    columns: Sequence[str],
    progress: Callable[[str, float], None] = lambda step, share: None,
    execute: Executor | None = None,
) -> pd.DataFrame:
    """Works on so many mechanisms, two at a time, family by family, seed 0 of all of them first.

    Args:
        file: The table that they are for; rows that were made for it before are not made again, see `grow_table`.
        work: Makes a row of seed and family. It pickles.
        execute: Where that is done; in two processes by default.

    Returns:
        The table, sorted.
    """
    names = families()
    items = sorted((i // len(names), names[i % len(names)]) for i in range(count))
    named = {f"{family} {seed}": (seed, family) for seed, family in items}

    def lost(name: str, reason: str) -> dict[str, Any]:
        seed, family = named[name]
        known = {"family": family, "seed": seed, "verdict": "failed", "reason": reason}
        return {name: known.get(name, "") for name in columns}

    text = grow_table(
        file,
        columns,
        [Task(name, partial(_rows, work, item)) for name, item in named.items()],
        execute or Processes(2),
        lost,
        progress,
        [work.__qualname__, CODE],
    )
    return pd.read_csv(StringIO(text), keep_default_na=False).sort_values(["family", "seed"], ignore_index=True)


def _rows(work: Callable[[Any], dict[str, Any]], item: Any, progress: Any) -> list[dict[str, Any]]:
    return [work(item)]
