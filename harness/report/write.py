"""Writes reports: first the data, all of them or none; then the pages, and a PDF on request."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from screwgauge.environment import json_text
from screwgauge.reference.errors import OutputError, ReportError
from screwgauge.reference.outputs import check_free, replace_file, save_file
from screwgauge.report.blocks import Block, Picture, as_kind, map_leaves, walk
from screwgauge.report.folder import PAGES, SAMPLES, check_writable, lock_folder, unchanged_files, write_files
from screwgauge.report.html import fragment, page
from screwgauge.report.text import markdown, screenful
from screwgauge.study.formatting import free_name
from screwgauge.study.lifeline import end_with_thread

PDF = "report.pdf"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
LONGEST = 120.0  # time limit of printing [s]
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer")


def write_report(
    out: Path,
    tell: Callable[[], Sequence[Block]],
    data: Mapping[str, Any],
    figures: int | None = None,
    *,
    pdf: bool = False,
    safe: Callable[[], None] = lambda: None,
    force: bool = False,
) -> Path:
    """Write data files, then ``report.md``, ``report.html`` and the plots.

    Args:
        out: Folder, created if needed. Files of an earlier report are replaced or removed; all other files stay.
        tell: Function that returns the blocks of the report.
        data: File name -> table for CSV and Parquet, anything else for JSON.
        figures: Significant digits of the numbers in CSV; exact by default.
        pdf: Also print the page to ``report.pdf``.
        safe: Called when the data are on disk.
        force: Replace existing files, whatever their origin.

    Raises:
        OutputError: The data cannot be written; the folder stays unchanged.
        ReportError: The data were written, but the report was not.
    """
    printed = [PDF] if pdf else []
    check_writable(out, [*data, *printed], force=force)
    numbers = {name: _text(value, figures) for name, value in data.items() if name != SAMPLES}
    before = unchanged_files(out)
    write_files(out, numbers, before)
    for name in before - {*numbers}:  # pictures of an earlier run would mislead next to the new report
        (out / name).unlink(missing_ok=True)
    try:
        samples = {name: value for name, value in data.items() if name == SAMPLES}
        write_files(out, samples, {*numbers})
        safe()
        blocks = _name_pictures(tell(), {path.stem for path in out.glob("plots/*")})
        drawn = {f"plots/{block.name}.svg": block.svg for block in walk(blocks) if isinstance(block, Picture)}
        pages = dict(zip(PAGES, (markdown(blocks), page(blocks)), strict=True))
        write_files(out, {**drawn, **pages}, {*data, *printed})
        if pdf:
            print_page(out / PAGES[1], out / PDF)
            write_files(out, {}, {*drawn, *pages, *data, *printed})
    except OutputError:  # its message states what is missing
        raise
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"the numbers are in {out}, but the report was not written") from None
    except Exception as error:  # the numbers took a long time to compute, and are worth more than a page
        what = f"the report could not be made ({type(error).__name__}: {error})"
        raise ReportError(
            what, str(out), "use the numbers, which are complete, and report the traceback that --debug prints"
        ) from error
    return out


def _name_pictures(blocks: Iterable[Block], taken: set[str]) -> list[Block]:
    """Give each picture a unique file name."""

    def rename(block: Block) -> Block:
        if not isinstance(block, Picture):
            return block
        taken.add(name := free_name(block.name, taken))
        return replace(block, name=name)

    return map_leaves(blocks, rename)


def _text(value: Any, figures: int | None) -> str:
    if not hasattr(value, "to_csv"):  # not a table; this test avoids loading pandas, which is slow
        return json_text(value)
    form = None if figures is None else f"%.{figures}g"
    return str(value.to_csv(index=False, na_rep="nan", lineterminator="\n", float_format=form))


class Shown:
    """Result with a page; terminals and notebooks display its first screen."""

    __slots__ = ()

    @classmethod
    def of(cls, result: Any) -> Self:
        """Convert a result to this class."""
        return as_kind(cls, result)

    @abstractmethod
    def _report(self) -> Any:
        """Return the kind of report for the result."""

    def _page(self) -> Iterable[Block]:
        """Return the blocks of the whole page."""
        report = self._report()
        blocks: list[Block] = report.blocks(self, report.draw(self))
        return blocks

    def _screen(self) -> Iterable[Block]:
        """Return the blocks that fit a screen."""
        blocks: list[Block] = self._report().terminal(self)
        return blocks

    def write(self, out: str | Path, *, force: bool = False) -> Path:
        """Write the data into a folder, then the report and its plots; replace an earlier report.

        Args:
            out: Folder, created if needed; it stays unchanged if the data cannot be written.
            force: Replace existing files, whatever their origin.

        Raises:
            OutputError: The folder is not writable, or contains different files with these names.
            ReportError: The data were written, but the report could not be made.
        """
        return self._write(out, force=force)

    def _write(self, out: str | Path, **writing: Any) -> Path:
        if out == "":
            raise OutputError("is empty, which would mean the current folder", "out", "choose a folder")
        with lock_folder(Path(out)):
            path: Path = self._report().write(self, Path(out), **writing)
        return path

    def to_html(self, path: str | Path | None = None, *, force: bool = False) -> str | Path:
        """Render the report as one page that opens offline.

        Args:
            path: File to write; None to write nothing.
            force: Replace an existing file, whatever its origin.

        Returns:
            The path, or the content of the page if there is no path.

        Raises:
            OutputError: The file cannot be written, or an existing file was changed or written by something else.
        """
        if path is not None:
            check_free(Path(path), force=force)
        text = page(self._page())
        return text if path is None else save_file(path, text, force=force)

    def __repr__(self) -> str:
        return screenful(self._screen())

    def _repr_html_(self) -> str:
        return fragment(self._screen())


def browser() -> str:
    """Return the path of a browser that can print.

    Raises:
        OutputError: Neither Chromium nor Chrome was found.
    """
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise OutputError(
            f"{PDF} needs Chromium or Chrome, and neither was found", "", "install one of them, or omit the PDF"
        )
    return path


def print_page(html: Path, pdf: Path) -> None:
    """Print a page to PDF, completely or not at all.

    Raises:
        OutputError: No browser was found, or it failed or took too long.
    """
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / PDF
        command = [browser(), *FLAGS, f"--user-data-dir={folder}/profile", f"--print-to-pdf={made}"]
        try:
            done = subprocess.run(
                [*command, html.absolute().as_uri()],
                capture_output=True,
                timeout=LONGEST,
                check=False,
                preexec_fn=end_with_thread(),
            )
            why = f"status {done.returncode}"
        except subprocess.TimeoutExpired:
            why = f"stopped after {LONGEST:g} s"
        if not made.is_file() or not made.stat().st_size:
            raise OutputError(f"the page was not printed ({why})", str(pdf), f"print {html.name} from a browser")
        replace_file(pdf, made.read_bytes())
