"""The cases: one line each. Their modules are imported when they are chosen."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from screwgauge.reference.errors import check_choice
from screwgauge.study.stress.case import Case

_HERE = "screwgauge.study.stress"
#: Name -> ``module:function``; the function returns the `Case`.
CASES = {
    "upu-singularity": f"{_HERE}.inverse.singular_poses:upu_singularity",
    "u-lock": f"{_HERE}.inverse.singular_poses:u_lock",
    "wrist-chart": f"{_HERE}.inverse.singular_poses:wrist_chart",
    "mass-ratio": f"{_HERE}.inverse.bodies:mass_ratio",
    "speed": f"{_HERE}.inverse.motions:speed",
    "scale": f"{_HERE}.inverse.bodies:scale",
    "load": f"{_HERE}.inverse.motions:load",
    "inertia-anisotropy": f"{_HERE}.inverse.bodies:inertia_anisotropy",
    "closure-violation": f"{_HERE}.inverse.closure:closure_violation",
    "softness": f"{_HERE}.driven.softness:softness",
    "refinement": f"{_HERE}.driven.refinement:refinement",
    "proximal": f"{_HERE}.driven.proximal:proximal",
    "redundant-constraints": f"{_HERE}.driven.redundant:redundant_constraints",
    "long-run": f"{_HERE}.driven.long_run:long_run",
    "stiff-legs": f"{_HERE}.stiff.legs:stiff_legs",
}


def choose(names: Iterable[str] | None) -> list[Case]:
    """The named cases in the order of the table, all by default.

    Raises:
        ScrewgaugeError: A name is not known.
    """
    wanted = list(CASES) if names is None else check_choice("case", names, CASES)
    return [load(name) for name in CASES if name in wanted]


def load(name: str) -> Case:
    """One case."""
    module, function = CASES[name].split(":")
    found: Case = getattr(import_module(module), function)()
    return found
