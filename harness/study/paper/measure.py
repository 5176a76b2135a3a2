"""Measures all errata of the paper, by running the printed form and the right one of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from screwgauge.reference.paper import printed
from screwgauge.scene.scene import Scene
from screwgauge.study.paper.axial import AxialRule, axial_errata, axial_rule
from screwgauge.study.paper.dynamics import dynamic_errata
from screwgauge.study.paper.errata import SCENE, STEP, Erratum, every, paper_case
from screwgauge.study.paper.given_case import given_case_errata
from screwgauge.study.paper.kinematics import kinematic_errata
from screwgauge.study.paper.reach import Reach, reach
from screwgauge.study.paper.references import shifted_references
from screwgauge.study.paper.scheme import SchemeRuns, scheme_errata, scheme_runs

NUMBERS = range(1, 19)


@dataclass(frozen=True, slots=True, eq=False)
class Paper:
    """All errata, measured, with what the plots need."""

    errata: tuple[Erratum, ...]
    reach: Reach
    runs: SchemeRuns
    axial: AxialRule

    @property
    def complete(self) -> bool:
        """Every number has a finite measurement."""
        return {row.number for row in self.errata if np.isfinite(row.effect)} >= set(NUMBERS)


Report = Callable[[str, float], None]


def measure(progress: Report = lambda step, share: None) -> Paper:
    """Measures all errata: some seconds, most of them for the paper's 10 000 steps."""
    case = paper_case(every(STEP))
    progress("kinematics", 0.0)
    rows = [*kinematic_errata(case), *given_case_errata(case), shifted_references()]
    progress("dynamics", 0.1)
    axial = axial_rule()
    rows += [*dynamic_errata(case), *axial_errata(axial)]
    runs = scheme_runs(case, lambda share: progress("scheme", 0.3 + 0.7 * share))
    rows += scheme_errata(runs)
    return Paper(tuple(sorted(rows, key=lambda row: row.number)), reach(case), runs, axial)


@lru_cache(maxsize=1)
def measured() -> Paper:
    """`measure`, once in the life of a program: it depends on nothing but the code."""
    return measure()


def is_the_papers(scene: Scene) -> bool:
    """Whether a scene is the paper's mechanism in the motion of eq. (59)."""
    motion = scene.motion
    if scene.mechanism.name != SCENE or motion.y.shape[1] != 2:
        return False
    right = printed.trajectory(motion.t)[0][:, :2]
    return bool(np.allclose(motion.y, right, rtol=0.0, atol=1e-12))
