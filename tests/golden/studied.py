"""Golden rungs."""

import math
import re
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

from golden.answers import Row
from golden.facts import Fact, text

import screwgauge
from screwgauge.study.bench.run import bench
from screwgauge.study.bench.stress import CASES, stress
from screwgauge.study.bench.timing import Plan

#: Digits beyond these are rounding, and so is one more or less; three next to poses that amplify rounding, where they
#: may make the difference between two verdicts.
KNOWN, OFF = 12.0, (1.0, 3.0)
AMPLIFIED = ("upu-singularity", "u-lock", "assembly", "wrist-chart")
ANSWERED = {"ok": "answered", "degraded": "answered"}
DIVERGENT = "stiff-legs"  # engines' own steps grow without bound: where that is noticed varies
ADMITTED = re.compile(r"admits [^ ;,]+")
STATE = re.compile(r"\[[^]]*\]")  # in a reason
DECADE = 0.3  # of a condition number
SINGULAR = 1e12


def rungs() -> list[str]:
    quick = [f"{name} {severity:.17g} quick" for name, case in CASES.items() for severity in case.quick]
    return quick + [f"{name} {severity:.17g}" for name, case in CASES.items() for severity in case.full]


def rung(case: str) -> Iterator[Row]:
    name, severity, *quick = case.split()
    study = stress([name], quick=bool(quick), severities=[float(severity)])
    by_engine, reasons = defaultdict[str, list[Any]](list), defaultdict[str, list[str]](list)
    for row in study.rows:
        by_engine[row.engine].append(row)
        if row.reason and not (name == DIVERGENT and row.verdict == "refused" and not row.own):
            reason = ADMITTED.sub("admits ...", row.reason) if name in AMPLIFIED else row.reason
            reasons[f"{row.engine}: {STATE.sub('...', reason)}"].append(row.quantity)
    for engine, rows in by_engine.items():
        verdicts = [ANSWERED.get(row.verdict, row.verdict) if name in AMPLIFIED else row.verdict for row in rows]
        named = [f"{row.quantity} {verdict}" for row, verdict in zip(rows, verdicts, strict=True)]
        yield f"{engine} verdicts", text(", ".join(named))
        yield f"{engine} digits", Fact(tuple(min(row.digits, KNOWN) for row in rows), OFF[name in AMPLIFIED])
        if math.isfinite(rows[0].condition):
            condition = min(max(rows[0].condition, 1.0), SINGULAR)  # of a pose that is singular rounding makes the rest
            yield f"{engine} condition", Fact((math.log10(condition),), DECADE)
    for i, (reason, quantities) in enumerate(reasons.items()):
        yield f"reason {i}", text(f"{', '.join(quantities)} of {reason}")


def left_out(scene: str) -> Iterator[Row]:
    """What leaving out changes."""
    plan = Plan(samples=3, rounds=1, budget=math.inf, quick=True)
    table = bench(screwgauge.load_scene(scene), plan=plan, contestants=["leaving-out"]).leaving_out
    for row in table.to_dict("records"):
        key = f"{row['engine']} {row['group']}, {row['setting']}"
        yield key, text(f"{row['status']}, unchanged: {row['unchanged']} {row['reason']}")
        yield f"{key}, changes", Fact((float(row["max_difference"]),), 1e-12)
