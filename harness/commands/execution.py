"""How every command is carried out: refusal of names that ended, work with progress, numbers onto the disk, pages."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge.reference.errors import DescriptionError, OutputError, ScrewgaugeError
from screwgauge.report.console import say

if TYPE_CHECKING:
    from screwgauge.report.console import Progress


def carry_out(
    page: Any,
    out: Path,
    work: Callable[[Any], Any],
    *,
    tell: Callable[[Any], str] | None = None,
    again: str = "",
    inputs: Iterable[Path] = (),
    force: bool = False,
    **writing: Any,
) -> Any:
    """Works with progress, writes and shows the page of what was found; what cannot be written is not begun.

    Args:
        work: Takes the progress.
        tell: What to print of what was found; by default what the page has for a terminal.
        again: File that the same command goes on from.
        inputs: Files that the command reads, which are not written over.
        force: Files in the way are replaced, whoever wrote them.
        writing: What else the page is written with.

    Returns:
        What was found.
    """
    from screwgauge.report.console import Progress
    from screwgauge.report.folder import PAGES, SAMPLES, check_writable, locked

    names = [*page.DATA, *([again] if again else []), *([SAMPLES] if writing.get("samples") else [])]
    with locked(out):
        for file in () if force else inputs:
            _check_kept(file, out, (*names, *PAGES))
        check_writable(out, names, force=force)
        with Progress(sys.stderr) as progress:
            try:
                found = work(progress.show)
            except KeyboardInterrupt:
                raise KeyboardInterrupt(again and f"run the same command again to go on from {out / again}") from None
            _write(page, out, found, progress, tell, {**writing, **({"force": True} if force else {})})
    return found


def _check_kept(file: Path, out: Path, names: Sequence[str]) -> None:
    """Refuses to write a report over what it is about."""
    for name in names:
        with suppress(OSError, ValueError):  # one of them is not there
            if file.samefile(out / name):
                what, remedy = f"the report's {name} would overwrite what is read", "choose another folder with --out"
                raise OutputError(what, str(file), remedy)


def _write(
    page: Any,
    out: Path,
    found: Any,
    progress: Progress,
    tell: Callable[[Any], str] | None,
    writing: dict[str, Any],
) -> None:
    """Writes a report, and tells what was found as soon as its numbers are on disk, or cannot be there."""
    from screwgauge.report.folder import PAGES
    from screwgauge.report.terminal import terminal

    lost, told = list[ScrewgaugeError](), list[bool]()

    def show() -> None:
        if told:
            return
        told.append(False)
        progress.wipe()
        try:
            say(tell(found) if tell else terminal(page.terminal(found)))
            told.append(True)
        except ScrewgaugeError as error:  # standard output takes nothing, which is no reason to draw nothing
            lost.append(error)
        progress.show("report", 0.5)

    progress.show("report", 0.0)
    try:
        page.write(found, out, safe=show, **writing)
    except ScrewgaugeError as error:  # what was found is told all the same
        lost.append(error)
    show()
    progress.wipe()
    if tell is None and told[-1]:
        say(f"\nreport: {out / PAGES[1] if (out / PAGES[1]).is_file() else 'none'}")
    if lost:
        raise lost[0]


_CAMPAIGN = "run pytest -m campaign -k {} in a checkout, see reports/README.md"
_PAPER = "run pytest tests/paper --reports=DIR in a checkout, see reports/README.md"
_ENDED, _RENAMED = "is no longer part of the package", "has another name"
#: Command, or command and option -> what became of it, and what to type in its place.
ENDED = {
    "bench --budget": (_RENAMED, "write bench --limit SECONDS"),
    "bench --random": (_ENDED, _CAMPAIGN.format("random")),
    "check --self-test": (_ENDED, _CAMPAIGN.format("alarms")),
    "diagnose --case": (_RENAMED, "write casebook ID"),
    "diagnose --self-test": (_ENDED, _CAMPAIGN.format("selftest")),
    "paper": (_ENDED, _PAPER),
    "run --errata": (_ENDED, _PAPER),
}


def check_current(arguments: Sequence[str]) -> None:
    """Refuses what ended or has another name, before it is called unknown.

    Raises:
        DescriptionError: It is in `ENDED`.
    """
    command, *rest = arguments or [""]
    options = [argument.partition("=")[0] for argument in rest]
    for typed in (command, *(f"{command} {option}" for option in options)):
        if typed in ENDED:
            what, instead = ENDED[typed]
            raise DescriptionError(what, typed, instead)
