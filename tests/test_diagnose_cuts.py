"""One loop cut in two ways, by points and by a copy of a body that is welded to it, is one loop."""

from __future__ import annotations

import pytest

import screwgauge
from support.mechanism import load_mechanism
from support.models import write_models

pytestmark = pytest.mark.slow


@pytest.fixture
def cuts(tmp_path):
    """The MJCF of both cuts of a mechanism that is built in; text of the minimal one may be replaced."""

    def of(name: str, old: str = "", new: str = ""):
        write_models(load_mechanism(name), tmp_path)
        points, copy = tmp_path / f"{name}.xml", tmp_path / f"{name}-full.xml"
        text = points.read_text(encoding="utf-8")
        assert old in text
        points.write_text(text.replace(old, new), encoding="utf-8")
        return points, copy

    return of


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider-crank", "3-rps"])
def test_both_cuts_of_a_machine_are_the_same(name, cuts):
    for a, b in (cuts(name), cuts(name)[::-1]):
        found = screwgauge.diagnose(a, b)
        assert found.same, found.verdict
        assert any("cuts its loops elsewhere, at " in note for note in found.notes)


@pytest.mark.slow
def test_what_else_differs_is_all_that_is_named(cuts, tmp_path):
    points, copy = cuts("slider-crank", 'mass="0.8"', 'mass="0.9"')
    found = screwgauge.diagnose(copy, points)
    (said,) = found.differences
    assert said.sentence == "piston: mass 0.9000 kg in B, 0.8000 kg in A (+12.50 %), with piston@wrist in A"
    assert screwgauge.diagnose(copy, found.write_fix(tmp_path / "fixed.xml")).same
    (said,) = screwgauge.diagnose(points, copy).differences
    assert said.sentence == "piston: mass 0.8000 kg in B, 0.9000 kg in A (-11.11 %), with piston@wrist in B"


@pytest.mark.slow
def test_other_points_of_the_axis_are_no_difference_and_points_beside_it_are(cuts):
    points, copy = cuts("slider-crank", ' 0 0.2"', ' 0 0.7"')
    assert screwgauge.diagnose(copy, points).same
    points, copy = cuts("slider-crank", 'name="wrist@parent1" pos="0.3', 'name="wrist@parent1" pos="0.31')
    found = screwgauge.diagnose(points, copy)
    assert not found.same
    assert {each.what for each in found.differences} <= {"first_frame", "second_frame"}


def test_a_joint_that_is_in_no_way_in_the_other_model_is_missing(cuts):
    points, copy = cuts("slider-crank")
    text = points.read_text(encoding="utf-8")
    start, end = text.index("<equality>"), text.index("</equality>")
    points.write_text(text[:start] + text[end + len("</equality>") :], encoding="utf-8")
    assert "branch" in {each.what for each in screwgauge.diagnose(points, copy).differences}
