import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import load_scene
from screwgauge.models.readings.read import implausible as implausible_reading
from support.claims import table
from support.facts import replaced
from support.mechanism import (
    Body,
    Mechanism,
    Solid,
    all_too_wide,
    implausible,
    load_mechanism,
    mechanism_names,
    of_bodies,
    suspicious,
    too_wide,
)
from support.models import import_model, notes, write_models
from support.readings import read
from support.report import verdict
from support.scene import doubts

TABLE = table("doubts")
MODELS = TABLE["models"]
CASES = [(row["of"], row["model"], case["edits"], case["says"]) for row in TABLE["doubt"] for case in row["each"]]
#: In kg mm^2.
WIDE = ("xx = 1.5e-3, yy = 1.5e-3, zz = 2e-4", "xx = 1500, yy = 1500, zz = 200")
TOLD = "1500 kg m^2 at 0.3 kg"
DEGREES, FREE = ("[[-3, 3]]", "[[-170, 170]]"), ("[[-3, 3]]", "[[-1000, 1000]]")
#: Who is asked -> sentences on a file.
ASKED: dict[str, Callable[[Path], list[str]]] = {
    "implausible": lambda file: implausible(load_mechanism(file)),
    "suspicious": lambda file: [one.sentence for one in suspicious(load_mechanism(file))],
    "doubts": lambda file: doubts(load_scene(file)),
    "check": lambda file: [text for text in import_model(file).remarks if text.startswith("Check this")][:1],
}


@pytest.fixture
def made(write):
    def make(model: str, edits=(), name: str = "") -> Path:
        if model == "scene":
            write("arm.toml", replaced(MODELS["arm"], [FREE]))
        return write(name or f"{model}.{'urdf' if model == 'urdf' else 'toml'}", replaced(MODELS[model], edits))

    return make


@pytest.mark.parametrize(("of", "model", "edits", "says"), CASES)
def test_what_no_machine_has_is_told_with_its_part_and_what_was_meant(of, model, edits, says, made):
    found = ASKED[of](made(model, edits))
    assert len(found) == len(says), found
    for sentence, words in zip(found, says, strict=True):
        assert sentence.removeprefix("Check this: ").startswith(words[0]) or of == "check"
        assert all(word in sentence for word in words), sentence


@pytest.mark.parametrize("moments", [(1.0, 1.0, 1.0), (0.5, 0.5, 1.0), (0.0, 1.0, 1.0)])
def test_textbook_machines_of_unit_mass_and_length_are_not_doubted(moments):
    assert not too_wide(Solid("body", 1.0, np.diag(moments), 1.0))


def test_a_rotor_on_gimbals_whose_joints_say_nothing_of_its_size_is_not_doubted():
    assert not too_wide(Solid("rotor", 2.0, np.diag([0.01, 0.01, 0.02]), 1e-3))


def test_a_mass_in_a_point_is_meant_so():
    point = Solid("bob", 1.0, np.diag([1e-12, 1e-12, 1e-12]), 1.0, 1.0)
    assert not of_bodies([point])
    assert of_bodies([Solid("base", 60.0, 1e-3 * np.eye(3), 0.5, 0.5)])


def test_many_are_named_in_one_sentence():
    bodies = [Solid(f"b{i}", 0.3, np.diag([1500.0, 1500.0, 200.0]), 0.2) for i in range(9)]
    first, rest = all_too_wide(bodies)
    assert first.startswith("b0: ")
    assert rest.startswith("8 more bodies")
    assert rest.endswith("b1, b2, b3 and 5 more")


@pytest.mark.parametrize("name", mechanism_names())
def test_built_in_mechanisms_are_not_doubted(name):
    mechanism = load_mechanism(name)
    assert not implausible(mechanism)
    assert not suspicious(mechanism) or name in ("a05-governor", "screw-press")


def test_a_body_without_mass_is_said(paper: Mechanism):
    bodies = [Body(b.name, 0.0, np.zeros(3), np.zeros((3, 3))) if b.name == "leg2.lower" else b for b in paper.bodies]
    (one,) = suspicious(replace(paper, bodies=tuple(bodies)))
    assert one.body == "leg2.lower"
    assert "no mass" in one.sentence


def test_a_view_marks_what_is_implausible(made):
    mechanism = load_mechanism(made("arm", [WIDE]))
    assert {*implausible(mechanism)} <= {one.sentence for one in suspicious(mechanism)}


@pytest.mark.parametrize(("kind", "odd"), [("P", 0), ("R", 1)])
def test_readings_are_doubted_as_their_description_is(kind, odd, made, tmp_path):
    write_models(load_mechanism(made("carriage", [('y = { kind = "P"', f'y = {{ kind = "{kind}"')])), tmp_path)
    for name, library in (("carriage.urdf", "pinocchio"), ("carriage.xml", "mujoco")):
        assert len(implausible_reading(read(tmp_path / name, library))) == odd


def test_a_run_agrees_but_says_what_no_machine_has(made):
    scene = made("scene", [("[[3, 0, 0.25]]", "[[3, 0, 14.3]]")])
    made("arm", [WIDE, FREE])
    results = screwgauge.run(load_scene(scene), engines=["screw", "pinocchio"])
    banner = verdict(results)
    assert (results.exit_status, banner.word) == (0, "✓ AGREE, but")
    assert TOLD in banner.text
    assert "likely degrees" in banner.text
    assert {*results.doubts} <= {*results.warnings}


def test_a_check_passes_and_says_it(made, inside, command):
    scene = made("scene")
    made("arm", [WIDE, FREE])
    assert TOLD in " ".join(command("check", scene, "--smoke").out.split())


def test_import_models_and_a_diagnosis_say_it(made, tmp_path, inside, command):
    write_models(load_mechanism(made("arm", [WIDE])), tmp_path, include=frozenset({"limits"}))
    assert any(TOLD in text for text in notes(import_model(tmp_path / "arm.urdf")))
    assert TOLD in command("models", "arm.toml", "--out", "m").out
    (said,) = json.loads(command("diagnose", "arm.urdf", "arm.xml", "--json").out)["doubts"]
    assert said.startswith("A and B: one: ")
    assert TOLD in said


def test_limits_of_a_model_file_are_doubted_too(made, tmp_path):
    write_models(load_mechanism(made("arm", [DEGREES])), tmp_path, include=frozenset({"limits"}))
    found = screwgauge.diagnose(tmp_path / "arm.urdf", tmp_path / "arm.urdf")
    assert found.same
    (said,) = found.doubts
    assert said.startswith("A and B: upper: a limit of 170 rad")
