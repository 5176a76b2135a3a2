"""How every report is laid out: what was found, what it was found on, then evidence, then what few read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache

from screwgauge.report.blocks import (
    TEXTS,
    Appendix,
    Banner,
    Block,
    Front,
    Glossary,
    Heading,
    Picture,
)
from screwgauge.report.markdown import markdown


def laid_out(
    title: str,
    banners: Sequence[Banner],
    body: Iterable[Block],
    appendix: Iterable[Block],
    *,
    first: Iterable[Block] = (),
    picture: Picture | None = None,
) -> list[Block]:
    """The blocks of a report.

    Args:
        banners: The verdict in a sentence, then warnings.
        body: Sections, what differs before what agrees.
        appendix: Sections that are folded.
        first: Three numbers that say how well, then what was judged: files, hashes, versions, date.
        picture: What stands on the first screen.
    """
    front = Front((*banners, *first, *([picture] if picture else [])))
    blocks: list[Block] = [Heading(title, 1), front, *body]
    words = _used(markdown([*blocks, *(appendix := list(appendix))]))
    glossary: list[Block] = [Heading("Words"), Glossary(words)] if words else []
    return [*blocks, Appendix((*appendix, *glossary))]


def _used(text: str) -> tuple[tuple[str, str], ...]:
    """Words of the glossary that a text has."""
    return tuple((w, m) for w, m in _glossary().items() if re.search(rf"\b{re.escape(w)}\b", text, re.IGNORECASE))


@cache
def _glossary() -> dict[str, str]:
    """Word -> what it means, from ``texts/glossary.md``."""
    lines = " ".join((TEXTS / "glossary.md").read_text(encoding="utf-8").split()).split(" - **")[1:]
    return {word: meaning for word, _, meaning in (line.partition("**: ") for line in lines)}
