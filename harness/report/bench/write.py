"""Writes what a bench found into a folder."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from screwgauge.report.bench.drawing import make_plots
from screwgauge.report.bench.report import report_markdown
from screwgauge.report.page import report_html
from screwgauge.report.summary import json_text
from screwgauge.report.write import write_files
from screwgauge.study.bench.rows import bench_table, reach, timing_table
from screwgauge.study.bench.run import Bench
from screwgauge.study.bench.slopes import table as slope_table


def write_bench(bench: Bench, out: Path) -> Path:
    """Report, plots, tables and environment.

    Raises:
        OutputError: The folder cannot be written.
    """
    plots = make_plots(bench)
    report = report_markdown(bench, plots)
    good = bench.complete and all(fit.ok for fit in bench.fits)
    tables = {
        "bench.csv": bench_table(bench.rows),
        "slopes.csv": slope_table(bench.fits),
        "timings.csv": timing_table(bench.rows),
        "reach.csv": reach(bench.rows),
        "leaving_out.csv": bench.leaving_out,
    }
    texts = {
        **{f"plots/{plot.name}.svg": plot.svg for plot in plots},
        "report.md": report,
        "report.html": report_html(report, plots, "agree" if good else "differ"),
        **{name: _csv(table) for name, table in tables.items()},
        "environment.json": json_text(bench.environment),
    }
    return write_files(out, texts)


def _csv(table: pd.DataFrame) -> str:
    return table.to_csv(index=False, na_rep="nan", lineterminator="\n", float_format="%.6g")
