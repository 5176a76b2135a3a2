"""Ladders, verdicts and what `screwgauge stress` leaves, on a toy case that needs no engine."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import pandas as pd
import pytest

from screwgauge.cli import main
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.study.stress import registry
from screwgauge.study.cases.case import DEGRADED, GOOD, OK, REFUSED, SILENT, Case, Finding, Rung
from screwgauge.study.stress import COLUMNS, stress


def toy() -> Case:
    """screw keeps all digits; mujoco loses one a rung and says so; pinocchio loses them silently, then NaN."""

    def rung(severity: float, quick: bool) -> Rung:
        def measure() -> Iterator[Finding]:
            if severity == 1e3:
                raise ValueError("the third rung\nbreaks")
            yield Finding("screw", "force", 1e-15, condition=3.0, time_s=0.1)
            yield Finding("mujoco", "force", severity * 1e-12, admitted=severity * 1e-11)
            yield Finding("pinocchio", "force", severity * 1e-10 if severity < 1e5 else math.nan)

        return Rung(severity, measure)

    rungs = (0.0, 1.0, 1e3, 1e4, 1e5)
    return Case("toy", "A toy", "severity [1]", "What is seen.", "force", 0.0, 1e6, rungs, (1.0, 1e4), rung)


def broken() -> Case:
    """Our own solver is wrong without a word."""
    return Case(
        "broken", "Broken", "severity [1]", "", "force", 0.0, 1.0, (1.0,), (1.0,),
        lambda severity, quick: Rung(severity, lambda: [Finding("screw", "force", 1.0)]),
    )  # fmt: skip


@pytest.fixture(autouse=True)
def _toys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "CASES", {"toy": f"{__name__}:toy", "broken": f"{__name__}:broken"})
    toys = {"toy": toy, "broken": broken}
    monkeypatch.setattr(registry, "load", lambda name: toys[name]())


@pytest.mark.parametrize(
    ("finding", "verdict"),
    [
        (Finding("e", "q", GOOD), OK),
        (Finding("e", "q", 2 * GOOD, admitted=3 * GOOD), DEGRADED),
        (Finding("e", "q", 4 * GOOD, admitted=3 * GOOD, reason="said too little"), SILENT),
        (Finding("e", "q", reason="why"), REFUSED),
        (Finding("e", "q"), SILENT),
        (Finding("e", "q", math.inf, reason="why"), SILENT),
    ],
)
def test_a_verdict_follows_from_error_and_warning(finding: Finding, verdict: str) -> None:
    assert finding.verdict == verdict


def test_every_rung_is_there_and_one_that_breaks_is_a_row() -> None:
    table = stress(["toy"]).table
    assert list(table.columns) == COLUMNS
    assert sorted(set(table["severity"])) == [0.0, 1.0, 1e3, 1e4, 1e5]
    (row,) = table[table["severity"] == 1e3].to_dict("records")
    assert (row["verdict"], row["reason"]) == (REFUSED, "ValueError: the third rung breaks")


def test_the_exit_status_blames_our_own_solver_only(tmp_path, capsys) -> None:
    assert main(["stress", "toy", "--severity", "0,1,1e4", "--out", str(tmp_path / "toy")]) == 0
    assert "Silently wrong: pinocchio." in capsys.readouterr().out
    assert main(["stress", "broken", "--out", str(tmp_path / "broken")]) == 1


def test_a_rung_that_breaks_is_said_and_is_no_success(tmp_path, capsys) -> None:
    assert main(["stress", "toy", "--out", str(tmp_path / "toy")]) == 3
    assert capsys.readouterr().err == "screwgauge: a rung broke: ValueError: the third rung breaks\n"
    assert (tmp_path / "toy" / "stress.csv").exists()


def test_the_folder_has_table_report_and_page_of_plots(tmp_path) -> None:
    assert main(["stress", "toy", "--quick", "--out", str(tmp_path)]) == 0
    names = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert names == {"stress.csv", "report.md", "report.html", "environment.json", "plots/01-digits.svg"}
    table = pd.read_csv(tmp_path / "stress.csv")
    assert list(table.columns) == COLUMNS
    assert sorted(set(table["severity"])) == [1.0, 1e4]
    assert "| toy | pinocchio |" in (tmp_path / "report.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nonsense"], ("case", "nonsense", "toy")),
        (["toy", "--severity", "1e7"], ("1e+07", "outside", "toy")),
        (["toy", "--severity", "nan"], ("nan",)),
        (["toy", "--severity", ","], ("no severity", "0 to 1e+06")),
        (["--severity", "1"], ("--severity", "one case")),
    ],
)
def test_bad_input_is_one_sentence(arguments, words, tmp_path, capsys) -> None:
    assert main(["stress", *arguments, "--out", str(tmp_path / "out")]) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    assert all(word in text for word in words), text
    assert not (tmp_path / "out").exists()


def test_severities_replace_the_rungs_of_one_case() -> None:
    assert set(stress(["toy"], severities=[2.0, 3.0]).table["severity"]) == {2.0, 3.0}
    with pytest.raises(ScrewgaugeError):
        stress(["toy", "broken"], severities=[1.0])


def test_counts_are_whole_and_rungs_are_climbed_once() -> None:
    case = replace(toy(), whole=True)
    with pytest.raises(ScrewgaugeError, match="no count"):
        case.rungs(severities=[2.5])
    assert [rung.severity for rung in case.rungs(severities=[2.0, 2.0])] == [2.0]
