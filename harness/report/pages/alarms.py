"""The report of ``screwgauge check --self-test``: false alarms and missed changes, by family."""

from __future__ import annotations

import pandas as pd

from screwgauge.report.blocks import Banner
from screwgauge.report.formatting import Row, rows
from screwgauge.report.study import study
from screwgauge.study.gate.alarms import CHANGE, NAME


def sentence(found: pd.DataFrame) -> str:
    """The counts in words."""
    return (
        "{mechanisms} random mechanisms of {families} families: {alarms} false alarms of {looked} ({refused} refused); "
        "{missed} of {changed} changes of the dynamics by {change:g} missed."
    ).format(**_counts(found), families=found["family"].nunique(), change=CHANGE)


def passed(found: pd.DataFrame) -> bool:
    """Whether there is neither a false alarm nor a missed change, and something was looked at."""
    n = _counts(found)
    return bool(n["looked"] and n["changed"]) and not n["alarms"] and not n["missed"]


def _counts(found: pd.DataFrame) -> dict[str, int]:
    quiet, caught = found["quiet"], found["caught"]
    refused, n = int((quiet == "refused").sum()), len(found)
    alarms, missed = int((quiet == "no").sum()), int((caught == "no").sum())
    counts = {"mechanisms": n, "refused": refused, "looked": n - refused, "alarms": alarms}
    return {**counts, "changed": int((caught != "").sum()), "missed": missed}


def _bad(found: pd.DataFrame) -> list[str]:
    """Every false alarm and missed change, and what was refused."""

    def because(row: Row) -> str:
        missed = "{parameter} by {share} missed ({error}, tolerance {tolerance})".format(**row)
        return "; ".join([*([row["reason"]] if row["reason"] else []), *([missed] if row["caught"] == "no" else [])])

    bad = rows(found[(found["quiet"] != "yes") | (found["caught"] == "no")])
    return [f"{row['family']} {row['seed']}: {because(row)}" for row in bad]


PAGE = study(
    NAME,
    "False alarms and missed changes",
    lambda found: Banner.of(sentence(found), passed(found), "PASSED", "FAILED"),
    sentence=sentence,
    families=lambda found: [{"family": name, **_counts(some)} for name, some in found.groupby("family")],
    bad=_bad,
)
