import json
import re
from itertools import combinations
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from screwgauge.report.figures.chart import straight_samples, thin
from support.command import loaded_after
from support.pages import Picture
from support.report import _error_and_time, chart, looks_by_camp

HOSTILE = "<script>alert(1)</script> </script> \"quoted\" 'too' & \x1b[31m \u202e \ud800 ${x} {{y}} " + 300 * "w"


def texts(plot: Picture) -> list[str]:
    nodes = (node for node in ET.fromstring(plot.svg).iter() if node.tag.endswith("text"))
    return ["".join(node.itertext()) for node in nodes]


def drawn(curves: dict[str, Any], title: str = "A title", unit: str = "q [m]", **more: Any) -> Picture:
    t = np.linspace(0.0, 1.0, len(next(iter(curves.values()))))
    looks = looks_by_camp(curves)
    series = [
        ({"panel": "", "curve": name, "engine": name, "colour": looks[name].colour, "kind": "line"}, t, np.array(v))
        for name, v in curves.items()
    ]

    def build(moving: bool) -> chart.Spec:
        told = chart.ways("curve", looks) | chart.ways("engine", looks) | chart.columns(1)
        values = {**chart.curves(series, moving), "height": 100, "title": unit, "views": ["curves"], "y_scale": {}}
        return chart.fill_template("curves", **told, **values)

    return chart.picture("name", title, build, **more)


AWKWARD = ([0.46, 0.46 + 1e-9], [0.0, 0.0], [-3e-7, 2e-7], [1e9, 1.2e9], [np.nan, np.nan], [-np.inf, 5.0, 6.0], [7.0])


@pytest.mark.slow
@pytest.mark.parametrize("values", AWKWARD, ids=str)
def test_whatever_the_numbers_the_picture_is_well_formed_and_the_same_twice(values: list[float], caplog) -> None:
    plot = drawn({"screw": values}, notes=["how to read it"])
    assert plot == drawn({"screw": values}, notes=["how to read it"])
    assert {"A title", "how to read it", "q [m]", "t [s]", "screw"} <= set(texts(plot))
    assert not {"NaN", "nan", "Infinity", "inf"} & set(re.findall(r"\w+", plot.svg))
    json.loads(plot.chart, parse_constant=lambda sign: pytest.fail(sign))
    assert len(set(texts(plot))) > 6 or not np.isfinite(values).all()  # axes have ticks that differ
    assert not caplog.records


def test_texts_of_others_stay_texts() -> None:
    plot = drawn({HOSTILE: [0.0, 1.0], "screw": [1.0, 0.0]}, HOSTILE, HOSTILE, notes=[HOSTILE])
    nodes = list(ET.fromstring(plot.svg).iter())
    assert not [node.tag for node in nodes if "script" in node.tag or any(key.startswith("on") for key in node.attrib)]
    said = " ".join(texts(plot))
    assert said.count("<script>alert(1)</script>") >= 3
    assert said.count(300 * "w") >= 2  # nothing is cut
    chart_texts = json.dumps(json.loads(plot.chart), ensure_ascii=False)
    assert all(sign.isprintable() or sign == "\n" for sign in plot.svg + chart_texts)
    assert not re.search(r"fetch|https?://(?!vega\.github\.io/schema|www\.w3\.org)", plot.svg + plot.chart)


def test_a_chart_answers_and_its_still_picture_is_of_the_same_specification() -> None:
    plot = drawn({"screw": [0.0, 1.0], "mujoco": [1.0, 0.0]})
    live = json.loads(plot.chart)
    assert {param["name"]: param["bind"] for param in live["params"]} == {"zoom": "scales", "engines": "legend"}
    assert [param["value"] for param in live["params"][1:]] == [[{"engine": "screw"}, {"engine": "mujoco"}]]
    (asked,) = (layer["encoding"]["tooltip"] for layer in live["layer"] if "tooltip" in layer["encoding"])
    assert [item.get("title") for item in asked][:2] == ["t [s]", "q [m]"]
    assert "clip" not in plot.svg
    assert not re.search(r"\bid=", plot.svg)  # two in a page cannot be mixed up


def test_a_logarithmic_axis_has_decades_or_parts_of_them() -> None:
    assert chart.logarithm("y", [3e-15, 2e-3, 0.0, np.nan])["y_axis"]["values"] == pytest.approx(
        [1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4]
    )
    assert chart.logarithm("x", [0.01, 0.2])["x_axis"]["values"] == pytest.approx([0.01, 0.02, 0.05, 0.1, 0.2])
    assert chart.logarithm("x", [])["x_axis"]["values"] == [1.0]


@pytest.mark.parametrize("at", [0, 1, 4711, 9998, 10000])
def test_peaks_and_ends_survive(at: int) -> None:
    t = np.linspace(0.0, 10.0, 10001)
    v = np.sin(t)
    v[at] += 0.5
    some = thin(v, 60)
    assert at in some
    assert {0, 10000} <= set(some)
    assert len(some) <= 2 * 60 + 2
    assert np.abs(np.interp(t, t[some], v[some]) - np.sin(t))[np.abs(t - t[at]) > 0.4].max() < 0.08
    assert at in thin(np.abs(v - np.sin(t)), 120, lows=False)


def test_points_on_a_line_between_others_are_left_out() -> None:
    t = np.linspace(0.0, 10.0, 240)
    v = np.where(t < 5.0, np.sin(t), np.nan)
    v[200] = 7.0
    some = straight_samples(t, v, 0.01)
    assert {0, 200, 239} <= set(some)
    assert len(some) < 160
    assert np.array_equal(np.isnan(v), np.isnan(np.interp(t, t[some], v[some])))
    assert np.nanmax(np.abs(np.interp(t, t[some], v[some]) - v)) <= 0.01


def test_gaps_stay_gaps() -> None:
    v = np.sin(np.linspace(0.0, 10.0, 1001))
    v[300:400] = np.nan
    v[700] = np.nan  # one that has no stretch for itself
    some = thin(v, 60)
    assert 700 in some
    assert np.isnan(v[some[(some >= 300) & (some < 400)]]).all()
    assert np.isnan(v[thin(v, 60, lows=False)]).any()
    plot = drawn({"screw": v[some]})
    path = max(re.findall(r'<path[^>]* d="(M[^"]*)"[^>]*stroke="#0072B2"', plot.svg), key=len)
    assert path.count("M") == 3


def test_labels_beside_points_do_not_cover_each_other() -> None:
    places = 10.0 ** np.random.default_rng(3).uniform(-9, -3, (200, 2))
    points = [
        {"family": "screw", "x": x, "y": y, "label": f"setting {i}", "hollow": False, "joined": False}
        for i, (x, y) in enumerate(places)
    ]
    axes = "Title", "run time", "error [1]"
    others = [(1e-5, 1e-6, "Someone"), (1e-4, np.nan, "Quick"), (np.nan, 1e-8, "Exact")]
    plot = _error_and_time("name", axes, points, looks_by_camp(["screw"]), (), others)
    label = r'text-anchor="(\w+)"[^>]*translate\(([^,]+),([^)]+)\)[^>]*opacity="(\S+)"[^>]*>(?:setting|Someone)'
    found = re.findall(label, plot.svg)
    boxes = [(side, float(x), float(y)) for side, x, y, seen in found if float(seen) > 0.0]
    assert len(places) > len(boxes) > 15
    near = [abs(y - v) < 7.0 and abs(x - u) < 30.0 and s == r for (s, x, y), (r, u, v) in combinations(boxes, 2)]
    assert not any(near)
    assert {"Quick", "Exact", "published by others"} <= set(texts(plot))


def test_lines_of_a_camp_share_its_colour_and_differ_in_shape_and_dash() -> None:
    looks = looks_by_camp([f"mujoco {k}" for k in range(12)] + ["screw", "pinocchio"])
    assert len({look.colour for look in looks.values()}) == 3
    assert len({(look.colour, look.shape, look.dash) for look in looks.values()}) == 14


@pytest.mark.slow
def test_only_what_draws_imports_the_library() -> None:
    modules = ("results", "figures.chart", "figures.diagnosis", "figures.run", "pages.bench", "pages.stress")
    code = f"import screwgauge.commands, {', '.join(f'screwgauge.report.{name}' for name in modules)}"
    assert loaded_after(code, "vl_convert") == set()
