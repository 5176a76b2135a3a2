"""What `screwgauge.diagnose` returns: a diagnosis that can be written and shown."""

from __future__ import annotations

from pathlib import Path

from screwgauge.diagnosis.diagnose import Diagnosis
from screwgauge.reference.errors import OutputError
from screwgauge.report.html import fragment, page
from screwgauge.report.lock import locked
from screwgauge.report.pages.diagnosis import PAGE
from screwgauge.report.terminal import screenful
from screwgauge.report.write import save_page


class DiagnosisReport(Diagnosis):
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
            return PAGE.write(self, Path(out), force=force)

    def to_html(self, path: str | Path | None = None) -> str | Path:
        """The report as one page that opens offline.

        Args:
            path: File that it is written to.

        Returns:
            The path, or the text of the page without one.

        Raises:
            OutputError: The file cannot be written.
        """
        text = page(PAGE.blocks(self, PAGE.draw(self)))
        return text if path is None else save_page(Path(path), text)

    def __repr__(self) -> str:
        return screenful(PAGE.terminal(self))

    def _repr_html_(self) -> str:
        return fragment(PAGE.terminal(self))
