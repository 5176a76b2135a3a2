import math
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

import pandas as pd
from campaigns.page import counted, study
from campaigns.selftest import ALIKE, CHANGED, CLOSE, VISIBLE

from screwgauge.report.blocks import Banner
from screwgauge.report.layout import Value
from screwgauge.study.formatting import Row, group_rows, rows, words

#: What is wanted: share detected of the changes that torques show, named right, magnitude right; time [s].
WANTED = {"detected": 0.99, "named right": 0.95, "magnitude right": 0.95}
SLOWEST = 10.0


def passed(table: pd.DataFrame) -> bool:
    changed, alike = _of(table, CHANGED), _of(table, ALIKE)
    reached = all(good >= WANTED[name] * of for name, (good, of) in _figures(changed).items())
    return reached and not any(row["detected"] for row in alike) and _median(changed) < SLOWEST


def _of(table: pd.DataFrame, group: str) -> list[Row]:
    some = [row for row in rows(table) if row["group"] == group and row["cpu_s"] != ""]
    return [{**row, **{name: str(row[name]) == "True" for name in ("detected", "right", "public")}} for row in some]


def _figures(changed: Sequence[Row]) -> dict[str, tuple[int, int]]:
    seen = [row for row in changed if row["detected"]]
    good = (
        [row["detected"] for row in changed if float(row["effect"]) > VISIBLE],
        [row["right"] for row in seen],
        [float(row["error"]) <= CLOSE for row in seen if row["error"] != ""],
    )
    return {name: (sum(each), len(each)) for name, each in zip(WANTED, good, strict=True)}


def _median(some: Sequence[Row]) -> float:
    return median(float(row["cpu_s"]) for row in some) if some else 0.0


def _banner(table: pd.DataFrame) -> Banner:
    changed, alike = _of(table, CHANGED), _of(table, ALIKE)
    figures = ", ".join(
        f"{name} {good} of {of} ({f'{100.0 * good / of:.1f} %' if of else 'none'})"
        for name, (good, of) in _figures(changed).items()
    )
    alarms = sum(row["detected"] for row in alike)
    models, public = ({row["model"] for row in changed if row["public"] or every} for every in (True, False))
    text = (
        f"{len(changed)} changes of {len({row['kind'] for row in changed})} kinds in {len(models)} models, "
        f"{len(public)} of them public robots: {figures}. {alarms} false alarms in {len(alike)} pairs that are alike. "
        f"Median processor time of a diagnosis: {_median([*changed, *alike]):.2g} s."
    )
    return Banner.of(text, passed(table), "PASSED", "FAILED")


def _by(label: Callable[[Row], str], order: Callable[[Row], Any] = lambda row: 0) -> Value:
    def lines(table: pd.DataFrame) -> list[Row]:
        labelled = ({**row, "label": label(row)} for row in sorted(_of(table, CHANGED), key=order))
        return [
            {"label": name, "diagnoses": len(group), "time": f"{_median(group):.2f}"}
            | {k.replace(" ", "_"): f"{good}/{of}" if of else "" for k, (good, of) in _figures(group).items()}
            for (name,), group in group_rows(labelled, "label").items()
        ]

    return lines


def _decade(row: Row) -> str:
    k = math.floor(math.log10(float(row["size"])))
    return f"1e{k} to 1e{k + 1}"


def _alike(table: pd.DataFrame) -> list[Row]:
    return [
        {
            "written": words(kind),
            "pairs": len(group),
            "readers": len({(row["a"], row["b"]) for row in group}),
            "alarms": sum(row["detected"] for row in group),
            "worst": f"{max(float(row['effect']) for row in group):.1e}",
        }
        for (kind,), group in group_rows(_of(table, ALIKE), "kind").items()
    ]


def _misses(table: pd.DataFrame) -> list[Row]:
    missed = [row for row in rows(table) if row["verdict"] != "ok"]
    return [{**row, "short": t if len(t := str(row["first"])) < 90 else f"{t[:87]}..."} for row in missed]


PAGE = study(
    "selftest.csv",
    "Self-test of the diagnosis",
    _banner,
    misses=_misses,
    missed=lambda table: counted(row["verdict"] for row in _misses(table)),
    kinds=_by(lambda row: words(row["kind"])),
    models=_by(lambda row: row["model"] + " (public)" * row["public"], order=lambda row: row["model"]),
    sizes=_by(_decade, order=lambda row: float(row["size"])),
    alike=_alike,
    visible=lambda table: VISIBLE,
    close=lambda table: CLOSE,
)
