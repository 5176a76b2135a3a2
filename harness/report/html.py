"""HTML renderer of blocks: ``report.html``, one page that opens offline and requests nothing.

The page contains the scripts that its pictures need: vega for charts, three.js for 3D drawings.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Sequence
from html import escape
from importlib.metadata import distribution, version
from pathlib import Path
from string import Template
from zipfile import ZipFile

import numpy as np

from screwgauge.report import blocks as b
from screwgauge.report.blocks import Block, plain, spans, walk
from screwgauge.report.figures.renderer import RENDERER
from screwgauge.study.formatting import file_name, free_name
from screwgauge.truth import cache

PAGE = Path(__file__).with_name("page.html")
#: Forbids all requests; pages with charts may evaluate code, because vega compiles functions.
POLICY = "default-src 'none'; script-src 'unsafe-inline'{}; style-src 'unsafe-inline'; img-src data:"
WIDE = 8  # smallest number of columns for which a table has a tighter layout
#: Letters per line on a phone, in a legible column of text, and in a table that fits twice on a line of paper.
PHONE, LEGIBLE, SLIM = 50, 30, 40
SENTENCE = 80  # smallest number of letters for which a cell is a sentence, not a name or number
UNTOUCHED = ("svg", "a", "code", "h1", "h2", "dl")  # elements in which words are not linked
STAGE = Path(__file__).with_name("stage") / "stage.js"
#: Matches three.js in trimesh's viewer, from the beginning of its licence to the end of the function that defines it.
THREE = re.compile(
    r"/\*\*\s*\* @license\s*\* Copyright \S+ Three\.js Authors.*?\}\)\s*\)\s*;?(?=\n|</script>)", re.DOTALL
)
#: SHA-256 of the text that `THREE` finds in reviewed releases of trimesh: 5.2.0.
KNOWN = frozenset({"1baf8525cd80caceabd6eb50da7961aa47f191ac7a68adb454c3a761b29244e2"})
#: Script that replaces an unknown three.js.
UNDRAWN = """window.screwgaugeStage = (element) => {
  const note = document.createElement("figcaption");
  note.textContent = REASON;
  element.parentElement.append(note);
  throw new Error(note.textContent);
};"""
#: three.js only names its licence, but every copy must include this text.
LICENCE = """/*! three.js. The MIT License. Copyright © 2010-2022 three.js authors

Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated
documentation files (the "Software"), to deal in the Software without restriction, including without limitation the
rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to permit
persons to whom the Software is furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all copies or substantial portions of the
Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE
WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR
COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR
OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
*/"""


def page(blocks: Iterable[Block]) -> str:
    """Render the whole page with embedded pictures and scripts; its title is the first heading."""
    blocks = list(blocks)
    title = next((block.text for block in blocks if isinstance(block, b.Text) and block.level), "Screwgauge")
    pictures = [block for block in walk(blocks) if isinstance(block, b.Picture)]
    glossaries = [block for block in walk(blocks) if isinstance(block, b.Group) and block.kind == "glossary"]
    terms = [line[0] for block in walk(glossaries) if isinstance(block, b.Table) for line in block.body]
    body, scripts = _link_words(_with_contents(fragment(blocks)), terms), _scripts(pictures)
    policy = POLICY.format(" 'unsafe-eval'" * ('id="chart"' in scripts))
    parts = {"title": escape(plain(title), quote=False), "body": body, "scripts": scripts, "policy": policy}
    style = PAGE.with_suffix(".css").read_text(encoding="utf-8")
    return Template(PAGE.read_text(encoding="utf-8")).substitute(parts, style=style)


def _scripts(pictures: Sequence[b.Picture]) -> str:
    """Embed the data of each picture, in order, the required libraries, and the code that connects them."""
    lines, needed = list[str](), dict[str, None]()
    for picture in pictures:
        kind = "stage" if picture.stage else "chart" if picture.chart else ""
        needed |= {kind: None} if kind else {}
        data = (picture.stage or picture.chart).replace("<", r"\u003c")  # in JSON, < occurs only in strings
        lines.append(f'<script type="application/json" data-kind="{kind}">{data}</script>')
    for kind in needed:
        source = re.sub("</(?=script)|<!--", lambda m: m[0].replace("<", r"\x3c"), MOVING[kind](), flags=re.IGNORECASE)
        lines.append(f'<script type="text/plain" id="{kind}">{source}</script>')
    own = PAGE.with_suffix(".js").read_text(encoding="utf-8")
    return "\n".join([*lines, f"<script>\n{own}</script>\n"])


def _with_contents(body: str) -> str:
    """Add anchors to headings, and a table of contents before the first heading."""
    places: dict[str, str] = {}

    def add_id(match: re.Match[str]) -> str:
        place = free_name(file_name(match[1]), places)
        places[place] = match[1]
        return f'<h2 id="{place}">{match[1]}</h2>'

    front, first, rest = re.sub("<h2>(.*?)</h2>", add_id, body).partition("<h2 ")
    links = "\n".join(f'<a href="#{place}">{text}</a>' for place, text in places.items())
    contents = f'<nav aria-label="Contents">Contents: {links}</nav>\n' if len(places) > 1 else ""
    before, details, fold = front.rpartition("<details>") if front.endswith("<summary>") else (front, "", "")
    return f"{before}{contents}{details}{fold}{first}{rest}"


def _link_words(body: str, words: Iterable[str]) -> str:
    """Link the first use of a glossary word in each section."""
    known = {word.lower(): f"word-{file_name(word)}" for word in words}
    every = re.compile(rf"\b({'|'.join(sorted(map(re.escape, known), key=len, reverse=True))})\b", re.IGNORECASE)
    return "".join(_link_section(part, every, dict(known)) for part in re.split("(?=<h2)", body)) if known else body


def _link_section(body: str, every: re.Pattern[str], left: dict[str, str]) -> str:
    """Link words in a section; `left`: word -> anchor, for words that have not been linked yet."""

    def link(match: re.Match[str]) -> str:
        place = left.pop(match[0].lower(), "")
        return f'<a class="word" href="#{place}">{match[0]}</a>' if place else match[0]

    pieces, within = re.split("(<[^>]*>)", body), 0
    for i, piece in enumerate(pieces):
        if i % 2 and piece.strip("</>").split(" ")[0] in UNTOUCHED:
            within += -1 if piece.startswith("</") else 1
        elif not i % 2 and not within:
            pieces[i] = every.sub(link, piece)
    return "".join(pieces)


def fragment(blocks: Iterable[Block]) -> str:
    """Render blocks for embedding, without a page around them."""
    return "\n".join(_block(b.without_lost_picture(block)) for block in blocks)


def _block(block: Block) -> str:
    match block:
        case b.Text(text, level):
            tag = f"h{level}" if level else "p"
            return f"<{tag}>{_text(text)}</{tag}>"
        case b.Banner(text, word, status):
            lead = f"<strong>{_text(word)}</strong> " if word else ""
            return f'<div class="banner {status}">{lead}{_text(text)}</div>'
        case b.Group("front", inside):
            return _front(inside)
        case b.Group("appendix", inside):
            return _fold_sections(fragment(inside))
        case b.Group("glossary", (b.Table(_, entries),)):
            terms = (f'<dt id="word-{file_name(x)}">{_text(x)}</dt><dd>{_text(y)}</dd>' for x, y in entries)
            return f"<dl>{''.join(terms)}</dl>"
        case b.Group(kind, inside, title, note):
            lead = f"<b>{_text(title)}</b><span>{_text(note)}</span>" if note else _text(title)
            mark = ' class="more"' if kind == "more" else ""
            return f"<details{mark}>\n<summary>{lead}</summary>\n{fragment(inside)}\n</details>"
        case b.Items(texts):
            return "<ul>" + "".join(f"<li>{_text(text)}</li>" for text in texts) + "</ul>"
        case b.Table():
            return _table(block)
        case b.Picture():
            return f"<figure>{_inline(block)}</figure>"


def _front(blocks: tuple[Block, ...]) -> str:
    """Arrange full-width banners, then text on the left and the picture on the right; wide tables go below both."""
    banners = fragment(block for block in blocks if isinstance(block, b.Banner))
    pictures = [block for block in blocks if isinstance(block, b.Picture)]
    others = [block for block in blocks if not isinstance(block, (b.Banner, b.Picture))]
    cut = next((i for i, block in enumerate(others) if i and pictures and _has_sentences(block)), len(others))
    text = f"<div>{fragment(others[:cut])}</div>"
    parts = [fragment(pictures), text] if len(pictures) > 1 else [text, fragment(pictures)]
    parts += [f'<div class="rest">{fragment(others[cut:])}</div>'] if others[cut:] else []
    kind = ("plain", "beside", "below")[len(pictures)]
    return "\n".join([f'<div class="front {kind}">', banners, *parts, "</div>"])


def _has_sentences(block: Block) -> bool:
    return isinstance(block, b.Table) and max((len(cell) for row in block.body for cell in row), default=0) > SENTENCE


def _fold_sections(body: str) -> str:
    """Fold each section under its heading."""
    front, *sections = body.split("<h2>")
    folds = (section.partition("</h2>") for section in sections)
    folded = (f"<details>\n<summary><h2>{x}{end}</summary>{rest}\n</details>" for x, end, rest in folds)
    return "\n".join(["<h2>Appendix</h2>", front, *folded])


def _inline(picture: b.Picture) -> str:
    """Embed a picture with unique ids and a label for screen readers."""
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{picture.name}-", picture.svg)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(plain(picture.title))}" ', 1).strip()


def _text(text: str) -> str:
    pieces = ((tag, _numbers(escape(piece, quote=False))) for tag, piece in spans(text))
    return "".join(f"<{tag}>{piece}</{tag}>" if tag else piece for tag, piece in pieces)


#: Characters in a cell after which names may break.
_BREAKS = re.compile(r"(?<=\w{4})[_/](?=\w{3})|(?<=[a-z0-9])[.](?=[a-z]{2})")
_UNITS = re.compile(r"(?<=\d) (?=(?:[mµ]?s|m?m|k?g|N|rad|%)(?!\w))")  # units that must stay with their numbers


def _numbers(text: str) -> str:
    """Keep numbers with exponents on one line, because browsers break lines after the minus."""
    return re.sub(r"(?<=.)\b\d[\d.]*e-\d+\b|\b\d[\d.]*e-\d+\b(?=.)", r'<span class="number">\g<0></span>', text)


def _cell(text: str) -> str:
    """Render a cell in which names may break only after punctuation."""
    pieces = re.split("(<[^>]*>)", _UNITS.sub("\N{NO-BREAK SPACE}", _text(text)))
    return "".join(piece if i % 2 else _BREAKS.sub(r"\g<0><wbr>", piece) for i, piece in enumerate(pieces))


def _longest(texts: Iterable[str]) -> int:
    """Return the length of the longest piece of text that cannot be broken."""
    pieces = (piece for text in texts for piece in re.split(rf"[\s-]+|{_BREAKS.pattern}", plain(text)))
    return max(map(len, pieces), default=0)


def _table(block: b.Table) -> str:
    """Render a table: compact if it has many columns; on a phone, one block per row if columns do not fit."""
    named, right = any(block.head), block.right
    columns = [*zip(block.head, *block.body, strict=True)]
    longest = [min(max(map(len, cells)), LEGIBLE) for cells in columns]
    widths = [max(_longest(x[:1]), *map(len, x[1:])) if i in right else _longest(x) for i, x in enumerate(columns)]
    letters = sum(widths) + len(widths)
    cramped = any(letters - width + most > 1.2 * PHONE for width, most in zip(widths, longest, strict=True))
    crowded = named and (letters > PHONE or cramped or sum(longest) > 2 * PHONE)
    heads = [f' data-head="{escape(plain(head))}"' if crowded else "" for head in block.head]
    marks = [' class="right"' if i in right else "" for i in range(len(block.head))]

    def line(cells: Iterable[str], tag: str) -> str:
        more = heads if tag == "td" else [""] * len(heads)
        parts = (f"<{tag}{m}{h}>{_cell(c)}</{tag}>" for m, h, c in zip(marks, more, cells, strict=True))
        return "<tr>" + "".join(parts) + "</tr>"

    kind = " wide" if len(block.head) >= WIDE else "" if named else " facts"
    kind += " cards" * crowded + " slim" * (letters < SLIM and len(block.body) > b.LONG)
    head = f"<thead>{line(block.head, 'th')}</thead>\n" if named else ""
    body = "\n".join(line(cells, "td") for cells in block.body)
    style = f' style="--letters:{letters:.0f}"' if named else ""
    return f'<div class="scroll{kind}"{style}><table>{head}<tbody>{body}</tbody></table></div>'


def chart_script() -> str:
    """Bundle vega, vega-lite and vega-embed; since this takes seconds, cache the bundle in the user's cache folder."""
    release = version("vl-convert-python")
    key = cache.digest("vega", release)
    kept, _ = cache.read(key, release)  # the cache returns complete and trusted content, or None
    if kept is not None:
        return kept["script"].tobytes().decode()
    script = str(RENDERER.ask("javascript_bundle"))
    cache.write(key, release, {"script": np.frombuffer(script.encode(), dtype=np.uint8)})
    return script


def stage_script() -> str:
    """Bundle three.js with its licence and the code that draws a mechanism.

    Unless the installed trimesh contains a three.js version in `KNOWN`, the script only shows a note below the still
    picture.
    """
    three = three_js()
    if hashlib.sha256(three.encode()).hexdigest() in KNOWN:
        return f"{LICENCE}\n{three}\n{STAGE.read_text(encoding='utf-8')}"
    what = "a three.js version that screwgauge does not support" if three else "no three.js"
    reason = f"No 3D picture: trimesh {version('trimesh')} contains {what}; install trimesh 5.2.0."
    return UNDRAWN.replace("REASON", json.dumps(reason))


def three_js() -> str:
    """Extract three.js from trimesh's viewer without importing trimesh; return an empty string if it is missing."""
    archive = viewer_archive()
    if not archive.is_file():
        return ""
    with ZipFile(archive) as viewer:
        pages = [viewer.read(name).decode() for name in viewer.namelist() if name.endswith(".html.template")]
    return next((match[0] for match in map(THREE.search, pages) if match), "")


def viewer_archive() -> Path:
    """Return the path of the archive in the installed trimesh that contains the viewer page."""
    return Path(str(distribution("trimesh").locate_file("trimesh/resources/templates/viewer.zip")))


#: Part of a picture -> function that draws it.
MOVING = {"chart": chart_script, "stage": stage_script}
