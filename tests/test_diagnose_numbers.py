"""Numbers in the sentences of a diagnosis are those of the files, each in the frame that its file gives it."""

from __future__ import annotations

import re

import pytest

import screwgauge
from support.diagnosis import summary
from support.mechanism import load_mechanism
from support.models import write_models

#: One hinge; the frame of the body sits at an offset of the joint, or is turned about the hinge.
ARM = """<mujoco><compiler angle="radian"/><option gravity="{g}"/><worldbody>
<body name="arm" pos="{pos}" euler="{euler}"><joint name="j" axis="{axis}" pos="{joint}" {more}/>
<inertial pos="{com}" mass="{mass}" diaginertia="{tensor}"/>{inside}</body></worldbody></mujoco>"""
USUAL = {
    "g": "0 0 -9.81",
    "pos": "0 0 0",
    "euler": "0 0 0",
    "axis": "0 1 0",
    "joint": "0 0 0",
    "more": "",
    "com": "-.1 0 -.15",
    "mass": "2",
    "tensor": ".01 .02 .03",
    "inside": "",
}


#: A quarter of a turn about z.
TURNED = {"euler": "0 0 1.5707963267948966", "axis": "1 0 0"}


@pytest.fixture
def diagnosed(diagnosed):
    """Of the arm with some entries in A and others in B."""
    return lambda a, b: diagnosed(ARM.format(**USUAL | a), ARM.format(**USUAL | b))


def test_a_centre_of_mass_is_said_in_the_frame_of_each_file(diagnosed):
    found = diagnosed({}, {"pos": ".01 0 0", "joint": "-.01 0 0", "com": "-.12 0 -.15"})
    assert [each.sentence for each in found.differences] == [
        "arm: centre of mass (-0.1200, 0, -0.15) m in B, (-0.1000, 0, -0.15) m in A, each in the frame of its own file "
        "(-10 mm along x of arm in A)"
    ]
    turned = diagnosed({}, {**TURNED, "com": "0 .12 -.15", "tensor": ".02 .01 .03"})
    (said,) = [each.sentence for each in turned.differences]
    assert said.startswith("arm: centre of mass (0, 0.12, -0.15) m in B, (-0.1, 0, -0.15) m in A, each in ")


def test_an_entry_of_a_tensor_that_is_seen_in_other_axes_says_in_which(diagnosed):
    found = diagnosed({}, {**TURNED, "com": "0 .1 -.15", "tensor": ".02 .011 .03"})
    (said,) = [each.sentence for each in found.differences]
    assert said == "arm: inertia yy 0.01100 kg m^2 in B, 0.01000 kg m^2 in A (+10.00 %), along the axes of B"


def test_gravity_is_said_along_the_axes_of_each_world(diagnosed):
    turned = {"pos": "0 0 0", "euler": "1.5707963267948966 0 0"}
    inertial = '<inertial pos="0 0 .1" mass="1" diaginertia=".1 .1 .1"/>'
    chain = f'<body name="tip" pos=".2 0 .1"><joint name="k" axis="1 0 0"/>{inertial}</body>'
    found = diagnosed({"inside": chain}, {**turned, "inside": chain, "g": "0 9.5 0"})
    said = " ".join(each.sentence for each in found.differences)
    assert "gravity" in said
    for numbers in re.findall(r"gravity \((.*?)\) m/s\^2 in B, \((.*?)\) m/s\^2 in A", said):
        assert [{abs(float(x)) for x in one.split(",")} for one in numbers] == [{0.0, 9.5}, {0.0, 9.81}]
        assert numbers[0].startswith("0, 9.5")


def test_limits_of_a_joint_that_counts_the_other_way_are_those_of_the_file(diagnosed):
    found = diagnosed({"more": 'range="-1 2"'}, {"axis": "0 -1 0", "more": 'range="-2 0.5"'})
    said = [each.sentence for each in found.differences if each.what == "limits"]
    assert said == ["j: limits (-2.000, 0.5000) rad in B, (-1.000, 2.000) rad in A; B counts the other way"]
    found = diagnosed(
        {"more": 'stiffness="3" springref=".4"'}, {"axis": "0 -1 0", "more": 'stiffness="3" springref="-.5"'}
    )
    (said,) = [each.sentence for each in found.differences if each.what == "rest"]
    assert said == "j: rest of the spring -0.5000 rad in B, 0.4000 rad in A (+25.00 %); B counts the other way"


def test_a_body_of_several_links_names_those_that_have_mass(diagnosed):
    hand = '<body name="hand" pos="0 0 .1"><inertial pos="0 0 0" mass="{}" diaginertia=".01 .01 .01"/></body>'
    frame = '<body name="tcp" pos="0 0 .2"/>'
    one, two = {"inside": hand.format(1) + frame}, {"inside": hand.format(1.5) + frame}
    found = diagnosed(one, two)
    assert "arm: mass 3.500 kg in B, 3.000 kg in A (+16.67 %), with hand" in [d.sentence for d in found.differences]
    alone = diagnosed(one, {"inside": frame, "mass": "4"})
    sentences = [each.sentence for each in alone.differences]
    assert "arm: mass 4.000 kg in B, 3.000 kg in A (+33.33 %), with hand in A" in sentences
    assert "with" not in diagnosed({"inside": frame}, {"inside": frame, "mass": "3"}).differences[0].sentence


@pytest.mark.slow
@pytest.mark.parametrize("other", ["description", "full model file"])
def test_masses_that_we_divide_among_copies_are_said_as_the_file_has_them(other, write, tmp_path):
    write("heavy.toml", 'extends = "five-bar"\nname = "heavy"\nbodies."right.rod".mass = 250\n')
    light = write("light.toml", 'extends = "five-bar"\nname = "light"\nbodies."right.rod".mass = 240\n')
    if other == "full model file":
        write_models(load_mechanism(light), tmp_path / "files")
        light = tmp_path / "files" / "light-full.xml"
    for a, b, numbers in (
        (tmp_path / "heavy.toml", light, "240.00 kg in B, 250.00 kg in A (-4.00 %)"),
        (light, tmp_path / "heavy.toml", "250.00 kg in B, 240.00 kg in A (+4.17 %)"),
    ):
        found = screwgauge.diagnose(a, b)
        masses = [each for each in found.differences if each.what == "mass"]
        assert len(masses) == 1
        numbers = numbers.replace(".00 kg", ".0 kg")
        said = re.sub(r", with right.rod@tip in [AB]$", "", masses[0].sentence)
        assert said == f"right.rod: mass {numbers}"
        for number in ("125", "120"):
            assert number not in found.verdict
        entry = next(each for each in summary(found)["differences"] if each["what"] == "mass")
        assert {float(entry["a"]), float(entry["b"])} == {240.0, 250.0}
        assert "100.0000 % of the torque difference" in found.verdict
