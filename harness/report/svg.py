"""Writes SVG: small, free of outside references, the same for the same data, fit to stand in a page."""

from __future__ import annotations

import re
from html import escape
from itertools import pairwise

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.report.figures.data import Look

FONTS = "'DejaVu Sans', Verdana, 'Segoe UI', Helvetica, Arial, sans-serif"
SIZE = 9.5  # of letters
#: Letters of DejaVu Sans by their width over the size, rounded up; all others are `WIDTH` wide.
LETTERS = {0.32: "'ijlIJ ,.·", 0.36: "/:;|\\f-", 0.42: '()[]t!²³r"', 0.53: "sz*_`?°", 0.61: "cLFkvxyPTYao"}
LETTERS |= {0.8: "AVKBRXZC&UHNDGOQw", 1.0: "mMW%@#+<=>^~"}
WIDTH, WIDTHS = 0.64, {letter: width for width, letters in LETTERS.items() for letter in letters}


def _corners(*radii: float, turn: float = 0.0) -> list[tuple[float, float]]:
    """Corners at equal angles, clockwise from above; the turn is in parts of the circle."""
    angles = [2.0 * np.pi * (i / len(radii) + turn) for i in range(len(radii))]
    return [(float(r * np.sin(angle)), float(-r * np.cos(angle))) for r, angle in zip(radii, angles, strict=True)]


#: Corners of the marks over half their size; every two corners of `STROKES` are a line, and ``o`` is a circle.
MARKERS = {
    "o": [],
    "s": _corners(*[1.41] * 4, turn=1 / 8),
    "^": _corners(*[1.3] * 3),
    "D": _corners(*[1.3] * 4),
    "v": _corners(*[1.3] * 3, turn=1 / 2),
    "P": _corners(*[1.45, 0.6] * 4),
    "X": _corners(*[1.45, 0.6] * 4, turn=1 / 8),
    "*": _corners(*[1.35, 0.55] * 5),
    "x": [_corners(*[1.41] * 4, turn=1 / 8)[i] for i in (0, 2, 1, 3)],
    "+": [_corners(*[1.2] * 4)[i] for i in (0, 2, 1, 3)],
}
STROKES = ("x", "+")


def text_width(text: str, size: float = SIZE) -> float:
    """Width of a text in points, rather too wide than too narrow."""
    return size * sum(WIDTHS.get(letter, WIDTH) for letter in text)


def polyline(x: Array, y: Array) -> str:
    """Path through points, broken where one is not a number: steps between rounded corners, so that no error adds up.

    Args:
        x, y: Coordinates in points, written to 0.01. Shape (n,).
    """
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    corners = np.rint(100.0 * np.column_stack([x, y])[known]).astype(int)
    runs = np.split(corners, np.flatnonzero(np.diff(known) > 1) + 1)
    return "".join(_run(run.tolist()) for run in runs if len(run))


def _run(corners: list[list[int]]) -> str:
    (x, y), steps = corners[0], [f"{(c - a) / 100:g} {(d - b) / 100:g}" for (a, b), (c, d) in pairwise(corners)]
    return f"M{_short(x / 100)} {_short(y / 100)}l{' '.join(steps) or '0 0'}".replace(" -", "-")


def _short(value: float) -> str:
    return f"{round(value, 2) + 0.0:.12g}"


class Page:
    """Collects the elements of a picture."""

    def __init__(self) -> None:
        self.parts: list[str] = []

    def text(
        self, x: float, y: float, words: str, size: float = SIZE, anchor: str = "start", **style: str | bool
    ) -> None:
        """Text with the middle of its height at y; `style`: colour, bold, or turned so that it reads from below."""
        extra = [f'font-size="{_short(size)}"'] * (size != SIZE) + [f'text-anchor="{anchor}"'] * (anchor != "start")
        extra += [f'fill="{style["colour"]}"'] if "colour" in style else []
        extra += ['font-weight="bold"'] * bool(style.get("bold"))
        extra += [f'transform="rotate(-90 {_short(x)} {_short(y)})"'] * bool(style.get("turned"))
        if words:
            place = [f'x="{_short(x)}" y="{_short(y + 0.36 * size)}"', *extra]
            self.parts.append(f"<text {' '.join(place)}>{escape(words, quote=False)}</text>")

    def path(self, d: str, look: Look | None = None, fill: str = "none") -> None:
        """A line of any shape, or what it encloses."""
        if not d or (look and look.dash is None):
            return
        stroke = f' stroke="{look.colour}" stroke-width="{_short(look.width)}"' if look else ""
        dashes = " ".join(_short(part * look.width) for part in look.dash or ()) if look else ""
        dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
        self.parts.append(f'<path d="{d}" fill="{fill}"{stroke}{dashed}/>')

    def marks(self, x: Array, y: Array, look: Look) -> None:
        """The marker of a look at each point that is a number. Shape (n,)."""
        if look.marker:
            points = np.column_stack([x, y])[np.isfinite(x) & np.isfinite(y)].tolist()
            shape = _glyph(look.marker, look.size / 2)
            fill = "none" if look.marker in STROKES else look.fill or look.colour
            d = "".join(f"M{_short(u)} {_short(v)}{shape}" for u, v in points)
            self.path(d, Look(look.colour, (), look.width), fill)

    def picture(self, width: float, height: float) -> str:
        """The whole of it."""
        w, h, body = _short(width), _short(height), "\n".join(self.parts)
        head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{w}pt" height="{h}pt" viewBox="0 0 {w} {h}"'
        return f'{head} font-family="{FONTS}" font-size="{SIZE:g}" stroke-linejoin="round">\n{body}\n</svg>\n'


def _glyph(marker: str, r: float) -> str:
    """A marker as steps from its middle."""
    if marker == "o":
        arc = f"a{_short(r)} {_short(r)} 0 1 0"
        return f"m{_short(-r)} 0{arc} {_short(2 * r)} 0{arc} {_short(-2 * r)} 0"
    steps = [(r * (c - a), r * (d - b)) for (a, b), (c, d) in pairwise([(0.0, 0.0), *MARKERS[marker]])]
    every = 2 if marker in STROKES else len(steps)
    drawn = (f"{'l' if i % every else 'm'}{_short(u)} {_short(v)}" for i, (u, v) in enumerate(steps))
    return "".join(drawn) + ("" if marker in STROKES else "z")


def inline(svg: str, prefix: str, label: str) -> str:
    """The picture for use inside a page: ids of its own, and a label for screen readers."""
    svg = re.sub(r'\bid="', f'id="{prefix}-', svg)
    svg = re.sub(r'href="#', f'href="#{prefix}-', svg)
    svg = svg.replace("url(#", f"url(#{prefix}-")
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1).strip()
