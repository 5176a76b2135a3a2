"""Makes the SVG that matplotlib writes small, free of outside references, and fit to stand in a page."""

from __future__ import annotations

import re
from html import escape
from itertools import pairwise

FONTS = "'DejaVu Sans', Verdana, 'Segoe UI', Helvetica, Arial, sans-serif"

_PROLOG = re.compile(r"<\?xml.*?\?>\s*|<!DOCTYPE.*?>\s*|<!--.*?-->\s*", re.DOTALL)
_METADATA = re.compile(r"\s*<metadata>.*?</metadata>", re.DOTALL)
_SHEET = re.compile(r'\s*<defs>\s*<style type="text/css">\*\{(.*?)\}</style>\s*</defs>', re.DOTALL)
_FAMILY = re.compile(r"font-family: [^;\"]*")
_LEVEL = re.compile(r' transform="rotate\(-?0 [^)]*\)"')
_PATH = re.compile(r'\bd="([^"]*)"')
_PLACE = re.compile(r'\b(?:x|y|width|height)="-?\d+\.\d{3,}"|(?:translate|rotate)\([^)]*\)')
_NUMBER = re.compile(r"-?\d+\.\d+(?:e[-+]?\d+)?")
_LINE = re.compile(r"-?[\d.]+ -?[\d.]+(?: L -?[\d.]+ -?[\d.]+){3,}")
_COMMAND = re.compile(r" ?([MLQCzl]) ?")
_USE = re.compile(r'(<use [^>]*?) style="([^"]*)"')


def _short(match: re.Match[str]) -> str:
    text = f"{float(match.group()):.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _fill(match: re.Match[str]) -> str:
    """A marker's style without its stroke, which the shape that it uses has already."""
    kept = "; ".join(part for part in match.group(2).split("; ") if not part.startswith("stroke"))
    return match.group(1) + (f' style="{kept}"' if kept else "")


def _round(match: re.Match[str]) -> str:
    return _NUMBER.sub(_short, match.group())


def _path(match: re.Match[str]) -> str:
    text = " ".join(_NUMBER.sub(_short, match.group(1)).split())
    lines = _LINE.sub(_relative, text)
    return 'd="' + _COMMAND.sub(r"\1", lines).replace(" -", "-") + '"'


def _relative(match: re.Match[str]) -> str:
    """A long polyline as steps between the rounded corners, so that no error adds up: half the size."""
    corners = [[round(100 * float(x)) for x in pair.split()] for pair in match.group().split(" L ")]
    steps = [f"{(x1 - x0) / 100:g} {(y1 - y0) / 100:g}" for (x0, y0), (x1, y1) in pairwise(corners)]
    return f"{corners[0][0] / 100:.12g} {corners[0][1] / 100:.12g}l" + " ".join(steps)


def tidy(svg: str) -> str:
    """Rounds coordinates to 0.01 points, drops metadata and style sheets, names fonts to fall back to."""
    svg = _METADATA.sub("", _PROLOG.sub("", svg))
    sheet = _SHEET.search(svg)
    if sheet:  # a sheet would style the whole page that the picture stands in
        svg = _SHEET.sub("", svg).replace("<svg ", f'<svg style="{sheet.group(1)}" ', 1)
    svg = _FAMILY.sub("font-family: " + FONTS, _LEVEL.sub("", svg))
    svg = _USE.sub(_fill, svg)
    svg = _PLACE.sub(_round, _PATH.sub(_path, svg))
    return re.sub(r"\n\s*", "\n", svg).strip() + "\n"


def inline(svg: str, prefix: str, label: str) -> str:
    """The picture for use inside a page: ids of its own, and a label for screen readers."""
    svg = re.sub(r'\bid="', f'id="{prefix}-', svg)
    svg = re.sub(r'href="#', f'href="#{prefix}-', svg)
    svg = svg.replace("url(#", f"url(#{prefix}-")
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1).strip()
