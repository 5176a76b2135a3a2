"""Makes the SVG that matplotlib writes small, free of outside references, and fit to stand in a page."""

from __future__ import annotations

import re
from html import escape

FONTS = "'DejaVu Sans', Verdana, 'Segoe UI', Helvetica, Arial, sans-serif"

_PROLOG = re.compile(r"<\?xml.*?\?>\s*|<!DOCTYPE.*?>\s*|<!--.*?-->\s*", re.DOTALL)
_METADATA = re.compile(r"\s*<metadata>.*?</metadata>", re.DOTALL)
_SHEET = re.compile(r'\s*<defs>\s*<style type="text/css">\*\{(.*?)\}</style>\s*</defs>', re.DOTALL)
_FAMILY = re.compile(r"font-family: [^;\"]*")
_LEVEL = re.compile(r' transform="rotate\(-?0 [^)]*\)"')
_PATH = re.compile(r'\bd="([^"]*)"')
_PLACE = re.compile(r'\b(?:x|y|width|height)="-?\d+\.\d{3,}"|(?:translate|rotate)\([^)]*\)')
_NUMBER = re.compile(r"-?\d+\.\d+(?:e[-+]?\d+)?")
_COMMAND = re.compile(r" ?([MLQCz]) ?")


def _short(match: re.Match[str]) -> str:
    text = f"{float(match.group()):.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _round(match: re.Match[str]) -> str:
    return _NUMBER.sub(_short, match.group())


def _path(match: re.Match[str]) -> str:
    text = " ".join(_NUMBER.sub(_short, match.group(1)).split())
    return 'd="' + _COMMAND.sub(r"\1", text) + '"'


def tidy(svg: str) -> str:
    """Rounds coordinates to 0.01 points; drops metadata, comments and style sheets; names fonts to fall back to."""
    svg = _METADATA.sub("", _PROLOG.sub("", svg))
    sheet = _SHEET.search(svg)
    if sheet:  # a sheet would style the whole page that the picture stands in
        svg = _SHEET.sub("", svg).replace("<svg ", f'<svg style="{sheet.group(1)}" ', 1)
    svg = _FAMILY.sub("font-family: " + FONTS, _LEVEL.sub("", svg))
    svg = _PLACE.sub(_round, _PATH.sub(_path, svg))
    return re.sub(r"\n\s*", "\n", svg).strip() + "\n"


def inline(svg: str, prefix: str, label: str) -> str:
    """The picture for use inside a page: ids of its own, and a label for screen readers."""
    svg = re.sub(r'\bid="', f'id="{prefix}-', svg)
    svg = re.sub(r'href="#', f'href="#{prefix}-', svg)
    svg = svg.replace("url(#", f"url(#{prefix}-")
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1).strip()
