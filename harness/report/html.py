"""Blocks as HTML: ``report.html``, one page that opens offline."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape
from pathlib import Path
from string import Template

from screwgauge.report.blocks import Banner, Block, Folded, Heading, Items, Paragraph, Picture, Table, plain, spans

PAGE = Path(__file__).with_name("page.html")
WIDE = 8  # columns from which a table scrolls instead of wrapping


def page(blocks: Iterable[Block]) -> str:
    """The whole page, pictures inside; its title is the first heading."""
    blocks = list(blocks)
    title = next((block.text for block in blocks if isinstance(block, Heading)), "Screwgauge")
    template = Template(PAGE.read_text(encoding="utf-8"))
    return template.substitute(title=escape(plain(title), quote=False), body=fragment(blocks))


def fragment(blocks: Iterable[Block]) -> str:
    """The blocks alone, to stand within a page."""
    return "\n".join(map(_block, blocks))


def _block(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"<h{level}>{_text(text)}</h{level}>"
        case Paragraph(text):
            return f"<p>{_text(text)}</p>"
        case Banner(text, word, status):
            lead = f"<strong>{_text(word)}</strong> " if word else ""
            return f'<div class="banner {status}">{lead}{_text(text)}</div>'
        case Items(texts):
            return "<ul>" + "".join(f"<li>{_text(text)}</li>" for text in texts) + "</ul>"
        case Table():
            return _table(block)
        case Picture():
            return f"<figure>{_inline(block)}</figure>"
        case Folded(title, inside):
            return f"<details>\n<summary>{_text(title)}</summary>\n{fragment(inside)}\n</details>"


def _inline(picture: Picture) -> str:
    """A picture within the page: with ids of its own, and a label for screen readers."""
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{picture.name}-", picture.svg)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(plain(picture.title))}" ', 1).strip()


def _text(text: str) -> str:
    pieces = ((tag, escape(piece, quote=False)) for tag, piece in spans(text))
    return "".join(f"<{tag}>{piece}</{tag}>" if tag else piece for tag, piece in pieces)


def _table(block: Table) -> str:
    """A table that scrolls if it is wider than the page."""
    named, right = any(block.head), block.right

    def line(cells: Iterable[str], tag: str) -> str:
        marks = (' class="right"' if i in right else "" for i in range(len(block.head)))
        return "<tr>" + "".join(f"<{tag}{m}>{_text(c)}</{tag}>" for m, c in zip(marks, cells, strict=True)) + "</tr>"

    kind = " wide" if len(block.head) >= WIDE else "" if named else " facts"
    head = f"<thead>{line(block.head, 'th')}</thead>\n" if named else ""
    body = "\n".join(line(cells, "td") for cells in block.body)
    return f'<div class="scroll{kind}"><table>{head}<tbody>{body}</tbody></table></div>'
