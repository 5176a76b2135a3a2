"""Measures all errata of the paper, by running the printed form and the right one of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from screwgauge.reference.paper import printed
from screwgauge.scene.scene import Scene
from screwgauge.study.paper import dynamics, kinematics
from screwgauge.study.paper.case import SCENE, STEP, Case, every
from screwgauge.study.paper.errata import Erratum, Values, tabulated
from screwgauge.study.paper.reach import Reach
from screwgauge.study.paper.scheme import SchemeRuns, scheme_runs, scheme_values

NUMBERS = range(1, 19)


@dataclass(frozen=True, slots=True, eq=False)
class Paper:
    """All errata, measured, with what the plots need."""

    errata: tuple[Erratum, ...]
    reach: Reach
    runs: SchemeRuns
    axial: dynamics.AxialRule

    @property
    def complete(self) -> bool:
        """Every number has a finite measurement."""
        return {row.number for row in self.errata if np.isfinite(row.effect)} >= set(NUMBERS)


def measure(progress: Callable[[str, float], None] = lambda step, share: None) -> Paper:
    """Measures all errata: some seconds, most of them for the paper's 10 000 steps."""
    case = Case(every(STEP))
    progress("kinematics", 0.0)
    values: dict[int, Iterable[Values]] = {number: found(case) for number, found in kinematics.ERRATA.items()}
    progress("dynamics", 0.1)
    forces = dynamics.Forces(case)
    values |= {number: found(case, forces) for number, found in dynamics.ERRATA.items()}
    axial, values[15] = dynamics.axial_rule()
    runs = scheme_runs(case, lambda share: progress("scheme", 0.3 + 0.7 * share))
    values[8] = scheme_values(runs)
    return Paper(tabulated(values), Reach(case), runs, axial)


@lru_cache(maxsize=1)
def measured() -> Paper:
    """`measure`, once in the life of a program: it depends on nothing but the code."""
    return measure()


def is_the_papers(scene: Scene) -> bool:
    """Whether a scene is the paper's mechanism in the motion of eq. (59)."""
    if scene.simulated or scene.mechanism.name != SCENE or scene.motion.y.shape[1] != 2:
        return False
    right = printed.trajectory(scene.t)[0][:, :2]
    return bool(np.allclose(scene.motion.y, right, rtol=0.0, atol=1e-12))
