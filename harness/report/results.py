"""What `screwgauge.run` returns: a comparison that can be written, drawn and shown."""

from __future__ import annotations

import os
from pathlib import Path

from screwgauge.reference.errors import OutputError, UnknownNameError
from screwgauge.report.blocks import Picture
from screwgauge.report.folder import write_files
from screwgauge.report.html import fragment, page
from screwgauge.report.lock import locked
from screwgauge.report.pages import run as run_page
from screwgauge.report.terminal import terminal
from screwgauge.study.comparison import Comparison

LINES = 24  # of one screen


class Results(Comparison):
    """A comparison with its report."""

    __slots__ = ()

    def write(self, out: str | Path, *, samples: bool = False, pdf: bool = False, force: bool = False) -> Path:
        """Writes tables and summary into a folder, then report and plots; those of the report before are replaced.

        Args:
            out: Folder, made if need be; if the numbers cannot be written, it is as it was before.
            samples: Also every sample of every engine, as Parquet.
            pdf: Also the page as PDF, printed by a Chromium.
            force: Files in the way are replaced, whoever wrote them.

        Raises:
            OutputError: The folder cannot be written or has other files of these names, or pyarrow is missing.
            ReportError: The numbers are there, the report could not be made.
        """
        if out == "":
            raise OutputError("is empty, which would be the current folder", "out", "name a folder")
        with locked(Path(out)):
            return run_page.write(self, Path(out), samples=samples, pdf=pdf, force=force)

    def plot(self) -> Pictures:
        """The pictures of the report; a notebook shows them."""
        return Pictures(run_page.pictures(self))

    def figure(self, name: str) -> Pictures:
        """Those of `plot` that have a name, or all whose names end with it: ``actuator-force``.

        Raises:
            UnknownNameError: None has; it lists the names there are.
        """
        every = self.plot()
        found = [picture for picture in every if picture.name == name or picture.name.partition("-")[2] == name]
        if not found:
            raise UnknownNameError("figure", name, [picture.name for picture in every])
        return Pictures(found)

    def to_html(self, path: str | Path) -> Path:
        """Writes the report as one page that opens offline.

        Raises:
            OutputError: The file cannot be written.
        """
        if os.path.isdir(path := Path(path)):
            raise OutputError("is a folder", str(path), "name a file, such as report.html, or use `write`")
        write_files(path.parent, {path.name: page(run_page.report(self, self.plot()))})
        return path

    def __repr__(self) -> str:
        lines = terminal(run_page.terminal(self, judge=False)).splitlines()
        return "\n".join(lines if len(lines) <= LINES else [*lines[: LINES - 1], "... `write` leaves the whole report"])

    def _repr_html_(self) -> str:
        return fragment(run_page.terminal(self, judge=False))


class Pictures(list[Picture]):
    """Pictures; a notebook shows them."""

    def __repr__(self) -> str:
        return "\n".join(picture.title for picture in self)

    def _repr_html_(self) -> str:
        return fragment(self)
