"""One file, two libraries: which of them leaves out what is said, and the proof is one of readings."""

from __future__ import annotations

import pytest

import screwgauge
from screwgauge.casebook.book import CASES as BOOK
from screwgauge.diagnosis.known import CASES
from screwgauge.reference.errors import OutputError

BAR = (
    '<mujoco><option gravity="0 0 -1.62"/><worldbody><body name="bar" gravcomp="0.3"><joint name="j" axis="0 1 0" '
    'stiffness="3"/><inertial pos="0.2 0 0.1" mass="2" diaginertia="0.01 0.02 0.02"/></body></worldbody></mujoco>'
)


@pytest.fixture
def bar(tmp_path):
    path = tmp_path / "bar.xml"
    path.write_text(BAR, encoding="utf-8")
    return path


@pytest.mark.parametrize("sides", [("mujoco", "pinocchio"), ("pinocchio", "mujoco")])
def test_a_loader_that_leaves_something_out_is_named_and_the_proof_agrees(bar, sides, tmp_path):
    found = screwgauge.diagnose(*(f"{bar}@{library}" for library in sides))
    assert "together explain 100.0000 % of the torque difference; after backfill of the reading" in found.verdict
    assert "pinocchio does not use what the file says of " in found.verdict
    for what in ("gravity", "stiffness", "compensated share of weight"):
        assert what in found.verdict.partition("does not use what the file says of")[2]
    assert "mujoco does not use" not in found.verdict
    assert "(casebook: " in found.verdict
    assert {"pin-mjcf-gravity", "pin-mjcf-gravcomp", "pin-mjcf-springs"} <= {
        *found.verdict.replace(",", " ").replace(")", " ").split()
    }
    assert found.proof.agrees
    with pytest.raises(OutputError, match="A and B are one file"):
        found.write_fix(tmp_path / "fixed.xml")


def test_cases_that_are_named_are_in_the_casebook():
    assert {*CASES.values()} <= {*BOOK}
