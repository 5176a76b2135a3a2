"""Writes what a run found into a folder: all of it or nothing."""

from __future__ import annotations

import errno
import os
import shutil
from importlib.util import find_spec
from pathlib import Path
from uuid import uuid4

import pandas as pd

from screwgauge.judging.compare import ERROR_COLUMNS
from screwgauge.reference.errors import OutputError
from screwgauge.report.document import report_markdown
from screwgauge.report.page import report_html
from screwgauge.report.plots import make_plots
from screwgauge.report.summary import json_text, summary_text
from screwgauge.report.verdict import verdict
from screwgauge.solution import Timing
from screwgauge.study.results import Results

TIMING_COLUMNS = list(Timing.__dataclass_fields__)
SAMPLES = "samples.parquet"


def write_results(results: Results, out: Path, *, samples: bool = False, paper: str = "") -> Path:
    """Writes summary, tables, environment, report and plots; see `Results.write`.

    Files of an earlier run in the same folder are replaced; other files there stay.

    Args:
        out: Folder, made if need be.
        samples: Also every sample of every engine, as Parquet.
        paper: A section of the report on the paper.

    Returns:
        The folder.

    Raises:
        OutputError: The folder cannot be written, or pyarrow is missing for the samples.
    """
    if samples:
        _need_pyarrow()
    return write_files(out, _texts(results, paper), frame=_samples(results) if samples else None)


def check_writable(out: Path, *, samples: bool = False) -> None:
    """Finds out before a long computation whether its output can be written; leaves nothing behind.

    Raises:
        OutputError: It cannot.
    """
    if samples:
        _need_pyarrow()
    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        shutil.rmtree(_stage(out))
    except OSError as error:
        raise _cannot(out, error) from error
    finally:
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def write_files(out: Path, texts: dict[str, str], *, frame: pd.DataFrame | None = None) -> Path:
    """Writes files into a new folder beside their place, then moves them there.

    Args:
        texts: Path below `out` -> content.
        frame: What goes into ``samples.parquet``, if anything.

    Raises:
        OutputError: The folder cannot be written; it is then as it was before.
    """
    stage = None
    try:
        stage = _stage(out)
        for name, text in texts.items():
            path = stage / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", newline="\n")
        if frame is not None:
            frame.to_parquet(stage / SAMPLES, index=False)
        _move(stage, out)
    except OSError as error:
        raise _cannot(out, error) from error
    finally:
        if stage is not None and stage.exists():
            shutil.rmtree(stage, ignore_errors=True)
    return out


def _need_pyarrow() -> None:
    if find_spec("pyarrow") is None:
        raise OutputError(f"{SAMPLES} needs pyarrow, which is not installed", "", "run pip install pyarrow")


def _stage(out: Path) -> Path:
    """An empty folder on the same disk: in `out` where that exists (it may be a mount), else beside it."""
    out = out.absolute()
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "it is a file")
    home = out if out.is_dir() else out.parent
    home.mkdir(parents=True, exist_ok=True)
    stage = home / f".screwgauge-{uuid4().hex[:8]}"
    stage.mkdir()
    return stage


def _move(stage: Path, out: Path) -> None:
    """Puts the files in place by renaming; ``summary.json`` comes last, as the sign that all are there."""
    if not out.exists():
        stage.rename(out)
        return
    names = sorted(path.relative_to(stage) for path in stage.rglob("*") if path.is_file())
    for name in names:
        if (out / name).is_dir():
            raise IsADirectoryError(errno.EISDIR, f"{name} is a folder")
    old = {path.relative_to(out) for path in (*out.glob("plots/*.svg"), out / SAMPLES) if path.is_file()}
    for name in sorted(names, key=lambda name: name.name == "summary.json"):
        (out / name).parent.mkdir(exist_ok=True)
        os.replace(stage / name, out / name)
    for name in old - set(names):  # of an earlier run; beside the new report they would mislead
        (out / name).unlink()


def _cannot(out: Path, error: OSError) -> OutputError:
    reason = (error.strerror or str(error)).lower()
    return OutputError(f"the folder cannot be written ({reason})", str(out), "choose another with --out")


def _texts(results: Results, paper: str) -> dict[str, str]:
    """Every file of the run as text, path below the folder -> content."""
    plots = make_plots(results)
    report = report_markdown(results, plots, paper)
    timings = [timing for solution in results.solutions.values() for timing in solution.timings]
    errors = results.errors[ERROR_COLUMNS]
    return {
        **{f"plots/{plot.name}.svg": plot.svg for plot in plots},
        "report.md": report,
        "report.html": report_html(report, plots, verdict(results).status),
        "errors.csv": errors.to_csv(index=False, na_rep="nan", lineterminator="\n"),
        "timings.csv": pd.DataFrame(timings, columns=TIMING_COLUMNS).to_csv(index=False, lineterminator="\n"),
        "environment.json": json_text(results.environment),
        "summary.json": summary_text(results),
    }


def _samples(results: Results) -> pd.DataFrame:
    """Every sample: column t and one column ``engine/quantity/component`` for each value."""
    columns = {"t": results.times}
    for engine, solution in results.solutions.items():
        for quantity, values in solution.values.items():
            for name, column in zip(values.components, values.array.T, strict=True):
                columns[f"{engine}/{quantity}/{name}"] = column
    return pd.DataFrame(columns)
