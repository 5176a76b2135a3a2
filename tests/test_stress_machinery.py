"""Ladders and verdicts of stress."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from screwgauge import ScrewgaugeError
from screwgauge.study.bench import stress as study
from support.acting import Applied
from support.command import main
from support.engines import Cost, Error, Method, ModelFiles, Problem, Progress, Solution, Values, quiet
from support.errors import ClosureError
from support.judging import Reference
from support.mechanism import load_mechanism
from support.questions import Question, findings
from support.scene import States
from support.stress import COLUMNS, DEGRADED, GOOD, OK, REFUSED, SILENT, Finding, StressCase, stress

NOWHERE = ModelFiles(Path("nowhere"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Fake(Method):
    """Engine with a known error."""

    error: float = 0.0
    admitted: float = 0.0
    stopped: str = ""
    notes: tuple[str, ...] = ()

    def load(self, files: ModelFiles) -> Fake:
        return self

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        if math.isnan(self.admitted):
            raise ClosureError("it does not close", "the fake", "start elsewhere")
        values = {"force": Values(("f", "unasked"), ("N", "N"), np.array([[self.error, 7.0]]))}
        errors = {"force": Error(np.array([self.admitted]))}
        answer = Solution(self.engine, "", values, np.array([3.0]), errors=errors, notes=self.notes)
        return replace(answer, stopped=self.stopped, cost=Cost(0.1))


def question(*methods: Method, **more: object) -> Question:
    right = Reference("truth", {"force": Values(("f",), ("N",), np.zeros((1, 1)))}, "", {"force": {"N": 1.0}})
    problem = Problem(Applied(), States((), np.zeros((1, 0)), np.zeros((1, 0))), frozenset(("force",)))
    files = dict.fromkeys(("screw", "pinocchio", "mujoco"), NOWHERE)
    asked = Question(load_mechanism("a01-pendulum"), files, problem, methods, ("force",), right)
    return replace(asked, **more)


def ask_toy(severity: float, quick: bool, folder: Path) -> Iterator[Question]:
    if severity == 1e3:
        raise ValueError("the third rung\nbreaks")
    yield question(Fake("screw", error=1e-15))
    yield question(Fake("mujoco", error=severity * 1e-12, admitted=severity * 1e-11))
    yield question(Fake("pinocchio", error=severity * 1e-10 if severity < 1e5 else math.nan))


def ask_broken(severity: float, quick: bool, folder: Path) -> Iterator[Question]:
    yield question(Fake("screw", error=1.0))


RUNGS = (0.0, 1.0, 1e3, 1e4, 1e5)
TOY = StressCase("toy", "A toy", "severity [1]", "What is seen.", "force", 0.0, 1e6, RUNGS, (1.0, 1e4), ask_toy)
BROKEN = StressCase("broken", "Broken", "severity [1]", "", "force", 0.0, 1.0, (1.0,), (1.0,), ask_broken)


@pytest.fixture(autouse=True)
def _toys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "CASES", {"toy": TOY, "broken": BROKEN})


@pytest.mark.parametrize(
    ("finding", "verdict"),
    [
        (Finding("q", a="e", error=GOOD), OK),
        (Finding("q", a="e", error=2 * GOOD, tolerance=3 * GOOD), DEGRADED),
        (Finding("q", a="e", error=4 * GOOD, tolerance=3 * GOOD, reason="said too little"), SILENT),
        (Finding("q", a="e", reason="why"), REFUSED),
        (Finding("q", a="e"), SILENT),
        (Finding("q", a="e", error=math.inf, reason="why"), SILENT),
    ],
)
def test_a_verdict_follows_from_error_and_warning(finding: Finding, verdict: str) -> None:
    assert finding.verdict == verdict


def only(asked: Question) -> Finding:
    (finding,) = findings(asked)
    return finding


def test_a_finding_has_name_error_condition_and_time_and_leaves_other_components_alone() -> None:
    finding = only(question(Fake("mujoco", error=1e-12, label="mujoco RK4")))
    right = Finding("force", a="mujoco RK4", error=1e-12, condition=3.0, time_s=0.1)
    assert repr(finding) == repr(right)  # NaN is no other NaN
    assert only(question(Fake("screw", label="screw otherwise"))).own


def test_a_cause_is_said_where_another_engine_is_wrong_and_nothing_says_so() -> None:
    caused = {"cause": "too soft: {notes}", "remarks": {"force": "one of many"}}
    silent = only(question(Fake("mujoco", error=1.0, notes=("rank 2",)), **caused))
    assert (silent.verdict, silent.reason) == (SILENT, "too soft: rank 2; one of many")
    for fine in (Fake("mujoco", error=1e-10), Fake("screw", error=1.0)):
        assert only(question(fine, **caused)).reason == "one of many"
    assert only(question(Fake("mujoco", error=math.inf), **caused)).verdict == SILENT


@pytest.mark.parametrize(
    ("fake", "more", "verdict", "reason"),
    [
        (Fake("mujoco", error=1e-8, admitted=2e-8), {}, DEGRADED, "its error estimate admits 2.0e-08"),
        (
            Fake("mujoco", error=1, admitted=math.inf),
            {},
            DEGRADED,
            "according to its error estimate no digit may be correct",
        ),
        (Fake("mujoco", error=1e-8, admitted=1.0), {"admitted": {"force": 0.0}}, SILENT, ""),
        (Fake("mujoco", error=1e-8), {"admitted": {"force": 1e-7}, "by": "eps"}, DEGRADED, "eps admits 1.0e-07"),
        (Fake("mujoco", stopped="t = 1 s: lost"), {}, REFUSED, "t = 1 s: lost"),
        (Fake("mujoco", admitted=math.nan), {}, REFUSED, "ClosureError: the fake: it does not close; start elsewhere."),
        (Fake("mujoco"), {"refused": "too long"}, REFUSED, "too long"),
        (Fake("mujoco", error=math.nan, notes=("noted",)), {"cause": "soft"}, SILENT, ""),
    ],
)
def test_what_is_admitted_and_what_is_refused(fake: Fake, more: dict, verdict: str, reason: str) -> None:
    finding = only(question(fake, **more))
    assert (finding.verdict, finding.reason) == (verdict, reason)


def test_a_question_pickles_and_is_answered_alike() -> None:
    asked = question(Fake("mujoco", error=1e-8, admitted=2e-8), cause="why")
    assert repr(only(pickle.loads(pickle.dumps(asked)))) == repr(only(asked))
    assert pickle.loads(pickle.dumps(TOY)) == TOY


def test_every_rung_is_there_and_one_that_breaks_is_a_row() -> None:
    table = stress(["toy"]).table
    assert list(table.columns) == list(COLUMNS)
    assert sorted(set(table["severity"])) == [0.0, 1.0, 1e3, 1e4, 1e5]
    (row,) = table[table["severity"] == 1e3].to_dict("records")
    assert (row["verdict"], row["reason"]) == (REFUSED, "ValueError: the third rung breaks")


def test_interrupted_stress_goes_on_where_it_stopped(tmp_path, monkeypatch, cache_folder) -> None:
    climbed, climb = list[float](), study.climb

    def counted(case: StressCase, severity: float, *, quick: bool = False) -> list[Finding]:
        climbed.append(severity)
        if len(climbed) == 3:
            raise KeyboardInterrupt
        return climb(case, severity, quick=quick)

    monkeypatch.setattr(study, "climb", counted)
    with pytest.raises(KeyboardInterrupt):
        stress(["toy"], place=tmp_path)
    again = stress(["toy"], place=tmp_path).table
    assert climbed == [*RUNGS[:3], *RUNGS[2:]]
    pd.testing.assert_frame_equal(again, stress(["toy"]).table)


@pytest.mark.slow
def test_the_exit_status_blames_our_own_solver_only(tmp_path, capsys) -> None:
    assert main(["stress", "toy", "--severity", "0,1,1e4", "--out", str(tmp_path / "toy")]) == 0
    assert "without a warning: pinocchio in 1 of 1 cases" in capsys.readouterr().out
    assert main(["stress", "broken", "--out", str(tmp_path / "broken")]) == 1


def test_a_rung_that_breaks_is_said_and_is_no_success(tmp_path, capsys) -> None:
    assert main(["stress", "toy", "--out", str(tmp_path / "toy")]) == 3
    assert capsys.readouterr().err == "screwgauge: a severity failed: ValueError: the third rung breaks\n"
    assert (tmp_path / "toy" / "stress.csv").exists()


def test_the_folder_has_table_report_and_page_of_plots(tmp_path) -> None:
    assert main(["stress", "toy", "--quick", "--out", str(tmp_path)]) == 0
    names = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    pictures, pages = {"plots/01-worst.svg", "plots/02-digits.svg"}, {"report.md", "report.html"}
    assert names == pictures | pages | {"stress.csv", "environment.json", "report-files.json"}
    table = pd.read_csv(tmp_path / "stress.csv")
    assert list(table.columns) == list(COLUMNS)
    assert sorted(set(table["severity"])) == [1.0, 1e4]
    assert "| toy | pinocchio |" in (tmp_path / "report.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nonsense"], ("case", "nonsense", "toy")),
        (["toy", "--severity", "1e7"], ("1e+07", "outside", "toy")),
        (["toy", "--severity", "nan"], ("nan",)),
        (["toy", "--severity", ","], ("no severity", "0 to 1e+06")),
        (["--severity", "1"], ("--severity", "single case")),
    ],
)
def test_bad_input_is_one_sentence(arguments, words, tmp_path, command) -> None:
    text = command("stress", *arguments, "--out", tmp_path / "out", status=2).err
    assert text.count("\n") == 1
    assert all(word in text for word in words), text
    assert not (tmp_path / "out").exists()


def test_severities_replace_the_rungs_of_one_case() -> None:
    assert set(stress(["toy"], severities=[2.0, 3.0]).table["severity"]) == {2.0, 3.0}
    with pytest.raises(ScrewgaugeError):
        stress(["toy", "broken"], severities=[1.0])


def test_counts_are_whole_and_rungs_are_climbed_once() -> None:
    case = replace(TOY, whole=True)
    with pytest.raises(ScrewgaugeError, match="whole number"):
        case.rungs(severities=[2.5])
    assert case.rungs(severities=[2.0, 2.0]) == [2.0]
