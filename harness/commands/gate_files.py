"""Files of the gate other than its report: inputs, outputs, and an early check that outputs can be written."""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path

from screwgauge.reference.outputs import check_free
from screwgauge.report.pages.check import SUMMARY
from screwgauge.study.gate.baseline import check_baseline
from screwgauge.study.gate.items import items
from screwgauge.study.gate.run import files_in


def check_files(options: Namespace) -> None:
    """Check, before long work, that files given by options can be written.

    Raises:
        OutputError: A file given by an option cannot be written.
    """
    if options.junit is not None:
        check_free(options.junit, force=options.force)
    if options.update:
        check_baseline(options.baseline, force=options.force)


def check_outputs(options: Namespace) -> dict[str, Path]:
    """Return option or environment variable -> file that the command writes in addition to its report."""
    known = options.baseline if options.update else None
    named = {"--junit": options.junit, "--baseline": known, SUMMARY: os.environ.get(SUMMARY)}
    return {name: Path(file) for name, file in named.items() if file}


def check_inputs(options: Namespace) -> Iterator[Path]:
    """Yield every file that the command reads."""
    yield from map(Path, filter(None, (options.tolerances, None if options.update else options.baseline)))
    for item in items(options.what):
        yield from map(Path, item.files)
        yield from files_in(item)
