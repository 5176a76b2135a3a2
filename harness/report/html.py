"""Blocks as HTML: ``report.html``, one page that opens offline."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from screwgauge.report.blocks import Banner, Block, Folded, Heading, Items, Paragraph, Picture, Table, spans
from screwgauge.report.svg import inline

CSS = """
:root { color-scheme: light; }
body { margin: 0 auto; padding: 1.5rem 1rem 4rem; max-width: 76rem; background: #fff; color: #1b1f24;
  font: 16px/1.5 system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0 0 1rem; }
h2 { font-size: 1.25rem; margin: 2.4rem 0 .7rem; padding-bottom: .25rem; border-bottom: 1px solid #d8dde3; }
p, li { max-width: 58rem; }
code { background: #f1f3f5; padding: .1em .3em; border-radius: 3px; font-size: .9em; }
.banner { margin: 0 0 1rem; padding: .8rem 1rem; border-left: 6px solid; border-radius: 4px; font-size: 1.05rem; }
.agree { background: #e8f3fb; border-color: #0072b2; }
.differ { background: #fdf0e6; border-color: #d55e00; }
.failed { background: #fbe9e7; border-color: #a4262c; }
.note { background: #f6f8fa; border-color: #57606a; }
.scroll { overflow-x: auto; margin: .8rem 0; }
table { border-collapse: collapse; font-size: .875rem; font-variant-numeric: tabular-nums; }
th, td { padding: .28rem .7rem; border-bottom: 1px solid #e3e7eb; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #aeb6bf; white-space: nowrap; }
.right { text-align: right; white-space: nowrap; }
tbody tr:hover { background: #f6f8fa; }
.facts td:first-child { color: #57606a; white-space: nowrap; }
.facts td { overflow-wrap: anywhere; }
.wide td { white-space: nowrap; }
figure { margin: 1.6rem 0; overflow-x: auto; }
figure svg { max-width: 100%; height: auto; min-width: 40rem; }
summary { cursor: pointer; font-weight: 600; margin: .6rem 0; }
@media print { .scroll, figure { overflow: visible; } figure { break-inside: avoid; } }
"""
SHELL = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{css}</style>
</head>
<body>
{body}
</body>
</html>
"""
WIDE = 8  # columns from which a table scrolls instead of wrapping


def page(blocks: Iterable[Block]) -> str:
    """The whole page, pictures inside; its title is the first heading."""
    blocks = list(blocks)
    title = next((block.text for block in blocks if isinstance(block, Heading)), "Screwgauge")
    plain = "".join(piece for _, piece in spans(title))
    return SHELL.format(title=escape(plain, quote=False), css=CSS, body=fragment(blocks))


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
        case Picture(plot):
            return f"<figure>{inline(plot.svg, plot.name, plot.title)}</figure>"
        case Folded(title, inside):
            return f"<details>\n<summary>{_text(title)}</summary>\n{fragment(inside)}\n</details>"


def _text(text: str) -> str:
    pieces = ((tag, escape(piece, quote=False)) for tag, piece in spans(text))
    return "".join(f"<{tag}>{piece}</{tag}>" if tag else piece for tag, piece in pieces)


def _table(block: Table) -> str:
    """A table that scrolls if it is wider than the page."""
    named = any(block.head)
    kind = " wide" if len(block.head) >= WIDE else "" if named else " facts"
    head = f"<thead>{_line(block, block.head, 'th')}</thead>" if named else ""
    body = "\n".join(_line(block, cells, "td") for cells in block.body)
    return f'<div class="scroll{kind}"><table>{head}\n<tbody>{body}</tbody></table></div>'


def _line(block: Table, cells: Iterable[str], tag: str) -> str:
    ends = (' class="right"' if i in block.right else "" for i in range(len(block.head)))
    return "<tr>" + "".join(f"<{tag}{e}>{_text(cell)}</{tag}>" for e, cell in zip(ends, cells, strict=True)) + "</tr>"
