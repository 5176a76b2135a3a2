import csv
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import screwgauge
from support import robots
from support.browser import Opened, open_page
from support.data import data
from support.errors import OutputError
from support.pages import Picture, Text, three_js
from support.pages import page as page_of
from support.report import print_page, run_page

#: Opens all that is folded.
UNFOLD = "document.querySelectorAll('details').forEach(fold => { fold.open = true; })"

PAPER = 703  # what is left of A4 between the margins [pixels]


@pytest.fixture(scope="module")
def results() -> screwgauge.Results:
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0, 0.5, 1.0])
    return screwgauge.run(replace(scene, figures=scene.figures[:2]), engines=["screw", "pinocchio"])


@pytest.fixture(scope="module")
def report(results: screwgauge.Results) -> list[Any]:
    return run_page.report(results, run_page.pictures(results))


@pytest.fixture(scope="module")
def opened(report: list[Any], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page_of(report), encoding="utf-8")
    with open_page(path, 1280, 800) as shown:
        yield shown


@pytest.fixture(scope="module")
def differing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a diagnosis."""
    folder = tmp_path_factory.mktemp("diagnosis")
    one, two = robots.write(folder)
    text = two.read_text(encoding="utf-8")
    two.write_text(re.sub(r' mass="', ' mass="1', text), encoding="utf-8")
    return screwgauge.diagnose(one, two).write(folder / "out") / "report.html"


@pytest.mark.slow
def test_a_page_that_asks_is_seen_and_not_served(opened: Opened) -> None:
    opened.ask("fetch('https://example.org/').catch(() => 0)")
    assert any("Content Security Policy" in text for text in opened.said)
    opened.said.clear()
    opened.asked[1:] = []


def test_the_first_screen_answers(opened: Opened) -> None:
    opened.at(1280)
    shown = "[...document.querySelectorAll('.front > .banner, .front > figure')].map(e => e.getBoundingClientRect())"
    assert opened.ask(f"{shown}.length") == 3  # verdict, curve, mechanism
    lowest = opened.ask(f"Math.max(...{shown}.map(box => box.bottom))")
    assert lowest < 800
    text = opened.ask("document.querySelector('.front').innerText")
    for said in ("✓ AGREE", "worst numbers", "digits", "SHA-256", "pinocchio", "date"):
        assert said in text


def seen(opened: Opened) -> str:
    shown = opened.ask(
        """() => {
          const { viewer } = document.querySelector('.moving.stage').shown;
          viewer.render();
          return viewer.renderer.domElement.toDataURL('image/png');
        }"""
    )
    return str(shown)


def test_the_mechanism_is_drawn_moved_and_turned(opened: Opened) -> None:
    opened.at(1280)
    before = seen(opened)
    assert len(before) > 10_000  # a blank one of that size takes less than 3000
    slider = opened.page.locator(".stage input[type=range]")
    slider.evaluate("s => { s.value = s.max; s.dispatchEvent(new Event('input', {bubbles: true})); }")
    assert "t = 1.000 s" in opened.page.locator(".stage output").inner_text()
    moved = seen(opened)
    assert moved != before
    box = opened.page.locator(".stage canvas").bounding_box()
    opened.page.mouse.move(box["x"] + 100, box["y"] + 100)
    opened.page.mouse.down()
    opened.page.mouse.move(box["x"] + 220, box["y"] + 130)
    opened.page.mouse.up()
    assert seen(opened) != moved


def test_plots_are_drawn_when_they_are_opened_and_engines_can_be_switched_off(opened: Opened) -> None:
    opened.at(1280)
    fold = opened.page.locator("details:has(figure)").first
    assert fold.locator(".moving").count() == 0
    fold.locator("summary").first.click()
    chart = fold.locator(".moving.chart svg").first
    chart.wait_for()
    assert not fold.locator("figure > svg").is_visible()
    shown = "svg => [...svg.querySelectorAll('path')].filter(p => p.getAttribute('opacity') === '0').length"
    before = chart.evaluate(shown)
    chart.get_by_text("pinocchio", exact=True).first.click()
    opened.page.wait_for_timeout(200)
    assert fold.locator(".moving.chart svg").first.evaluate(shown) > before


FIGURE = "figure:has(> svg[aria-label^='Relative angular displacements'])"


def saved(opened: Opened, near: str, form: str) -> str:
    opened.ask(UNFOLD)
    with opened.page.expect_download() as download:
        opened.page.locator(f"{near} button", has_text=form).first.click()
    assert download.value.suggested_filename.endswith(f".{form.lower()}")
    return Path(download.value.path()).read_text(encoding="utf-8-sig")


def test_a_table_is_saved_as_it_reads(opened: Opened) -> None:
    opened.at(1280)
    lines = [*csv.reader(saved(opened, "#judge ~ .save", "CSV").splitlines())]
    shown = opened.ask(
        """[...document.querySelectorAll('#judge ~ .scroll table')].slice(0, 1).flatMap(table =>
          [...table.rows].map(row => [...row.cells].map(cell => cell.textContent.replaceAll('\\u00a0', ' '))))"""
    )
    assert len(shown) > 4
    assert lines == shown


def test_a_chart_is_saved_as_points_with_units_and_as_a_picture(opened: Opened, results: screwgauge.Results) -> None:
    opened.at(1280)
    rows = [*csv.DictReader(saved(opened, FIGURE, "CSV").splitlines())]
    first = [row for row in rows if row["engine"] == "screw"]
    known = results.frame("joint_position")["screw"]
    for row in first:
        assert float(row["joint position [rad]"]) == pytest.approx(
            known.loc[float(row["t [s]"]), f"{row['panel'].replace(' ', '')}.{row['curve']}"], rel=1e-5, abs=1e-12
        )
    assert len(first) == 3 * len({(row["panel"], row["curve"]) for row in first}) > 9
    assert {row["pair"] for row in rows} > {"|screw - pinocchio|"}
    assert ElementTree.fromstring(saved(opened, FIGURE, "SVG")).tag.endswith("svg")


def test_no_cell_that_is_saved_is_a_formula(opened: Opened) -> None:
    text = "=HYPERLINK(1)"
    opened.ask(f"document.querySelector('#judge ~ .scroll td').textContent = '{text}'")
    assert f"'{text}," in saved(opened, "#judge ~ .save", "CSV")


def test_links_lead_to_what_is_then_open(opened: Opened) -> None:
    opened.at(1280)
    places = opened.ask("[...document.querySelectorAll('nav a, a.word')].map(a => a.hash.slice(1))")
    assert len(places) > 10
    assert (
        opened.ask("[...document.querySelectorAll('a')].filter(a => !document.getElementById(a.hash.slice(1))).length")
        == 0
    )
    opened.page.locator("nav a", has_text="Environment").click()
    opened.page.wait_for_function("document.getElementById('environment').closest('details').open")
    word = opened.page.locator("a.word").first
    word.focus()
    opened.page.keyboard.press("Enter")
    opened.page.wait_for_function("document.getElementById('glossary').closest('details').open")


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (1280, "dark"), (390, "light"), (390, "dark")])
def test_the_page_never_scrolls_sideways(opened: Opened, width: int, scheme: str) -> None:
    opened.at(width, color_scheme=scheme)
    opened.ask(UNFOLD)
    assert opened.ask("document.documentElement.scrollWidth") <= width
    bars = "[...document.querySelectorAll('figure, .scroll')].filter(e => e.scrollHeight > e.clientHeight).length"
    assert opened.ask(bars) == 0
    colour = opened.ask("getComputedStyle(document.body).backgroundColor")
    assert (colour == "rgb(255, 255, 255)") is (scheme == "light")


def test_a_phone_shows_every_table_whole(opened: Opened) -> None:
    opened.at(390)
    opened.ask(UNFOLD)
    cut = opened.ask(
        """[...document.querySelectorAll('.scroll')].filter(e => e.scrollWidth > e.clientWidth + 12)
          .map(e => e.textContent.slice(0, 80))"""
    )
    assert cut == []


def test_a_phone_shows_every_chart_whole(opened: Opened) -> None:
    with opened.beside(opened.path, 390, 844) as phone:
        phone.ask(UNFOLD)
        for figure in phone.page.locator("figure").all():
            figure.scroll_into_view_if_needed()
            figure.locator(".moving").wait_for()
        assert phone.page.locator("figure > .chart").count() > 2
        assert (
            phone.ask("Math.max(...[...document.querySelectorAll('figure')].map(e => e.scrollWidth - e.clientWidth))")
            <= 1
        )
        heights = "[...document.querySelectorAll('.chart text')].map(e => e.getBoundingClientRect().height)"
        assert min(filter(None, phone.ask(heights))) > 8  # letters that can be read [pixels]
        phone.check_quiet()


def test_causes_come_before_the_machine_and_both_sketches_fit_a_phone(opened: Opened, differing: Path) -> None:
    with opened.beside(differing, 1280, 900) as shown:
        causes, record = (
            shown.ask(f"document.querySelector('.front {place}').getBoundingClientRect().bottom")
            for place in (".scroll:not(.facts)", ".facts")
        )
        assert causes < min(record, 900)
        shown.at(390, 844)
        width = shown.ask("document.querySelector('svg.two').parentElement.getBoundingClientRect().right")
        parts = "[...document.querySelectorAll('svg.two > g')].map(e => e.getBoundingClientRect())"
        boxes = shown.ask(f"{parts}.map(box => [box.left, box.right, box.top, box.bottom])")
        assert len(boxes) == 3
        assert all(left >= 0.0 and right <= width for left, right, _, _ in boxes)
        assert all(above[3] <= below[2] for above, below in pairwise(boxes))


#: Words in tables that more than one line has a part of; digests may, which are no words.
BROKEN = data("broken-words.js")


@pytest.mark.parametrize(("width", "media"), [(PAPER, "print"), (390, "screen"), (1280, "screen")])
def test_no_word_of_a_table_is_broken_inside(opened: Opened, width: int, media: str) -> None:
    opened.at(width, 1000, media=media)
    opened.ask(UNFOLD)
    assert opened.ask(BROKEN) == []


def test_paper_has_everything_and_cuts_no_table(opened: Opened) -> None:
    opened.ask("document.querySelectorAll('details').forEach(fold => { fold.open = false; })")
    opened.at(PAPER, 1000, media="print")
    boxes = opened.ask(
        """[...document.querySelectorAll('table, dl, figure > svg')]
          .map(e => e.getBoundingClientRect()).map(box => [box.height, box.right])"""
    )
    assert all(height > 0 and right <= PAPER + 1 for height, right in boxes)
    assert opened.ask("[...document.querySelectorAll('.moving, .save')].filter(e => e.offsetHeight).length") == 0


def test_it_asks_for_nothing_and_says_nothing(opened: Opened) -> None:
    opened.check_quiet()


def test_a_page_of_paper_is_written_whole_or_not_at_all(
    opened: Opened, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    html, pdf = tmp_path / "report.html", tmp_path / "report.pdf"
    html.write_text(page_of([Text("A page", 1), Text("text")]), encoding="utf-8")
    print_page(html, pdf)
    assert pdf.read_bytes().startswith(b"%PDF")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "report.pdf"]
    monkeypatch.setenv("PATH", "")
    with pytest.raises(OutputError, match="none is found"):
        print_page(html, tmp_path / "other.pdf")


def test_three_js_is_cut_whole_out_of_what_carries_it(opened: Opened) -> None:
    opened.ask(f"new Function({json.dumps(three_js())}).call(window)")
    assert opened.ask("THREE.REVISION") == "140"
    assert opened.ask("typeof THREE.WebGLRenderer") == "function"


def test_a_page_with_three_js_holds_its_licence(opened: Opened) -> None:
    text = opened.path.read_text(encoding="utf-8")
    for said in ("The MIT License", "three.js authors", "Permission is hereby granted", 'PROVIDED "AS IS"'):
        assert said in text


def test_only_what_a_page_needs_is_put_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "screwgauge.report.html.MOVING", {"chart": lambda: "CHARTS", "stage": lambda: "STAGES</script>"}
    )
    still, chart, stage = (Picture("x", "x", "<svg ></svg>", **more) for more in ({}, {"chart": "{}"}, {"stage": "{}"}))
    texts = [page_of([picture]) for picture in (still, chart, stage)]
    assert [("CHARTS" in text, "STAGES" in text) for text in texts] == [(False, False), (True, False), (False, True)]
    assert "STAGES</script>" not in texts[2]


def test_what_data_say_ends_no_script() -> None:
    text = page_of([Picture("x", "x", "<svg ></svg>", stage=json.dumps({"title": "</script><script>alert(1)"}))])
    assert "<script>alert" not in text
