"""Every erratum of the paper has its measured number, and the numbers are those found elsewhere."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from screwgauge import load_scene
from screwgauge.cli import main
from screwgauge.reference.errors import DescriptionError
from screwgauge.report.pages.paper import PAGE, errata_frame, errata_values
from screwgauge.report.terminal import COLUMNS
from screwgauge.report.terminal import terminal as text
from screwgauge.study.paper.errata import Values, tabulated
from screwgauge.study.paper.measure import is_the_papers, measured

AGREE = 0.03  # sizes found elsewhere are given with two or three figures

#: (number, part of what was measured, size of the effect)
SIZES = [
    (1, "redundant constraints", 2),
    (2, "second free axis", 0.4),
    (3, "infinite entries", 1),
    (4, "S chain", 0.104),
    (5, "at home", 0.60),
    (5, "t = 1 s", 0.0515),
    (8, "UPS legs", 4.4e-5),
    (8, "attitude", 1.07e-4),
    (8, "UPU leg", 0.032),
    (9, "joint accelerations", 17.5),
    (10, "joint accelerations", 4.8),
    (11, "centres of mass", 6.9),
    (15, "ratio", 7.05),
    (15, "t = 6.28 s", 7.4e8),
    (16, "numbers", 2),
    (17, "angular velocity", 0.039),
    (17, "derivative", 0.28),
    (17, "P away", 0.21),
    (18, "longest leg", 0.264),
]


@pytest.fixture(scope="module")
def paper_check():
    return measured()


def row(check, number, words):
    found = [r for r in check.errata if r.number == number and words in r.measure]
    assert len(found) == 1, (number, words)
    return found[0]


def test_no_erratum_without_its_measured_number(paper_check):
    assert paper_check.complete
    assert {r.number for r in paper_check.errata} == set(range(1, 19))
    for r in paper_check.errata:
        assert np.isfinite([r.printed, r.right, r.effect]).all(), r
        assert r.kind in "EAN"


@pytest.mark.parametrize(("number", "words", "size"), SIZES)
def test_sizes_are_those_found_elsewhere(paper_check, number, words, size):
    assert row(paper_check, number, words).effect == pytest.approx(size, rel=AGREE, abs=0)


def test_what_is_an_error_vanishes_in_the_right_form(paper_check):
    """Where the right form has a residual of its own, it is rounding, or that of a difference formula."""
    for number, words, bound in [
        (2, "axis", 1e-13),
        (4, "S chain", 1e-13),
        (5, "at home", 1e-13),
        (7, "S w - V", 1e-13),
        (8, "UPS", 1e-11),
        (9, "joint", 1e-10),
        (10, "joint", 1e-10),
        (11, "centres", 1e-5),
        (14, "imbalance", 1e-9),
        (16, "c Q - b", 1e-9),
        (17, "P away", 1e-13),
    ]:
        assert abs(row(paper_check, number, words).right) < bound, (number, words)


def test_units_of_length_change_the_answer_of_the_pseudo_inverse(paper_check):
    found = row(paper_check, 7, "t = 2 s")
    assert (found.printed, found.right) == (pytest.approx(0.162, abs=5e-4), pytest.approx(0.182, abs=5e-4))
    assert row(paper_check, 7, "S w - V").printed == pytest.approx(1.86e-2, rel=AGREE, abs=0)


def test_orders_of_the_scheme(paper_check):
    found = row(paper_check, 8, "order")
    assert (found.printed, found.right) == (pytest.approx(1.0, rel=0.1), pytest.approx(4.0, rel=0.1))


def test_each_reading_of_the_lever_arms_leaves_something(paper_check):
    readings = [r for r in paper_check.errata if r.number == 13 and "imbalance" in r.measure]
    assert len(readings) == 5  # two for (53), two for (54); one reading of (55) is right
    assert all(r.effect > 50.0 and abs(r.right) < 1e-9 for r in readings)


def test_the_papers_case_is_statics(paper_check):
    reach = paper_check.reach
    assert reach.load == pytest.approx(1000.0, rel=1e-6)
    assert reach.gravity == pytest.approx(17.0, rel=0.01)
    assert reach.inertia == pytest.approx(0.7, rel=0.03)
    assert reach.joint_error > 10.0
    assert reach.bracket < 1e-4 * reach.driving  # a wrong Lie bracket does not show in Fig. 11
    assert "statics" in reach.sentence


def test_measurements_that_are_not_those_of_the_table_are_refused():
    with pytest.raises(ValueError, match="table"):
        tabulated({1: [Values(2.0, 0.0), Values(1.0, 0.0)]})


def test_terminal_has_every_row_in_its_width(paper_check):
    lines = text(PAGE.terminal(paper_check)).splitlines()
    assert max(map(len, lines)) <= COLUMNS
    assert sum(line[:2].strip().isdigit() for line in lines[1:]) >= len(paper_check.errata)


def test_files(paper_check, tmp_path):
    PAGE.write(paper_check, tmp_path)
    table = pd.read_csv(tmp_path / "errata.csv")
    assert tuple(table.columns) == ("number", "equation", "printed", "right", "effect", "unit")
    assert len(table) == len(errata_frame(paper_check.errata)) == len(paper_check.errata)
    report = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert report.count("plots/") == len(list((tmp_path / "plots").glob("*.svg"))) == 3
    assert "<svg" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "packages" in json.loads((tmp_path / "environment.json").read_text())


def test_command(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("screwgauge.study.paper.measure.measure", lambda progress: measured())
    assert main(["paper", "--out", str(tmp_path / "out")]) == 0
    assert "statics" in capsys.readouterr().out
    assert (tmp_path / "out" / "errata.csv").is_file()
    (tmp_path / "file").write_text("")
    assert main(["paper", "--out", str(tmp_path / "file")]) == 2


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("3ups-upu-s", True),
        ("3ups-upu-s-eq55", True),
        ("3ups-upu-s-fast", False),
        ("3ups-upu-s-offset", False),
    ],
)
def test_the_default_report_has_a_section_for_the_papers_scenes_only(name, expected):
    scene = load_scene(name).at([0.0, 0.7])
    assert is_the_papers(scene) is expected
    if expected:
        assert errata_values(scene)
    else:
        with pytest.raises(DescriptionError, match="not that of the paper, whose errata are asked for"):
            errata_values(scene)
