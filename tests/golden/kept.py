"""The parts of the golden numbers: what cases each has, which of them take long, and what makes their facts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from golden import diagnosed, solved, studied
from golden.answers import Row
from golden.facts import Facts


@dataclass(frozen=True, slots=True)
class Part:
    """A table.

    Attributes:
        cases: Names of all.
        rows: Makes the facts of a case.
        quick: Whether a case is in the fast loop, of its place and its name.
    """

    cases: Callable[[], Iterable[str]]
    rows: Callable[[str], Iterator[Row]]
    quick: Callable[[int, str], bool] = lambda i, case: True

    def facts(self, case: str) -> Facts:
        """All facts of a case."""
        return dict(self.rows(case))


def every(n: int) -> Callable[[int, str], bool]:
    """Every n-th case is quick."""
    return lambda i, case: i % n == 0


def usual(i: int, case: str) -> bool:
    """Whether a case takes no longer than others."""
    return not any(name in case for name in ("a02-fourbar-40", "wrist-chart"))


PARTS: dict[str, Part] = {
    "scenes": Part(solved.given, solved.scene),
    "simulations": Part(solved.simulations, solved.simulated, usual),
    "wrong": Part(solved.given, solved.wrong),
    "covered": Part(solved.given, solved.covered),
    "proved": Part(solved.unsprung, solved.proved, every(3)),
    "random": Part(lambda: map(str, range(200)), solved.drawn, every(2)),
    "imported": Part(solved.files, solved.imported, every(5)),
    "compiled": Part(solved.programs, solved.compiled),
    "stress": Part(studied.rungs, studied.rung, lambda i, case: case.endswith("quick") and usual(i, case)),
    "leaving-out": Part(lambda: ["3ups-upu-s-fast"], studied.left_out),
    "diagnoses": Part(lambda: diagnosed.CASES, diagnosed.diagnosis),
}
