"""Blocks as plain text of 100 columns: what commands print."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

from screwgauge.report import blocks as b
from screwgauge.report.blocks import Block, plain

COLUMNS = 100


def terminal(blocks: Iterable[Block]) -> str:
    """The text, with an empty line between blocks; plots are left out."""
    parts = (_lines(block) for block in blocks)
    return "\n\n".join("\n".join(map(_cut, lines)) for lines in parts if lines)


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


def _cut(line: str) -> str:
    line = line.rstrip()
    return line if len(line) <= COLUMNS else f"{line[: COLUMNS - 4]} ..."


def _table(lines: list[list[str]], block: b.Table) -> list[str]:
    """Columns side by side, numbers at their right ends."""
    right, widths = block.right, [max(map(len, column)) for column in zip(*lines, strict=True)]
    forms = [f"{'>' if i in right else '<'}{width}" for i, width in enumerate(widths)]
    return ["  ".join(map(format, line, forms)) for line in lines]
