"""Figures for a paper: plain curves in the width, font and font size of the paper."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from textwrap import wrap

from screwgauge.reference.errors import DescriptionError, ReportError, quote
from screwgauge.reference.outputs import check_free, save_file
from screwgauge.report.blocks import Picture
from screwgauge.report.figures.chart import GAP, Spec, still_parts
from screwgauge.report.figures.renderer import RENDERER

POINTS = {"pt": 1.0, "in": 72.0, "cm": 72.0 / 2.54, "mm": 7.2 / 2.54}
ENDINGS = (".pdf", ".png", ".svg")
DRAFTS = 4  # number of drafts of a chart; each one measures the width of axes and legends
NARROW = 110.0  # smallest width of a panel [pt]
KEPT = ("$schema", "data", "transform", "params", "facet", "spec", "encoding", "layer", "width")  # of a chart
#: Font -> the font, and fonts with equal letter widths that replace it if it is not installed.
ALIKE = {
    "Times": "Times, Times New Roman, Nimbus Roman, TeX Gyre Termes, Liberation Serif, serif",
    "Helvetica": "Helvetica, Arial, Nimbus Sans, Liberation Sans, sans-serif",
}


class Figure(Picture):
    """Picture that can be saved for a paper, created by `Results.figure` and `Results.plot`."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"Figure {self.name}: {self.title}"

    def save(
        self,
        path: str | Path,
        *,
        width: str = "8.5cm",
        font: str = "Helvetica",
        size: float = 8,
        dpi: int = 600,
        force: bool = False,
    ) -> Path:
        """Write the figure for a paper: only the curves of a chart, without title, differences, tolerance or marks.

        Args:
            path: Path that ends with ``.pdf``, ``.png`` or ``.svg``.
            width: Width in cm, mm, in or pt.
            font: Times, Helvetica, or an installed font. Drawings of mechanisms have a fixed font.
            size: Font size [pt].
            dpi: Dots per inch of a PNG.
            force: Replace an existing file, whatever its origin.

        Raises:
            ScrewgaugeError: The figure cannot be drawn in this style, or the file cannot be written.
        """
        check_ending(path := Path(path))
        check_free(path, force=force)
        if self.lost:
            raise ReportError(f"{self.title} could not be drawn ({self.lost})", str(path), "draw it again")
        if not (4 <= size <= 72 and 30 <= dpi <= 2400):
            what = f"font size {size} pt or resolution {dpi} dpi is out of range"
            raise DescriptionError(what, "figure", "use 4 to 72 pt and 30 to 2400 dpi")
        spec, svg = json.loads(self.chart or "{}"), self.svg
        if {"layer", "facet", "vconcat"} & spec.keys():
            svg = _draw(spec, points_of_width(width), _with_fallbacks(font), size)
        return save_file(path, picture_file(svg, path.suffix, width, dpi), force=force)


def picture_file(svg: str, ending: str, width: str, dpi: int) -> str | bytes:
    """Convert an SVG to the content of an SVG, PDF or PNG file with a width such as ``8.5cm``."""
    if ending == ".svg":
        return scale_svg(svg, points_of_width(width), "pt")
    call, more = ("svg_to_pdf", {}) if ending == ".pdf" else ("svg_to_png", {"ppi": dpi})
    return bytes(RENDERER.ask(call, scale_svg(svg, points_of_width(width)), **more))


def check_ending(path: Path, known: Iterable[str] = ENDINGS, where: str = "figure") -> None:
    """Reject a file whose extension is not in `known`."""
    if path.suffix not in known:
        raise DescriptionError(
            f"cannot write {path.name}", where, f"choose a file name that ends with {' or '.join(known)}"
        )


def points_of_width(width: str) -> float:
    """Convert a width such as ``8.5cm`` to points.

    Raises:
        DescriptionError: The string is not a width, or the width does not fit a page.
    """
    found = re.fullmatch(r" *(\d+(?:\.\d*)?) *(pt|in|cm|mm) *", width) if isinstance(width, str) else None
    points = float(found[1]) * POINTS[found[2]] if found else 0.0
    if not 50.0 <= points <= 3000.0:
        raise DescriptionError(f"{quote(width)} is not a width for a figure", "figure", 'use cm, mm, in or pt: "8.5cm"')
    return points


def scale_svg(svg: str, wide: float, unit: str = "") -> str:
    """Scale an SVG to a width; converters to PDF and PNG read a width without unit as points."""
    head, end, tail = svg.partition(">")
    w, h = (float(re.findall(rf'\b{name}="([\d.]+)"', head)[0]) for name in ("width", "height"))
    box = "" if "viewBox" in head else f' viewBox="0 0 {w:g} {h:g}"'
    head = re.sub(r' (width|height)="[\d.]+"', "", head)
    return f'{head}{box} width="{wide:.2f}{unit}" height="{wide * h / w:.2f}{unit}"{end}{tail}'


def _with_fallbacks(font: str) -> str:
    """Add fallback fonts, since text in a missing font would disappear."""
    if font in ALIKE:
        return ALIKE[font]
    name = re.fullmatch(r"[\w -]{1,80}", font)
    probe = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><text y="9" font-family="{font}">a</text></svg>'
    )
    if not name or b"/BaseFont" not in bytes(RENDERER.ask("svg_to_pdf", probe)):
        raise DescriptionError(
            f"font {quote(font)} is not installed", "figure", f"choose an installed font, or {' or '.join(ALIKE)}"
        )
    return font


def _draw(spec: Spec, wide: float, font: str, size: float) -> str:
    """Draw a chart's curves as an SVG with a given width [pt]; drafts show how much space axes and legends need."""
    view = _curves(spec, wide, font, size)
    panel, svg = view.get("spec", view), ""
    axis = panel.get("encoding", view.get("encoding"))["y"]
    axis["title"] = wrap(axis["title"], 20)
    least = 0.5 * size * max(map(len, axis["title"]))  # keeps titles of panels from overlapping
    for _ in range(DRAFTS):
        panel["height"] = max(0.6 * panel["width"], least)
        svg = RENDERER.ask("vegalite_to_svg", json.dumps(still_parts(view)))
        over = float(re.findall(r'\bwidth="([\d.]+)"', svg)[0]) - wide
        if abs(over) < 1.0:
            break
        panel["width"] -= over / view["columns"]
    return str(svg[svg.index("<svg ") :])


def _curves(spec: Spec, wide: float, font: str, size: float) -> Spec:
    """Reduce a chart's specification to its curves (or the contour plot), axes and legends, in the style of a paper."""
    view, texts = {**spec, **spec.get("vconcat", [{}])[0]}, {"labelFontSize": size, "titleFontSize": size}
    config = {key: {**part, **texts} for key, part in spec["config"].items() if isinstance(part, dict)}
    config["axis"] |= {"grid": False, "domainColor": "black", "tickColor": "black"}
    config["line"]["strokeWidth"] = 1.0
    panel = view.get("spec", view)
    if panel["layer"][0]["mark"]["type"] == "rect":  # a contour plot keeps its cells and lines
        panel["layer"][0]["encoding"]["color"]["legend"]["gradientLength"] = 0.35 * wide
        kept = {key: view[key] for key in KEPT if key in view}
        return {**kept, "columns": 1, "width": 0.8 * wide, "config": {**config, "font": font, "padding": 1}}
    panel["layer"] = [layer for layer in panel["layer"] if layer["mark"]["type"] == "line"]
    channels = [panel["layer"][0]["encoding"][name] for name in ("color", "strokeDash")]
    entry = 0.6 * size * max(map(len, channels[0]["scale"]["domain"])) + 40.0
    for channel in channels:
        channel["legend"]["columns"] = max(1, int((wide - 6.0 * size) / entry))
    n = max(1, min(view.get("columns", 1), int(wide / NARROW)))
    panel["width"] = (wide - (n - 1) * GAP) / n
    kept = {key: view[key] for key in KEPT if key in view}
    return {**kept, "columns": n, "config": {**config, "font": font, "padding": 1}}
