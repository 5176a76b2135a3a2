"""Numbers that no machine has are told with the unit that was likely meant; no verdict changes for that."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest

import screwgauge
from screwgauge import load_scene
from support.mechanism import (
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
from support.report import verdict
from support.scene import doubts

ARM = """
name = "arm"
independent = {{ upper = "upper", lower = "lower" }}
[bodies]
one = {{ mass = 0.3, com = [0, 0, 0.1], inertia = {{ {inertia} }} }}
two = {{ mass = 0.2, com = [0, 0, 0.1], inertia = {{ xx = 8e-4, yy = 8e-4, zz = 1e-4 }} }}
[joints]
upper = {{ kind = "R", parent = "ground", child = "one", axes = [[0, 1, 0]], actuated = true, limits = [{limits}] }}
[joints.lower]
kind = "R"
parent = "one"
child = "two"
axes = [[0, 1, 0]]
parent_frame.position = [0, 0, 0.2]
actuated = true
"""
RIGHT = {"inertia": "xx = 1.5e-3, yy = 1.5e-3, zz = 2e-4", "limits": "[-3, 3]"}
#: In kg mm^2.
WIDE = "xx = 1500, yy = 1500, zz = 200"
SCENE = """
mechanism = "arm.toml"
motion.upper.{upper}
motion.lower.harmonics = [[3, 0, 0.2]]
time = {{ duration = 1, step = 0.1 }}
"""
SWINGS = "harmonics = [[3, 0, 0.25]]"


@pytest.fixture
def arm(write) -> Callable:
    return lambda **changes: load_mechanism(write("arm.toml", ARM.format(**{**RIGHT, **changes})))


@pytest.fixture
def scene(write, arm) -> Callable:
    def make(upper: str = SWINGS, **changes):
        arm(**{"limits": "[-1000, 1000]", **changes})
        return load_scene(write("s.toml", SCENE.format(upper=upper)))

    return make


def test_what_can_be_is_not_doubted(arm, scene) -> None:
    assert not implausible(arm())
    assert not doubts(scene())


@pytest.mark.parametrize(
    ("inertia", "unit"),
    [
        (WIDE, "likely kg mm^2 or g cm^2 meant"),
        ("xx = 1500, yy = 1500", "likely kg mm^2 or g cm^2 meant"),  # a rod, which has no volume
        ("xx = 1.5e6, yy = 1.5e6, zz = 2e5", "likely g mm^2 meant"),
        ("xx = 15, yy = 15, zz = 2", "likely kg cm^2 or kg mm^2 meant"),
        ("xx = 1, yy = 1, zz = 1", "a placeholder, or likely g m^2 or kg cm^2 meant"),
        ("xx = 1e20, yy = 1e20, zz = 1e20", "no usual unit explains it"),
    ],
)
def test_moments_of_inertia_in_another_unit_are_told_with_it(arm, inertia, unit) -> None:
    mechanism = arm(inertia=inertia)
    (sentence,) = implausible(mechanism)
    assert sentence.startswith("one: a moment of inertia of ")
    assert f"of a body about 0.2 m large, and makes it lighter than air ({unit}" in sentence
    assert sentence in [one.sentence for one in suspicious(mechanism)]  # which a view marks


def test_the_number_is_in_the_sentence(arm) -> None:
    (sentence,) = implausible(arm(inertia=WIDE))
    assert "1500 kg m^2 on 0.3 kg is a radius of gyration of 70.7 m" in sentence


@pytest.mark.parametrize("moments", [(1.0, 1.0, 1.0), (0.5, 0.5, 1.0), (0.0, 1.0, 1.0)])
def test_machines_of_unit_mass_and_length_are_not_doubted(moments) -> None:
    """Textbooks have them, and they are lighter than air."""
    assert not too_wide(Solid("body", 1.0, np.diag(moments), 1.0))


def test_a_rotor_on_gimbals_that_meet_in_a_point_is_not_doubted() -> None:
    """Its joints say nothing of its size."""
    assert not too_wide(Solid("rotor", 2.0, np.diag([0.01, 0.01, 0.02]), 1e-3))


@pytest.mark.parametrize(("limits", "value"), [("[-170, 170]", "170"), ("[-2, 14.3]", "14.3")])
def test_limits_in_degrees_are_told(arm, limits, value) -> None:
    (sentence,) = implausible(arm(limits=limits))
    assert sentence.startswith(f"upper: a limit of {value} rad is ")
    assert sentence.endswith(f"likely degrees were meant, {np.radians(float(value)):.3g} rad")


@pytest.mark.parametrize("limits", ["[-9.43, 9.43]", "[-1000, 1000]", "[-100, 100]"])
def test_limits_of_some_turns_and_of_none_are_meant(arm, limits) -> None:
    assert not implausible(arm(limits=limits))


@pytest.mark.parametrize(
    ("upper", "said"),
    [
        ("harmonics = [[3, 0, 14.3]]", "upper: a motion of 14."),
        ("polynomial = [0, 0, 42.9, -28.6]", "upper: a motion of 14.3 rad is 2.28 turns; likely degrees were meant"),
        ("offset = 14.3", "upper: a start of 14.3 rad is 2.28 turns; likely degrees were meant, 0.25 rad"),
    ],
)
def test_motions_in_degrees_are_told(scene, upper, said) -> None:
    (sentence,) = doubts(scene(upper))
    assert sentence.startswith(said)


def test_what_runs_round_is_meant(scene) -> None:
    assert not doubts(scene("polynomial = [0, 30]"))
    assert not doubts(scene("polynomial = [0, 0, 30]"))  # up to speed


def test_a_run_agrees_but_says_what_no_machine_has(scene) -> None:
    results = screwgauge.run(scene("harmonics = [[3, 0, 14.3]]", inertia=WIDE), engines=["screw", "pinocchio"])
    assert results.exit_status == 0
    banner = verdict(results)
    assert banner.word == "✓ AGREE, but"
    assert "1500 kg m^2 on 0.3 kg" in banner.text
    assert "likely degrees were meant" in banner.text
    assert {*results.doubts} <= {*results.warnings}


def test_a_check_passes_and_says_it(scene, inside, command) -> None:
    file = scene(inertia=WIDE).file
    assert "1500 kg m^2 on 0.3 kg" in " ".join(command("check", file, "--smoke").out.split())


def test_import_models_and_a_diagnosis_say_it(arm, tmp_path, inside, command) -> None:
    write_models(arm(inertia=WIDE), tmp_path, include=frozenset({"limits"}))
    said = notes(import_model(tmp_path / "arm.urdf"))
    assert any("Check this: one: a moment of inertia of 1500" in text for text in said)
    assert "1500 kg m^2 on 0.3 kg" in command("models", "arm.toml", "--out", "m").out
    (said,) = json.loads(command("diagnose", "arm.urdf", "arm.xml", "--json").out)["doubts"]
    assert said.startswith("A and B: one: a moment of inertia of 1500 kg m^2 on 0.3 kg")


def test_limits_of_a_model_file_are_doubted_too(arm, tmp_path) -> None:
    write_models(arm(limits="[-170, 170]"), tmp_path, include=frozenset({"limits"}))
    found = screwgauge.diagnose(tmp_path / "arm.urdf", tmp_path / "arm.urdf")
    assert found.same
    (said,) = found.doubts
    assert said.startswith("A and B: upper: a limit of 170 rad is 27.1 turns")


def test_many_are_named_in_one_sentence(arm) -> None:
    bodies = [Solid(f"b{i}", 0.3, np.diag([1500.0, 1500.0, 200.0]), 0.2) for i in range(9)]
    first, rest = all_too_wide(bodies)
    assert first.startswith("b0: ")
    assert rest == "8 more bodies are lighter than air in the same way: b1, b2, b3 and 5 more"


@pytest.mark.parametrize("name", mechanism_names())
def test_built_in_mechanisms_are_not_doubted(name: str) -> None:
    assert not implausible(load_mechanism(name))


FIELD = """<robot name="arm"><link name="base"/>
<link name="shoulder"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
<inertia ixx="{I}" iyy="{I}" izz="{I}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
<inertia ixx="{I}" iyy="{I}" izz="{I}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="shoulder"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
<joint name="j2" type="revolute"><parent link="shoulder"/><child link="fore"/><origin xyz="{far}" rpy="0 {turn} 0"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="3"/></joint></robot>"""
METRES = {"com": "0.01 0 0.14", "far": "0 0.05 0.28", "mass": "2.4", "I": "0.02", "turn": "0.5"}
#: What a file of the field has -> bodies or joints that are named, and the remedy.
DOUBTED = {
    "millimetres": ({"com": "10 0 140", "far": "0 50 280", "I": "20000"}, "shoulder", "by 0.001"),
    "degrees": ({"turn": "90"}, "j2", "pi/180"),
    "tonnes in decimetres": ({"mass": "2400"}, "shoulder", "by 0.001"),
    "gyration of millimetres": ({"mass": "60", "I": "0.001"}, "shoulder", "write the tensor"),
}


@pytest.mark.parametrize("case", DOUBTED)
def test_import_says_what_no_machine_has_with_a_remedy(case, tmp_path) -> None:
    changes, name, remedy = DOUBTED[case]
    (tmp_path / "m.urdf").write_text(FIELD.format(**METRES), encoding="utf-8")
    assert not [said for said in import_model(tmp_path / "m.urdf").remarks if said.startswith("Check this")]
    (tmp_path / "m.urdf").write_text(FIELD.format(**{**METRES, **changes}), encoding="utf-8")
    first, *_ = (said for said in import_model(tmp_path / "m.urdf").remarks if said.startswith("Check this"))
    assert name in first
    assert remedy in first


def test_a_mass_in_a_point_is_meant_so() -> None:
    point = Solid("bob", 1.0, np.diag([1e-12, 1e-12, 1e-12]), 1.0, 1.0)
    assert not of_bodies([point])
    assert of_bodies([Solid("base", 60.0, 1e-3 * np.eye(3), 0.5, 0.5)])
