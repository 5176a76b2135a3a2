"""The report of a run: the verdict, the evidence, a summary, tables, and terminal output."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.judging.allowance import LIMIT
from screwgauge.judging.residual import ERROR_COLUMNS
from screwgauge.report import reviewed
from screwgauge.report.blocks import Banner, Block, Group, Marked, Picture
from screwgauge.report.figures.drawings import named_drawings, unmatched_figures
from screwgauge.report.figures.run import make_plots
from screwgauge.report.folder import SAMPLES
from screwgauge.report.layout import Report, Value
from screwgauge.report.left_out import left_out_rows
from screwgauge.report.record import (
    describe_run,
    forces,
    judged_files,
    samples,
    samples_table,
    shorten_hashes,
    summary,
    timings,
)
from screwgauge.report.stage.picture import stage
from screwgauge.report.verdict import compared_pairs, conclusion, has_excuse, verdict
from screwgauge.scene.observables import Published
from screwgauge.solution import REFERENCE, Error, Timing
from screwgauge.study.comparison import Comparison
from screwgauge.study.formatting import (
    FORMS,
    Row,
    digits_text,
    error_ratio,
    group_rows,
    is_empty,
    join_all,
    number,
    rows,
    size,
    span,
    unit_text,
    words,
)

__all__ = ["DATA", "pictures", "report", "summary", "terminal", "write"]


def _banners(results: Comparison) -> list[Banner]:
    headline, remarks = conclusion(results)
    warnings = [*results.warnings, *unmatched_figures(results.scene.figures, results.solutions)]
    known = " ".join([headline.text, *remarks])
    return [headline, *(Banner(sentence, "Warning") for sentence in warnings if sentence not in known)]


def _error_rows(errors: Iterable[Row]) -> list[Row]:
    """Return rows for tables, with component and time of the worst error, marked if the error is out of tolerance."""
    shown = []
    for row in errors:
        component, t = row.get("worst_component"), row.get("worst_t")
        nowhere = is_empty(component) or not component
        at = "-" if nowhere else component if is_empty(t) else f"{component} @ {number(t)} s"
        digits, sign = digits_text(row["max_scaled"]), "" if row["ok"] else " ✗"
        cells: Row = {"reached": f"{digits.replace('NaN', 'no number')}{sign}", "digits": digits.replace("NaN", "-")}
        cells |= {"residue": f"{size(row['max_scaled'])}{sign}", "worst_at": at, "rule": row.get("rule") or "-"}
        shown.append({"reason": "", **row, **cells, "unique": "yes" if row.get("unique") else "no"})
    return shown


def _worst_three(results: Comparison) -> list[Row]:
    """Return the worst row of three quantities: those closest to their tolerance, or farthest beyond it."""
    pairs = [row for row in compared_pairs(results) if not has_excuse(row, results.scene.simulated)]
    errors = [{**row, "what": words(row["quantity"]), "who": row["pair"]} for row in pairs]
    residuals = (row for row in rows(results.judge) if row["engine"] not in results.failures)
    errors += [{**row, "what": f"judge: {words(row['residual'])}", "who": row["engine"]} for row in residuals]
    groups = dict[str, list[Row]]()
    for row in sorted(errors, key=lambda row: (_is_open_tree(row), -error_ratio(row["max_scaled"], row["tolerance"]))):
        groups.setdefault("tree" if _is_open_tree(row) else row["what"], []).append(row)
    three = _error_rows(_least(group) for group in list(groups.values())[:3])
    return [{**row, "off": f"{size(row['max_abs'])} {unit_text(row['unit'])}"} for row in three]


def _is_open_tree(row: Row) -> bool:
    """Return True for an open-tree force within tolerance, which comes last because it does not act in the machine."""
    return bool(row["ok"]) and row["what"].removeprefix("judge: ").startswith("tree force")


def _summary_line(results: Comparison) -> dict[str, Any]:
    """Describe the scene and files briefly for the first screen."""
    files, versions = shorten_hashes(judged_files(results.provenance)), dict[str, Any]()
    for name in (*results.solutions, *results.failures):
        version = (results.solutions[name].version or "given") if name in results.solutions else "✗ failed"
        versions[name] = ", ".join(filter(None, (version, files.pop(f"model of {name}", ""))))
    scene = f"{files.pop('scene file', results.scene.name)}, {samples(results.times)}"
    mechanism = files.pop("description", results.scene.mechanism.name)
    return {"scene": scene, "mechanism": mechanism, **versions, **files}


def _overview(results: Comparison) -> list[Row]:
    """Return the digits to which each pair agrees, and those that the tolerance requires; pairs that differ first."""
    lines, groups = list[Row](), group_rows(compared_pairs(results), "quantity", "unit").values()
    for group in sorted(groups, key=lambda group: all(row["ok"] for row in group)):
        tolerances = [row["tolerance"] for row in group]
        needed = span(digits_text(max(tolerances)), digits_text(min(tolerances)))
        lines += [{**row, "needed": needed} for row in _error_rows(group)]
    return lines


def _plots(results: Comparison, pictures: Sequence[Picture]) -> list[Block]:
    """Show plots of quantities that differ; fold the other plots under a line that states the digits of agreement."""
    drawn, pairs, shown, folds = named_drawings(results), _pairs(results), list[Block](), list[Block]()
    for picture in pictures:
        drawing, errors = drawn.get(picture.name), pairs.get(picture.name, [])
        note = f"agrees to {digits_text(max(row['max_scaled'] for row in errors))} digits" if errors else ""
        if drawing and not drawing.unique:
            note = "not compared"
        elif drawing and errors and drawing.others:
            note += f"; {drawing.others} components without a unique value are plotted separately"
        if all(row["ok"] for row in errors):
            folds.append(Group("folded", (picture,), picture.title, note))
        else:
            shown.append(picture)
    return [*shown, *folds]


def _pairs(results: Comparison) -> dict[str, list[Row]]:
    """Return the name of each picture -> rows of its pairs, for unique components only."""
    rows = group_rows(compared_pairs(results), "quantity", "unit")
    return {name: rows.get((one.quantity, one.unit), []) for name, one in named_drawings(results).items() if one.unique}


def _lead(results: Comparison, pictures: Sequence[Picture]) -> list[Picture]:
    """Select the first pictures: a quantity that differs, or else actuator forces, or else any; then the mechanism."""
    drawn, pairs = named_drawings(results), _pairs(results)
    shown = [picture for picture in pictures if picture.name in drawn]
    differ = [picture for picture in shown if not all(row["ok"] for row in pairs.get(picture.name, []))]
    forces = [picture for picture in shown if picture.of == "actuator_force"]
    return [*[*differ, *forces, *shown][:1], *(picture for picture in pictures if picture.stage)]


def _parameters(results: Comparison) -> list[Row]:
    """Return the smallest error in each parameter that would be noticed."""
    parameters, hidden = sorted(results.coverage.parameters, key=lambda row: -row["smallest"]), results.coverage.hidden
    untested = {row["parameter"]: "by no motion" if row["parameter"] in hidden else "not tested" for row in parameters}
    return [
        {**row, "shows": FORMS["percent"](row["smallest"]) if row["tested"] else untested[row["parameter"]]}
        for row in parameters
    ]


def estimates(results: Comparison) -> list[Row]:
    """Return the estimated error of each quantity for each engine."""

    def cell(error: Error) -> str:
        flagged = f"{error.flagged.sum()} of {len(error.scaled)}, t = {number(results.times[error.worst])} s"
        mark = "" if error.ok else f" ✗ ({flagged})"
        return f"{_estimate(error)}, condition {size(error.worst_condition)}{mark}"

    return [{"quantity": words(name), "engine": engine, "cell": cell(x)} for (engine, name), x in results.guard.items()]


def _estimate(error: Error) -> str:
    return size(error.largest) if math.isfinite(error.largest) else "no digit"


def _conditioning(results: Comparison) -> list[Block]:
    """Summarise the conditioning: state that no sample is flagged, or describe the worst flagged samples."""
    if not results.guard:
        return []
    bad = {key: error for key, error in results.guard.items() if not error.ok}
    (engine, quantity), worst = max((bad or results.guard).items(), key=lambda x: (x[1].largest, x[1].flagged.sum()))
    kind = "error" if not results.scene.simulated else "effect of rounding on the motion"
    text = f"nothing flagged; largest estimated {kind} {_estimate(worst)} ({quantity} of {engine})"
    if bad:
        text = (
            f"{len(bad)} of {len(results.guard)} results flagged ({join_all(dict.fromkeys(name for name, _ in bad))}); "
            f"worst {quantity} of {engine} at t = {number(results.times[worst.worst])} s: estimated error "
            f"{_estimate(worst)}, condition {size(worst.worst_condition)}"
        )
    return [Banner(text, "conditioning")]


def _engines(results: Comparison) -> Iterator[Row]:
    """Yield the engines, each with its version and the time that it reached."""
    for name, solution in results.solutions.items():
        n, status = solution.n_solved, "given" if solution.engine == REFERENCE else "ran"
        if solution.stopped:
            status = f"✗ stopped after t = {number(results.times[n - 1])} s" if n else "✗ stopped"
        yield {"engine": name, "version": solution.version, "status": status}
    for name, failure in results.failures.items():
        yield {"engine": name, "version": "", "status": f"✗ {failure.reason}"}


def _times(results: Comparison) -> list[Row]:
    """Return the timed stages, with a description of what the clock includes."""
    return [{**asdict(x), "each": number(1e6 * x.median_s / max(x.n_sample, 1), 3)} for x in timings(results)]


def published_rows(results: Comparison) -> list[Row]:
    """Return errors and times of this run and of published results."""
    theirs_, ours = [*map(published_row, results.scene.published)], list[Row]()
    pairs, judged = results.pairs, results.judge
    for engine, solution in results.solutions.items() if theirs_ else ():
        known = rows(pairs[(pairs["a"] == engine) & (pairs["b"] == REFERENCE)].dropna(subset="max_abs"))
        balance = judged[(judged["engine"] == engine) & (judged["residual"] == "energy_balance")]
        row = {
            "who": Marked(f"**{engine}**, {solution.setting.replace('*', '')}"),
            "observable": ", ".join(f"{size(row['max_abs'])} {row['unit']}" for row in known),
            "energy": "".join(map(size, balance["max_abs"])),
            "cpu_s": None if solution.cost is None else solution.cost.cpu_s,
        }
        ours += [{**row, "remark": "", "source": "this run"}] if engine != REFERENCE else []
    return [*ours, *theirs_]


def published_row(item: Published) -> Row:
    """Build the table row of a published result, with its error in the column of the measured quantity."""
    off = "" if is_empty(item.accuracy) else size(item.accuracy)
    errors = {measure: off if measure == item.measure else "" for measure in ("observable", "energy")}
    cpu_s = None if is_empty(item.cpu_s) else item.cpu_s
    return {"who": item.who, **errors, "cpu_s": cpu_s, "remark": item.remark, "source": item.source}


def _worst(errors: Sequence[Row], key: str) -> list[Row]:
    """Return the worst error for each key and unit; errors out of tolerance are worse than others, and NaN is worst."""
    return _error_rows(map(_least, group_rows(errors, key, "unit").values()))


def _least(group: Sequence[Row]) -> Row:
    """Return the row with the fewest digits, of the rows out of tolerance if there are any, as in the verdict."""
    return max(group, key=lambda row: (not row["ok"], error_ratio(row["max_scaled"], 1.0)))


VALUES: dict[str, Value] = {
    "title": lambda results: f"{results.scene.title or results.scene.name}: verification report",
    "worst three": _worst_three,
    "remarks": lambda results: conclusion(results)[1],
    "what": _summary_line,
    "every pair": lambda results: _error_rows(rows(results.pairs)),
    "pairs that differ": lambda results: _error_rows(row for row in rows(results.pairs) if not row["ok"]),
    "residuals": lambda results: _error_rows(rows(results.judge)),
    "residuals too large": lambda results: _error_rows(row for row in rows(results.judge) if not row["ok"]),
    "overview": _overview,
    "differ": lambda results: not all(row["ok"] for row in compared_pairs(results)),
    "tables": lambda results: [
        {"table": name, **row} for name, review in results.reviews.items() for row in reviewed.rows(review)
    ],
    "forces": forces,
    "left out": left_out_rows,
    "actuators": lambda results: [row for row in forces(results) if row["what"].startswith("actuator")],
    "forces by": lambda results: join_all(dict.fromkeys(row["engine"] for row in forces(results))),
    "parameters": _parameters,
    "estimates": estimates,
    "limit": lambda results: LIMIT,
    "computed": lambda results: describe_run(results.scene, results.times) | judged_files(results.provenance),
    "engines": lambda results: [*_engines(results)],
    "not unique": lambda results: rows(results.errors[results.errors["ok"].isna()]),
    "notes": lambda results: [f"{name}: {note}" for name, s in results.solutions.items() for note in s.notes],
    "published": published_rows,
    "times": _times,
    "worst pairs": lambda results: _worst(compared_pairs(results), "quantity"),
    "worst residuals": lambda results: _worst(rows(results.judge), "residual"),
    "conditioning": _conditioning,
    "whole verdict": lambda results: [verdict(results), *_banners(results)[1:]],
}


def errors_table(results: Comparison) -> pd.DataFrame:
    """Build the content of ``errors.csv``; cells are empty if an error is not judged, and ``nan`` for NaN."""
    table = results.errors[[*ERROR_COLUMNS]].astype({"tolerance": object, "ok": object})
    table.loc[table["ok"].isna(), ["tolerance", "ok"]] = ""
    return table


def pictures(results: Comparison) -> list[Picture]:
    """Draw the mechanism, then each quantity for all engines."""
    return [stage(results.scene, results.solutions), *make_plots(results)]


RUN = Report(
    text="run",
    banner=_banners,
    data={
        "errors.csv": errors_table,
        "timings.csv": lambda results: pd.DataFrame(timings(results), columns=list(Timing.__dataclass_fields__)),
        "summary.json": summary,
    },
    values=VALUES,
    draw=pictures,
    lead=_lead,
    plots=_plots,
)
DATA, report = RUN.DATA, RUN.blocks


def terminal(results: Comparison, *, judge: bool = True) -> list[Block]:
    """Return the blocks for a terminal: the verdict, the worst pair for each quantity and unit, the worst engine for
    each residual, and the conditioning.
    """
    brief: dict[str, Value] = {} if judge else {"worst residuals": lambda results: ()}
    return replace(RUN, values={**VALUES, **brief}).terminal(results)


def write(results: Comparison, out: Path, *, samples: bool = False, **writing: Any) -> Path:
    """Write all files, see `screwgauge.report.results.Results.write` and `Report.write`."""
    return RUN.write(results, out, more={SAMPLES: samples_table(results)} if samples else {}, **writing)
