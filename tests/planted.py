"""Plants the mistakes of planted.toml one at a time: does `check --smoke` see them?

    python tests/planted.py                   # all of them, a few seconds each; half a minute if nobody sees it
    python tests/planted.py --only 3 17       # some, by their numbers
    python tests/planted.py --tests           # also the test that each unseen one names
    python tests/planted.py --list mutants.toml --tests   # mutants that chance has drawn, and the tests that kill them

Each is written into a copy of the package, see `mutants`. One line is printed for each: what it is about, and who
sees it first.
"""

import argparse
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
    about: str = ""
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


def mistakes(file: Path = LIST) -> list[Mistake]:
    """Read a list."""
    tables = tomllib.loads(file.read_text(encoding="utf-8"))["mistakes"]
    return [Mistake(**{**table, "file": Path(table["file"])}) for table in tables]


@contextmanager
def planted(folder: Path, mistake: Mistake) -> Iterator[None]:
    target = installed(folder, mistake.file)
    right = target.read_bytes()
    target.write_bytes(mistake.mutant.source())
    try:
        yield
    finally:
        target.write_bytes(right)


#: Rows of `check --smoke`, until one fails: those first that see the most.
ROWS = """
import sys
from screwgauge.processes import fix_threads
fix_threads()
import numpy as np
from screwgauge.report.pages.check import sentence_of
from screwgauge.study.gate.items import items
from screwgauge.study.gate.known_files import known_item
from screwgauge.study.gate.measure import GateSettings
from screwgauge.study.gate.run import check_item
first = [known_item().name, "ruse", "ruse-braked", "belt-leg", "geared-five-bar", "3ups-upu-s"]
np.seterr(all="ignore")
for item in sorted([*items([]), known_item()], key=lambda one: one.name not in first):
    row = check_item(item, GateSettings(sentence_of, smoke=True), lambda share, step: None)
    if not row.ok:
        sys.exit(f"{row.scene} {row.status}: {row.sentence}")
"""


def smoke(folder: Path) -> str:
    done = execute(folder, "-c", ROWS)
    if done is None:
        return "hangs"
    return " ".join(done.stderr.split())[-400:] if done.returncode else ""


def by_test(folder: Path, name: str) -> str:
    done = execute(folder, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", "", name)
    failed = done is not None and done.returncode == 1
    return f"seen by {name}" if failed else ""


def seen(some: Sequence[Mistake], *, tests: bool = False) -> Iterator[tuple[Mistake, str]]:
    with tempfile.TemporaryDirectory() as name:
        folder = package(Path(name))
        os.environ["SCREWGAUGE_CACHE"] = str(folder / "cache")
        assert not (said := smoke(folder)), f"without any mistake: {said}"
        for mistake in some:
            with planted(folder, mistake):
                who = smoke(folder)
                yield mistake, who or (by_test(folder, mistake.test) if tests and mistake.test else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", type=int, nargs="+", help="numbers of mistakes, from 1")
    parser.add_argument("--tests", action="store_true", help="also run the tests that are named in the list")
    parser.add_argument("--list", default=LIST.name, help="another file of tests/ with such a list")
    options = parser.parse_args()
    every = mistakes(LIST.with_name(options.list))
    numbers = options.only or range(1, len(every) + 1)
    for number, (mistake, who) in zip(numbers, seen([every[i - 1] for i in numbers], tests=options.tests), strict=True):
        print(f"{number}\t{mistake.room}\t{mistake.about or mistake.planted}\t{who or 'NOT SEEN'}", flush=True)


if __name__ == "__main__":
    main()
