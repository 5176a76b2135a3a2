"""Each file by both libraries: degrees of freedom, mass, their own torques, and the cause where these differ."""

from __future__ import annotations

import pytest
from campaigns.imports import models_in
from campaigns.readers import reader_matrix
from campaigns.readers_page import PAGE as page

ARM = """<mujoco model="arm">{option}<worldbody><body name="upper" pos="0 0 1">
<joint name="shoulder" axis="0 1 0" {joint}/><inertial pos="0.1 0.02 -0.2" mass="1" diaginertia="0.1 0.12 0.09"/>
<body name="lower" pos="0.3 0 0"><joint name="elbow" axis="1 0 0"/>
<inertial pos="0 0.1 0.05" mass="0.5" diaginertia="0.03 0.02 0.01"/></body></body>{more}</worldbody></mujoco>"""
SECOND = """<body name="other"><joint name="hinge" axis="0 1 0"/>
<inertial pos="0.1 0 0" mass="2" diaginertia="1 1 1"/></body>"""
FLAT = """<robot name="flat"><link name="base"/><link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="{ixx}" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"""


def arm(joint: str = "", option: str = "", more: str = "") -> str:
    return ARM.format(joint=joint, option=option, more=more)


MODELS = {
    "plain.xml": arm(),
    "damped.xml": arm('damping="0.5"'),
    "floating-in-space.xml": arm(option='<option gravity="0 0 0"/>'),
    "two-trees.xml": arm(more=SECOND),
    "fine.urdf": FLAT.format(ixx=0.1),
    "impossible.urdf": FLAT.format(ixx=0.5),
    "nothing.xml": "<html/>",
}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    for name, text in MODELS.items():
        (folder / name).write_text(text, encoding="utf-8")
    return reader_matrix(models_in([folder]))


def row(found, model: str, library: str):
    return found.set_index(["model", "library"]).loc[(model, library)]


def test_a_model_that_both_read_alike_has_equal_torques(found):
    for model, other in (("plain", "pinocchio"), ("fine", "mujoco")):
        one = row(found, model, other)
        assert one["loads"]
        assert one["torque"] < 1e-13
        assert one["rigid"] < 1e-13
        assert one["cause"] == ""


def test_each_library_says_its_own_freedoms_and_mass(found):
    assert row(found, "plain", "pinocchio")[["freedoms", "mass"]].tolist() == [2, 1.5]
    assert row(found, "two-trees", "mujoco")[["freedoms", "mass"]].tolist() == [3, 3.5]


def test_damping_that_one_leaves_out_is_no_difference_of_rigid_bodies(found):
    one = row(found, "damped", "pinocchio")
    assert one["torque"] > 1e-3
    assert one["rigid"] < 1e-13
    assert one["cause"].startswith("inverse dynamics of pinocchio leave out damping")


def test_gravity_that_one_does_not_read_is_the_cause(found):
    one = row(found, "floating-in-space", "pinocchio")
    assert one["rigid"] > 1e-3
    assert "gravity (0, 0, -9.81) m/s^2 as pinocchio reads it, (0, 0, 0) m/s^2 as mujoco reads it" in one["cause"]


def test_a_tree_that_one_drops_leaves_nothing_to_compare(found):
    one = row(found, "two-trees", "pinocchio")
    assert one["torque"] != one["torque"]
    assert "body other, which pinocchio drops" in one["cause"]


def test_who_refuses_says_why(found):
    one = row(found, "impossible", "mujoco")
    assert not one["loads"]
    assert "MuJoCo refuses it" in one["cause"]
    assert "/" not in found.set_index("model").loc["nothing", "cause"].split("<")[0]


def test_the_page_counts_and_tells_the_causes(found, tmp_path):
    page.write(found, tmp_path)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    said = text.split("7 models: ")[1].split(".")[0].split(", ")
    assert said[0] == "2 equal"
    others = ("equal as rigid bodies", "other torques", "other joints", "read by pinocchio alone", "read by neither")
    assert sorted(said[1:]) == sorted(f"1 {what}" for what in others)
    assert "which pinocchio drops" in text
    assert (tmp_path / page.NAME).is_file()
