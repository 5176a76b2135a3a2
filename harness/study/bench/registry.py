"""Who takes part in a bench of a given motion, and how they are chosen."""

from __future__ import annotations

from collections.abc import Iterable

from screwgauge.reference.errors import check_choice
from screwgauge.study.bench import contestants_engines as engines
from screwgauge.study.bench import contestants_screw as screw
from screwgauge.study.bench import leaving_out
from screwgauge.study.bench.contestant import Contestant


def contestants(*, quick: bool) -> list[Contestant]:
    """All of them, family by family. `quick`: settings that take longest are left out."""
    own = (*screw.solver(quick), *screw.shortcuts(quick), *screw.paper(quick))
    return [*own, *engines.pinocchio(), *engines.mujoco(), *leaving_out.contestants()]


def names() -> list[str]:
    """Everything that `choose` understands: families and contestants."""
    everyone = contestants(quick=False)
    return list(dict.fromkeys([*(c.family for c in everyone), *(c.name for c in everyone)]))


def choose(wanted: Iterable[str] | None, *, quick: bool = False) -> list[Contestant]:
    """The named families and contestants, all by default.

    Raises:
        ScrewgaugeError: A name is not known, or there is none.
    """
    everyone = contestants(quick=quick)
    if wanted is None:
        return everyone
    chosen = set(check_choice("contestant", wanted, names()))
    return [contestant for contestant in everyone if {contestant.family, contestant.name} & chosen]
