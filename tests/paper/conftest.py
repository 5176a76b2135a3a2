"""The paper, checked: its formulas as printed and the right ones, each of its 18 errata measured and tested.

pytest tests/paper                       # every erratum has its size
pytest tests/paper --reports=reports     # and reports/paper is written anew
"""

from __future__ import annotations

import pytest
from paper import dynamics, kinematics, mobility, numbering, scheme
from paper.case import STEP, Case, every
from paper.page import Paper


@pytest.fixture(scope="session")
def case() -> Case:
    return Case(every(STEP))


@pytest.fixture(scope="session")
def forces(case: Case) -> dynamics.Forces:
    return dynamics.Forces(case)


@pytest.fixture(scope="session")
def axial() -> dynamics.AxialRule:
    """Its driving forces under eq. (56)."""
    return dynamics.AxialRule()


@pytest.fixture(scope="session")
def runs(case: Case) -> scheme.Runs:
    return scheme.runs(case)


@pytest.fixture(scope="session")
def checked(case: Case, forces: dynamics.Forces, axial: dynamics.AxialRule, runs: scheme.Runs) -> Paper:
    errata = [
        *mobility.errata(case),
        *kinematics.errata(case),
        *numbering.references(),
        *scheme.units(case),
        *scheme.steps_in_time(runs),
        *dynamics.errata(case, forces),
        *dynamics.one_dimension(axial),
    ]
    return Paper(sorted(errata, key=lambda row: row.number), dynamics.Reach(case), runs, axial)
