"""The contestants: one line each. Their modules are imported when they are chosen, so a missing engine is a row."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from importlib import import_module

from screwgauge.reference.errors import check_choice
from screwgauge.study.bench.contestant import Contestant

_HERE = "screwgauge.study.bench"
#: Chooses the table of what leaving out buys; it is no contestant.
LEAVING_OUT = "leaving-out"


@dataclass(frozen=True, slots=True)
class Entry:
    """A contestant's family, name, and ``module:function``; the function returns its settings as `Contestant`s."""

    family: str
    name: str
    source: str


REGISTRY = (
    Entry("floor", "floor", f"{_HERE}.contestants_screw:floor"),
    Entry("closed-form", "closed-form", f"{_HERE}.contestants_screw:closed"),
    Entry("newton", "newton", f"{_HERE}.contestants_screw:newton_closed"),
    Entry("float32", "float32", f"{_HERE}.contestants_screw:single"),
    Entry("screw", "screw-trajectory", f"{_HERE}.contestants_screw:trajectory"),
    Entry("screw", "screw-per-sample", f"{_HERE}.contestants_screw:per_sample"),
    Entry("finite-differences", "differences", f"{_HERE}.contestants_difference:interior"),
    Entry("finite-differences", "differences-ends", f"{_HERE}.contestants_difference:ends"),
    Entry("missing-jdotv", "missing-jdotv", f"{_HERE}.contestants_difference:missing_jdotv"),
    Entry("paper-printed", "paper-printed", f"{_HERE}.contestants_paper:literal"),
    Entry("paper-corrected", "paper-corrected", f"{_HERE}.contestants_paper:corrected"),
    Entry("pinocchio", "pinocchio-path", f"{_HERE}.contestants_pinocchio:path"),
    Entry("pinocchio", "pinocchio-rnea", f"{_HERE}.contestants_pinocchio:rnea"),
    Entry("pinocchio-forward", "constraint-dynamics", f"{_HERE}.contestants_pinocchio:ladder"),
    Entry("pinocchio-forward", "constraint-dynamics-default", f"{_HERE}.contestants_pinocchio:default"),
    Entry("four-bar", "four-bar", f"{_HERE}.four_bar:contestants"),
    Entry("mujoco", "mujoco-path", f"{_HERE}.contestants_mujoco:path"),
    Entry("mujoco", "mj-inverse-projected", f"{_HERE}.contestants_mujoco:projected"),
    Entry("mujoco-naive", "mj-inverse-naive", f"{_HERE}.contestants_mujoco:naive"),
    Entry("mujoco-forward", "mj-forward", f"{_HERE}.contestants_mujoco:forward"),
    Entry("mujoco-forward", "mj-forward-solref", f"{_HERE}.contestants_mujoco:solref"),
    Entry("mujoco-refinement", "mj-refinement", f"{_HERE}.contestants_mujoco:refinement"),
)


def names() -> list[str]:
    """Everything that `choose` understands: families, contestants, and what leaving out buys."""
    return list(dict.fromkeys([*(e.family for e in REGISTRY), *(e.name for e in REGISTRY), LEAVING_OUT]))


def choose(wanted: Iterable[str] | None) -> tuple[Entry, ...]:
    """The entries of the named families and contestants, all by default.

    Raises:
        ScrewgaugeError: A name is not known, or there is none.
    """
    if wanted is None:
        return REGISTRY
    chosen = set(check_choice("contestant", wanted, names()))
    return tuple(entry for entry in REGISTRY if {entry.family, entry.name} & chosen)


def load(entry: Entry, *, quick: bool) -> list[Contestant]:
    """The settings of a contestant.

    Raises:
        ImportError: Its engine is not installed.
    """
    module, function = entry.source.split(":")
    found: list[Contestant] = getattr(import_module(module), function)(quick)
    return [replace(contestant, family=entry.family, name=entry.name) for contestant in found]
