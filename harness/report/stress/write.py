"""Writes what the stress cases found into a folder."""

from __future__ import annotations

from pathlib import Path

from screwgauge.report.page import report_html
from screwgauge.report.stress.drawing import make_plots
from screwgauge.report.stress.report import report_markdown
from screwgauge.report.summary import json_text
from screwgauge.report.write import write_files
from screwgauge.study.stress.run import Stress


def write_stress(found: Stress, out: Path) -> Path:
    """Report, page of small plots, table and environment.

    Raises:
        OutputError: The folder cannot be written.
    """
    plots = make_plots(found)
    report = report_markdown(found, plots)
    texts = {
        **{f"plots/{plot.name}.svg": plot.svg for plot in plots},
        "report.md": report,
        "report.html": report_html(report, plots, "agree" if found.ok else "differ"),
        "stress.csv": found.table.to_csv(index=False, na_rep="nan", lineterminator="\n", float_format="%.6g"),
        "environment.json": json_text(found.environment),
    }
    return write_files(out, texts)
