"""What `screwgauge.diagnose` returns: a diagnosis that can be written and shown."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from screwgauge.diagnosis.diagnose import Diagnosis
from screwgauge.reference.errors import OutputError
from screwgauge.report.blocks import Block
from screwgauge.report.folder import locked
from screwgauge.report.write import Shown

if TYPE_CHECKING:
    from screwgauge.report.layout import Report


class DiagnosisReport(Shown, Diagnosis):
    """A diagnosis with its report; a notebook shows it."""

    __slots__ = ()

    def write(self, out: str | Path, *, force: bool = False) -> Path:
        """Writes ``diagnosis.json`` into a folder, then report and plots; those of the report before are replaced.

        Args:
            out: Folder, made if need be; if the numbers cannot be written, it is as it was before.
            force: Files in the way are replaced, whoever wrote them.

        Raises:
            OutputError: The folder cannot be written or has other files of these names.
            ReportError: The numbers are there, the report could not be made.
        """
        if out == "":
            raise OutputError("is empty, which would be the current folder", "out", "name a folder")
        with locked(Path(out)):
            return _report().write(self, Path(out), force=force)

    def _page(self) -> Iterable[Block]:
        return _report().blocks(self, _report().draw(self))

    def _screen(self) -> Iterable[Block]:
        return _report().terminal(self)


def _report() -> Report:
    """Imported where a page is made: pages and figures take a tenth of the time of a diagnosis."""
    from screwgauge.report.pages.diagnosis import PAGE

    return PAGE
