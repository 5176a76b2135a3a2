import re
from collections import Counter
from itertools import pairwise
from statistics import median

import pandas as pd
from campaigns.page import study
from campaigns.random_mechanisms import CERTIFIED, ENGINES

from screwgauge.report.blocks import Banner, Table, table
from screwgauge.study.formatting import Row, group_rows, rows

VERDICTS = ("agree", "estimated", "judged", "differ", "failed", "refused")


def _sentence(found: pd.DataFrame) -> str:
    counts = Counter(found["verdict"])
    verdicts = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
    asked, branches = [text for text in found["truth"] if text], Counter(found["branch"][found["branch"] != ""])
    return (
        f"{len(found)} random mechanisms of {found['family'].nunique()} families: {verdicts}. "
        f"All engines were in the same assembly in {branches['same']} of {branches.total()}. "
        f"The truth certified {asked.count(CERTIFIED)} of {len(asked)}."
    )


def _banner(found: pd.DataFrame) -> Banner:
    return Banner.of(_sentence(found), not set(found["verdict"]) & {"differ", "judged", "failed"})


def _families(found: pd.DataFrame) -> Table:
    verdicts, lines = [verdict for verdict in VERDICTS if (found["verdict"] == verdict).any()], []
    for (family,), group in group_rows(rows(found), "family").items():
        counts, asked = Counter(row["verdict"] for row in group), [row["truth"] for row in group if row["truth"]]
        measured = [row for row in group if row["max_scaled"] != ""]
        worst = max(measured, key=lambda row: float(row["max_scaled"]) / float(row["tolerance"]), default={})
        error = {key: worst.get(key, "") for key in ("quantity", "seed")} | {"worst": worst.get("max_scaled", "")}
        sums = {"family": family, "drawn": len(group), CERTIFIED: f"{asked.count(CERTIFIED)}/{len(asked)}"}
        lines.append({**dict.fromkeys(verdicts, 0), **counts, **sums, **error})
    counted = " | ".join(("family", "drawn", *verdicts, CERTIFIED))
    return table(lines, f"{counted} | worst error = worst | of = quantity | seed")


def _reasons(found: pd.DataFrame) -> list[Row]:
    told = [
        {"reason": plain(text), "first_seen_in": f"{row['family']} {row['seed']}"}
        for row in rows(found)
        for text in (
            f"{row['verdict']}: {row['reason'] or row['judge']}" * (row["verdict"] not in VERDICTS[:2]),
            f"truth: {row['truth']}" * (row["truth"] not in ("", CERTIFIED)),
        )
        if text
    ]
    groups = sorted(group_rows(told, "reason").items(), key=lambda item: (-len(item[1]), item[0]))
    return [{**group[0], "count": len(group)} for _, group in groups]


def plain(reason: str) -> str:
    text = re.sub(r"'[^']*'", "'...'", reason)
    text = re.sub(r"(\S+ = (\[[^]]*\]|[^\s,]+)(, (?=\S+ =))?)+", "...", text)
    return re.sub(r"(?<![\w-])-?\d[\d.]*(e-?\d+)?", "N", text)


def _costs(found: pd.DataFrame) -> Table:
    keys, lines = [*(f"{engine}_s" for engine in ENGINES), "cpu_s"], []
    for low, high in pairwise((1, 4, 7, 10, 13, 100)):
        group = [row for row in rows(found) if low <= row["bodies"] < high]
        times = ([float(row[key]) for row in group if row[key] != ""] for key in keys)
        lines.append((f"{low} to {high - 1}", *(f"{median(each):.3f}" if each else "" for each in times)))
    return Table(("bodies", *ENGINES, "all, with comparison"), tuple(lines))


PAGE = study(
    "random.csv",
    "Random mechanisms",
    _banner,
    sentence=_sentence,
    families=_families,
    reasons=_reasons,
    costs=_costs,
)
