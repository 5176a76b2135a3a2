"""Rows of campaigns by the runner; those of random mechanisms of all families are kept from run to run."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

import screwgauge
from screwgauge.families.draw import families
from screwgauge.reference.outputs import replace_file
from screwgauge.scene.scene import Scene
from screwgauge.study.runner import Executor, InTurn, Task, grow_table, run_tasks
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


def grown(
    file: Path,
    columns: Sequence[str],
    works: Mapping[str, Callable[[], list[dict[str, Any]]]],
    lost: Callable[[str, str], dict[str, Any]],
    about: Sequence[Any] = (),
    progress: Callable[[str, float], None] = lambda step, share: None,
    execute: Executor | None = None,
) -> str:
    """Rows of works by name as CSV, of which those that were made for `file` before are not made again.

    Args:
        lost: Cells of the row of a work that ends its process, of its name and the reason; the others are empty.
        execute: Where works are done, which pickle unless that is this process, the default.
    """
    tasks = [Task(name, partial(_made, work)) for name, work in works.items()]
    empty = dict.fromkeys(columns, "")
    return grow_table(
        file, columns, tasks, execute or InTurn(), lambda *how: empty | lost(*how), progress, [*about, CODE]
    )


def keep(file: Path, text: str) -> None:
    """Write a table without report."""
    file.parent.mkdir(parents=True, exist_ok=True)
    replace_file(file, text)


@contextmanager
def drawn(item: tuple[int, str], columns: Sequence[str]) -> Iterator[tuple[Scene, dict[str, Any]]]:
    """A random mechanism of seed and family in motion, and the beginning of its row."""
    seed, family = item
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        scene = screwgauge.random(seed, family, Path(folder))
        yield scene, {**dict.fromkeys(columns, ""), "family": family, "seed": seed}


def rows_of_mechanisms(
    count: int,
    file: Path,
    work: Callable[[tuple[int, str]], dict[str, Any]],
    columns: Sequence[str],
    progress: Callable[[str, float], None],
    execute: Executor,
) -> pd.DataFrame:
    """Works on so many mechanisms, family by family, seed 0 of all of them first.

    Args:
        file: The table that they are for, see `grown`.
        work: Makes a row of seed and family. It pickles.

    Returns:
        The table, sorted.
    """
    names = families()
    items = sorted((i // len(names), names[i % len(names)]) for i in range(count))
    named = {f"{family} {seed}": (seed, family) for seed, family in items}

    def lost(name: str, reason: str) -> dict[str, Any]:
        seed, family = named[name]
        known = {"family": family, "seed": seed, "verdict": "failed", "reason": reason}
        return {key: value for key, value in known.items() if key in columns}

    works = {name: partial(_row, work, item) for name, item in named.items()}
    text = grown(file, columns, works, lost, [work.__qualname__], progress, execute)
    return pd.read_csv(StringIO(text), keep_default_na=False).sort_values(["family", "seed"], ignore_index=True)


def _row(work: Callable[[Any], dict[str, Any]], item: Any) -> list[dict[str, Any]]:
    return [work(item)]
