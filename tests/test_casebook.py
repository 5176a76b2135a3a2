import re
import string
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.casebook import book
from screwgauge.casebook.book import CASES, Case
from screwgauge.diagnosis.properties import PROPERTIES
from support.models import write_models
from support.report import verdict

ROOT = Path(__file__).parents[1]
README = (ROOT / "harness/casebook/README.md").read_text(encoding="utf-8")
PARTS = {"symptom", "expected", "mended", "said"}
CASE = Case("x", "it is wrong", ("mujoco",), "it is {symptom}", "of that", "do so: {mended}", "MuJoCo 1")
TRIED = replace(CASE, shown=(("3.6.0",), ("3.10.0",)), not_shown=(("3.3.0",), ("4.0.0",)))


def placeholders(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name is not None}


@pytest.mark.parametrize("name", CASES)
def test_a_case_is_told_with_the_numbers_that_were_measured(name, command) -> None:
    case = CASES[name]
    assert placeholders(f"{case.symptom} {case.cause} {case.remedy}") <= PARTS
    said = " ".join(command("casebook", name).out.split())
    assert said.startswith(f"{name}: {case.sentence}".split("`")[0])
    for part in (
        case.versions,
        *case.links,
        *(case.numbers[each] for each in ("symptom", "mended") if each in case.numbers),
    ):
        assert part in said
    assert "{" not in case.sentence.replace("{mended}", "")


@pytest.mark.parametrize(
    ("versions", "shown"),
    [
        ("3.3.0", False),
        ("3.6.0", True),
        ("3.9.1", True),
        ("3.10.0", True),
        ("4.0.0", False),
        ("5.0", False),
        ("3.1", False),
    ],
)
def test_versions_do_what_the_newest_measured_ones_did_that_are_not_newer(versions, shown) -> None:
    assert TRIED.shows([versions]) is shown


def test_a_version_behind_the_last_shows_nothing() -> None:
    assert [replace(TRIED, last="3.10.0").shows([each]) for each in ("3.10.0", "3.10.1")] == [True, False]


def test_of_two_engines_both_have_to_be_as_new_as_those_measured() -> None:
    both = replace(CASE, engines=("pinocchio", "mujoco"), shown=(("3.9.0", "4.0.0"),), not_shown=(("3.4.0", "3.3.0"),))
    tried = {("3.9.0", "4.0.0"): True, ("4.1.0", "4.0.0"): True, ("3.9.0", "3.6.0"): False, ("3.0", "4.0.0"): False}
    assert {versions: both.shows(versions) for versions in tried} == tried


def test_what_is_not_installed_shows_nothing(monkeypatch) -> None:
    monkeypatch.setitem(book._PACKAGES, "mujoco", "no-such-package")
    assert not book.is_shown_here(replace(CASE, shown=(("0.1",),)))


def test_a_case_that_the_newest_versions_do_not_show_is_told_without_a_number() -> None:
    case = replace(CASE, numbers={"mended": "1 N"})
    assert case.sentence == "It is wrong, because of that; do so: 1 N."


def test_cases_that_properties_name_are_in_the_casebook() -> None:
    named = {case for each in PROPERTIES.values() for case in (*each.cases.values(), each.call)}
    assert named - {""} <= {*CASES}


def test_unknown_case_is_one_sentence(command) -> None:
    assert "did you mean 'mj-soft-floor'?" in command("casebook", "mj-soft-flor", status=2).err


def test_the_old_option_names_the_command(command) -> None:
    said = command("diagnose", "--case", "mj-gear", status=2).err
    assert said == "screwgauge: diagnose --case: was renamed; use casebook ID.\n"


def test_list_has_every_case_uncut(command) -> None:
    lines = command("casebook").out.splitlines()
    assert [line.split("  ", 1)[0] for line in lines] == list(CASES)
    assert [line.split("  ", 1)[1].strip() for line in lines] == [case.title for case in CASES.values()]


def test_readme_has_the_table_as_measured() -> None:
    shown = {case.id: ", ".join(" + ".join(each) for each in case.shown) or "-" for case in CASES.values()}
    table = "".join(f"| `{c.id}` | {c.title} | {c.cause} | {shown[c.id]} |\n" for c in CASES.values())
    assert table in README


def test_main_readme_counts_the_cases() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"[casebook](harness/casebook/README.md) has {len(CASES)} discrepancies" in text


def test_links_are_reports_of_users() -> None:
    links = [link for case in CASES.values() for link in case.links]
    assert len(links) == len(set(links)) >= 7
    assert all(re.fullmatch(r"https://github\.com/[\w.-]+/[\w.-]+/(issues|pull)/\d+", link) for link in links)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("touches", "gravity", "named"),
    [
        (("actuator_force",), (0, -1, -9.81), True),
        (("actuator_force", "joint_velocity"), (0, -1, -9.81), False),  # of which one is right
        (("actuator_force",), None, False),  # nothing is wrong
    ],
)
def test_a_run_names_what_the_installed_engines_show_of_a_difference(touches, gravity, named, monkeypatch, tmp_path):
    case = CASES["mj-closure-residual-gain"]
    monkeypatch.setitem(CASES, case.id, replace(case, touches=touches))
    scene = screwgauge.load_scene("slider-crank")
    scene = replace(scene.at(scene.t[:3]), quantities=("joint_velocity", "actuator_force"))
    if gravity:
        write_models(scene.mechanism, tmp_path, gravity=np.array(gravity, dtype=float))
        scene = replace(scene, models={"mujoco": tmp_path / "slider-crank.xml"})
    results = screwgauge.run(scene, engines=("screw", "mujoco"))
    assert results.ok is (gravity is None)
    told = f"Known issue of mujoco {version('mujoco')}: "
    assert [text.startswith(told) and text.endswith(f"(casebook: {case.id}).") for text in results.known] == [
        True
    ] * named
    assert (told in verdict(results).text) is named
