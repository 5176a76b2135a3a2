"""Diagrams are readable: axes fit what they show, awkward numbers are drawn all the same, mechanisms can be seen."""

from __future__ import annotations

import subprocess
import sys
from itertools import combinations
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from screwgauge.report.blocks import Picture
from screwgauge.report.figures.labels import beside, guide, place
from screwgauge.report.figures.page import Page, arrange, linear_scale, log_scale, panels, saved
from screwgauge.report.figures.style import MARKERS, Look, by_camp, styled

LOOK: Look = {"color": "#123456", "linestyle": (0, (2, 1)), "marker": "o"}


def texts(plot: Picture) -> list[str]:
    nodes = (node for node in ET.fromstring(plot.svg).iter() if node.tag.endswith("text"))
    return ["".join(node.itertext()) for node in nodes]


@styled
def drawn(x: object, y: object, *, log: bool = False, **look: object) -> Page:
    page = panels(400.0, [100.0])
    (ax,) = page.axes
    ax.plot(x, y, **look)
    (log_scale if log else linear_scale)(ax.yaxis)
    ax.set(xlabel="t [s]", ylabel="q [m]")
    arrange(
        page, "A <title> & more", ["how to read it"], ["what is missing"], [{"a": LOOK}], {"b": LOOK}, (), {"c": LOOK}
    )
    return page


def ticks(page: Page) -> list[tuple[float, str]]:
    """Places and names of the ticks that are seen."""
    (ax,) = page.axes
    low, high = ax.get_ylim()
    pairs = zip(ax.get_yticks(), ax.get_yticklabels(), strict=True)
    return [(float(at), label.get_text()) for at, label in pairs if low <= at <= high]


@pytest.mark.parametrize(
    "values",
    [[0.0, 1.0], [0.46, 0.46 + 1e-9], [0.0, 0.0], [-3e-7, 2e-7], [1e9, 1.2e9], [np.nan, np.nan], [-np.inf, 5.0], [7.0]],
)
def test_a_linear_axis_covers_its_values_with_ticks_that_differ(values: list[float]) -> None:
    page = drawn(range(len(values)), values)
    low, high = page.axes[0].get_ylim()
    finite = [v for v in values if np.isfinite(v)]
    assert all(low < v < high for v in finite)
    assert high - low > 0.99e-6 * max(map(abs, finite), default=0.0)  # what is smaller is rounding
    seen = ticks(page)
    assert 3 <= len(seen) <= 9
    assert len({name for _, name in seen}) == len(seen)
    for at, name in seen:
        number = float(name.replace("\N{MINUS SIGN}", "-"))
        assert number == pytest.approx(at, rel=1e-6, abs=1e-7 * (high - low))


def test_a_logarithmic_axis_has_decades_or_parts_of_them() -> None:
    errors = drawn(range(4), [3e-15, 2e-3, 0.0, np.nan], log=True)
    low, high = errors.axes[0].get_ylim()
    assert 1e-17 < low < 3e-15 < 2e-3 < high < 1
    assert [name for _, name in ticks(errors)] == ["1e-15", "1e-13", "1e-11", "1e-9", "1e-7", "1e-5", "1e-3"]
    assert [name for _, name in ticks(drawn(range(2), [0.01, 0.2], log=True))] == ["0.01", "0.02", "0.05", "0.1", "0.2"]


@styled
def test_whatever_the_numbers_the_picture_is_well_formed_and_the_same_twice() -> None:
    t = np.linspace(0.0, 1.0, 5)
    for v in (np.zeros(5), np.full(5, np.nan), np.array([1.0, np.nan, np.inf, -np.inf, 2.0])):
        pictures = []
        for _ in range(2):
            page = drawn(t, v, **LOOK)
            (ax,) = page.axes
            place(ax, [guide(ax, 0.5, "half & half", LOOK), beside((0.5, 0.5), "a < b", "#000000")])
            pictures.append(saved(page, "name"))
        said = {"A <title> & more", "half & half", "t [s]", "how to read it", "what is missing", "a", "b", "c"}
        assert said <= set(texts(pictures[0]))
        assert pictures[0] == pictures[1]
        assert not {"nan", "inf"} & set(pictures[0].svg.replace('"', " ").split())


def test_nothing_that_stands_around_the_axes_covers_anything_else() -> None:
    page = drawn([0.0, 1.0], [-1.23456, 9.87654], **LOOK)
    assert {"t [s]", "q [m]", "7.5"} <= {text.get_text() for text in page.figure.texts}
    boxes = [one.get_window_extent() for one in (*page.figure.texts, *page.figure.legends)]
    boxes.append(page.axes[0].bbox)
    for one, other in combinations(boxes, 2):
        assert not one.overlaps(other)
    assert all(page.figure.bbox.count_contains(box.corners()) == 4 for box in boxes)


@styled
def test_names_stand_at_outer_axes_only_and_no_objects_are_made_for_ticks() -> None:
    page = panels(400.0, [80.0, 80.0], 2, sharex=True, sharey=True)
    for ax in page.axes:
        ax.plot([0.0, 1.0], [2.0, 3.0])
    arrange(page, "title")
    words = texts(saved(page, ""))
    assert words.count("0.25") == 2  # below both columns
    assert words.count("2.5") == 2  # beside both rows
    for axis in (axis for ax in page.axes for axis in (ax.xaxis, ax.yaxis)):
        assert "majorTicks" not in vars(axis)  # matplotlib makes them as soon as they are asked for


@styled
def test_lines_of_a_camp_share_its_colour_and_differ_in_marker_and_dash() -> None:
    looks = by_camp([f"mujoco {k}" for k in range(12)] + ["screw", "pinocchio"])
    assert len({look["color"] for look in looks.values()}) == 3
    assert len({(look["color"], look["marker"], look["linestyle"]) for look in looks.values()}) == 14
    shapes = {saved(drawn([1.0], [1.0], linestyle="", marker=marker), "").svg for marker in MARKERS}
    assert len(shapes) == len(MARKERS)


def test_only_what_draws_imports_matplotlib() -> None:
    code = (
        "import sys, screwgauge.report.results, screwgauge.commands; "
        "from screwgauge.report.pages import bench, bench_simulation, paper, run, stress; "
        "print('matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
