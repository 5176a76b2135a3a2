"""Text renderers of blocks: 100 columns for a terminal, and Markdown for ``report.md``."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import zip_longest

from screwgauge.reference.errors import log_text
from screwgauge.report import blocks as b
from screwgauge.report.blocks import Block, plain, spans

COLUMNS = 100
LINES = 24  # number of lines on a screen
NARROW = 12  # smallest width of a text column, unless its longest word is wider
MARKS = {"": "{}", "code": "`{}`", "strong": "**{}**", "em": "*{}*"}


def terminal(blocks: Iterable[Block]) -> str:
    """Render blocks as text without plots, separated by empty lines."""
    parts = (_lines(block) for block in blocks)
    return log_text("\n\n".join("\n".join(map(str.rstrip, lines)) for lines in parts if lines))


def screenful(blocks: Iterable[Block]) -> str:
    """Render as much text as fits a screen."""
    lines = terminal(blocks).splitlines()
    return "\n".join(lines if len(lines) <= LINES else [*lines[: LINES - 1], "... `write` saves the whole report"])


def _lines(block: Block) -> list[str]:
    match block:
        case b.Text(text):
            return textwrap.wrap(plain(text), COLUMNS)
        case b.Banner(text, word):
            return textwrap.wrap(plain(f"{word}: {text}" if word else text), COLUMNS)
        case b.Items(texts):
            return [line for text in texts for line in textwrap.wrap(f"- {plain(text)}", COLUMNS)]
        case b.Table(head, body):
            return _table([[plain(cell) for cell in line] for line in ([head] if any(head) else []) + [*body]], block)
        case b.Picture() | b.Group("glossary"):
            return []
        case b.Group(_, inside, title):
            return [*([f"{plain(title)}:"] if title else []), *terminal(inside).splitlines()]


def _table(lines: list[list[str]], block: b.Table) -> list[str]:
    """Align columns, with numbers on the right; wrap long text; list the names of columns that still do not fit."""
    columns = dict(enumerate(zip(*lines, strict=True)))
    left_out = list[str]()
    while _excess(widths := _widths(columns, block)) > 0 and len(columns) > 1:
        left_out.insert(0, columns.pop(max(columns))[0])
    shown = [line for cells in lines for line in _wrap(cells, widths, block)]
    return shown + (textwrap.wrap(f"(in the report only: {', '.join(left_out)})", COLUMNS) if left_out else [])


def _excess(widths: Mapping[int, int]) -> int:
    """Return the number of characters beyond the line width."""
    return sum(widths.values()) + 2 * (len(widths) - 1) - COLUMNS


def _widths(columns: Mapping[int, Sequence[str]], block: b.Table) -> dict[int, int]:
    """Return the widths of columns, shrinking the widest text columns until the line fits."""
    widths = {i: max(map(len, cells)) for i, cells in columns.items()}
    for i in sorted({*columns} - block.right, key=widths.__getitem__, reverse=True):
        least = max(NARROW, *(len(word) for cell in columns[i] for word in cell.split()))
        widths[i] -= max(0, min(_excess(widths), widths[i] - least))
    return widths


def _wrap(cells: Sequence[str], widths: Mapping[int, int], block: b.Table) -> list[str]:
    """Wrap a row of a table into lines."""
    columns = [textwrap.wrap(cells[i], max(width, 1), break_on_hyphens=False) or [""] for i, width in widths.items()]
    forms = [f"{'>' if i in block.right else '<'}{width}" for i, width in widths.items()]
    return ["  ".join(map(format, line, forms)) for line in zip_longest(*columns, fillvalue="")]


def markdown(blocks: Iterable[Block]) -> str:
    """Render a report's text, with plots linked as ``plots/NAME.svg``."""
    return "\n\n".join(_block(block) for block in blocks) + "\n"


def _block(block: Block) -> str:
    match block:
        case b.Text(text, level):
            return f"{'#' * level} {_text(text)}" if level else _line(text)
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
        case b.Group("front" | "appendix", inside):
            return markdown(inside).rstrip("\n")
        case b.Group("glossary", (b.Table(_, entries),)):
            return "\n".join(f"- **{_text(word)}**: {_text(meaning)}" for word, meaning in entries)
        case b.Group(_, inside, title, note):
            lead = escape(plain(f"{title}: {note}" if note else title), quote=False)
            return f"<details>\n<summary>{lead}</summary>\n\n{markdown(inside)}\n</details>"


def _text(text: str) -> str:
    """Render one line, escaping characters that Markdown or HTML would interpret outside code."""
    pieces = (MARKS[tag].format(piece if tag == "code" else _escape(piece)) for tag, piece in spans(text))
    return " ".join("".join(pieces).split())


def _escape(text: str) -> str:
    return re.sub(r"[\\`*\[\]~$#]|(?<![^\W_])_|_(?![^\W_])", r"\\\g<0>", escape(text, quote=False))


def _line(text: str) -> str:
    """Escape the start of a line, so that it neither begins a list nor underlines the previous line."""
    return re.sub(r"^(\d+)(?=[.)](\s|$))", r"\1\\", re.sub(r"^(?=[-+=])", r"\\", _text(text)))


def _cells(texts: Iterable[str]) -> tuple[str, ...]:
    return tuple(_text(text).replace("|", "\\|") for text in texts)
