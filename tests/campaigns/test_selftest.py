from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from campaigns.lookalikes import REWRITES
from campaigns.mutations import KINDS, Expected, mutated
from campaigns.selftest import ALIKE, CHANGED, COLUMNS, COUNT, judged, machines, row, selftest
from campaigns.selftest_page import PAGE, passed
from hypothesis import given, settings

from screwgauge.diagnosis.diagnose import diagnose
from support.robots import robots, tree, urdf, write


@pytest.mark.campaign
def test_changes_at_random_are_detected_named_and_measured(campaign):
    count, file = campaign.count or COUNT, campaign.reports / "selftest" / PAGE.NAME
    table = campaign.carry_out(PAGE, "selftest", lambda show: selftest(count, file, show), again=True)
    assert passed(table), table[table["verdict"] != "ok"].to_string()


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    folder = tmp_path_factory.mktemp("machines")
    return [machine for machine in machines(folder) if not machine.public], folder


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("kind", [*KINDS, *REWRITES])
def test_each_kind_of_change_is_named_and_no_other_words_are_taken_for_one(kind, known):
    answer = row(kind, *known, [2])  # by [1] a placement moves a whole tree, which nobody can see
    assert answer["verdict"] == "ok", answer


@pytest.mark.slow
@given(parts=robots())
@settings(max_examples=10, derandomize=True, database=None, deadline=None)
def test_a_robot_is_the_same_in_both_formats(parts, tmp_path_factory):
    answer = diagnose(*write(tmp_path_factory.mktemp("robot"), parts))
    assert answer.same, answer.verdict


@pytest.fixture
def heavier(tmp_path):
    text, (expected,) = mutated("mass_factor", urdf(tree(0)), np.random.default_rng(1), 0.01)
    for name, content in (("a.urdf", urdf(tree(0))), ("b.urdf", text)):
        (tmp_path / name).write_text(content)
    return diagnose(tmp_path / "a.urdf", tmp_path / "b.urdf"), expected


def test_a_wrong_name_or_magnitude_is_not_let_pass(heavier):
    answer, expected = heavier
    assert judged(answer, [expected])["verdict"] == "ok"
    for wrong in ({"item": "link9"}, {"what": ("damping",)}, {"slip": "in mm"}):
        assert judged(answer, [replace(expected, **wrong)])["verdict"] == "wrong"
    assert judged(answer, [expected, Expected("link1", ("inertia",), 1.0)])["verdict"] == "wrong"
    assert judged(answer, [replace(expected, magnitude=1.05 * expected.magnitude)])["verdict"] == "imprecise"


def test_the_report_lists_what_was_missed_and_fails(tmp_path):
    good = dict.fromkeys(COLUMNS, "") | {"group": CHANGED, "number": 0, "kind": "mass_factor", "model": "tree0"}
    good |= {"size": 0.01, "effect": 0.1, "detected": True, "right": True, "error": 0.0, "cpu_s": 0.1, "verdict": "ok"}
    quiet = good | {"group": ALIKE, "kind": "renamed", "detected": False}
    assert passed(pd.DataFrame([good, quiet]))
    missed = good | {"verdict": "wrong", "right": False, "first": "mass of nobody"}
    for worse in ({"detected": False}, {"right": False}, {"error": 0.2}, {"cpu_s": 60.0}):
        assert not passed(pd.DataFrame([good | worse, quiet]))
    assert not passed(pd.DataFrame([good, quiet | {"detected": True}]))
    PAGE.write(pd.DataFrame([missed, quiet]), tmp_path)
    assert "mass of nobody" in (tmp_path / "report.md").read_text()
