"""Softness of equalities is a hypothesis that is tried on the forces that soft equalities exert, by MuJoCo's own."""

from __future__ import annotations

import pytest

import screwgauge
from support.command import main

INERTIAL = '<inertial pos="0.1 0 0.02" mass="{0}" diaginertia="0.01 0.02 0.02"/>'
#: A four-bar whose rod ends in a point of the rocker, and a tip that follows the crank.
LINKAGE = (
    f'<mujoco><worldbody><body name="crank"><joint name="a" axis="0 1 0"/>{INERTIAL}'
    f'<body name="rod" pos="0 0 0.2"><joint name="b" axis="0 1 0"/>{INERTIAL}</body></body>'
    f'<body name="rocker" pos="0.3 0 0"><joint name="c" axis="0 1 0"/>{INERTIAL}'
    f'<body name="tip" pos="0 0 0.1"><joint name="d" axis="0 1 0"/>{INERTIAL}</body></body></worldbody>'
    '<equality><connect name="loop" body1="rod" body2="rocker" anchor="0.3 0 0"{1}/>'
    '<joint name="gear" joint1="d" joint2="a" polycoef="0 1 0 0 0"{2}/></equality></mujoco>'
)
STIFF, YIELDING = ' solref="0.05 1"', ' solimp="0.8 0.9 0.002 0.4 3"'


@pytest.fixture
def files(tmp_path):
    def of(*models):
        for name, model in zip("ab", models, strict=True):
            (tmp_path / f"{name}.xml").write_text(LINKAGE.format(*model), encoding="utf-8")
        return tmp_path / "a.xml", tmp_path / "b.xml"

    return of


@pytest.mark.parametrize(
    ("loop", "gear", "said"),
    [
        (STIFF, "", "softness of loop explains 100.0000 % of that"),
        ("", YIELDING, "softness of gear explains 100.0000 % of that"),
        (YIELDING, STIFF, "softness of loop, softness of gear explain 100.0000 % of that"),
    ],
)
@pytest.mark.parametrize("mass", [1, 1.2])
def test_softness_explains_what_soft_equalities_exert(files, loop, gear, said, mass):
    found = screwgauge.diagnose(*files((1, "", ""), (mass, loop, gear)))
    assert "forces of soft equalities differ by" in found.verdict
    assert said in found.verdict
    assert found.soft.complete
    assert {hypothesis.name for hypothesis, _ in found.soft.ranking} == {
        f"softness of {name}" for name, text in (("loop", loop), ("gear", gear)) if text
    }
    assert ("mass 1.200 kg in B" in found.verdict) == (mass != 1)


def test_a_softness_that_is_not_the_cause_does_not_explain(files, monkeypatch):
    from screwgauge.diagnosis.causes import soft

    patched = soft.patched
    monkeypatch.setattr(soft, "patched", lambda text, reading, changes: patched(text, reading, []))
    found = screwgauge.diagnose(*files((1, "", ""), (1, STIFF, "")))
    assert "their softness does not explain it" in found.verdict
    assert not found.soft.steps


def test_where_softness_does_not_differ_nothing_is_said_of_it(files):
    found = screwgauge.diagnose(*files((1, STIFF, YIELDING), (1.2, STIFF, YIELDING)))
    assert found.soft is None
    assert "soft" not in found.verdict


def test_softness_is_written_into_the_fixed_file(files, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    a, b = map(str, files((1, STIFF, YIELDING), (1, "", STIFF)))
    assert main(["diagnose", a, b, "--fix", "fixed.xml"]) == 1
    capsys.readouterr()
    assert main(["diagnose", a, "fixed.xml"]) == 0
