"""Blocks as Markdown: ``report.md``."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape

from screwgauge.report import blocks as b
from screwgauge.report.blocks import Block, plain, spans

MARKS = {"": "{}", "code": "`{}`", "strong": "**{}**", "em": "*{}*"}


def markdown(blocks: Iterable[Block]) -> str:
    """The text of a report; plots are linked as ``plots/NAME.svg``."""
    return "\n\n".join(_block(block) for block in blocks) + "\n"


def _block(block: Block) -> str:
    match block:
        case b.Heading(text, level):
            return f"{'#' * level} {_text(text)}"
        case b.Paragraph(text):
            return _line(text)
        case b.Banner(text, word):
            return f"> **{_text(word)}** {_text(text)}" if word else f"> {_line(text)}"
        case b.Items(texts):
            return "\n".join(f"- {_line(text)}" for text in texts)
        case b.Table():
            right = block.right
            rule = tuple("---:" if i in right else "---" for i in range(len(block.head)))
            lines = [_cells(block.head), rule, *map(_cells, block.body)]
            return "\n".join("| " + " | ".join(line) + " |" for line in lines)
        case b.Picture(name, title):
            return f"![{_text(title)}](plots/{name}.svg)"
        case b.Folded(title, inside, note):
            lead = escape(plain(f"{title}: {note}" if note else title), quote=False)
            return f"<details>\n<summary>{lead}</summary>\n\n{markdown(inside)}\n</details>"
        case b.Front(inside) | b.Appendix(inside):
            return markdown(inside).rstrip("\n")
        case b.Glossary(entries):
            return "\n".join(f"- **{_text(word)}**: {_text(meaning)}" for word, meaning in entries)


def _text(text: str) -> str:
    """One line; what Markdown or HTML would take for its own is escaped outside of code, where Markdown does it."""
    pieces = (MARKS[tag].format(piece if tag == "code" else _escaped(piece)) for tag, piece in spans(text))
    return " ".join("".join(pieces).split())


def _escaped(text: str) -> str:
    return re.sub(r"[\\`*\[\]~$#]|(?<![^\W_])_|_(?![^\W_])", r"\\\g<0>", escape(text, quote=False))


def _line(text: str) -> str:
    """A text at the beginning of a line, where it must not begin a list or underline what is before."""
    return re.sub(r"^(\d+)(?=[.)](\s|$))", r"\1\\", re.sub(r"^(?=[-+=])", r"\\", _text(text)))


def _cells(texts: Iterable[str]) -> tuple[str, ...]:
    return tuple(_text(text).replace("|", "\\|") for text in texts)
