import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from screwgauge.report.pages.matrix import PAGE as page
from screwgauge.study import matrix as study
from support.command import main

AGREE = {"scene": "s", "status": "agree", "sentence": "", "errors": []}
BEYOND = {"reaction": "mujoco", "power": "judge"}
ERRORS = [{"quantity": name, "b": b, "ok": False, "error": 1.0} for name, b in BEYOND.items()]
DIFFER = {**AGREE, "scene": "t", "status": "differ", "sentence": "they differ", "errors": [*ERRORS, *ERRORS]}


@pytest.fixture
def made(monkeypatch):
    told = SimpleNamespace(asked=[], checks={})

    def make(folder: Path, wanted):
        told.asked.append(wanted)
        pin = next(text for text in wanted if text.startswith("pin=="))
        if pin == "pin==9":
            raise study.CannotError("nothing is pin==9")
        return Path(pin)

    def run(command, folder=None, ends=(0,)):
        return told.checks.get(command[0], json.dumps({"rows": [AGREE, DIFFER]}))

    monkeypatch.setattr(study, "make_environment", make)
    monkeypatch.setattr(study, "_run", run)
    monkeypatch.setattr(study, "lay_out", lambda folder: None)
    return told


def test_one_row_a_pair_and_only_these_versions_are_pinned(made, tmp_path):
    found = study.matrix([("3.9.0", "3.6.0"), ("4.1.0", "3.6.0")], tmp_path / "m.csv")
    assert found[["pin", "mujoco", "status", "passing", "scenes"]].values.tolist() == [
        ["3.9.0", "3.6.0", "differ", 1, 2],
        ["4.1.0", "3.6.0", "differ", 1, 2],
    ]
    assert {*found["reason"]} == {"t: they differ"}
    assert {*found["differing"]} == {"reaction 1"}
    first = made.asked[0]
    assert {"pin==3.9.0", "mujoco==3.6.0", "numpy>=2.0"} <= {*first}
    assert not any("extra" in text or "pytest" in text for text in first)


def test_what_pin_3_was_built_with_is_asked_for():
    asked = {pin: {*study.requirements(pin=pin, mujoco="4.0.0")} for pin in ("3.9.0", "4.1.0")}
    assert asked["3.9.0"] - asked["4.1.0"] == {"pin==3.9.0", "cmeel-tinyxml2<11", "cmeel-urdfdom<5"}


def test_rows_that_are_there_are_not_made_again(made, tmp_path):
    study.matrix([("3.9.0", "3.6.0")], tmp_path / "m.csv")
    found = study.matrix([("3.9.0", "3.6.0"), ("4.1.0", "3.6.0")], tmp_path / "m.csv")
    assert len(made.asked) == len(found) == 2


def test_what_cannot_be_installed_or_checked_is_a_row(made, tmp_path):
    made.checks["pin==4"] = "Segmentation fault"
    made.checks["pin==5"] = json.dumps({"rows": [{**DIFFER, "status": "failed"}]})
    made.checks["pin==6"] = json.dumps({"rows": []})
    found = study.matrix([(pin, "4.0.0") for pin in "94567"], tmp_path / "m.csv")
    assert found["status"].tolist() == ["not installed", "failed", "failed", "differ", "differ"]
    assert found["reason"][0] == "nothing is pin==9"
    assert found["reason"][1] == "the check printed no JSON"


def test_versions_that_are_none_are_refused(refused):
    assert "'--index-url' is not a version; write 4.1.0" in refused("matrix", "--pin=4.1.0,--index-url")
    assert "'latest' is not a version" in refused("matrix", "--mujoco", "latest")


def test_the_command_writes_the_table_and_a_page(made, tmp_path, capsys):
    assert main(["matrix", "--pin", "3.9.0,4.1.0,9", "--mujoco", "4.0.0", "--out", str(tmp_path / "out")]) == 3
    assert "not installed" in capsys.readouterr().out
    assert [*pd.read_csv(tmp_path / "out" / page.NAME).columns] == [*study.COLUMNS]
    text = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    first, _, _ = text.partition("## Environment")
    assert "3.9.0, 4.1.0, 9" in first
    assert "| 4.1.0 | 4.0.0 | differ | 1 of 2 |" in text
    said = "pin 3.9.0 and 4.1.0 with mujoco 4.0.0: scenes out of tolerance, by quantity: reaction 1; the first: t: they"
    assert said in text
    assert text.index("| differ |") < text.index("the first: t: they") < text.index("| python |")


@pytest.mark.slow
def test_the_package_answers_where_it_is_laid_out(tmp_path):
    found = study.matrix(
        [("0", "0")],
        tmp_path / "m.csv",
        make=lambda folder, wanted: Path(sys.executable),
        scenes=["slider-crank"],
    )
    (row,) = found.to_dict("records")
    assert (row["status"], row["passing"], row["scenes"]) == ("agree", 1, 1)
    assert row["digits"] > 11
    assert row["worst"].startswith("slider-crank: ")
