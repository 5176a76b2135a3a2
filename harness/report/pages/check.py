"""The report of ``screwgauge check``, and what CI services read."""

from __future__ import annotations

import os
from argparse import Namespace
from pathlib import Path
from typing import Any

from screwgauge.reference.errors import OutputError
from screwgauge.reference.files import check_free, replace_file, stamped, why
from screwgauge.report.gate import PAGE, Check
from screwgauge.study.gate.history import check_baseline

DATA, terminal = PAGE.DATA, PAGE.terminal


def check_files(options: Namespace) -> None:
    """Finds out before long work whether single files can be written.

    Raises:
        OutputError: One of them cannot.
    """
    for path in (options.junit, options.baseline if options.update else None):
        if path is not None and (os.path.isdir(path) or not os.access(path.parent, os.W_OK)):
            what = "is a folder" if os.path.isdir(path) else "cannot be written (no such folder, or not allowed)"
            raise OutputError(what, str(path), "name another file")
    read = [name for name in (*options.what, options.tolerances, options.baseline) if name is not None]
    if options.junit is not None:
        check_free(options.junit, read, force=options.force)
    if options.update:
        check_baseline(options.baseline, force=options.force)


def write(
    check: Check,
    out: Path,
    *,
    junit: Path | None = None,
    baseline: Path | None = None,
    **writing: Any,
) -> Path:
    """Writes ``check.json``, the report and ``environment.json``; JUnit and baseline where they are asked for.

    The summary of a job is added to the file that ``GITHUB_STEP_SUMMARY`` names.
    """
    if junit is not None:
        replace_file(junit, stamped(check.junit()))
    if summary := os.environ.get("GITHUB_STEP_SUMMARY"):
        try:
            with Path(summary).open("a", encoding="utf-8") as file:
                file.write(check.markdown())
        except OSError as error:
            what = f"cannot be written ({why(error)})"
            raise OutputError(what, f"GITHUB_STEP_SUMMARY, {summary}", "unset it, or name a file") from error
    PAGE.write(check, out, **writing)
    if baseline is not None:
        check.write_baseline(baseline)
    return out
