"""Random mechanisms put to `screw` and `lagrange`, which share no formulation, a row each, and the page of these."""

from collections import Counter
from time import process_time
from typing import Any

import pandas as pd
from campaigns.page import counted, study
from campaigns.rows import drawn
from campaigns.verdict import counts, judged

from screwgauge.engines.registry import ENGINES
from screwgauge.report.blocks import Banner, Table, table
from screwgauge.study.formatting import group_rows, rows
from screwgauge.study.run import run

PAIR = ("screw", "lagrange")
NAMED = ("resistance", "mass_matrix")
COLUMNS = (
    *("family", "seed", "bodies", "joints", "freedoms", "loops", "verdict", "max_scaled", "tolerance", "quantity"),
    *("component", "judge", "branch", "reason", "cpu_s", *(f"{engine}_s" for engine in PAIR)),
)


def measured(item: tuple[int, str]) -> dict[str, Any]:
    with drawn(item, COLUMNS) as (scene, row):
        row |= counts(scene.mechanism)
        begin = process_time()
        wanted = [name for name in scene.quantities if name not in ENGINES["lagrange"].lacks]
        wanted += [*NAMED, *["axis_moment"] * ("actuator_force" in wanted)]
        found = judged(run(scene, PAIR, wanted))
        row |= {name: value for name, value in found.items() if name in COLUMNS}
        row["cpu_s"] = f"{process_time() - begin:.3g}"
    return row


def _sentence(found: pd.DataFrame) -> str:
    worst = pd.to_numeric(found["max_scaled"]).max()
    return (
        f"{len(found)} random mechanisms of {found['family'].nunique()} families by screw and by Lagrange's equations: "
        f"{counted(found['verdict'])}; the largest difference is {worst:.2g}."
    )


def _banner(found: pd.DataFrame) -> Banner:
    return Banner.of(_sentence(found), {*found["verdict"]} == {"agree"})


def _families(found: pd.DataFrame) -> Table:
    verdicts, lines = sorted({*found["verdict"]}), []
    for (family,), group in group_rows(rows(found), "family").items():
        worst = max((row for row in group if row["max_scaled"]), key=lambda row: float(row["max_scaled"]), default={})
        error = {"worst": worst.get("max_scaled", ""), **{key: worst.get(key, "") for key in ("quantity", "seed")}}
        counts = Counter(row["verdict"] for row in group)
        lines.append({"family": family, "drawn": len(group), **dict.fromkeys(verdicts, 0), **counts, **error})
    return table(lines, f"family | drawn | {' | '.join(verdicts)} | worst error = worst | of = quantity | seed")


def _reasons(found: pd.DataFrame) -> list[dict[str, Any]]:
    return [row for row in rows(found) if row["verdict"] != "agree"]


PAGE = study(
    "second-opinion.csv",
    "A second formulation",
    _banner,
    sentence=_sentence,
    families=_families,
    reasons=_reasons,
)
