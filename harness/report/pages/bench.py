"""The report of a bench: the fastest method for each accuracy, the timing protocol, all rows, and the pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from screwgauge.quantities import FLOAT32
from screwgauge.report.blocks import Banner, Block, Group, Marked, Picture, Table, Text, table
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import INK, STAR, Look, Spec, camp, looks_by_camp
from screwgauge.report.layout import Report, Value
from screwgauge.report.pages.run import published_row
from screwgauge.report.record import judged_files, shorten_hashes
from screwgauge.study.bench.contestants import count
from screwgauge.study.bench.run import Bench
from screwgauge.study.bench.tables import (
    CUT,
    FAILED,
    LEVELS,
    OK,
    BenchRow,
    SlopeFit,
    absolute_table,
    bench_table,
    pairs,
    reach,
    slopes_table,
    timing_table,
)
from screwgauge.study.formatting import (
    Row,
    digits_text,
    duration,
    group_rows,
    is_empty,
    join_all,
    number,
    rows,
    size,
    tick,
    words,
)
from screwgauge.study.reference_values import QUANTITIES

NINE, SHOWN = LEVELS[2], ("actuator_force", "joint_acceleration")
LEFT_OUT = (
    "requested = asked | run time = time_s | share of the whole = share | largest difference | numbers unchanged = same"
)
NO_STEPS = {"steps": None, "evaluations": None}
STARTS = {False: "from the independent coordinates by", True: "from given joint motion by"}
DIGITS = {"3": "Three", "6": "Six", "9": "Nine", "12": "Twelve"}
NAMES = ("joint positions", "joint velocities", "joint accelerations", "actuator forces")
WORDS = dict(zip(QUANTITIES, NAMES, strict=True))
ERROR = "largest scaled error [1]"
ZERO = 1e-17  # value at which a zero error is drawn
SENSELESS = 10.0  # scaled error from which a motion appears only in the table
MEASURES = {"observable": "largest error of an observable [m or rad]", "energy": "energy not accounted for [J]"}
NOTES = (
    "Lower left is better. Each point is one setting; errors are against {}. T: duration of the motion.",
    "Filled: starts from y and its derivatives. Hollow: starts from given joint motion.",
)
SIMULATED = (
    "Lower left is better. Hollow: stopped before the end.",
    "Stars and dashed lines: published by others, measured on other machines.",
)
FITTED = ("Filled points are fitted; the line has the expected slope through them.",)
OTHERS = "published by others"


def _banners(bench: Bench) -> list[Banner]:
    """Return banners about missing rows and about the fastest methods, marked with a cross if a slope is wrong."""
    sentence = _simulated_headline(bench) if bench.scene.simulated else headline(bench)
    measured = Banner.of(sentence, all(fit.ok for fit in bench.fits), "MEASURED", "NOT ALL MEASURED AS EXPECTED")
    lost = [row["rows"] for row in _cut_short(bench)]
    budget = f"The budget of {number(bench.plan.budget)} s ended before {count(sum(lost), 'row')}"
    cut = f"{budget}; the results are those of the remaining rows."
    return [*([Banner(cut, "CUT SHORT")] if lost else []), measured]


def _cheapest(bench: Bench, quantity: str) -> list[Row]:
    """Return the fastest family for each error level, with its lead: first families that close loops, then the rest."""
    lines, table = list[Row](), [row for row in rows(reach(bench.rows)) if row["quantity"] == quantity]
    for (given, level), (best, *others) in group_rows(table, "given", "error").items():
        cost = best["seconds_per_sample"]
        lead = {"next": "none", "times_as_long": ""}
        if others:
            times = number(others[0]["seconds_per_sample"] / cost, 3)
            lead = {"next": others[0]["family"], "times_as_long": times}
        lines.append({**best, "cost": cost, "start": STARTS[given], "digits": number(-np.log10(level)), **lead})
    return sorted(lines, key=lambda line: bool(line["given"]))


def headline(bench: Bench) -> str:
    """Name the fastest methods at nine digits: one that closes the loops, and one for given joint motion."""
    for quantity in SHOWN:
        cheapest = [row for row in _cheapest(bench, quantity) if row["error"] == NINE]
        if each := [f"{row['start']} {row['family']}, {duration(row['cost'])} a sample" for row in cheapest]:
            return f"{words(quantity).capitalize()} to nine digits is cheapest {'; '.join(each)}."
    return "Nothing reached nine digits."


def _remarks(bench: Bench) -> list[str]:
    """Count the rows, the slopes that match theory, and the failures."""
    table_rows = rows(bench_table(bench.rows))
    parts = [f"{count(len(table_rows), 'row')} in {len(group_rows(table_rows, 'family'))} families of methods."]
    if bench.fits:
        parts.append(f"{sum(fit.ok for fit in bench.fits)} of {len(bench.fits)} slopes match theory.")
    if failed := [row["contestant"] for row in table_rows if row["status"] == FAILED]:
        parts.append(f"{count(len(failed), 'row')} failed: {join_all(dict.fromkeys(failed))}.")
    return parts


def _nine_digits(bench: Bench) -> list[Row]:
    """Return the run times of each family at nine digits, for the quantities shown on a terminal."""
    return [
        {**row, "family": row["family"] + " †" * row["given"], "who": f"{row['contestant']}: {row['setting']}"[:42]}
        for row in rows(reach(bench.rows))
        if row["error"] == NINE and row["quantity"] in SHOWN
    ]


def _float32_notes(bench: Bench) -> list[Row]:
    """Return the digits of float32 contestants, the digits that rounding may leave, and run times."""
    return [
        {
            **{name: getattr(row.contestant, name) for name in ("setting", "family")},
            "contestant": row.contestant.name,
            "quantity": row.quantity,
            "digits": digits_text(row.error) + " ✗" * (row.error > bench.rounding[row.quantity]),
            "allowed": digits_text(bench.rounding[row.quantity]),
            "time": duration(row.price),
        }
        for row in bench.rows
        if row.contestant.kind is FLOAT32 and row.quantity in bench.rounding and row.status == OK
    ]


def _failures(bench: Bench) -> list[Row]:
    """Return a row for each failed contestant and reason, with all settings and quantities."""
    failed = [row for row in rows(bench_table(bench.rows)) if row["status"] == FAILED]
    lines = list[Row]()
    for group in group_rows(failed, "contestant", "reason").values():
        settings, quantities = (list(dict.fromkeys(row[key] for row in group)) for key in ("setting", "quantity"))
        more = f" and {count(len(settings) - 1, 'more setting')}" if len(settings) > 1 else ""
        lines.append({**group[0], "setting": settings[0] + more, "quantity": ", ".join(quantities)})
    return lines


def _cut_short(bench: Bench) -> list[Row]:
    """Count, for each family and for omissions, the rows that were cut short."""
    left_out = [{**row, "family": "leaving out", "contestant": row["engine"]} for row in rows(bench.leaving_out)]
    cut = [row for row in [*rows(bench_table(bench.rows)), *left_out] if row["status"] == CUT]
    families = ((name, [row["contestant"] for row in group]) for (name,), group in group_rows(cut, "family").items())
    return [{"family": name, "rows": len(c), "contestants": ", ".join(dict.fromkeys(c))} for name, c in families]


def _reach(bench: Bench) -> list[Block]:
    """Return a table for each quantity: families ordered by the time to their smallest error."""
    blocks: list[Block] = []
    head = ("family", *(f"to {level:.0e}" for level in LEVELS), "setting that reaches the smallest")
    for (quantity,), reached in reversed(group_rows(rows(reach(bench.rows)), "quantity").items()):
        lines = []
        for (family,), group in group_rows(reached, "family").items():
            at = {row["error"]: row for row in group}
            order = [at[x]["seconds_per_sample"] if x in at else np.inf for x in reversed(LEVELS)]
            times = [duration(at[x]["seconds_per_sample"]) + " †" * at[x]["given"] if x in at else "-" for x in LEVELS]
            lines.append((order, (family, *times, "{contestant}: {setting}".format(**at[min(at)]))))
        across, title = Table(head, tuple(line for _, line in sorted(lines))), words(quantity).capitalize()
        blocks += [Group("folded", (across,), title)] if blocks else [Text(Marked(f"**{title}**")), across]
    return blocks


def _savings(bench: Bench) -> list[Block]:
    """Return tables of the time saved by omitting quantities, by engine, with changes in the remaining numbers."""

    def line(row: Row) -> Row:
        left = size(row["max_difference"]) if row["status"] == "ok" else row["status"]
        cells = {"asked": f"{row['group']} {row['setting']}".strip(), "largest_difference": left}
        share = "" if is_empty(row["ratio"]) else f"{row['ratio']:.2f}"
        same = f"✗ {row['reason']}" if row["reason"] else tick(row["unchanged"])
        return {**row, **cells, "share": share, "same": same}

    groups = group_rows(rows(bench.leaving_out), "engine").items()
    return [table(map(line, group), f"{engine} = {LEFT_OUT}") for (engine,), group in groups]


def _simulated_headline(bench: Bench) -> str:
    """Name the first family to reach six digits, or the most digits reached, with its lead, and the failures."""
    t, rows = bench.scene.t, [row for row, _ in pairs(bench.rows)]
    parts, cheapest = list[str](), {row["digits"]: row for row in _cheapest(bench, "observable")}
    if best := cheapest.get("6", [*cheapest.values()][-1:][0] if cheapest else None):
        what = f"{DIGITS[best['digits']]} digits of the observables are cheapest with"
        lead = f"; {best['next']} takes {best['times_as_long']} times as long" if best["times_as_long"] else ""
        parts.append(f"{what} {best['family']} ({best['setting']}): {duration(best['cost'])} of processor time{lead}.")
    parts.append(f"{len(rows)} contestants on {number(t[-1] - t[0])} s of motion.")
    for status, what in ((FAILED, "Failed or stopped early"), (CUT, "Cut short")):
        names = dict.fromkeys(row.contestant.family for row in rows if row.status == status)
        parts += [f"{what}: {join_all(names)}."] if names else []
    return " ".join(parts)


def _measurements(bench: Bench) -> list[Row]:
    """Return the measurements of a simulation, and published results."""
    lines = list[Row]()
    for row, energy in pairs(bench.rows):
        line: Row = {name: getattr(row.contestant, name) for name in ("family", "setting", "label")}
        line["observable"] = ", ".join(f"{size(value)} {unit}" for unit, value in row.largest.items())
        line["scaled"] = "" if is_empty(row.error) else size(row.error)
        line["energy"] = "".join(size(value) for value in energy.largest.values() if not is_empty(value))
        line |= {"cpu": row.cost.cpu_s, "wall": row.cost.wall_s, "status": row.status}
        line |= {"steps": row.cost.steps, "evaluations": row.cost.evaluations} if row.cost.steps else NO_STEPS
        lines.append({**line, "remark": "" if row.status == OK else f"✗ {row.status}: {row.reason}"})
    for item in bench.scene.published:
        line = published_row(item) | {"family": Marked("*published*"), "setting": item.who, "label": item.who[:18]}
        line |= {"scaled": line["observable"], "status": "other machine", "cpu": item.cpu_s}
        lines.append({**line, "remark": " - ".join(filter(None, (item.remark, item.source, "other machine")))})
    return lines


def _facts(bench: Bench) -> dict[str, Any]:
    compared = {"compared": count(len(bench.scene.t), "sample"), "errors against": bench.reference}
    return {**shorten_hashes(judged_files(bench.provenance)), **compared}


def _rows(*status: str) -> Value:
    return lambda bench: [row for row in rows(bench_table(bench.rows)) if not status or row["status"] in status]


def make_plots(bench: Bench) -> list[Picture]:
    """Draw the plots of the report, skipping empty ones."""
    drawn = _of_simulation(bench) if bench.scene.simulated else _of_given_motion(bench)
    return [replace(one, name=f"{i:02d}-{one.name}") for i, one in enumerate(drawn, 1)]


def _of_given_motion(bench: Bench) -> Iterator[Picture]:
    drawable = [r for r in bench.rows if r.contestant.drawn and np.isfinite(r.error) and bool(r.price > 0)]
    looks, notes = (
        looks_by_camp(row.contestant.line for row in bench.rows),
        [note.format(bench.reference) for note in NOTES],
    )
    for quantity in QUANTITIES[::-1]:
        points, rows = list[Spec](), [row for row in drawable if row.quantity == quantity]
        for row in rows:
            group = [other.contestant for other in rows if other.contestant.line == row.contestant.line]
            joined = any(other.parameter for other in group) or len({other.name for other in group}) == 1
            point = _point(row, row.contestant.line, row.price, row.error)
            points.append(point | {"hollow": row.contestant.given, "joined": joined})
        axes = f"Error against run time: {WORDS[quantity]}", "run time for each sample delivered", ERROR
        if points:
            yield _error_and_time(quantity.replace("_", "-"), axes, points, looks, notes)
    if bench.fits:
        yield _slopes("slopes", bench.fits)


def _of_simulation(bench: Bench) -> Iterator[Picture]:
    """Draw errors of the observables and of the energy against processor time."""
    sensible = {r.contestant for r in bench.rows if r.quantity == "observable" and r.error < SENSELESS}
    done = [row for row in bench.rows if row.contestant in sensible and row.work_s > 0.0]
    looks = looks_by_camp(row.contestant.family for row in done)
    for measure, title in MEASURES.items():
        errors = [(row, max(row.largest.values(), default=np.nan)) for row in done if row.quantity == measure]
        placed = [(row, _point(row, row.contestant.family, row.work_s, e)) for row, e in errors if np.isfinite(e)]
        points = [point | {"hollow": row.status != OK, "joined": True} for row, point in placed]
        theirs = [item for item in bench.scene.published if item.measure == measure or np.isnan(item.accuracy)]
        others = [(item.cpu_s, item.accuracy, item.who.split(",")[0].split(":")[0]) for item in theirs]
        axes = f"Error against processor time: {measure}", "processor time of the integration", title
        if points:
            yield _error_and_time(measure, axes, points, looks, SIMULATED, others)


def _point(row: BenchRow, family: str, seconds: float, error: float) -> Spec:
    fields = {"family": family, "contestant": row.contestant.name, "setting": row.contestant.setting}
    return {**fields, "x": seconds, "y": max(error, ZERO), "label": row.contestant.label}


def _error_and_time(
    name: str,
    axes: tuple[str, str, str],
    points: Sequence[Spec],
    looks: dict[str, Look],
    notes: Sequence[str],
    others: Sequence[tuple[float, float, str]] = (),
) -> Picture:
    """Draw points of families, connecting lines, and published values (a line if only error or time is known).

    Args:
        axes: Title of the picture, and names of both axes.
    """
    title, across, up = axes
    lines = {family: [p for p in points if p["family"] == family] for family in looks}
    shown = {family: look for family, look in looks.items() if lines[family]}
    drawn: list[Spec] = [
        {"family": OTHERS, "x": x, "y": max(y, ZERO), "label": who} for x, y, who in others if np.isfinite(x * y)
    ]
    shown |= {OTHERS: Look(INK, shape=STAR)} if drawn else {}
    rows = [[p | {"i": i} for i, p in enumerate(line)] for line in lines.values()]
    # draw the ends of a line first: they are most informative, and the first labels find room
    drawn += [*(p for line in rows for p in (*line[:1], *line[1:][-1:])), *(p for line in rows for p in line[1:-1])]
    drawn = [p | {"colour": shown[p["family"]].colour, "dash": shown[p["family"]].dash} for p in drawn]
    errors = [p["y"] for p in points]
    level = [{"y": x, "text": f"{-np.log10(x):.0f} digits"} for x in LEVELS if min(errors) < x < max(errors)]
    level = [{"y": y, "text": who} for x, y, who in others if np.isnan(x)] + (level if up == ERROR else [])
    upright = [{"x": x, "text": who} for x, y, who in others if np.isnan(y)]
    values = {"across": across, "asked": f"{across} [s]", "up": up, "level": level, "upright": upright}
    values |= chart.logarithm("x", [p["x"] for p in [*drawn, *upright]], chart.TIME)
    values |= chart.logarithm("y", [p["y"] for p in [*drawn, *level]])
    spec = chart.fill_template("error-time", points=drawn, **values, **chart.ways("family", shown))
    spec["layer"] = [layer for layer in spec["layer"] if layer.get("data", spec["data"])["values"]]
    return chart.picture(name, title, lambda moving: spec, notes)


def _slopes(name: str, fits: Sequence[SlopeFit]) -> Picture:
    """Draw errors over the parameter, and a line with the expected slope through the centre of the fitted points."""

    def panel(fit: SlopeFit) -> Spec:
        x, error, line = fit.x[fit.used], fit.error[fit.used], list[Spec]()
        if len(x):
            level = np.mean(np.log10(error) - fit.expected * np.log10(x))
            line = [{"x": end, "y": 10**level * end**fit.expected} for end in (x.min() / 1.5, x.max() * 1.5)]
        points = [{"x": a, "y": b, "used": used} for a, b, used in zip(fit.x, fit.error, fit.used, strict=True)]
        slope = f"{WORDS[fit.quantity]}: slope {fit.slope:.3f}, expected {fit.expected:g}"
        head, colour = [fit.line, slope], camp(fit.line)
        scales = chart.logarithm("x", fit.x) | chart.logarithm("y", fit.error)
        return chart.fill_template("slope", head=head, name=fit.name, line=line, points=points, colour=colour, **scales)

    spec = {"concat": [panel(fit) for fit in fits], "columns": 2}
    return chart.picture(name, "Error against the varied parameter, with expected slopes", lambda moving: spec, FITTED)


PAGE = Report(
    text="bench",
    banner=_banners,
    data={
        "bench.csv": lambda bench: bench_table(bench.rows),
        "slopes.csv": lambda bench: slopes_table(bench.fits),
        "timings.csv": lambda bench: timing_table(bench.rows),
        "reach.csv": lambda bench: reach(bench.rows),
        "leaving_out.csv": lambda bench: bench.leaving_out,
    },
    values={
        "title": lambda bench: f"{bench.scene.title or bench.scene.name}: error against run time",
        "remarks": _remarks,
        "about": _facts,
        "files": lambda bench: judged_files(bench.provenance),
        "cheapest": lambda bench: _cheapest(bench, SHOWN[0]) or _cheapest(bench, SHOWN[1]),
        "no truth": lambda bench: bench.reference != "truth",
        "reached": _nine_digits,
        "reach": _reach,
        "narrow": _float32_notes,
        "failed": _failures,
        "cut short": _cut_short,
        "cut rows": _rows(CUT),
        "slopes": lambda bench: rows(slopes_table(bench.fits)),
        "leaving out": _savings,
        "every row": _rows(),
        "one thread": lambda bench: bench.environment["one_thread"],
        "samples": lambda bench: len(bench.scene.t),
    },
    draw=make_plots,
    figures=6,
)
SIMULATION = replace(
    PAGE,
    text="bench_simulation",
    data={
        "bench.csv": PAGE.data["bench.csv"],
        "forward.csv": lambda bench: absolute_table(bench.rows),
        "slopes.csv": PAGE.data["slopes.csv"],
    },
    values={
        **PAGE.values,
        "cheapest": lambda bench: _cheapest(bench, "observable"),
        "measured": _measurements,
    },
)
