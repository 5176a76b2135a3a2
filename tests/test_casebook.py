"""Every named discrepancy shows what its sentence says, and its remedy works; one that no longer shows it says so."""

from __future__ import annotations

import re
import string
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.casebook import book
from screwgauge.casebook.book import CASES, Case, CaseResult, reproduce
from screwgauge.engines.toy_models import Evidence, FourBar
from support.command import main
from support.models import write_models
from support.report import verdict

ROOT = Path(__file__).parents[1]
README = (ROOT / "harness/casebook/README.md").read_text(encoding="utf-8")
RUN = [name for name, case in CASES.items() if case.run]
#: Symptoms stand this far above the threshold at least, so that rounding or another machine cannot hide one.
MARGIN = 1.4
PARTS = {"symptom", "expected", "mended", "said"}


@pytest.fixture(scope="module")
def results() -> dict[str, CaseResult]:
    return {name: reproduce(name) for name in CASES}


def placeholders(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name is not None}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_reproduction_runs_and_its_remedy_works(name, results) -> None:
    result = results[name]
    assert result.failure == ""
    assert result.ok, f"after the remedy {result.shown}, within {result.case.within:g} is wanted"
    assert result.status in ("shown", "not shown") if CASES[name].run else "cannot be shown"


@pytest.mark.parametrize("name", RUN)
def test_symptom_is_shown_with_a_margin_or_not_at_all(name, results) -> None:
    found, case = results[name].shown, CASES[name]
    apart = abs(found.symptom - found.expected)
    assert case.within < case.differs  # no number is symptom and remedy at once
    if results[name].status == "shown":
        assert np.isnan(apart) or apart > MARGIN * case.differs
        assert not abs(found.mended - found.symptom) <= case.within
    else:
        assert apart <= max(case.within, 1e-9)


@pytest.mark.parametrize("name", RUN)
def test_sentence_has_measured_numbers_in_it(name, results) -> None:
    case, sentence = CASES[name], results[name].sentence
    texts = (case.symptom, case.cause, case.remedy)
    assert placeholders(" ".join(texts)) <= PARTS
    assert "symptom" in placeholders(case.symptom)
    assert "mended" in placeholders(case.remedy)
    assert "{" not in sentence.replace("{mended}", "")
    assert sentence.endswith(".")
    if results[name].status == "shown":
        assert results[name].numbers["symptom"] in sentence
        assert results[name].numbers["mended"] in sentence
        assert results[name].numbers["symptom"] != results[name].numbers["expected"]


def test_at_least_25_are_shown_by_the_installed_versions(results) -> None:
    shown = [result for result in results.values() if result.status == "shown"]
    assert len(shown) >= 25
    assert {engine for result in shown for engine in result.case.engines} == {"mujoco", "pinocchio"}


CASE = Case(
    "x", "it is wrong", ("mujoco",), "it is {symptom}", "of that", "do so: {mended}", "MuJoCo 1", "m:f", 0.1, 0.01
)


def result(*values: float, **more: str) -> CaseResult:
    return CaseResult(CASE, {"mujoco": "9.9"}, Evidence(*values, "N", **more))


def test_a_number_that_no_longer_shows_the_symptom_says_so() -> None:
    mended = result(1.05, 1.0, 1.0)
    assert mended.status == "not shown"
    assert mended.ok
    assert mended.sentence == (
        "Not with mujoco 9.9, where it is 1.05 N as it should be; "
        "with MuJoCo 1 it is wrong, because of that; do so: 1 N."
    )


def test_a_remedy_that_does_not_work_says_so() -> None:
    for value in (1.02, float("nan")):
        wrong = result(2.0, 1.0, value)
        assert wrong.status == "shown"
        assert not wrong.ok
        assert "and is no remedy here" in wrong.sentence


def test_what_is_no_number_is_a_symptom() -> None:
    nothing = result(float("nan"), 1.0, 1.0)
    assert (nothing.status, nothing.numbers["symptom"]) == ("shown", "NaN")
    assert result(float("nan"), 1.0, 1.0, said="no").numbers["symptom"] == "nothing"


def test_close_numbers_are_told_apart() -> None:
    near = CaseResult(replace(CASE, differs=1e-9), {}, Evidence(1.0000001, 1.0, 1.0, ""))
    assert near.numbers["symptom"] == "1.0000001"


def test_an_engine_that_raises_fails_its_case_and_no_other(monkeypatch, command) -> None:
    broken = replace(CASE, run="casebook.both_engines:nothing_there")
    monkeypatch.setitem(book.CASES, "x", broken)
    found = reproduce("x")
    assert found.status == "failed"
    assert "AttributeError" in found.sentence
    assert "x, failed: The reproduction failed with mujoco" in command("casebook", "x", status=3).out


def test_remedy_that_fails_ends_with_3(monkeypatch) -> None:
    monkeypatch.setitem(book.CASES, "x", replace(CASES["mj-soft-floor"], within=0.0))
    assert main(["casebook", "x"]) == 3


def test_command_says_sentence_numbers_versions_and_links(command) -> None:
    said = " ".join(command("casebook", "sparse-hessian-4.0.0").out.split())
    for part in ("sparse-hessian-4.0.0, ", "as it should be 0 rad/s^2", version("mujoco"), "issues/3767"):
        assert part in said


def test_unknown_case_is_one_sentence(command) -> None:
    assert "did you mean 'mj-soft-floor'?" in command("casebook", "mj-soft-flor", status=2).err


def test_the_old_option_names_the_command(command) -> None:
    said = command("diagnose", "--case", "mj-gear", status=2).err
    assert said == "screwgauge: diagnose --case: has another name; write casebook ID.\n"


def test_list_has_every_case_uncut(command) -> None:
    lines = command("casebook").out.splitlines()
    assert [line.split("  ", 1)[0] for line in lines] == list(CASES)
    assert [line.split("  ", 1)[1].strip() for line in lines] == [case.title for case in CASES.values()]


@pytest.mark.slow
def test_nothing_is_written_and_nothing_but_the_sentence_said(tmp_path, inside, capfd) -> None:
    for name in RUN:
        reproduce(name)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_readme_has_the_table_as_measured(results) -> None:
    stated = dict(re.findall(r"(pin|mujoco) (\d+\.\d+\.\d+)", README.split("| case |")[0]))
    assert len(stated) == 2
    if any(version(name) != number for name, number in stated.items()):
        pytest.skip(f"the table is that of {stated}")
    table = "".join(f"| `{r.case.id}` | {r.case.title} | {r.case.cause} | {r.status} |\n" for r in results.values())
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
    told = f"Known of mujoco {version('mujoco')}: "
    assert [text.startswith(told) and text.endswith(f"(casebook: {case.id}).") for text in results.known] == [
        True
    ] * named
    assert (told in verdict(results).text) is named


def test_torque_of_the_sample_is_the_change_of_its_energy() -> None:
    """The closed form that most loops are compared with, against energies of neighbouring poses."""
    h, crank, speed = 1e-4, np.pi / 3, 10.0

    def energy(angle: float) -> float:
        bar = FourBar(speed, angle)
        lengths, masses = bar.lengths, bar.masses
        omega = np.array([bar.v[0], bar.v[0] + bar.v[1], bar.v[2]])
        centres = np.array(
            [
                lengths[0] / 2 * bar.along[0],
                bar.elbow + lengths[1] / 2 * bar.along[1],
                bar.base + lengths[2] / 2 * bar.along[2],
            ]
        )
        ends = [
            lengths[0] / 2 * omega[0] * bar.across[0],
            lengths[0] * omega[0] * bar.across[0] + lengths[1] / 2 * omega[1] * bar.across[1],
        ]
        v = np.array([*ends, lengths[2] / 2 * omega[2] * bar.across[2]])
        kinetic = (masses @ np.sum(v**2, axis=1) + bar.moments @ omega**2) / 2
        return float(kinetic - masses @ (centres @ bar.gravity))

    slope = (energy(crank + h) - energy(crank - h)) / (2 * h)
    assert slope == pytest.approx(FourBar(speed, crank).torque, rel=1e-6)
