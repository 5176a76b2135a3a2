"""Softness of equalities is a hypothesis that is tried on the forces that soft equalities exert, by MuJoCo's own."""

from __future__ import annotations

import pytest

import screwgauge
from support.command import main
from support.diagnosis import linkage

pytestmark = pytest.mark.slow

STIFF, YIELDING = ' solref="0.05 1"', ' solimp="0.8 0.9 0.002 0.4 3"'


@pytest.fixture
def files(tmp_path):
    def of(*models):
        for name, model in zip("ab", models, strict=True):
            (tmp_path / f"{name}.xml").write_text(linkage(*model), encoding="utf-8")
        return tmp_path / "a.xml", tmp_path / "b.xml"

    return of


@pytest.mark.slow
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
    assert {cause.name for cause in found.soft.causes} == {
        f"softness of {name}" for name, text in (("loop", loop), ("gear", gear)) if text
    }
    assert ("masses of all 4 bodies: 1.2 times those of A in B" in found.verdict) == (mass != 1)


def test_a_softness_that_is_not_the_cause_does_not_explain(files, monkeypatch):
    from screwgauge.diagnosis.causes import explanation

    patched = explanation.patched
    monkeypatch.setattr(explanation, "patched", lambda text, reading, changes: patched(text, reading, []))
    found = screwgauge.diagnose(*files((1, "", ""), (1, STIFF, "")))
    assert "their softness does not explain it" in found.verdict
    assert not found.soft.seen


def test_where_softness_does_not_differ_nothing_is_said_of_it(files):
    found = screwgauge.diagnose(*files((1, STIFF, YIELDING), (1.2, STIFF, YIELDING)))
    assert found.soft is None
    assert "soft" not in found.verdict


def test_softness_is_written_into_the_fixed_file(files, inside, command):
    a, b = map(str, files((1, STIFF, YIELDING), (1, "", STIFF)))
    command("diagnose", a, b, "--fix", "fixed.xml", status=1)
    assert main(["diagnose", a, "fixed.xml"]) == 0
