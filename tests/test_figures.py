"""Diagrams are data: axes fit what they show, awkward numbers are drawn all the same, and mechanisms can be seen."""

from __future__ import annotations

import subprocess
import sys
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from screwgauge import load_scene
from screwgauge.report.figures.axes import linear, log
from screwgauge.report.figures.data import Axis, Diagram, Guide, Label, Look, Panel, Row, Series
from screwgauge.report.figures.looks import MARKERS, by_camp
from screwgauge.report.figures.mechanism import KINDS, mechanism_figure
from screwgauge.report.figures.render import render


def texts(diagram: Diagram) -> list[str]:
    return [node.text or "" for node in ET.fromstring(render(diagram)).iter() if node.tag.endswith("text")]


def one_panel(x: Axis, y: Axis, *series: Series, **more: object) -> Diagram:
    return Diagram("A <title> & more", (Row((Panel(x, y, series, **more),), 100.0),), 400.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "values",
    [[0.0, 1.0], [0.46, 0.46 + 1e-9], [0.0, 0.0], [-3e-7, 2e-7], [1e9, 1.2e9], [np.nan, np.nan], [-np.inf, 5.0], [7.0]],
)
def test_a_linear_axis_covers_its_values_with_ticks_that_differ(values: list[float]) -> None:
    axis = linear("q [m]", [np.array(values)])
    finite = [v for v in values if np.isfinite(v)]
    assert all(axis.low < v < axis.high for v in finite)
    assert 3 <= len(axis.ticks) <= 9
    names = [name for _, name in axis.ticks]
    assert len(set(names)) == len(names)
    for at, name in axis.ticks:
        assert axis.low <= at <= axis.high
        assert float(name.replace("\N{MINUS SIGN}", "-")) == pytest.approx(
            at, rel=1e-6, abs=1e-7 * (axis.high - axis.low)
        )


def test_a_logarithmic_axis_has_decades_or_parts_of_them() -> None:
    errors = [np.array([3e-15, 2e-3, 0.0, np.nan])]
    assert log("e", errors).low == pytest.approx(1e-15)
    assert log("e", errors).high == pytest.approx(1e-2)
    assert [name for _, name in log("e", errors).ticks] == ["1e-15", "1e-13", "1e-11", "1e-9", "1e-7", "1e-5", "1e-3"]
    steps = log("h [s]", [np.array([0.01, 0.2])], whole=False)
    assert [name for _, name in steps.ticks] == ["0.01", "0.02", "0.05", "0.1", "0.2"]
    assert np.isnan(steps.share(np.array([-1.0, 0.0]))).all()
    assert steps.share(steps.high) == pytest.approx(1.0)


def test_whatever_the_numbers_the_picture_is_well_formed_and_the_same_twice() -> None:
    t = np.linspace(0.0, 1.0, 5)
    for v in (np.zeros(5), np.full(5, np.nan), np.array([1.0, np.nan, np.inf, -np.inf, 2.0])):
        look = Look("#000000", (2.0, 1.0), marker="o")
        more = {"guides": (Guide(0.5, look, "half & half"),), "labels": (Label(0.5, 0.5, "a < b", "#000000"),)}
        diagram = one_panel(linear("t [s]", [t]), linear("v", [v]), Series(t, v, look), **more)
        assert {"A <title> & more", "half & half", "t [s]"} <= set(texts(diagram))
        assert render(diagram) == render(diagram)
        assert not {"nan", "inf"} & set(render(diagram).replace('"', " ").split())


def test_a_single_sample_is_seen() -> None:
    one = np.array([1.0])
    svg = render(one_panel(linear("t", [one]), linear("v", [one]), Series(one, one, Look("#123456"))))
    assert 'fill="#123456"' in svg


def test_lines_of_a_camp_share_its_colour_and_differ_in_marker_and_dash() -> None:
    looks = by_camp([f"mujoco {k}" for k in range(12)] + ["screw", "pinocchio"])
    assert len({look.colour for look in looks.values()}) == 3
    assert len({(look.colour, look.marker, look.dash) for look in looks.values()}) == 14
    axis, point = linear("", []), np.ones(1)
    shapes = {render(one_panel(axis, axis, Series(point, point, Look("", None, marker=marker)))) for marker in MARKERS}
    assert len(shapes) == len(MARKERS)


@pytest.mark.parametrize("name", ["3ups-upu-s", "a02-fourbar-2", "a04-bricard-box", "a05-governor", "a01-pendulum"])
def test_the_picture_of_a_mechanism_names_its_bodies_and_kinds_of_joints(name: str) -> None:
    mechanism = load_scene(name).mechanism
    words = texts(mechanism_figure(mechanism))
    assert {body.name for body in mechanism.bodies} <= set(words)
    assert {KINDS[joint.kind] + ", actuated" * joint.actuated for joint in mechanism.joints} <= set(words)


def test_drawing_needs_no_matplotlib() -> None:
    code = (
        "import sys; from screwgauge import load_scene; from screwgauge.report.figures.render import render; "
        "from screwgauge.report.figures.mechanism import mechanism_figure as figure; "
        "import screwgauge.report.plots, screwgauge.report.bench.drawing, screwgauge.report.stress.drawing; "
        "print(render(figure(load_scene('a01-pendulum').mechanism))[:4], 'matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "<svg False"
