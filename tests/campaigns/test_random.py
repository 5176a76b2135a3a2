from dataclasses import replace

import pytest
from campaigns.random_mechanisms import COLUMNS, measured
from campaigns.random_page import PAGE, plain
from campaigns.verdict import judged

import screwgauge
from screwgauge.solution import Failure
from screwgauge.study.run import run

COUNT = 2000


@pytest.mark.campaign
def test_engines_agree_on_random_mechanisms(campaign):
    table = campaign.of_mechanisms(PAGE, "random", measured, COLUMNS, COUNT)
    assert {*table["verdict"]} <= {"agree", "estimated"}


@pytest.mark.slow
def test_a_verdict_follows_from_the_comparison():
    results = run(screwgauge.random(1, "rsur"), ["screw", "pinocchio"])
    assert (judged(results)["verdict"], judged(results)["branch"]) == ("agree", "same")
    judge, pairs = results.judge.copy(), results.pairs.copy()
    judge.loc[0, "ok"] = False
    assert judged(replace(results, judge=judge))["verdict"] == "judged"
    pairs.loc[3, ["ok", "max_scaled", "undecided"]] = [False, 1e-3, 1]
    estimated = judged(replace(results, judge=judge, pairs=pairs))
    assert (estimated["verdict"], estimated["quantity"]) == ("estimated", pairs["quantity"][3])
    pairs.loc[4, ["ok", "max_scaled", "reason"]] = [False, float("nan"), "not a number"]
    assert judged(replace(results, pairs=pairs))["verdict"] == "differ"
    assert judged(replace(results, failures={"mujoco": Failure("mujoco", "no", "")}))["verdict"] == "failed"


def test_reasons_that_differ_in_names_and_numbers_alone_are_one():
    assert plain("t = 0.3 s, a = 1e-3: joint 'x.q1' of 2 bodies") == plain(
        "t = 4 s, b = 2, c_2 = -3: joint 'y' of 31 bodies"
    )
    assert plain("it ends beyond y = [0.1, -2e-3] or so") == plain("it ends beyond y = [ 0.1 2 3 ] or so")
