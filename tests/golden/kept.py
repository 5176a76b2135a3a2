"""The parts of the golden numbers: what cases each has, which of them take long, and what makes their facts."""

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
        long: Whether it takes so long that it is looked at with `-m thorough` only.
    """

    cases: Callable[[], Iterable[str]]
    rows: Callable[[str], Iterator[Row]]
    quick: Callable[[int, str], bool] = lambda i, case: True
    long: Callable[[str], bool] = lambda case: False

    def facts(self, case: str) -> Facts:
        """All facts of a case."""
        return dict(self.rows(case))


def every(n: int) -> Callable[[int, str], bool]:
    """Every n-th case is quick."""
    return lambda i, case: i % n == 0


def usual(i: int, case: str) -> bool:
    return not any(name in case for name in ("a02-fourbar-40", "wrist-chart"))


def quick_rung(i: int, case: str) -> bool:
    return case.endswith("quick") and usual(i, case)


#: Rungs of quick runs of 5 s and more; the others of these cases say nearly as much.
LONG = ("long-run 1000000", "long-run 100000", "softness 1.0000000000000001e-05", "softness 2.0000000000000002e-05")


def long_rung(case: str) -> bool:
    name, severity, *quick = case.split()
    every_other = [f"{each:.17g}" for each in studied.CASES[name].quick[::2]]
    return not quick or case.startswith(("wrist-chart", *LONG)) or severity not in every_other


def further_random(case: str) -> bool:
    return int(case) % 8 != 0


def similar_file(case: str) -> bool:
    """Whether a file has all joints in its tree, or is a second one of a large mechanism: others say nearly as much."""
    return "-full." in case or case in ("stewart.xml", "stewart-legs.urdf", "stewart-legs.xml")


def but_every(n: int) -> Callable[[str], bool]:
    """Leave to thorough runs all given scenes but every n-th: those of the same joints say nearly as much."""
    names = solved.given()
    return lambda case: names.index(case) % n != 0


PARTS: dict[str, Part] = {
    "scenes": Part(solved.given, solved.scene),
    "simulations": Part(solved.simulations, solved.simulated, usual),
    "wrong": Part(solved.given, solved.wrong, long=but_every(3)),
    "covered": Part(solved.given, solved.covered, long=but_every(3)),
    "proved": Part(solved.unsprung, solved.proved, every(3)),
    "random": Part(lambda: map(str, range(200)), solved.drawn, every(4), further_random),
    "imported": Part(solved.files, solved.imported, every(8), similar_file),
    "compiled": Part(solved.programs, solved.compiled),
    "stress": Part(studied.rungs, studied.rung, quick_rung, long_rung),
    "leaving-out": Part(lambda: ["3ups-upu-s-fast"], studied.left_out),
    "diagnoses": Part(lambda: diagnosed.CASES, diagnosed.diagnosis),
}
