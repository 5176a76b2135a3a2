"""Blocks as Markdown: ``report.md``."""

from __future__ import annotations

import re
from collections.abc import Iterable

from screwgauge.report.blocks import Banner, Block, Folded, Heading, Items, Paragraph, Picture, Table


def markdown(blocks: Iterable[Block]) -> str:
    """The text of a report; plots are linked as ``plots/NAME.svg``."""
    return "\n\n".join(_block(block) for block in blocks) + "\n"


def _block(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"{'#' * level} {_text(text)}"
        case Paragraph(text):
            return _text(text)
        case Banner(text, word):
            return f"> **{word}** {_text(text)}" if word else f"> {_text(text)}"
        case Items(texts):
            return "\n".join(f"- {_text(text)}" for text in texts)
        case Table():
            right = block.right
            rule = tuple("---:" if i in right else "---" for i in range(len(block.head)))
            lines = [_cells(block.head), rule, *map(_cells, block.body)]
            return "\n".join("| " + " | ".join(line) + " |" for line in lines)
        case Picture(name, title):
            return f"![{_text(title)}](plots/{name}.svg)"
        case Folded(title, inside):
            return f"<details>\n<summary>{_text(title)}</summary>\n\n{markdown(inside)}\n</details>"


def _text(text: str) -> str:
    """One line; what HTML would take for its own is escaped outside of code, where Markdown does it."""
    parts = re.split(r"(`[^`]+`)", " ".join(text.split()))
    plain = (part.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;") for part in parts[::2])
    return "".join(x for pair in zip(plain, [*parts[1::2], ""], strict=True) for x in pair)


def _cells(texts: Iterable[str]) -> tuple[str, ...]:
    return tuple(_text(text).replace("|", "\\|") for text in texts)
