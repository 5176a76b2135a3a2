"""``report.html``: the Markdown report as one page that opens offline."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape, unescape

import markdown

from screwgauge.report.plots import Plot
from screwgauge.report.svg import inline

CSS = """
:root { color-scheme: light; }
body { margin: 0 auto; padding: 1.5rem 1rem 4rem; max-width: 76rem; background: #fff; color: #1b1f24;
  font: 16px/1.5 system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0 0 1rem; }
h2 { font-size: 1.25rem; margin: 2.4rem 0 .7rem; padding-bottom: .25rem; border-bottom: 1px solid #d8dde3; }
p, li { max-width: 58rem; }
code { background: #f1f3f5; padding: .1em .3em; border-radius: 3px; font-size: .9em; }
.verdict { margin: 0 0 1.5rem; padding: .8rem 1rem; border-left: 6px solid; border-radius: 4px; }
.verdict p { margin: 0; max-width: none; font-size: 1.05rem; }
.agree { background: #e8f3fb; border-color: #0072b2; }
.differ { background: #fdf0e6; border-color: #d55e00; }
.failed { background: #fbe9e7; border-color: #a4262c; }
.scroll { overflow-x: auto; margin: .8rem 0; }
table { border-collapse: collapse; font-size: .875rem; font-variant-numeric: tabular-nums; }
th, td { padding: .28rem .7rem; border-bottom: 1px solid #e3e7eb; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #aeb6bf; white-space: nowrap; }
tbody tr:hover { background: #f6f8fa; }
.scroll.plain thead { display: none; }
.scroll.plain td:first-child { color: #57606a; white-space: nowrap; }
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


def report_html(text: str, plots: Sequence[Plot], status: str) -> str:
    """The page, pictures inside.

    Args:
        text: The Markdown report.
        status: ``agree``, ``differ`` or ``failed``: colour of the banner.
    """
    body = markdown.markdown(text, extensions=["tables", "md_in_html"], output_format="html")
    body = body.replace("<blockquote>", f'<blockquote class="verdict {status}">', 1)
    body = re.sub(r"<table>.*?</table>", _scroll, body, flags=re.DOTALL)
    pictures = {f"plots/{plot.name}.svg": (i, plot) for i, plot in enumerate(plots, 1)}

    def picture(match: re.Match[str]) -> str:
        i, plot = pictures[unescape(match.group(1))]
        return f"<figure>{inline(plot.svg, f'f{i}', plot.title)}</figure>"

    body = re.sub(r'<p><img [^>]*?src="([^"]*)"[^>]*>\s*</p>', picture, body)
    heading = re.search(r"<h1>(.*?)</h1>", body, flags=re.DOTALL)
    title = escape(unescape(re.sub(r"<[^>]*>", "", heading.group(1)))) if heading else "Screwgauge"
    return SHELL.format(title=title, css=CSS, body=body)


def _scroll(match: re.Match[str]) -> str:
    """Wraps a table so that it scrolls; marks headless and wide ones for the style sheet."""
    table = match.group()
    heads = re.findall(r"<th[^>]*>(.*?)</th>", table, flags=re.DOTALL)
    kind = " wide" if len(heads) >= WIDE else "" if any(heads) else " plain"
    return f'<div class="scroll{kind}">{table}</div>'
