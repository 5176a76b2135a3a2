"""The page on paper: ``report.pdf``, printed by a Chromium without a window."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from screwgauge.reference.errors import OutputError
from screwgauge.study.lifeline import tied

PDF = "report.pdf"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
LONGEST = 120.0  # [s]
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer")


def browser() -> str:
    """Path of a browser that can print.

    Raises:
        OutputError: There is none.
    """
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise OutputError(f"{PDF} needs Chromium or Chrome, and none is found", "", "install one, or leave out --pdf")
    return found


def print_page(html: Path, pdf: Path) -> None:
    """Prints a page: all of it or nothing.

    Raises:
        OutputError: No browser, or it fails or takes too long.
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
                preexec_fn=tied(),
            )
            why = f"status {done.returncode}"
        except subprocess.TimeoutExpired:
            why = f"stopped after {LONGEST:g} s"
        if not made.is_file() or not made.stat().st_size:
            raise OutputError(f"the browser did not print it ({why})", str(pdf), f"print {html.name} from a browser")
        shutil.copyfile(made, near := pdf.with_name(f".{PDF}"))
        os.replace(near, pdf)
