"""Engines on random mechanisms: one row each, kept over interruptions, verdicts that say what was found."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

import screwgauge
from screwgauge.cli import main
from screwgauge.report.pages.random import plain
from screwgauge.solution import Failure
from screwgauge.study.campaigns.campaign import COLUMNS, judged
from screwgauge.study.run import run


@pytest.fixture(scope="module")
def results():
    return run(screwgauge.random(1, "rsur"), ["screw", "pinocchio"])


def test_a_bench_goes_on_where_it_stopped_and_reports_by_family_and_reason(tmp_path, capsys):
    def bench(count: int) -> pd.DataFrame:
        asked = ["--random", str(count), "--seed", "3", "--contestants", "serial,bennett", "--out", str(tmp_path)]
        assert main(["bench", *asked]) == 0
        return pd.read_csv(tmp_path / "random.csv", keep_default_na=False)

    first, both = bench(1), bench(2)
    assert list(both.columns) == list(COLUMNS)
    assert both["family"].tolist() == ["bennett", "serial"]
    assert both[both["family"] == "serial"]["cpu_s"].tolist() == first["cpu_s"].tolist()  # it was not done again
    assert set(both["verdict"]) == {"agree"}
    assert "2 random mechanisms of 2 families: 2 agree." in capsys.readouterr().out
    assert "## By family" in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_an_unknown_family_is_bad_input(tmp_path, capsys):
    assert main(["bench", "--random", "1", "--contestants", "bennet", "--out", str(tmp_path)]) == 2
    assert "unknown family 'bennet'" in capsys.readouterr().err


def test_a_verdict_says_what_was_found(results):
    assert (judged(results)["verdict"], judged(results)["branch"]) == ("agree", "same")
    elsewhere = replace(results.solutions["pinocchio"], assembly=None, values={})
    unknown = replace(results, solutions={**results.solutions, "pinocchio": elsewhere})
    assert judged(unknown)["branch"] == "unknown for pinocchio"
    judge, pairs = results.judge.copy(), results.pairs.copy()
    judge.loc[0, "ok"] = False
    assert judged(replace(results, judge=judge))["verdict"] == "judged"
    pairs.loc[3, ["ok", "max_scaled", "reason"]] = [False, 1e-3, "within the error that screw admits by ..."]
    found = judged(replace(results, judge=judge, pairs=pairs))
    assert (found["verdict"], found["max_scaled"], found["quantity"]) == ("estimated", "0.001", pairs["quantity"][3])
    pairs.loc[4, ["ok", "max_scaled", "reason"]] = [False, float("nan"), "not a number"]
    assert judged(replace(results, pairs=pairs))["verdict"] == "differ"
    failed = judged(replace(results, failures={"mujoco": Failure("mujoco", "ValueError: no", "")}))
    assert (failed["verdict"], failed["reason"]) == ("failed", "mujoco: ValueError: no")


def test_reasons_that_differ_in_names_and_numbers_alone_are_one():
    assert plain("t = 0.3 s, a = 1e-3: joint 'x.q1' of 2 bodies") == plain(
        "t = 4 s, b = 2, c_2 = -3: joint 'y' of 31 bodies"
    )
    assert plain("it ends beyond y = [0.1, -2e-3] or so") == plain("it ends beyond y = [ 0.1 2 3 ] or so")
