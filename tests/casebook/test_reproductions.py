import string
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from casebook.record import CRASHED, found_by, grown, measured, text
from casebook.reproduce import REPRODUCTIONS, RUN, Reproduction, Result, reproduce
from casebook.toy_models import Evidence, FourBar
from screwgauge.casebook.book import CASES, SHOWN, Case, installed_versions, is_shown_here, version_key

#: Symptoms stand this far above the threshold at least, so that rounding or another machine cannot hide one.
MARGIN = 1.4
#: Cases that can be shown with what is installed; engines of extras may be missing.
HERE = [name for name in RUN if installed_versions(CASES[name])]
#: Cases whose symptom is what happens to be in memory.
IN_MEMORY = {"pin-connect-site"}
HOW = Reproduction("m:f", differs=0.1, within=0.01)


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    return {name: reproduce(CASES[name], REPRODUCTIONS[name]) for name in HERE}


def test_each_case_has_a_reproduction_or_a_reason_why_not() -> None:
    assert [*REPRODUCTIONS] == [*CASES]
    assert all(bool(how.run) == bool(how.number) != bool(how.why_not) for how in REPRODUCTIONS.values())


@pytest.mark.slow
@pytest.mark.parametrize("name", HERE)
def test_reproduction_runs_and_its_remedy_works(name, results) -> None:
    result = results[name]
    assert result.failure == ""
    assert result.works, f"after the remedy {result.evidence}, within {result.how.within:g} is wanted"


@pytest.mark.parametrize("name", HERE)
def test_symptom_is_shown_with_a_margin_or_not_at_all(name, results) -> None:
    found, how = results[name].evidence, REPRODUCTIONS[name]
    apart = abs(found.symptom - found.expected)
    assert how.within < how.differs  # no number is symptom and remedy at once
    if results[name].status == "shown":
        assert np.isnan(apart) or apart > MARGIN * how.differs
        assert not abs(found.mended - found.symptom) <= how.within
    else:
        assert apart <= max(how.within, 1e-9)


@pytest.mark.parametrize("name", HERE)
def test_the_package_says_of_the_installed_versions_what_they_show(name, results) -> None:
    assert is_shown_here(CASES[name]) is (results[name].status == "shown")


@pytest.mark.parametrize("name", HERE)
def test_numbers_of_the_package_are_those_measured(name, results) -> None:
    case = CASES[name]
    newest = max((*case.shown, *case.not_shown), key=version_key)
    if newest != installed_versions(case):
        pytest.skip(f"the numbers are those of {newest}")
    measured = results[name].numbers
    assert case.numbers.keys() == measured.keys()
    for part in ("expected",) if name in IN_MEMORY else ("symptom", "expected"):
        kept, now = (str(numbers.get(part, 0)).split()[0].rstrip("%") for numbers in (case.numbers, measured))
        assert kept == now or float(kept) == pytest.approx(float(now), rel=0.05)


@pytest.mark.parametrize("name", RUN)
def test_a_sentence_needs_a_symptom_and_a_remedy_that_are_measured(name) -> None:
    case = CASES[name]
    for wanted, told in (("symptom", case.symptom), ("mended", case.remedy)):
        assert wanted in {part for _, part, _, _ in string.Formatter().parse(told)}


def test_at_least_25_are_shown_by_the_installed_versions(results) -> None:
    shown = [name for name, result in results.items() if result.status == "shown"]
    assert len(shown) >= 25
    assert {engine for name in shown for engine in CASES[name].engines} >= {"mujoco", "pinocchio"}


def result(*values: float, **more: str) -> Result:
    return Result(HOW, Evidence(*values, "N", **more))


def test_a_number_that_no_longer_shows_the_symptom_says_so() -> None:
    mended = result(1.05, 1.0, 1.0)
    assert mended.status == "not shown"
    assert mended.works
    assert mended.numbers == {"expected": "1 N", "mended": "1 N", "said": ""}


def test_a_remedy_that_does_not_work_says_so() -> None:
    for value in (1.02, float("nan")):
        wrong = result(2.0, 1.0, value)
        assert wrong.status == "shown"
        assert not wrong.works


def test_what_is_no_number_is_a_symptom() -> None:
    nothing = result(float("nan"), 1.0, 1.0)
    assert (nothing.status, nothing.numbers["symptom"]) == ("shown", "NaN")
    assert result(float("nan"), 1.0, 1.0, said="no").numbers["symptom"] == "nothing"


def test_close_numbers_are_told_apart() -> None:
    near = Result(replace(HOW, differs=1e-9), Evidence(1.0000001, 1.0, 1.0, ""))
    assert near.numbers["symptom"] == "1.0000001"


def test_an_engine_that_raises_fails_its_case_and_no_other() -> None:
    found = reproduce(CASES["mj-gear"], replace(HOW, run="both_engines:nothing_there"))
    assert found.status == "failed"
    assert "AttributeError" in found.failure


@pytest.mark.slow
def test_nothing_is_written_and_nothing_said(tmp_path, inside, capfd, results) -> None:
    for name in HERE:
        reproduce(CASES[name], REPRODUCTIONS[name])
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_another_python_shows_cases_and_one_that_dies_costs_only_itself(tmp_path) -> None:
    """A program that ends after the first case stands for an engine that takes its process along."""
    asked = RUN[:2]
    assert found_by(cases=asked[:1])[asked[0]][0] == "shown"
    code = f"import json; print('noise'); print(json.dumps([{asked[0]!r}, 'not shown', {{}}]))"
    lost = found_by([sys.executable, "-c", code], cases=RUN[:3])
    assert [status for status, _ in lost.values()] == ["not shown", CRASHED, CRASHED]


def test_the_record_is_text_that_reads_as_it_was_written() -> None:
    assert text(CASES.values()) == SHOWN.read_text(encoding="utf-8")


def test_what_is_found_with_further_versions_goes_into_the_record() -> None:
    first = Case("x", "", ("mujoco",), "", "", "", "")
    for number, status in (("3.10.0", "shown"), ("3.9.0", "not shown"), ("4.0.0", "failed"), ("3.9.0", "shown")):
        first = grown(first, {"pinocchio": "1", "mujoco": number}, (status, {"mended": number}))
    assert first.shown == (("3.9.0",), ("3.10.0",))
    assert first.not_shown == ()
    assert first.numbers == {"mended": "3.10.0"}


@pytest.mark.slow
def test_a_fresh_environment_measures_what_the_record_has(tmp_path) -> None:
    asked, installed = list[str](), (version("pin"), version("mujoco"))

    def make(folder: Path, wanted: Sequence[str]) -> Path:
        asked.extend(wanted)
        return Path(sys.executable)

    found = measured([installed], tmp_path, make)
    assert {f"pin=={installed[0]}", f"mujoco=={installed[1]}"} <= {*asked}
    assert {name for name, case in found.items() if not is_shown_here(case)} == {
        name for name, case in CASES.items() if not is_shown_here(case)
    }


def test_torque_of_the_sample_is_the_change_of_its_energy() -> None:
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
