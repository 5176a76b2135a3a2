"""The study of changed models, small: all kinds of change are found, named and measured, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from campaigns import selftest as run
from campaigns.judged import judged
from campaigns.kinds import KINDS
from campaigns.lookalikes import REWRITES
from campaigns.mutant import Expected
from campaigns.selftest_page import PAGE as page
from campaigns.selftest_page import passed
from support.robots import tree, urdf

from screwgauge.diagnosis.diagnose import diagnose


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A row for each kind of change, and for each way to write the same."""
    file = tmp_path_factory.mktemp("study") / page.NAME
    return run.selftest(len(KINDS), len(REWRITES), file, quick=True), file


def test_there_are_enough_kinds():
    assert len(KINDS) >= 25


def test_changes_are_found_named_and_measured_and_nothing_is_seen_that_is_not_there(study):
    found, _ = study
    assert passed(found), found[found["verdict"] != "ok"].to_string()
    assert len(found[found["verdict"] == "ok"]) >= 40


def test_rows_that_are_there_are_not_made_again(study, monkeypatch):
    found, file = study
    monkeypatch.setattr(run, "diagnose", None)  # would fail
    again = run.selftest(len(KINDS), len(REWRITES), file, quick=True)
    pd.testing.assert_frame_equal(found, again)


@pytest.fixture
def heavier(tmp_path):
    """A diagnosis of a link that is 1 % heavier, and its name."""
    (tmp_path / "a.urdf").write_text(urdf(tree(0)))
    text, (expected,) = KINDS["mass_factor"](urdf(tree(0)), np.random.default_rng(1), 0.01)
    (tmp_path / "b.urdf").write_text(text)
    return diagnose(tmp_path / "a.urdf", tmp_path / "b.urdf"), expected


def test_a_wrong_name_or_magnitude_is_not_let_pass(heavier):
    found, expected = heavier
    good = judged(found, [expected])
    assert good.right
    assert good.error < 1e-9
    assert not judged(found, [replace(expected, item="link9")]).right
    assert not judged(found, [replace(expected, what=("com",))]).right
    assert not judged(found, [replace(expected, slip="in mm")]).right
    assert not judged(found, [expected, Expected("link1", ("inertia",), 1.0)]).right
    assert judged(found, [replace(expected, magnitude=1.05 * expected.magnitude)]).error > 0.01


@pytest.mark.parametrize(
    "spoilt",
    [
        {"group": run.ALIKE, "detected": True},
        {"group": run.CHANGED, "detected": False, "right": False},
        {"group": run.CHANGED, "right": False},
        {"group": run.CHANGED, "error": 0.2},
        {"group": run.CHANGED, "cpu_s": 60.0},
    ],
)
def test_a_study_that_fails_says_so(study, spoilt):
    found = study[0].copy().astype(object)
    rows = found["group"] == spoilt["group"]
    if spoilt["group"] == run.CHANGED:
        rows &= found["effect"].astype(str) != ""
    found.loc[rows, list(spoilt)] = list(spoilt.values())
    assert not passed(found)


def test_the_page_lists_what_was_missed(study, tmp_path):
    found = study[0].copy().astype(object)
    found.loc[0, ["verdict", "right", "first"]] = "wrong", False, "mass of nobody"
    page.write(found, tmp_path)
    text = (tmp_path / "report.md").read_text()
    assert "mass of nobody" in text
    assert "Pairs that are alike" in text


@pytest.mark.campaign
def test_changes_at_random_are_found_named_and_measured(campaign):
    count = campaign.count or run.COUNT
    file = campaign.reports / "selftest" / page.NAME
    found = campaign.carry_out(
        page,
        "selftest",
        lambda progress: run.selftest(count, round(run.PAIRS * count), file, progress=progress),
        again=page.NAME,
    )
    assert passed(found), found[found["verdict"] != "ok"].to_string()
