"""The cases. Each module of `screwgauge.study.cases` has some of them; none of them loads an engine."""

from __future__ import annotations

from collections.abc import Iterable

from screwgauge.reference.errors import check_choice
from screwgauge.study.cases import long_run, loops, open_states, poses, regular, softness, stiff
from screwgauge.study.cases.case import Case

#: Name -> case, in the order in which they are run.
CASES: dict[str, Case] = {
    case.name: case
    for case in (
        *poses.CASES,
        regular.MASS_RATIO,
        regular.SPEED,
        regular.SCALE,
        regular.LOAD,
        regular.INERTIA_ANISOTROPY,
        open_states.CLOSURE_VIOLATION,
        *softness.CASES,
        *loops.CASES,
        long_run.LONG_RUN,
        stiff.STIFF_LEGS,
    )
}


def choose(names: Iterable[str] | None) -> list[Case]:
    """The named cases in the order of the table, all by default.

    Raises:
        ScrewgaugeError: A name is not known.
    """
    wanted = list(CASES) if names is None else check_choice("case", names, CASES)
    return [case for name, case in CASES.items() if name in wanted]


def load(name: str) -> Case:
    """One case."""
    return CASES[name]
