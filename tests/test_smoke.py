from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.diagnosis.facts import bodies, links
from screwgauge.engines import lagrange
from screwgauge.engines.registry import ENGINES
from screwgauge.engines.tree import closed_forces
from screwgauge.models.readings import mujoco
from screwgauge.models.readings.reading import BodyReading
from screwgauge.report.pages import check as page
from screwgauge.scene.preflight import check_scene
from screwgauge.study.gate import check as gate_check
from screwgauge.study.gate import known_files, smoke
from screwgauge.study.gate.items import items
from screwgauge.study.gate.known_files import known_item, known_row
from screwgauge.study.gate.measure import GateSettings
from screwgauge.study.runner import InTurn

SETTINGS = GateSettings(lambda comparison: "", smoke=True)


def row_of_files():
    with np.errstate(all="ignore"):
        return known_row(known_item(), SETTINGS)


def test_truth_takes_part_in_built_in_scenes_alone(theirs, monkeypatch):
    scene, _ = smoke.reduce_scene(screwgauge.load_scene("screw-press"))
    asked = smoke.with_truth(scene)
    assert asked.engines == ("screw", "truth")
    assert len(asked.t) == 1
    assert smoke.with_truth(screwgauge.load_scene("turn.toml")) is None
    monkeypatch.setitem(ENGINES, "truth", type("Missing", (), {"installed": False}))
    assert smoke.with_truth(scene) is None


def test_truth_reads_texts_of_some_scenes_and_doubles_of_others():
    asked = [
        smoke.with_truth(smoke.reduce_scene(screwgauge.load_scene(name))[0]) for name in ("screw-press", "five-bar")
    ]
    assert [scene.wording().motion is None for scene in asked] == [False, True]


def test_truth_is_asked_without_springs_and_motors():
    scene = screwgauge.load_scene("ruse")
    assert scene.applied.springs
    asked = smoke.with_truth(scene)
    assert (asked.applied.springs, asked.applied.motors) == ((), ())
    assert asked.applied.loads == scene.applied.loads


def test_a_second_formulation_takes_part_in_built_in_scenes_alone(theirs):
    scene, _ = smoke.reduce_scene(screwgauge.load_scene("ruse"))
    asked = smoke.with_lagrange(scene)
    assert asked.engines == ("screw", "lagrange")
    assert {*scene.quantities} - {*asked.quantities} == {"tree_force", "tree_force_soft"}
    assert asked.applied is scene.applied
    assert smoke.with_lagrange(replace(scene, engines=("screw", "lagrange"))) is None
    assert smoke.with_lagrange(screwgauge.load_scene("turn.toml")) is None


def test_what_a_second_formulation_contradicts_is_seen(monkeypatch):
    (row,) = screwgauge.check("five-bar", smoke=True).rows
    assert row.ok
    assert "all but tree_force and tree_force_soft" in row.coverage
    right = lagrange.SolvedMotion.needs.func
    turned = cached_property(lambda at: 1.001 * right(at))
    turned.__set_name__(lagrange.SolvedMotion, "needs")
    monkeypatch.setattr(lagrange.SolvedMotion, "needs", turned)
    (row,) = screwgauge.check("five-bar", smoke=True).rows
    assert row.status == "differ"
    assert row.sentence.startswith("second formulation: ")


def test_the_motion_of_a_smoke_test_is_followed_once_however_many_runs_it_has():
    scene, _ = smoke.reduce_scene(screwgauge.load_scene("slider-crank"))
    first, again = check_scene(scene), check_scene(smoke.full_cuts(scene))
    assert first is again
    assert check_scene(replace(scene, task=scene.motion.part(slice(0, 2)))) is not first


def test_a_mistake_of_truth_is_seen(monkeypatch):
    from screwgauge.truth import forces

    assert screwgauge.check("screw-press", smoke=True).ok
    right = forces.coupling_balances
    monkeypatch.setattr(forces, "coupling_balances", lambda *at: [[-x for x in column] for column in right(*at)])
    monkeypatch.setattr("screwgauge.truth.cache.read", lambda *key: (None, ""))
    monkeypatch.setattr("screwgauge.truth.cache.write", lambda *kept: "")
    (row,) = screwgauge.check("screw-press", smoke=True).rows
    assert not row.ok
    assert row.sentence.startswith("truth: ")


@pytest.mark.slow
def test_redundant_actuators_are_compared_by_the_other_rule(monkeypatch):
    assert smoke.full_cuts(screwgauge.load_scene("3ups-upu-s")).rule == "spherical_axial"
    assert smoke.full_cuts(screwgauge.load_scene("five-bar")).rule == "min_norm"
    right = closed_forces._force
    monkeypatch.setattr(closed_forces, "_force", lambda *at: (right(*at)[0], -right(*at)[1]))
    (row,) = screwgauge.check("3ups-upu-s", smoke=True).rows
    assert row.sentence.startswith("full cuts: ")


def test_two_model_files_are_checked_where_nothing_is_named(monkeypatch):
    monkeypatch.setattr(gate_check, "items", lambda what: items([*what] or ["slider-crank"]))
    found = page.check_with(InTurn(), (), smoke=True)
    assert [row.scene for row in found.rows] == ["slider-crank", known_item().name]
    assert [row.scene for row in screwgauge.check("five-bar", smoke=True).rows] == ["five-bar"]


def test_two_model_files_are_the_same_and_what_is_planted_in_one_is_seen():
    row = row_of_files()
    assert row.ok, row.sentence
    text = Path(known_files.PAIR[1]).read_text(encoding="utf-8")
    assert all(text.count(here) == 1 for _, here, _ in known_files.PLANTED.values())


def turned(named: tuple[str, BodyReading]) -> tuple[str, BodyReading]:
    name, link = named
    moments, axes = np.linalg.eigh(link.inertia)
    return name, replace(link, inertia=axes.T @ np.diag(moments) @ axes)


@pytest.mark.parametrize(
    ("room", "name", "mistaken"),
    [
        (mujoco, "_links", lambda right: lambda *given: map(turned, right(*given))),
        (links, "difference", lambda right: lambda a, b, *of: (a > b) * right(a, b, *of)),
        (bodies, "difference", lambda right: lambda a, b, *of: (a > b) * right(a, b, *of)),
        (known_files, "import_model", lambda right: lambda file: right(Path(known_files.PAIR[1]))),
    ],
    ids=["a turned tensor", "larger values of joints", "larger values of bodies", "an import"],
)
def test_a_mistake_of_readers_or_diagnosis_is_seen(room, name, mistaken, monkeypatch):
    monkeypatch.setattr(room, name, mistaken(getattr(room, name)))
    assert not row_of_files().ok
