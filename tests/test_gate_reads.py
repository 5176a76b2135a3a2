import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.judging import compare as comparing
from screwgauge.judging.allowance import Allowance
from support.command import main
from support.repository import scene
from support.trees import TreeLoops


def test_a_model_of_an_engine_that_does_not_run_keeps_a_gate_from_passing(theirs, command):
    text = scene('models.mujoco = "edited.xml"').replace('engines = ["screw", "mujoco"]', 'engines = ["screw"]')
    Path("turn.toml").write_text(text.replace('["screw"]', '["screw", "pinocchio"]'), encoding="utf-8")
    shutil.copy("four-bar.xml", "edited.xml")
    said = command("check", "turn.toml", "--junit", "junit.xml", status=1).out
    assert "FAILED: 0 of 1 pass." in said
    assert "turn: edited.xml (models.mujoco) is not read" in said
    assert "all engines agree" not in said
    assert "edited.xml" in Path("junit.xml").read_text(encoding="utf-8")
    row = screwgauge.check("turn.toml").rows[0]
    assert row.status == "unread"
    assert all(error.ok for error in row.errors)


def test_one_engine_alone_agrees_with_nobody(theirs, command):
    Path("turn.toml").write_text(scene().replace('["screw", "mujoco"]', '["screw"]'), encoding="utf-8")
    said = " ".join(command("check", "turn.toml").out.split())
    assert "agree" not in said.partition("report:")[0]
    assert "1 of 1 pass. Nothing was compared" in said
    assert screwgauge.check("turn.toml").rows[0].status == "judged"


def test_files_of_a_folder_that_no_scene_names_are_named(theirs, capsys):
    shutil.copy("four-bar.xml", "forgotten.xml")
    Path("tolerances.toml").write_text("actuator_force = 1e-6\n", encoding="utf-8")
    Path("other.toml").write_text('extends = "four-bar.toml"\nname = "other"\n', encoding="utf-8")
    found = screwgauge.check(".")
    left = {"forgotten.xml", "four-bar.urdf", "four-bar-full.urdf", "four-bar-full.xml", "other.toml"}
    assert {*found.unread} == {*left, "tolerances.toml"}
    assert found.ok
    assert "OK, but: 1 of 1 pass." in str(found)
    assert all(name in " ".join(found.markdown().split()) for name in left)
    assert {*json.loads(found.json)["unread"]} == {*found.unread}
    assert "forgotten.xml" in found.junit()
    assert "tolerances.toml" not in screwgauge.check(".", tolerances="tolerances.toml").unread


def test_a_description_that_a_scene_s_own_extends_was_read(theirs):
    Path("more.toml").write_text('extends = "four-bar.toml"\nname = "more"\n', encoding="utf-8")
    Path("turn.toml").write_text(scene().replace("four-bar.toml", "more.toml"), encoding="utf-8")
    assert not any(name.endswith(".toml") for name in screwgauge.check(".").unread)


def test_a_scene_that_misspells_its_mechanism_is_refused_and_not_passed_over(theirs):
    Path("typo.toml").write_text(scene().replace("mechanism", "mechansim"), encoding="utf-8")
    found = screwgauge.check(".")
    assert {row.scene: row.status for row in found.rows} == {"turn": "agree", "typo": "refused"}
    assert found.exit_status == 2


def test_a_model_file_of_a_hundred_gigabytes_is_refused_unread(theirs):
    enormous("four-bar.xml")
    assert main(["check", "turn.toml", "--out", "out"]) == 2


def enormous(name: str) -> None:
    """A sparse file."""
    with Path(name).open("wb") as file:
        file.truncate(10**10)


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [
        os.mkfifo,
        lambda path: os.symlink("/dev/zero", path),
        os.mkdir,
        lambda path: os.symlink(path, path),
        lambda path: Path(path).write_text("[" * 1_000_000),
        lambda path: Path(path).write_text("a." * 50_000 + "b = 1"),
        lambda path: Path(path).write_text("[" + ".".join("a" * 2000) + "]"),
        lambda path: Path(path).write_text(f"mechanism = {'9' * 5000}"),
        enormous,
    ],
    ids=["fifo", "endless", "folder", "circle", "brackets", "dots", "tables", "digits", "huge"],
)
def test_a_folder_may_hold_anything(make, theirs):
    make("x.toml")
    found = {row.scene: row for row in screwgauge.check(".").rows}
    assert found["turn"].ok
    assert found["x"].status == "refused"
    assert re.search(r"x\.toml.*: .*; .*\.$", found["x"].sentence)


def turned(self: TreeLoops, at, V, A):
    out = right(self, at, V, A).reshape(len(V), -1, 3).copy()
    for k, anchor in enumerate(self.anchors):
        if anchor.angular:
            out[:, k] = A[:, anchor.child, :3] + A[:, anchor.parent, :3]
    return out.reshape(len(out), -1)


right = TreeLoops.bias


@pytest.mark.slow
def test_a_smoke_test_notices_what_only_the_full_cuts_see(monkeypatch):
    found = screwgauge.check("bennett", smoke=True).rows[0]
    assert found.ok
    assert {"mujoco-full", "pinocchio-full"} <= found.versions.keys()
    assert "of screw, pinocchio-full, mujoco-full" in found.coverage
    monkeypatch.setattr(TreeLoops, "bias", turned)
    assert screwgauge.check("bennett").ok  # no default engine welds copies of moving bodies here
    found = screwgauge.check("bennett", smoke=True).rows[0]
    assert found.status == "differ"
    assert found.sentence.startswith("full cuts: ")


def scaled(by: float):
    def components(*arguments):
        for row in each(*arguments):
            yield replace(row, max_abs=by * row.max_abs, error=by * row.error)

    return components


each, granted = comparing._components, Allowance.grant


def loose(*arguments, **sizes):
    right = granted(*arguments, **sizes)
    return replace(right, limits=np.maximum(right.limits, 1e-3))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("room", "name", "instead", "said"),
    [
        (comparing, "_components", scaled(1e-3), "was found as"),
        (Allowance, "grant", loose, "passes a tolerance of"),
        (
            comparing,
            "_compare_with_tolerance",
            lambda row, *others: replace(row, rule="", unique=True, ok=True),
            "pass",
        ),
    ],
)
def test_a_smoke_test_notices_that_the_comparison_is_blind(room, name, instead, said, monkeypatch):
    assert screwgauge.check("slider-crank", smoke=True).ok
    monkeypatch.setattr(room, name, instead)
    (row,) = screwgauge.check("slider-crank", smoke=True).rows
    assert row.status == "failed"
    assert row.sentence.startswith("the comparison would miss ")
    assert said in row.sentence


@pytest.mark.slow
def test_engines_that_share_no_quantity_are_no_agreement(monkeypatch):
    monkeypatch.setattr(comparing, "combinations", lambda *arguments: [])
    (row,) = screwgauge.check("slider-crank").rows
    assert row.status == "nothing"
    assert "nothing was compared" in row.sentence
