"""Executes commands: rejects retired names, runs the work and shows progress, writes the data, then the pages."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge.reference.errors import DescriptionError, ScrewgaugeError
from screwgauge.reference.outputs import check_apart
from screwgauge.report.console import say

if TYPE_CHECKING:
    from screwgauge.report.console import Progress


Files = tuple[Iterable[Path], Mapping[str, Path]]
"""Files that a command reads, and option -> file that the command writes."""

_ON = "run the same command again; it resumes from the existing rows"


def carry_out(
    page: Any,
    out: Path,
    work: Callable[[Any], Any],
    *,
    tell: Callable[[Any], str] | None = None,
    again: bool = False,
    files: Files = ((), {}),
    force: bool = False,
    **writing: Any,
) -> Any:
    """Check that outputs can be written, run work while showing progress, write the report, and print a summary.

    Args:
        work: Function that reports its progress to its argument, and returns the results.
        tell: Function that formats the results for printing; by default the page formats them for a terminal.
        again: True if the same command resumes from existing rows.
        files: Files that the command reads, and files that it writes in addition to its report. All files must be
            different; with `force`, an input may be overwritten.
        force: Replace existing files, whatever their origin.
        writing: Further arguments for writing the page.

    Returns:
        The results.
    """
    from screwgauge.report.console import Progress
    from screwgauge.report.folder import MANIFEST, PAGES, SAMPLES, check_writable, lock_folder

    names = [*page.DATA, *([SAMPLES] if writing.get("samples") else [])]
    with lock_folder(out):
        written = {f"the report's {name}": out / name for name in (*names, *PAGES, MANIFEST)}
        check_apart({**written, **files[1]}, () if force else files[0])
        check_writable(out, names, force=force)
        with Progress(sys.stderr) as progress:
            try:
                results = work(progress.show)
            except KeyboardInterrupt:
                raise KeyboardInterrupt(_ON if again else "") from None
            _write(page, out, results, progress, tell, {**writing, **({"force": True} if force else {})})
    return results


def _write(
    page: Any,
    out: Path,
    results: Any,
    progress: Progress,
    tell: Callable[[Any], str] | None,
    writing: dict[str, Any],
) -> None:
    """Write a report, and print the results as soon as their data are on disk or cannot be written."""
    from screwgauge.report.folder import PAGES
    from screwgauge.report.text import terminal

    lost, printed = list[ScrewgaugeError](), list[bool]()

    def show() -> None:
        if printed:
            return
        printed.append(False)
        progress.wipe()
        try:
            say(tell(results) if tell else terminal(page.terminal(results)))
            printed.append(True)
        except ScrewgaugeError as error:  # draw the report even if standard output is closed
            lost.append(error)
        progress.show("report", 0.5)

    progress.show("report", 0.0)
    try:
        page.write(results, out, safe=show, **writing)
    except ScrewgaugeError as error:  # print the results nevertheless
        lost.append(error)
    show()
    progress.wipe()
    if tell is None and printed[-1]:
        say(f"\nreport: {out / PAGES[1] if (out / PAGES[1]).is_file() else 'none'}")
    if lost:
        raise lost[0]


_CAMPAIGN = "run pytest -m campaign -k {} in a checkout, see reports/README.md"
_KEPT = "keep check.json of each check, and compare with an earlier check using check --baseline"
_TLS = "omit it, and use tls:// or a network that you trust: Dask has no login, see harness/guide/cluster.md"
_PAPER = "run pytest tests/paper --reports=DIR in a checkout, see reports/README.md"
_ENDED, _RENAMED = "is no longer part of the package", "was renamed"
#: Retired command, or command and option -> what happened to it, and its replacement.
ENDED = {
    "bench --budget": (_RENAMED, "use bench --limit SECONDS"),
    "bench --random": (_ENDED, _CAMPAIGN.format("random")),
    "check --self-test": (_ENDED, _CAMPAIGN.format("alarms")),
    "check --store": (_ENDED, _KEPT),
    "diagnose --case": (_RENAMED, "use casebook ID"),
    "diagnose --matrix": (_ENDED, "name a library for each side: diagnose FILE@pinocchio FILE@mujoco"),
    "diagnose --self-test": (_ENDED, _CAMPAIGN.format("selftest")),
    **{f"{name} --insecure": (_ENDED, _TLS) for name in ("bench", "check", "matrix", "stress")},
    "history": (_ENDED, _KEPT),
    "paper": (_ENDED, _PAPER),
    "run --errata": (_ENDED, _PAPER),
    "view --mujoco": (_ENDED, "write an MJCF with screwgauge models, and run python -m mujoco.viewer --mjcf=FILE"),
    "view --video": (_ENDED, "write the animated page with view --out FILE.html"),
}


def check_current(arguments: Sequence[str]) -> None:
    """Reject retired or renamed commands and options with a hint, before they are rejected as unknown.

    Raises:
        DescriptionError: The command or option is in `ENDED`.
    """
    command, *rest = arguments or [""]
    options = [argument.partition("=")[0] for argument in rest]
    for typed in (command, *(f"{command} {option}" for option in options)):
        if typed in ENDED:
            what, instead = ENDED[typed]
            raise DescriptionError(what, typed, instead)
