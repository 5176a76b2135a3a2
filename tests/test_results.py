"""What `screwgauge.run` returns shows itself in one screen, and can be drawn and written."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace

import pytest

import screwgauge
from screwgauge.reference.errors import UnknownNameError
from screwgauge.report.results import LINES


@pytest.fixture(scope="module")
def results():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0, 0.5, 1.0])
    return screwgauge.run(replace(scene, figures=scene.figures[:3]), engines=["screw", "pinocchio"])


def test_it_shows_itself_in_one_screen(results):
    lines = repr(results).splitlines()
    assert lines[0].startswith("✓ AGREE: screw and pinocchio agree")
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= 100
    assert "joint_position" in repr(results)


def test_a_long_one_says_that_there_is_more(results, monkeypatch):
    monkeypatch.setattr("screwgauge.report.results.LINES", 5)
    assert len(repr(results).splitlines()) == 5
    assert repr(results).splitlines()[-1] == "... `write` leaves the whole report"


def test_a_notebook_shows_tables_and_pictures(results):
    shown = results._repr_html_()
    assert shown.startswith('<div class="banner agree">')
    assert "<table>" in shown
    pictures = results.plot()
    assert repr(pictures).splitlines() == [picture.title for picture in pictures]
    assert pictures._repr_html_().count("<svg ") == len(pictures) == 5  # the mechanism, and that of the condition


def test_the_page_alone_can_be_written_and_leaves_the_rest(results, tmp_path):
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "mine.svg").write_text("mine")
    page = results.to_html(tmp_path / "page.html")
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["mine.svg", "page.html", "plots"]


def test_a_figure_is_found_by_its_name(results):
    assert [picture.name for picture in results.figure("mechanism")] == ["mechanism"]
    assert [picture.name for picture in results.figure("condition")] == ["04-condition"]
    with pytest.raises(UnknownNameError, match=r"unknown figure 'conditions'.*did you mean '04-condition'"):
        results.figure("conditions")


def test_names_that_are_not_there_are_said(results):
    with pytest.raises(UnknownNameError, match="unknown engine 'mujoco'"):
        results.values("joint_position", "mujoco")
    with pytest.raises(UnknownNameError, match=r"unknown quantity 'joint_positon'.*did you mean 'joint_position'"):
        results.values("joint_positon")
    with pytest.raises(UnknownNameError, match="none, as the engine truth was not run"):
        results.radius("joint_position")


def test_the_errata_are_in_the_report_only_where_asked_for(results, tmp_path, monkeypatch):
    monkeypatch.setattr("screwgauge.report.pages.run.make_plots", lambda results: [])
    values = {
        "errata": lambda results: [
            {
                "number": 1,
                "kind": "E",
                "equation": "an erratum",
                "right_form": "",
                "printed_form": "",
                "right": 1,
                "printed": 2,
            }
        ],
        "reach": lambda results: "It reaches far.",
    }
    monkeypatch.setattr("screwgauge.report.pages.paper.errata_values", lambda scene: values)
    texts = [
        (results.write(tmp_path / str(errata), errata=errata) / "report.md").read_text(encoding="utf-8")
        for errata in (False, True)
    ]
    assert "The paper, checked" not in texts[0]
    assert "## The paper, checked\n\nIt reaches far. `screwgauge paper` writes" in texts[1]
    assert "| an erratum |" in texts[1]


def test_the_package_lists_its_public_names_and_only_those():
    code = "import screwgauge; screwgauge.load_scene('3ups-upu-s'); print(*dir(screwgauge))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names = [name for name in done.stdout.split() if not re.fullmatch("__.*__", name)]
    assert names == sorted(screwgauge.__all__)
    for name in names:
        assert getattr(screwgauge, name) is not None
