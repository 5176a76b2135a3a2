"""`screwgauge bench` of given motions."""

import json
import re
from dataclasses import replace

import pandas as pd
import pytest

import screwgauge
from screwgauge.study.bench import run as run_module
from support.bench import CUT, Plan, bench, journals, reach
from support.command import main
from support.pages import terminal as text
from support.report import BENCH_PAGE as PAGE
from support.report import make_plots
from support.tasks import Processes

FEW = ["closed-form", "missing-jdotv", "mj-forward", "four-bar", "floor"]
PLAN = Plan(samples=5, rounds=2, budget=1e9, quick=True)


@pytest.fixture(scope="module")
def scene():
    return screwgauge.load_scene("3ups-upu-s")


@pytest.fixture(scope="module")
def found(scene):
    return bench(scene, plan=PLAN, contestants=FEW)


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(run_module.timing, "QUICK", PLAN)


@pytest.mark.slow
def test_files_and_columns_are_those_of_the_contract(found, tmp_path):
    out = PAGE.write(found, tmp_path / "out")
    first = (out / "bench.csv").read_text(encoding="utf-8").splitlines()[0]
    assert (
        first == "family,contestant,setting,quantity,max_scaled,rms_scaled,digits,time_s,n_sample,covers,status,reason"
    )
    slopes = pd.read_csv(out / "slopes.csv")
    assert list(slopes.columns) == ["family", "parameter", "quantity", "expected", "fitted", "ok"]
    assert json.loads((out / "environment.json").read_text(encoding="utf-8"))["packages"]
    names = {path.name for path in out.iterdir()}
    assert names >= {"report.md", "report.html", "timings.csv", "leaving_out.csv", "reach.csv", "plots"}
    page = (out / "report.html").read_text(encoding="utf-8").partition("<script")[0]
    assert page.count("<svg ") == len(list((out / "plots").glob("*.svg")))
    assert not re.search(r'(?:src|href)="http', page)


@pytest.mark.slow
def test_a_failure_is_a_row_and_in_the_report(found, tmp_path):
    out = PAGE.write(found, tmp_path / "out")
    table = pd.read_csv(out / "bench.csv")
    failed = table[table["status"] == "failed"]
    assert failed["max_scaled"].isna().all()
    assert failed["reason"].str.contains("rank 2 of 3").all()
    assert "rank 2 of 3" in (out / "report.md").read_text(encoding="utf-8")


def test_the_report_says_what_errors_are_against(found):
    assert found.reference in ("truth", "screw")
    assert any(found.reference in note for note in found.notes)
    if found.reference != "truth":
        assert "not against a truth" in text(PAGE.terminal(found))


def test_terminal_fits_a_hundred_columns(found):
    assert max(len(line) for line in text(PAGE.terminal(found)).splitlines()) <= 100


@pytest.mark.slow
def test_plots_are_the_same_for_the_same_data(found):
    assert [plot.svg for plot in make_plots(found)] == [plot.svg for plot in make_plots(found)]


def test_reach_lists_the_quickest_setting_of_each_family(found):
    table = reach(found.rows)
    here = table[(table["quantity"] == "joint_position") & (table["error"] == 1e-12)]
    assert list(here["family"]) == ["closed-form"]
    assert table["seconds_per_sample"].gt(0).all()


@pytest.mark.slow
def test_a_budget_too_small_says_who_was_cut_short(scene, tmp_path, cache_folder):
    clock = iter(range(0, 10**15, 10**9))  # every look at the clock costs a second
    plan = Plan(samples=5, rounds=1, budget=12.0, quick=True)
    found = bench(scene, plan=plan, contestants=FEW, place=tmp_path, clock=lambda: next(clock))
    cut = [row for row in found.rows if row.status == CUT]
    kept = [row for row in found.rows if row.status != CUT]
    assert cut
    assert kept or journals()
    families = {row.contestant.family for row in cut}
    lines = text(PAGE.terminal(found)).split("\n\n")[-1].splitlines()
    assert lines[0].startswith("cut short")
    assert [line.split()[0] for line in lines[1:]] == list(dict.fromkeys(row.contestant.family for row in cut))
    assert len(lines) == 1 + len(families)  # one line per family
    assert all("budget" in row.reason for row in cut)
    assert not found.complete
    again = bench(scene, plan=PLAN, contestants=FEW, place=tmp_path)
    assert again.complete
    assert any("Resumed" in note for note in again.notes)
    assert not journals()


def test_a_budget_too_small_leaves_no_contestant_out(scene):
    clock = iter(range(0, 10**15, 10**9))  # every look at the clock costs a second: one contestant takes six of them
    plan = Plan(samples=5, rounds=3, budget=6.0 * len(FEW) + 1.0, quick=True)
    found = bench(scene, plan=plan, contestants=FEW, clock=lambda: next(clock))
    timed = [row for row in found.rows if row.seconds]
    assert {row.contestant.name for row in timed} == set(FEW)
    assert len({row.contestant.key for row in timed}) == len(FEW)
    assert {row.rounds for row in timed} == {1}
    assert len(reach(found.rows))


@pytest.mark.slow
def test_an_interrupted_bench_goes_on_where_it_stopped(scene, tmp_path, monkeypatch, cache_folder):
    original = run_module.timing.measure

    def interrupt(calls, *rest):
        if len(calls) > 1:  # the rounds that follow errors and first times
            raise KeyboardInterrupt
        return original(calls, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(run_module.timing, "measure", interrupt)
        with pytest.raises(KeyboardInterrupt):
            bench(scene, plan=PLAN, contestants=FEW, place=tmp_path)
    scored: list[str] = []
    scores = run_module._Measurements._score
    monkeypatch.setattr(
        run_module._Measurements, "_score", lambda self, c, *rest: scored.append(c.key) or scores(self, c, *rest)
    )
    found = bench(scene, plan=PLAN, contestants=FEW, place=tmp_path)
    assert not scored
    assert found.complete


def test_a_model_file_of_ones_own_is_refused_not_passed_over(paper_scene, write, refused):
    write("own", "not a model")
    said = refused("bench", paper_scene(models='models = { mujoco = "own" }'), "--quick", "--contestants", "floor")
    assert "scene.toml, models: " in said


@pytest.mark.slow
def test_the_command_writes_its_report(tmp_path, command, small, no_progress, cache_folder):
    out = tmp_path / "out"
    said = command("bench", "--quick", "--contestants", "closed-form,floor", "--out", out)
    assert "closed-form" in said.out
    assert str(out / "report.html") in said.out
    assert said.err == ""
    assert (out / "bench.csv").is_file()
    assert not journals()


def test_the_command_keeps_what_it_has_when_interrupted(tmp_path, capsys, monkeypatch, small, cache_folder):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(run_module.timing, "measure", interrupt)
    out = tmp_path / "out"
    assert main(["bench", "--quick", "--contestants", "closed-form", "--out", str(out)]) == 130
    assert "run the same command again" in capsys.readouterr().err
    assert journals()
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--contestants", "nobody"], "unknown contestant 'nobody'"),
        (["--contestants", ","], "no contestant is chosen"),
        (["--limit", "0"], "a limit of 0 s"),
        (["--limit", "nan"], "a limit of nan s"),
        (["no-such-scene"], "unknown scene 'no-such-scene'"),
    ],
)
def test_bad_input_is_one_sentence_and_status_2(tmp_path, command, arguments, message):
    said = command("bench", *arguments, "--out", tmp_path / "out", status=2)
    assert message in said.err
    assert said.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_contestants_in_processes_of_their_own_have_the_same_errors(found, scene, isolated, tmp_path, cache_folder):
    few = ["closed-form", "four-bar"]
    there = bench(scene, plan=PLAN, contestants=few, execute=Processes(2), place=tmp_path)
    here = {(row.contestant.key, row.quantity): row for row in found.rows}
    for row in there.rows:
        same = here[row.contestant.key, row.quantity]
        assert repr((row.error, row.status, row.reason)) == repr((same.error, same.status, same.reason))
        assert bool(row.seconds) == bool(same.seconds)
    assert there.notes[-1] == run_module.BESIDE
    assert not journals()


def test_what_closes_loops_is_not_priced_against_what_is_given_the_motion(found):
    lines = [row for row in reach(found.rows).to_dict("records") if row["error"] == 1e-9]
    front, *_ = PAGE.blocks(found)[1].blocks
    for given, start in ((False, "from the independent coordinates by "), (True, "from given joint motion by ")):
        there = [row for row in lines if row["quantity"] == "joint_acceleration" and bool(row["given"]) is given]
        assert (start in front.text) is bool(there)
        if there:
            assert start + min(there, key=lambda row: row["seconds_per_sample"])["family"] in front.text


def test_a_bench_that_was_only_cut_short_has_no_cross(found):
    short = replace(found, rows=[*found.rows, replace(found.rows[-1], status=CUT)], fits=[])
    cut, measured, *_ = PAGE.blocks(short)[1].blocks
    assert (cut.word, cut.status, measured.word) == ("CUT SHORT", "note", "✓ MEASURED")
    assert "before 1 row;" in cut.text
