"""All reports below a folder on one page, FOLDER/index.html: ``python -m screwgauge.report.gallery FOLDER``."""

from __future__ import annotations

import re
import sys
from html import escape, unescape
from pathlib import Path

from screwgauge.reference.errors import DescriptionError
from screwgauge.report.console import console, say
from screwgauge.report.folder import PAGES
from screwgauge.report.html import fill

LONG = 240  # letters of what was found


def gallery(folder: Path) -> str:
    """The page: of each report its title, what it found and its first picture, in the order of their folders.

    Raises:
        DescriptionError: There is no report.
    """
    cards = [_card(path, folder) for path in sorted(folder.rglob(PAGES[0])) if path.with_name(PAGES[1]).is_file()]
    if not cards:
        raise DescriptionError("has no reports", str(folder), "name a folder that commands wrote into with --out")
    body = f'<h1>Reports</h1>\n<div class="cards">\n{"".join(cards)}</div>'
    return fill("Reports", body, images=" 'self' file:")


def _card(path: Path, folder: Path) -> str:
    """One report, from its Markdown."""
    text, below = path.read_text(encoding="utf-8"), path.parent.relative_to(folder).as_posix()
    title, said, picture = (
        next(iter(re.findall(form, text, flags=re.MULTILINE)), "")
        for form in (r"^# (.*)", r"^> (.*)", r"\]\((plots/\S+)\)")
    )
    short = escape(_plain(said) if len(_plain(said)) <= LONG else f"{_plain(said)[:LONG].rpartition(' ')[0]} ...")
    drawn = f'<img src="{escape(f"{below}/{picture}")}" alt="" loading="lazy">' if picture else ""
    link = f'<a href="{escape(f"{below}/{PAGES[1]}")}">{drawn}<strong>{escape(_plain(title))}</strong></a>'
    return f"<article>{link}<p>{short}</p></article>\n"


def _plain(text: str) -> str:
    """Markdown of our own as plain text."""
    return unescape(re.sub(r"\\(.)", r"\1", re.sub(r"\*\*|`", "", text)))


if __name__ == "__main__":
    with console():
        for name in sys.argv[1:] or ["reports"]:
            index = Path(name) / "index.html"
            index.write_text(gallery(index.parent), encoding="utf-8")
            say(str(index))
