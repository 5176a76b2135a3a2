import csv
import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import screwgauge
from support.engines import Values
from support.freedoms import mobility
from support.judging import Allowance, compare
from support.pages import terminal
from support.report import run_in_terminal, verdict
from support.scene import sampled
from support.solve import layout

SENTENCE = "12 of 20 components of reaction"


@pytest.fixture(scope="module")
def results():
    return screwgauge.run(sampled("slider-crank", slice(None, None, 25)))


@pytest.fixture(scope="module")
def written(results, tmp_path_factory):
    return results.write(tmp_path_factory.mktemp("out"))


@pytest.fixture(scope="module")
def open_(results):
    return results.errors[results.errors["rule"] == "undetermined"]


@pytest.mark.slow
def test_they_are_far_apart_and_carry_no_verdict(results, open_):
    assert open_["max_abs"].max() > 1.0  # newtons or newton metres
    assert not open_["unique"].any()
    assert open_["ok"].isna().all()
    assert open_["tolerance"].isna().all()
    others = results.errors.drop(open_.index)
    assert (others["max_scaled"] <= others["tolerance"]).all()
    assert others["ok"].all()
    assert results.ok


@pytest.mark.slow
def test_in_the_table_their_cells_are_empty(open_, written):
    with (written / "errors.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["rule"] == "undetermined"]
    assert len(rows) == len(open_)
    assert {(row["tolerance"], row["ok"]) for row in rows} == {("", "")}
    assert all(float(row["max_abs"]) >= 0.0 for row in rows)


def compared(results, engine, **changed):
    found = results.solutions[engine].values["reaction"]
    array = found.array.copy()
    for name, value in changed.items():
        array[-1, found.components.index(name.replace("_", "."))] = value
    values = {"reaction": Values(found.components, found.units, array)}
    other = replace(results.solutions[engine], values=values)
    scene, lay = results.scene, layout(results.scene.mechanism)
    counts = mobility(lay, results.solutions["screw"].assembly[1:2])
    both = {"screw": results.solutions["screw"], engine: other}
    return compare(scene.mechanism, scene.problem(()), both, {}, counts, Allowance(scene.tolerance))


def test_any_value_of_theirs_leaves_the_verdict_as_it_is_but_what_is_no_number_fails(results, open_):
    name = open_["component"].iloc[0]
    assert compared(results, "mujoco", **{name: 1e3})[1]["ok"].all()
    errors, pairs = compared(results, "mujoco", **{name: np.nan})
    assert errors.loc[errors["component"] == name, "ok"].tolist() == [False]
    bad = pairs[~pairs["ok"].astype(bool)]
    assert bad["worst_component"].tolist() == [name]
    assert "not a number" in bad["reason"].iloc[0]


def test_a_unique_component_that_differs_still_fails(results, open_):
    names = results.components("reaction")
    unique = next(name for name in names if name not in {*open_["component"]})
    errors, pairs = compared(results, "mujoco", **{unique: 1e3})
    assert not pairs["ok"].all()
    assert not errors.loc[errors["component"] == unique, "ok"].any()


@pytest.mark.slow
def test_the_plots_show_them_apart_and_without_a_tolerance(results, open_):
    pictures = results.plot()
    titles = ("Reaction [N]", "Reaction [N·m]")
    apart = [picture for picture in pictures if picture.title in [f"{title}: not unique" for title in titles]]
    assert len(apart) == open_["unit"].nunique()
    drawn = {name for picture in apart for name in re.findall(r'"component": "([^"]+)"', picture.chart)}
    assert drawn <= {*open_["component"]}
    assert not any("tolerance" in picture.svg for picture in apart)
    assert all("Not unique: redundant constraints leave" in picture.svg for picture in apart)
    for picture in (picture for picture in pictures if picture.title in titles):
        assert "tolerance" in picture.svg
        assert "have no unique value" in " ".join(re.findall(r">([^<>]+)<", picture.svg))
        assert not any(f'"component": "{name}"' in picture.chart for name in open_["component"])


def test_every_form_of_the_report_says_how_many_there_are(results, written):
    assert SENTENCE in " ".join(repr(results).split())
    for name in ("report.md", "report.html"):
        text = " ".join(re.sub(r"<[^>]*>", "", (written / name).read_text(encoding="utf-8")).split())
        assert text.count(SENTENCE) >= 1, name
        assert "Redundant constraints" in text, name
    said = json.loads((written / "summary.json").read_text(encoding="utf-8"))
    assert said["ok"] is True
    assert len(said["not_unique"]["reaction"]) == 12


@pytest.mark.slow
def test_the_gate_says_so_too(results):
    found = screwgauge.check(results.scene.name, smoke=True)
    found.assert_ok()
    assert SENTENCE in found.rows[0].sentence


def test_where_all_is_unique_nothing_of_it_is_said(tmp_path):
    found = screwgauge.run(sampled("3-upu", [0, 1]), engines=["screw", "pinocchio"])
    assert "unique value" not in terminal_text(found)
    assert found.errors["ok"].dtype == "boolean"
    assert not found.errors["ok"].isna().any()
    assert not pd.isna(found.errors["tolerance"]).any()


def test_of_a_linkage_whose_reactions_are_all_open_none_is_called_alone():
    said = verdict(screwgauge.run(sampled("bennett", [0, 1, 2]), engines=["screw", "pinocchio"])).text
    assert "All 20 components of reaction" in said
    assert "which no other engine computes" not in said


def terminal_text(results) -> str:
    return terminal(run_in_terminal(results))
