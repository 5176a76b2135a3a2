"""Blocks as plain text of 100 columns: what commands print."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest

from screwgauge.report import blocks as b
from screwgauge.report.blocks import Block, plain

COLUMNS = 100
LINES = 24  # of one screen
NARROW = 20  # a column of text is made no narrower: no number is longer


def terminal(blocks: Iterable[Block]) -> str:
    """The text, with an empty line between blocks; plots are left out."""
    parts = (_lines(block) for block in blocks)
    return "\n\n".join("\n".join(map(str.rstrip, lines)) for lines in parts if lines)


def screenful(blocks: Iterable[Block]) -> str:
    """As much of the text as a screen shows."""
    lines = terminal(blocks).splitlines()
    return "\n".join(lines if len(lines) <= LINES else [*lines[: LINES - 1], "... `write` leaves the whole report"])


def _lines(block: Block) -> list[str]:
    match block:
        case b.Heading(text) | b.Paragraph(text):
            return textwrap.wrap(plain(text), COLUMNS)
        case b.Banner(text, word):
            return textwrap.wrap(plain(f"{word}: {text}" if word else text), COLUMNS)
        case b.Items(texts):
            return [line for text in texts for line in textwrap.wrap(f"- {plain(text)}", COLUMNS)]
        case b.Table(head, body):
            return _table([[plain(cell) for cell in line] for line in ([head] if any(head) else []) + [*body]], block)
        case b.Folded(title, inside):
            return [f"{plain(title)}:", *terminal(inside).splitlines()]
        case b.Front(inside) | b.Appendix(inside):
            return terminal(inside).splitlines()
        case b.Picture() | b.Glossary():
            return []


def _table(lines: list[list[str]], block: b.Table) -> list[str]:
    """Columns side by side, numbers at their right ends. Text that is too wide is wrapped; columns for which there is
    no room even so are left out, and named."""
    widths = {i: max(map(len, column)) for i, column in enumerate(zip(*lines, strict=True))}
    left_out = []
    while _excess(_narrowed(widths, block)) > 0 and len(widths) > 1:
        left_out.append(lines[0][max(widths)])
        widths.pop(max(widths))
    widths = _narrowed(widths, block)
    shown = [line for cells in lines for line in _wrapped(cells, widths, block)]
    return [*shown, *textwrap.wrap(f"(in the report only: {', '.join(reversed(left_out))})" * bool(left_out), COLUMNS)]


def _excess(widths: Mapping[int, int]) -> int:
    """Signs by which a line is too long."""
    return sum(widths.values()) + 2 * (len(widths) - 1) - COLUMNS


def _narrowed(widths: Mapping[int, int], block: b.Table) -> dict[int, int]:
    """Widths after the widest columns of text have given way."""
    narrowed = dict(widths)
    for i in sorted({*widths} - block.right, key=widths.__getitem__, reverse=True):
        narrowed[i] -= max(0, min(_excess(narrowed), narrowed[i] - NARROW))
    return narrowed


def _wrapped(cells: Sequence[str], widths: Mapping[int, int], block: b.Table) -> list[str]:
    """The lines of one line of a table."""
    columns = [textwrap.wrap(cells[i], width, break_on_hyphens=False) or [""] for i, width in widths.items()]
    forms = [f"{'>' if i in block.right else '<'}{width}" for i, width in widths.items()]
    return ["  ".join(map(format, line, forms)) for line in zip_longest(*columns, fillvalue="")]
