"""The report of a sweep: the most influential number, the spread of variants, and variants checked by engines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.reference.parameters import unit
from screwgauge.report.blocks import Banner, Block, Picture
from screwgauge.report.figures import chart
from screwgauge.report.folder import SAMPLES
from screwgauge.report.layout import Report
from screwgauge.study.formatting import Row, join_all, number
from screwgauge.study.sweep.plan import Scatter
from screwgauge.study.sweep.run import Sweep

#: Number of bars in a tornado chart, of rows on the first screen, and of names for the farthest variant.
BARS, FIRST, NAMED = 15, 8, 3
TABLE = "variants.csv"
NOTES = ("Effect of one standard deviation in both directions, to first order; longer bars mean more influence.",)


def headline(sweep: Sweep) -> str:
    """State the most influential number, how many variants there are, and on how many of them the engines agree."""
    count, lost = len(sweep.why), int(np.sum(sweep.why != ""))
    parts = []
    if sweep.effects:
        effect, column = sweep.ranked[0]
        share = abs(effect.changes[column]) / sweep.sizes[column]
        parts.append(
            f"{effect.name} has the most influence: one standard deviation ({_size(effect)}) changes "
            f"{sweep.columns[column].name} by {number(abs(effect.changes[column]), 3)}, "
            f"or {number(100.0 * share, 2)} % of the largest nominal value."
        )
    parts.append(f"{count} variants" + (f", {lost} without values." if lost else ", all with values."))
    if sweep.checked:
        good = sum(one.ok for one in sweep.checked)
        parts.append(f"Other engines agree on {good} of {len(sweep.checked)} variants that they checked.")
    return " ".join(parts)


def _banner(sweep: Sweep) -> Banner:
    return Banner.of(headline(sweep), sweep.exit_status == 0, "SWEPT", "ENGINES DISAGREE")


def _size(effect: Scatter) -> str:
    if effect.kind == "body":
        return f"{number(100.0 * effect.deviation, 3)} % of the body"
    return f"{number(effect.deviation, 3)} {unit(effect.name)}".rstrip()


def _effects(sweep: Sweep) -> list[Row]:
    """Return a row for each number, most influential first."""
    return [
        {
            "name": effect.name,
            "deviation": _size(effect),
            "column": sweep.columns[column].name,
            "change": number(effect.changes[column], 3),
            "share": f"{number(100.0 * abs(effect.changes[column]) / sweep.sizes[column], 2)} %",
        }
        for effect, column in sweep.ranked
    ]


def _columns(sweep: Sweep) -> list[Row]:
    """Return a row for each statistic: its value in the scene, and its mean, spread and farthest value in variants."""
    lines = list[Row]()
    for k, column in enumerate(sweep.columns):
        row, line = sweep.worst(k), {"name": column.name, "nominal": number(sweep.nominal[k], 4)}
        if row is None:
            lines.append({**line, "mean": "no number", "spread": "", "farthest": "", "row": "", "numbers": ""})
            continue
        some = sweep.values[np.isfinite(sweep.values[:, k]), k]
        found = {"mean": some.mean(), "spread": some.std(), "farthest": sweep.values[row, k]}
        line |= {name: number(float(x), 4) for name, x in found.items()}
        lines.append({**line, "row": str(row + 1), "numbers": _farthest(sweep, row, k)})
    return lines


def _farthest(sweep: Sweep, row: int, column: int) -> str:
    """List the numbers that influence a statistic most, with their values in a variant."""
    order = sorted(sweep.effects, key=lambda effect: -abs(float(effect.changes[column])))
    values = sweep.numbers.iloc[row]
    some = [effect.name for effect in order if effect.name in values.index] or [*values.index]
    return join_all(f"{name} = {number(float(values[name]), 4)}" for name in some[:NAMED])


def _refusals(sweep: Sweep) -> list[Row]:
    counts = Counter(str(reason) for reason in sweep.why if reason)
    first = {reason: int(np.argmax(sweep.why == reason)) + 1 for reason in counts}
    return [{"why": reason, "count": str(n), "first": str(first[reason])} for reason, n in counts.most_common()]


def _checks(sweep: Sweep) -> list[Row]:
    return [
        {
            "variant": str(one.variant + 1),
            "engines": one.what,
            "digits": number(one.digits, 3) if np.isfinite(one.digits) else "no number",
            "agree": "yes" if one.ok else "no",
        }
        for one in sweep.checked
    ]


def _indices(sweep: Sweep) -> list[Row]:
    order = sorted(sweep.indices.items(), key=lambda item: -item[1][1])
    return [{"name": name, "first": f"{one:.3f}", "total": f"{whole:.3f}"} for name, (one, whole) in order]


def make_plots(sweep: Sweep) -> list[Picture]:
    """Draw a tornado chart of the statistic with the largest change."""
    if not sweep.effects:
        return []
    column = sweep.ranked[0][1]
    order = sorted(sweep.effects, key=lambda effect: -abs(float(effect.changes[column])))[:BARS]
    bars = []
    for effect in order:
        size = abs(float(effect.changes[column]))
        bars.append({"name": effect.name, "low": -size, "high": size, "text": f"+-{number(size, 3)}"})
    spec = chart.fill_template("tornado", bars=bars, title=f"change of {sweep.columns[column].name}")
    return [chart.picture("tornado", "Influence of each number", lambda moving: spec, NOTES)]


def effects_table(sweep: Sweep) -> pd.DataFrame:
    """Build a table of the effects of changing each number by one standard deviation."""
    rows = [effect.changes for effect, _ in sweep.ranked]
    head = pd.DataFrame(
        [[effect.name, effect.kind, effect.deviation] for effect, _ in sweep.ranked],
        columns=["number", "scatter", "deviation"],
    )
    names = [column.name for column in sweep.columns]
    return pd.concat([head, pd.DataFrame(np.reshape(rows, (-1, len(names))), columns=names)], axis=1)


def _plots(sweep: Sweep, pictures: Sequence[Picture]) -> list[Block]:
    return [*pictures]


PAGE = Report(
    text="sweep",
    banner=_banner,
    data={"effects.csv": effects_table},
    values={
        "title": lambda sweep: sweep.plan.title,
        "headline": headline,
        "about": lambda sweep: {"scene": sweep.plan.scene.name, "plan": sweep.plan.file.name, "draws": _draws(sweep)},
        "ranked": lambda sweep: _effects(sweep)[:FIRST],
        "effects": _effects,
        "columns": _columns,
        "refused": _refusals,
        "checks": _checks,
        "indices": _indices,
    },
    draw=make_plots,
    plots=_plots,
)
#: Data files, including the table as CSV.
DATA, terminal = (*PAGE.DATA, TABLE), PAGE.terminal


def _draws(sweep: Sweep) -> str:
    plan = sweep.plan
    grid = f" at each of {plan.variants // plan.count} points of a grid" if plan.grid else ""
    return f"{plan.count} {plan.design}, seed {plan.seed}{grid}"


def write(sweep: Sweep, out: Path, *, samples: bool = False, **writing: Any) -> Path:
    """Write the report; `samples` writes the table as Parquet instead of CSV. See also `Report.write`."""
    return PAGE.write(sweep, out, more={SAMPLES if samples else TABLE: sweep.table}, **writing)
