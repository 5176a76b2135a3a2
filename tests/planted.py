"""Plants the mistakes of planted.toml one at a time: does `check --smoke` see them?

    python tests/planted.py                   # all of them, half a minute each
    python tests/planted.py --only 3 17       # some, by their numbers
    python tests/planted.py --tests           # also the test that each unseen one names

Each is written into a copy of the package, see `mutants`. One line is printed for each: what it is about, and who
sees it first.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from mutants import ROOT, Mutant, execute, installed, package

LIST = Path(__file__).with_name("planted.toml")
#: Room of mistakes in readers and diagnosis; all others are in what solves, judges and encloses.
FILES = "files"


@dataclass(frozen=True)
class Mistake:
    """A mistake of one line; `test`: one that sees it, where `check --smoke` does not."""

    room: str
    file: Path
    line: str
    planted: str
    about: str
    test: str = ""

    @property
    def mutant(self) -> Mutant:
        """The place of the line in its file.

        Raises:
            ValueError: The line does not stand there once.
        """
        code = (ROOT / self.file).read_bytes()
        head, *tail = code.split(self.line.encode())
        if len(tail) != 1:
            raise ValueError(f"{self.file} has {len(tail)} times: {self.line}")
        return Mutant(self.file, head.count(b"\n") + 1, len(head), len(head) + len(self.line.encode()), self.planted)


def mistakes() -> list[Mistake]:
    """All that are listed."""
    tables = tomllib.loads(LIST.read_text(encoding="utf-8"))["mistakes"]
    return [Mistake(**{**table, "file": Path(table["file"])}) for table in tables]


@contextmanager
def planted(folder: Path, mistake: Mistake) -> Iterator[None]:
    """The mistake in a copy of the package."""
    target = installed(folder, mistake.file)
    right = target.read_bytes()
    target.write_bytes(mistake.mutant.source())
    try:
        yield
    finally:
        target.write_bytes(right)


def smoke(folder: Path) -> str:
    """What `check --smoke` says in a copy of the package: empty, or the first row that fails and how many do."""
    done = execute(
        folder, "-m", "screwgauge.cli", "check", "--smoke", "--json", "--force", "--out", str(folder / "out")
    )
    if done is None:
        return "hangs"
    if not done.returncode:
        return ""
    try:
        rows = [row for row in json.loads(done.stdout)["rows"] if not row["ok"]]
    except ValueError:
        return f"exit {done.returncode}: {' '.join(done.stderr.split()[-20:])}"
    first = rows[0]
    return f"exit {done.returncode}, {len(rows)} rows, first {first['scene']} {first['status']}: {first['sentence']}"


def by_test(folder: Path, name: str) -> str:
    """What the test says that sees a mistake; empty where it passes."""
    done = execute(folder, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", "", name)
    failed = done is not None and done.returncode == 1
    return f"seen by {name}" if failed else ""


def seen(some: Sequence[Mistake], *, tests: bool = False) -> Iterator[tuple[Mistake, str]]:
    """Each mistake, and who sees it; empty where nobody does."""
    with tempfile.TemporaryDirectory() as name:
        folder = package(Path(name))
        os.environ["SCREWGAUGE_CACHE"] = str(folder / "cache")
        for mistake in some:
            with planted(folder, mistake):
                who = smoke(folder)
                yield mistake, who or (by_test(folder, mistake.test) if tests and mistake.test else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", type=int, nargs="+", help="numbers of mistakes, from 1")
    parser.add_argument("--tests", action="store_true", help="also run the tests that are named in the list")
    options = parser.parse_args()
    every = mistakes()
    numbers = options.only or range(1, len(every) + 1)
    for number, (mistake, who) in zip(numbers, seen([every[i - 1] for i in numbers], tests=options.tests), strict=True):
        print(f"{number}\t{mistake.room}\t{mistake.about}\t{who or 'NOT SEEN'}", flush=True)


if __name__ == "__main__":
    main()
