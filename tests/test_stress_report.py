"""The report of stress."""

import json
import math
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest

from screwgauge.report.pages.stress import PAGE, headline, inks, make_plots
from support.pages import Banner, markdown, walk
from support.report import CROSS, SHAPES
from support.stress import GOOD, Finding, Stress, StressCase

ENGINES = ("screw", "pinocchio", "mujoco", "mujoco RK4", "mujoco Euler")


def case(name: str, *, falling: bool = False) -> StressCase:
    return StressCase(
        name, f"Title of {name}", "severity [m]", "About it.", "force", 0.0, 1e9, (), (),
        lambda severity, quick, folder: [], falling=falling,
    )  # fmt: skip


@pytest.fixture
def found() -> Stress:
    # screw is good, pinocchio says so, mujoco refuses, its settings are silent

    def row(name: str, severity: float, engine: str, quantity: str) -> Finding:
        kind = ENGINES.index(engine)
        error = (1e-15, severity * 1e-10, math.nan, severity * 1e-9, severity * 1e-8)[kind]
        admitted = 1.0 if kind == 1 else GOOD
        finding = Finding(quantity, a=engine, error=error, tolerance=admitted, own=engine == "screw")
        return replace(finding, reason="why" if kind > 1 else "", case=name, severity=severity)

    rows = [
        row(name, severity, engine, quantity)
        for name in ("rising", "falling")
        for severity in (0.0, 1.0, 10.0, 1e5)
        for engine in ENGINES
        for quantity in ("force", "motion")
    ]
    return Stress((case("rising"), case("falling", falling=True)), tuple(rows), {})


def test_the_page_names_every_case_engine_setting_and_verdict(found: Stress) -> None:
    _, plot = make_plots(found)
    texts = ["".join(node.itertext()).strip() for node in ET.fromstring(plot.svg).iter() if node.tag.endswith("text")]
    for name in ("Title of rising", "Title of falling", "severity [m]"):
        assert name in texts
    for name in ENGINES:
        assert texts.count(name) == 2  # below each plot
    for words in ("degraded", "refused", "silently wrong"):
        assert words in " ".join(texts)
    assert {"0", "1", "1e4"} <= set(texts)  # decades of the axis, zero before them


def test_the_first_picture_counts_cases_by_their_worst_verdict(found: Stress) -> None:
    worst, _ = make_plots(found)
    nodes = [node for node in ET.fromstring(worst.svg).iter() if node.tag.endswith("text")]
    texts = ["".join(node.itertext()).strip() for node in nodes]
    assert {"screw", "pinocchio", "mujoco", "silently wrong"} <= set(texts)
    assert "mujoco RK4" not in texts  # a setting of mujoco
    asked = {(row["who"], row["case"]) for row in json.loads(worst.chart)["data"]["values"]}
    counts = [text for text, node in zip(texts, nodes, strict=True) if node.attrib.get("font-weight") == "bold"]
    assert sum(int(text) for text in counts if text.isdigit()) == len(asked)


def test_verdicts_differ_in_more_than_colour(found: Stress) -> None:
    _, plot = make_plots(found)
    marks = [node for node in ET.fromstring(plot.svg).iter() if node.attrib.get("aria-roledescription") != "x"]
    shapes = {(node.attrib["d"], node.attrib.get("fill")) for node in marks if "d" in node.attrib}
    (panel, _) = json.loads(plot.chart)["concat"]
    told = {row["verdict"] for row in panel["data"]["values"]}
    assert len(told) == 4
    assert {fill for _, fill in shapes} >= {"white", "#0072B2"}  # hollow and full
    encoding = panel["layer"][-1]["encoding"]
    assert {item["value"] for item in encoding["shape"]["condition"]} == {CROSS, "square"}
    assert all(row["y"] < 0.0 for row in panel["data"]["values"] if row["kept"] is None)


def test_settings_of_an_engine_share_its_colour_and_nothing_else() -> None:
    looks, other = inks([ENGINES, ("paper Euler", *(f"mujoco {k}" for k in range(12)))])
    assert list(looks) == list(ENGINES)
    assert len({look.colour for name, look in looks.items() if name.startswith("mujoco")}) == 1
    assert len({(look.colour, look.shape, look.dash) for look in looks.values()}) == len(ENGINES)
    assert len({look.colour for look in looks.values()}) == 3
    twelve = [(look.shape, look.dash) for name, look in other.items() if name.startswith("mujoco")]
    assert len(set(twelve)) == 12 > len(SHAPES)


def test_the_headline_counts_engines_without_their_settings(found: Stress) -> None:
    text = headline(found)
    assert "mujoco in 2 of 2 cases (worst in rising, starting at severity [m] = 1)" in text
    assert "(screw) never" in text


def test_numbers_that_are_wrong_in_silence_are_no_good_news(found: Stress) -> None:
    def status(stress: Stress) -> str:
        return next(block.status for block in walk(PAGE.blocks(stress)) if isinstance(block, Banner))

    own = tuple(replace(row, own=row.engine == "mujoco RK4") for row in found.rows)
    quiet = tuple(row for row in found.rows if "mujoco " not in row.engine)
    assert [status(replace(found, rows=rows)) for rows in (found.rows, own, quiet)] == ["differ", "failed", "agree"]


def test_the_report_says_where_each_engine_breaks_first(found: Stress) -> None:
    text = markdown(PAGE.blocks(found))
    assert "| rising | screw | 15.0 |  |  |  |" in text
    assert "| rising | pinocchio | 5.0 to 17.0 | 1e5 |  |  |" in text
    assert "| falling | mujoco |  |  | 1e5 |  |" in text
    assert "| rising | mujoco RK4 | 4.0 to 17.0 |  |  | 10 |" in text


def test_each_cause_is_said_once_for_a_case_and_engine(found: Stress) -> None:
    text = markdown(PAGE.blocks(found))
    silent = text.split("## Silently wrong")[1].split("\n## ")[0]
    assert silent.count("| rising | mujoco RK4 | force, motion |") == 1
    assert silent.count("| why |") == 4
