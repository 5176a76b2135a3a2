"""The casebook on a terminal."""

from __future__ import annotations

from screwgauge.casebook.book import CASES
from screwgauge.casebook.case import CaseResult
from screwgauge.report.blocks import Banner, Block, Items, Marked, Table


def blocks(result: CaseResult) -> list[Block]:
    """A case with its sentence, its numbers, versions and links."""
    case, numbers = result.case, result.numbers
    rows = [(words, numbers[name]) for words, name in _NUMBERS if name in numbers]
    rows += [(name, version) for name, version in result.versions.items()]
    rows += [("seen with", case.versions)]
    return [
        Banner(Marked(result.sentence), f"{case.id}, {result.status}", "note" if result.ok else "failed"),
        Table(("", ""), tuple(rows)),
        *([Items(case.links)] if case.links else []),
    ]


_NUMBERS = (("as users get it", "symptom"), ("as it should be", "expected"), ("after the remedy", "mended"))


def discrepancies() -> dict[str, str]:
    """Name -> what users see."""
    return {case.id: case.title for case in CASES.values()}
