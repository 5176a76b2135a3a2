import re
from collections.abc import Iterator
from html import escape
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from markdown_it import MarkdownIt

from support.data import data
from support.pages import (
    LONG,
    Banner,
    Block,
    Group,
    Items,
    Marked,
    Picture,
    Report,
    Table,
    Text,
    facts,
    fragment,
    markdown,
    number,
    page,
    prose,
    size,
    stage_script,
    table,
    terminal,
    three_js,
)
from support.scene import digits

ROWS = [
    {"engine": "screw", "case": "x", "max_abs": 1.25e-13, "ok": True},
    {"engine": "mujoco", "case": "y", "max_abs": float("nan"), "ok": False},
]
EVERYTHING: list[Block] = [
    Text("A <title>", 1),
    Banner("they agree", "✓ AGREE", "agree"),
    Text(Marked("some **bold**, *slanted* and `a < b` text")),
    Items(("one", "two")),
    Table(("name", "size"), (("a", "1e-3"),)),
    Group("folded", (Text("inside"),), "behind"),
]


def test_markdown_of_every_block() -> None:
    assert markdown(EVERYTHING).split("\n\n") == [
        "# A &lt;title&gt;",
        "> **✓ AGREE** they agree",
        "some **bold**, *slanted* and `a < b` text",
        "- one\n- two",
        "| name | size |\n| --- | ---: |\n| a | 1e-3 |",
        "<details>\n<summary>behind</summary>",
        "inside",
        "</details>\n",
    ]


def test_html_of_every_block() -> None:
    text = page(EVERYTHING)
    for piece in (
        "<title>A &lt;title&gt;</title>",
        '<div class="banner agree"><strong>✓ AGREE</strong> they agree</div>',
        "<p>some <strong>bold</strong>, <em>slanted</em> and <code>a &lt; b</code> text</p>",
        "<ul><li>one</li><li>two</li></ul>",
        '<td>a</td><td class="right">1e-3</td>',
        "<summary>behind</summary>\n<p>inside</p>",
    ):
        assert piece in text


def test_a_terminal_shows_plain_text() -> None:
    assert terminal(EVERYTHING).split("\n\n") == [
        "A <title>",
        "✓ AGREE: they agree",
        "some bold, slanted and a < b text",
        "- one\n- two",
        "name  size\na     1e-3",
        "behind:\ninside",
    ]


@pytest.mark.parametrize("text", ["f(*args, **kwargs)", "a*b*c", "2 * 3 * 4", "leg1.q1_dot_x", "x | y"])
def test_what_only_looks_like_markup_stays_as_it_is(text: str) -> None:
    assert terminal([Text(text)]) == text
    assert fragment([Text(text)]) == f"<p>{text}</p>"


HOSTILE = [
    "[click](javascript:alert(1)) ![x](http://example.org/x.png)",
    "<javascript:alert(1)> <img src=x onerror=alert(1)> &lt;b&gt; &#60;",
    "**bold** *slanted* `code` __bold__ _slanted_ ~~gone~~ ``two``",
    "[x]: javascript:alert(1)",
    "# heading #",
    "- item",
    "+ item",
    "1. item",
    "10) item",
    "===",
    "---",
    "> quote",
    "```html",
    "a | b \\| c \\",
    "\\*x\\* \\[x\\](y) \\",
    "line\n\n# heading\n\n<script>alert(1)</script>",
    "</summary></details><script>alert(1)</script>",
    "$x$ * 3 * leg1.q1_dot_x _",
    '" onload="alert(1)',
]


def shown(tokens) -> Iterator[str]:
    for token in tokens:
        yield from shown(token.children) if token.children else ()
        if token.type == "text":
            yield token.content
        elif token.type not in KNOWN and not token.type.endswith("_close"):
            yield f"<{token.type}>"


KNOWN = {"inline", "paragraph_open", "heading_open", "bullet_list_open", "list_item_open", "blockquote_open"}
KNOWN |= {f"{part}_open" for part in ("table", "thead", "tbody", "tr", "th", "td")}


@pytest.mark.parametrize("text", HOSTILE)
def test_text_is_text_in_markdown_whatever_it_contains(text: str) -> None:
    parser, said = MarkdownIt("gfm-like", {"linkify": False}), " ".join(text.split())
    for block in (Text(text, 2), Text(text), Banner(text), Items((text,)), Table((text,), ((text,),))):
        found = [piece for piece in shown(parser.parse(markdown([block]))) if piece]
        times = 2 if isinstance(block, Table) else 1
        assert "".join(found) == said * times, block
    picture = parser.parse(markdown([Picture("01-x", text, "")]))[1].children
    assert [(token.type, token.attrs.get("src")) for token in picture] == [("image", "plots/01-x.svg")]
    folded_ = "".join(token.content for token in parser.parse(markdown([Group("folded", (), text)])))
    assert re.findall(r"<(/?\w+)", folded_) == ["details", "summary", "/summary", "/details"]


@pytest.mark.parametrize("text", HOSTILE)
def test_text_is_text_in_html_and_on_a_terminal(text: str) -> None:
    assert fragment([Text(text)]) == f"<p>{escape(text, quote=False)}</p>".replace("\n", " ")
    assert terminal([Table(("", ""), (("a", text),))]) == f"a  {text}".replace("\n", " ").rstrip()
    svg = fragment([Picture("x", text, "<svg >")])
    assert re.findall(r'(\w[\w-]*)="', svg) == ["role", "aria-label"]


def test_what_steers_a_terminal_is_not_passed_on() -> None:
    text = "a\x1b[31mred\x9b2J\x07\u202eb\u2028c\udcff"
    for rendered in (terminal([Text(text)]), markdown([Text(text, 2)]), page([Text(text, 2), Banner(text)])):
        assert all(sign.isprintable() or sign == "\n" for sign in rendered)


def test_nothing_in_a_cell_can_break_a_page() -> None:
    text = fragment([Table(("a",), (("<script>alert(1)</script>",),)), Text("<b>", 2)])
    assert "<script>" not in text
    assert "<b>" not in text


def test_columns_are_named_and_formatted_by_their_keys() -> None:
    shown = table(ROWS, "engine | largest, 1 = all = max_abs | = ok")
    assert shown.head == ("engine", "largest, 1 = all", "")
    assert shown.body == (("screw", "1.2e-13", "✓ ok"), ("mujoco", "NaN", "✗ no"))
    assert shown.right == {1}


def test_a_cross_table_leaves_empty_what_there_is_not() -> None:
    shown = table(ROWS, "case || engine = max_abs")
    assert shown.head == ("case", "screw", "mujoco")
    assert shown.body == (("x", "1.2e-13", ""), ("y", "", "NaN"))


def test_columns_of_numbers_are_told_by_their_cells() -> None:
    cells = ("1.5", "-3e-12", "NaN", "12.3 µs", "9.1 ✗", "0.0 to 15.2", "refused", "", "-", "4.0 **silently wrong**")
    assert Table(("a", "b"), tuple((cell, "leg1") for cell in cells)).right == {0}
    assert Table(("a",), (("",),)).right == frozenset()


def test_facts_spread_what_is_nested_and_sort_yes_from_no() -> None:
    shown = facts(
        {"cores": 2, "packages": {"numpy": "2.4"}, "unique_forces": {"a": True, "b": False}, "load": ["1", "2"]}
    )
    assert isinstance(shown, Table)
    assert shown.body == (
        ("cores", "2"),
        ("packages: numpy", "2.4"),
        ("unique forces", "yes: a; no: b"),
        ("load", "1"),
        ("load", "2"),
    )
    assert facts({}) == Text("Not recorded.")


def test_prose_has_paragraphs_and_lists() -> None:
    assert prose("one\ntwo\n\n- a\n  b\n- c\n") == [Text("one two"), Items(("a b", "c"))]


def told(monkeypatch, tmp_path, n: int) -> Report:
    (tmp_path / f"kind-{n}.md").write_text(data("report-text.md"), encoding="utf-8")
    monkeypatch.setattr("screwgauge.report.layout.TEXTS", tmp_path)
    monkeypatch.setattr("screwgauge.report.layout._glossary", dict)
    rows = [{"name": f"row {k}", "size": k} for k in range(n)]
    values = {"worst": rows[:1], "about": {"of": "all"}, "said": "In a word.", "count": n, "many": n > 1, "rows": rows}
    values |= {"nothing": (), "rows that are not": [], "title": "A report"}
    fixed = {name: lambda found, value=value: value for name, value in values.items()}
    return Report(text=f"kind-{n}", banner=lambda found: Banner(found), data={}, values=fixed)


def test_a_text_is_filled_in(monkeypatch, tmp_path) -> None:
    text = markdown(told(monkeypatch, tmp_path, LONG + 2).blocks("found", record={"cpu": "old"}))
    lines = [line for line in text.splitlines() if line]
    assert lines[:2] == ["# A report", "> found"]
    for line in (
        "| of | all |",
        "| cpu | old |",
        f"## Prose with {LONG + 2}",
        "They are **many**.",
        "Nothing was found.",
    ):
        assert line in lines
    assert "- Always.\n- Only of many, as it seems.\n- After all.\n" in text
    assert "few." not in text
    assert "Left out" not in text
    assert "In a word." not in text
    shown, rest = text.split("<summary>2 more lines</summary>")
    assert f"| row {LONG - 1} | {LONG - 1} mm |" in shown
    assert f"| row {LONG} | {LONG} mm |" in rest


def test_a_text_says_what_there_is_none_of(monkeypatch, tmp_path) -> None:
    report = told(monkeypatch, tmp_path, 0)
    text = markdown(report.blocks("found"))
    assert "They are few.\n\nNone.\n" in text
    assert "more lines" not in text
    assert terminal(report.terminal("found")) == "In a word.\n\n- Always.\n- Only of few.\n- After all."


def test_a_terminal_wraps_text_that_is_too_wide_and_cuts_no_number() -> None:
    said = " ".join(["word"] * 40)
    body = (("a", "1.234567890123e-12", said), ("b", "2", "x"))
    lines = terminal([Table(("what", "value", "of"), body)]).splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[1].startswith("a     1.234567890123e-12  word word")
    assert " ".join(lines).count("word") == 40


def test_a_terminal_names_the_columns_that_it_has_no_room_for() -> None:
    head, numbers = [f"n{i}" for i in range(12)], [f"{i}.123456789" for i in range(12)]
    lines = terminal([Table(tuple(head), (tuple(numbers),))]).splitlines()
    assert lines[1].split() == numbers[:7]
    assert lines[-1] == f"(in the report only: {', '.join(head[7:])})"


def test_a_table_that_is_too_wide_for_a_phone_names_its_cells_and_no_other_does() -> None:
    heads = tuple(f"a long head {k}" for k in range(9))
    assert "data-head" not in fragment([Table(("a", "b"), (("x", "1"),))])
    assert '<td data-head="a long head 8">some text</td>' in fragment([Table(heads, (("some text",) * 9,))])


def test_names_in_cells_may_break_at_their_signs_and_numbers_nowhere() -> None:
    cell = fragment([Table(("a", "b"), (("joint_acceleration of left.elbow @ 1.96 s", "at most 2e-08 by screw"),))])
    assert "joint_<wbr>acceleration of left.<wbr>elbow @ 1.96\N{NO-BREAK SPACE}s" in cell
    assert '<span class="number">2e-08</span>' in cell


def test_numbers_read_well() -> None:
    assert [number(x) for x in (0.0, 1.25, 1e-11, 1234567.0, np.nan)] == [
        "0",
        "1.25",
        "1e-11",
        "1.23457e6",
        "NaN",
    ]
    shown = [size(x) for x in (0.0, 3.14e-13, 1.26, 12.3, np.nan, np.inf)]
    assert shown == ["0", "3.1e-13", "1.3", "12", "NaN", "inf"]
    assert [digits(x) for x in (0.0, 1e-30, 1e-3, 5.0)] == [17.0, 17.0, pytest.approx(3.0), 0.0]
    assert np.isnan(digits(np.nan))


def test_cells_cannot_break_a_table() -> None:
    assert markdown([Table(("a",), (("x | <y>\nz",),))]).splitlines()[-1] == "| x \\| &lt;y&gt; z |"


@pytest.mark.parametrize("content", [None, "a page without it"])
def test_without_three_js_the_still_picture_stays(
    content: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive = tmp_path / "viewer.zip"
    if content:
        with ZipFile(archive, "w") as viewer:
            viewer.writestr("viewer.html.template", content)
    monkeypatch.setattr("screwgauge.report.html.viewer_archive", lambda: archive)
    assert three_js() == ""
    assert "contains no three.js" in stage_script()


@pytest.mark.parametrize("added", ["alert(1);", " "])
def test_a_three_js_that_nobody_read_is_not_put_into_pages(
    added: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    changed = three_js().replace("*/", f"*/{added}", 1)
    assert "THREE" in stage_script()
    archive = tmp_path / "viewer.zip"
    with ZipFile(archive, "w") as viewer:
        viewer.writestr("viewer.html.template", f"<script>{changed}</script>")
    monkeypatch.setattr("screwgauge.report.html.viewer_archive", lambda: archive)
    assert three_js() == changed
    assert "a three.js version that" in stage_script()
    assert len(stage_script()) < 1000
