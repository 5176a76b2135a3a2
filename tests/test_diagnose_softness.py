"""Softness of equalities is compared, and written into the fixed file."""

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


def test_where_softness_does_not_differ_nothing_is_said_of_it(files):
    found = screwgauge.diagnose(*files((1, STIFF, YIELDING), (1.2, STIFF, YIELDING)))
    assert "soft" not in found.verdict


def test_softness_is_written_into_the_fixed_file(files, inside, command):
    a, b = map(str, files((1, STIFF, YIELDING), (1, "", STIFF)))
    command("diagnose", a, b, "--fix", "fixed.xml", status=1)
    assert main(["diagnose", a, "fixed.xml"]) == 0
