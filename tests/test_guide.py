"""What the pages say is so: their files, commands, code, output, links, keys, columns and options."""

import json
import re
import shlex
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import screwgauge
from screwgauge.engines.features import TASKS
from screwgauge.report.listing import listing
from support import guide
from support.command import GROUPS, main, parser, printed_by
from support.data import data
from support.engines import ENGINES, further_engines
from support.guide import FENCE, ROOT, blocks
from support.mechanism import load_mechanism
from support.models import read_loops, write_models

TEXTS = guide.pages()
README = TEXTS["README.md"]
#: Pages that people write, the casebook and the reports apart: as many words as somebody reads.
APART = ("reports", "harness/casebook", ".github")
WRITTEN = [page for page, text in TEXTS.items() if guide.MADE not in text and not page.startswith(APART)]
WORDS = 14_600
RUN = [page for page, text in TEXTS.items() if any(block.language in ("sh", "python") for block in blocks(text))]


def squeezed(text: str) -> str:
    return " ".join(text.split())


def block_with(beginning: str) -> str:
    found = {block.text for text in TEXTS.values() for block in blocks(text) if block.text.startswith(beginning)}
    return max(found, key=len)


def test_readme_is_short_and_documentation_is_no_book() -> None:
    assert len(README.splitlines()) < 150
    words = {page: len(re.findall(r"\w\S*", FENCE.sub("", TEXTS[page]))) for page in WRITTEN}
    assert sum(words.values()) <= WORDS, f"{sum(words.values())} words: {words}"


def test_readme_is_the_table_of_contents() -> None:
    linked = {target.partition("#")[0] for target in re.findall(r"\]\(([^)\s]+)\)", README)}
    assert {*TEXTS} - {"README.md"} <= linked


def test_what_the_python_page_refers_to_stands_on_it() -> None:
    page = TEXTS["harness/guide/python.md"]
    classes = dict(re.findall(r"^### ([A-Z]\w*)\n(.*?)(?=^### |\Z)", page, re.DOTALL | re.MULTILINE))
    referred = {*re.findall(r"`([A-Z][A-Za-z]*[a-z])\.([a-z]\w*)`", page)}
    assert ("Figure", "save") in referred
    assert [(one, name) for one, name in referred if f"- `.{name}" not in classes.get(one, "")] == []


def test_numbers_of_the_text_are_those_of_their_reports() -> None:
    paper = json.loads((ROOT / "reports/3ups-upu-s/summary.json").read_text(encoding="utf-8"))
    (share,) = re.findall(r"Inertia is (\S+ %) of actuator_force", paper["coverage"]["sentence"])
    assert f"inertia is {share} of its actuator forces" in squeezed(TEXTS["harness/guide/coverage.md"])
    lines = len(guide.shown_files()["four-bar.toml"].splitlines())
    for page in ("README.md", "harness/guide/tutorial-four-bar.md"):
        assert f"in {lines} lines" in squeezed(TEXTS[page])
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {screwgauge.__version__}\n" in cited


def test_first_two_commands_are_those_that_others_rely_on() -> None:
    first = next(blocks(README)).text
    assert [squeezed(line.partition(" #")[0]) for line in first.splitlines()] == [
        "python3 -m venv .venv && .venv/bin/pip install . && .venv/bin/screwgauge run",
        ".venv/bin/pip install '.[test]' && .venv/bin/pytest",
    ]


def test_pages_that_are_made_of_the_program_are_current() -> None:
    for path, text in guide.made().items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: run PYTHONPATH=tests python -m support.guide"


def test_every_dash_in_the_table_of_engines_has_a_reason() -> None:
    for engine in ENGINES.values():
        taken = {task.__name__ for task in engine.tasks}
        assert {*TASKS} - taken <= {*engine.refuses}, engine.name


@pytest.fixture
def engines_of_pages(inside, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, str(inside)])
    with further_engines({"absolute": "my_engine:ENGINE", "mytree": "tree_engine:ENGINE"}):
        yield inside


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN)
def test_commands_and_code_of_a_page_do_what_it_shows(page, engines_of_pages, no_progress) -> None:
    for each in guide.carried_out(TEXTS[page], engines_of_pages):
        assert not guide.missing(each.shown, each.printed), each.printed


def test_what_is_shown_and_not_printed_is_found() -> None:
    printed = "✗ DIFFER: in a word.\n\ninertia  coupler  inertia yy 0.0303 kg m^2\nclosure  d.1  4.4e-16  15.4\n"
    assert not guide.missing(printed.replace("in a word", "in other words"), printed)
    assert not guide.missing(printed.replace("4.4e-16  15.4", "1.1e-16  16.0"), printed)  # another processor
    assert guide.missing(printed.replace("✗ DIFFER", "✓ SAME"), printed) == ["✓ SAME"]
    assert guide.missing(printed.replace("0.0303", "0.0304"), printed) == ["0.0304"]
    assert guide.missing(printed.replace("d.1", "d.2"), printed) == ["d.2"]
    assert guide.missing(printed.replace("4.4e-16", "4.4e-6"), printed) == ["4.4e-6"]


@pytest.mark.slow
def test_the_notebook_runs(inside) -> None:
    script = guide.GUIDE / "notebook.py"
    names = {}
    exec(compile(script.read_text(encoding="utf-8"), str(script), "exec"), names)
    for name in ("scene", "results", "diagnosis"):
        assert len(repr(names[name])) < 4000
        assert "<table>" in names[name]._repr_html_()


@pytest.mark.campaign
@pytest.mark.parametrize("page", RUN)
def test_wording_of_a_page_is_what_commands_print(page, engines_of_pages, no_progress) -> None:
    """Compare word by word."""
    shown = guide.carried_out(TEXTS[page], engines_of_pages)
    assert not [piece for each in shown for piece in guide.other_wording(each.shown, each.printed)]


def test_readme_shows_what_pages_show() -> None:
    there = squeezed(" ".join(block.text for page in TEXTS if page != "README.md" for block in blocks(TEXTS[page])))
    for block in blocks(README):
        for piece in re.split(r"\.\.\.|\n", block.text) if block.language == "text" else ():
            assert squeezed(piece) in there, piece


def test_commands_that_are_shown_are_understood(capsys) -> None:
    for page, text in TEXTS.items():
        lines = [line for block in blocks(text) if not block.language for line in block.text.splitlines()]
        lines += re.findall(r"`(screwgauge [^`]*)`", FENCE.sub("", text))
        for line in lines:
            if not line.startswith("screwgauge ") or re.search(r"\[|\||\\$|\b[A-Z]{2,}\b", line.partition(" #")[0]):
                continue
            try:
                parser().parse_args(shlex.split(line.partition(" #")[0])[1:])
            except SystemExit:
                pytest.fail(f"{page}: {line}: {capsys.readouterr().err}")


def test_help_shows_every_command_in_its_group(capsys) -> None:
    assert main([]) == 2
    said = capsys.readouterr().out
    shown = re.findall(r"^  ([a-z]+)  ", said, re.MULTILINE)
    assert shown == [name for names in GROUPS.values() for name in names]
    assert {*shown} == {*guide.commands()}


#: What else an option takes: one file for what others make a folder of, one side for two, a viewer for versions.
OTHER_FORMS = {"import": {"-o", "--out", "--loops"}, "view": {"-o", "--out", "--pdf"}}


def test_an_option_has_one_name_and_takes_one_thing() -> None:
    forms: dict[str, dict[object, str]] = {}
    for name, command in guide.commands().items():
        for each in command._actions:
            for option in {*each.option_strings} - OTHER_FORMS.get(name, set()):
                forms.setdefault(option, {})[each.metavar, tuple(each.option_strings)] = name
    assert not {option: found for option, found in forms.items() if len(found) > 1}


@pytest.mark.slow
def test_help_is_quick_to_load() -> None:
    code = "import sys\nfrom screwgauge.cli import _parser\n_parser()\nprint(*sys.modules)"
    assert not {"numpy", "pandas", "scipy", "mujoco", "pinocchio"} & {*printed_by(code).split()}


def test_the_panda_differs_as_its_report_says() -> None:
    report = json.loads((ROOT / "reports/panda/diagnosis.json").read_text(encoding="utf-8"))
    said, table = block_with("✗ DIFFER: panda").split("share  class     cause")
    rounding = re.compile(r"\de-1\d")  # another processor leaves another one
    shown = rounding.sub("0", squeezed(said)).removesuffix(" ...")
    assert rounding.sub("0", f"✗ DIFFER: {report['verdict']}").startswith(shown)
    rows = re.findall(r"^ *(-?[\d.]+) %  (\w+) +(.*?)$", table, re.MULTILINE)
    assert len(rows) >= 3
    for share, family, sentence in rows:
        shown = squeezed(sentence).removesuffix(" ...")
        (cause,) = [each for each in report["causes"] if each["short"].startswith(shown)]
        assert cause["family"] == family
        assert float(share) == pytest.approx(100.0 * cause["share"], abs=0.05 if abs(float(share)) > 1 else 0.0005)


def test_the_panda_is_told_as_its_report_says() -> None:
    report = json.loads((ROOT / "reports/panda/diagnosis.json").read_text(encoding="utf-8"))
    text = squeezed(TEXTS["harness/guide/compare-two-files.md"])
    for side in "AB":
        assert report["models"][side]["file"] in text
    assert not [each for each in report["differences"] if each["what"] in ("placement", "axis", "end", "zero")]
    inertias = [np.array(each["b"]) for each in report["differences"] if each["what"] == "inertia"]
    assert all(np.abs(inertia / inertia[0, 0] - np.eye(3)).max() < 3e-3 for inertia in inertias)
    assert {round(inertia[0, 0], 3) for inertia in inertias} == {0.1, 0.2, 0.3}
    damping = [each["b"] / each["a"] for each in report["differences"] if each["what"] == "damping"]
    assert f"up to {max(damping):.0f} times" in text
    assert report["fix"]
    readers = pd.read_csv(ROOT / "reports/readers/readers.csv")
    assert f"[{len(readers.groupby(['source', 'model']))} public models]" in text


def test_reports_begin_with_what_was_found() -> None:
    first = TEXTS["reports/README.md"].partition("\n## ")[0]
    quoted = re.findall(r"\[([^]]*)\]\(([\w/-]+)/report\.md\)", first)
    reports = (ROOT / "reports").rglob("report.md")
    verdicts = {str(path.parent.relative_to(ROOT / "reports")): path.read_text(encoding="utf-8") for path in reports}
    assert {folder for _, folder in quoted} == {*verdicts}
    for text, folder in quoted:
        (verdict,) = re.findall(r"^> (.*)", verdicts[folder], re.MULTILINE)
        numbers = re.findall(r"\d+(?:\.\d+)?", re.sub(r"N = \d+|Tables .*", "", text))
        assert {*numbers} <= {*re.findall(r"\d+(?:\.\d+)?", verdict)}, (folder, text, verdict)


def test_no_report_says_where_it_was_made() -> None:
    texts = {path: path.read_text(encoding="utf-8") for path in (ROOT / "reports").glob("*/*.json")}
    assert len(texts) > 4
    assert not {path.parent.name: found for path, text in texts.items() if (found := re.findall(r'"/[^"\s]+"', text))}


def slug(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


@pytest.mark.parametrize("page", TEXTS)
def test_links_lead_somewhere(page) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", TEXTS[page]):
        if target.startswith("https://"):
            continue
        name, _, heading = target.partition("#")
        path = (ROOT / page).parent / name if name else ROOT / page
        assert path.exists(), f"{page}: {target}"
        if heading:
            headings = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in map(slug, headings), f"{page}: {target}"


@pytest.mark.parametrize("page", TEXTS)
def test_files_and_modules_that_are_named_exist(page) -> None:
    prose = FENCE.sub("", TEXTS[page])
    for path in re.findall(r"`((?:harness|reference|models)/[\w/.-]*)`", prose):
        assert (ROOT / path).exists(), path
    for module in re.findall(r"`(screwgauge(?:\.[a-z_]+)+)`", prose):
        assert find_spec(module), module


MECHANISM = data("any-keys.toml")
UNKNOWN = "unknown_one = 1"


def undocumented(call, path: Path, text: str) -> list[str]:
    with pytest.raises(screwgauge.ScrewgaugeError) as error:
        call(path)
    assert "unknown key 'unknown_one'" in str(error.value)
    known = error.value.remedy.split(": ", 1)[1].split(", ")
    words = {word for code in re.findall(r"`([^`]+)`", FENCE.sub("", text)) for word in re.findall(r"\w+", code)}
    return [key for key in known if key not in words]


@pytest.mark.parametrize(
    "entry",
    [
        {"top": UNKNOWN},
        {"top": f"spherical_axial = {{ {UNKNOWN} }}", "joint": "coordinates = ['a']"},
        {"body": UNKNOWN},
        {"inertia": f", {UNKNOWN}"},
        {"joint": UNKNOWN},
        {"joint": f"child_frame = {{ {UNKNOWN} }}"},
    ],
)
def test_every_key_of_a_mechanism_is_documented(entry, write) -> None:
    path = write("m.toml", MECHANISM.format(**{"top": "", "body": "", "inertia": "", "joint": "", **entry}))
    assert undocumented(load_mechanism, path, TEXTS["models/README.md"]) == []


@pytest.mark.parametrize("name", ["four-bar", "four-bar-full"])
def test_every_key_of_a_loops_file_is_documented(name, write, tmp_path) -> None:
    write_models(load_mechanism(write("four-bar.toml", guide.shown_files()["four-bar.toml"])), tmp_path)
    text = (tmp_path / f"{name}.loops.toml").read_text(encoding="utf-8")
    for bad in (f"{UNKNOWN}\n{text}", f"{text}{UNKNOWN}\n"):
        assert undocumented(read_loops, write(f"{name}.toml", bad), TEXTS["models/README.md"]) == []


@pytest.mark.parametrize("path", sorted(ROOT.glob("reports/**/*.csv")), ids=lambda path: str(path.relative_to(ROOT)))
def test_every_column_of_a_table_is_documented(path) -> None:
    columns = set(pd.read_csv(path, nrows=0).columns)
    passages = re.split(r"\n\n|\n(?=\|)", TEXTS["reports/README.md"])
    assert any(f"`{path.name}`" in text and columns <= set(re.findall(r"\w[\w-]*", text)) for text in passages)


def test_every_quantity_case_scene_and_engine_is_documented() -> None:
    texts = "".join(TEXTS.values())
    names = re.findall(r"^ {0,2}(\S+)  ", listing(None), re.MULTILINE)
    assert len(names) > 40
    assert [name for name in names if f"`{name}`" not in texts] == []
