"""A machine that stands elsewhere, is mirrored or in other units has one cause, told of the whole; its facts stay."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from screwgauge import diagnose, models
from screwgauge.diagnosis.causes.edits import WHOLE
from support.mechanism import DATA

FOLDER = Path(models.__file__).parent

#: Place, axis, mass, centre of mass, moments of each link of an arm whose first three axes lie in a plane.
ARM = (
    ((0, 0, 0.16), (0, 0, 1), 3.7, (0, 0, 0.02), (0.01, 0.01, 0.007)),
    ((0, 0.138, 0), (0, 1, 0), 8.4, (0.21, 0, 0), (0.015, 0.134, 0.134)),
    ((0.425, -0.13, 0), (0, 1, 0), 2.3, (0.2, 0, 0), (0.004, 0.03, 0.03)),
    ((0.392, 0, 0), (0, 1, 0), 1.2, (0, 0.127, 0), (0.0026, 0.0022, 0.0026)),
    ((0, 0.127, 0), (0, 0, 1), 1.2, (0, 0, -0.1), (0.0026, 0.0026, 0.0022)),
)
TURNS = [
    *(((0, 0, 1), angle) for angle in (90, 180, 30, -137)),
    *(((1, 0, 0), angle) for angle in (90, 180, 30, -77)),
    *(((0, 1, 0), angle) for angle in (90, 180, 30)),
    ((1, 1, 1), 120),
]
ARM_URDF = """<robot name="arm"><link name="base"/>
<link name="shoulder"><inertial><origin xyz="0.01 0.02 0.14"/><mass value="2.4"/>
<inertia ixx="0.021" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.004"/></inertial></link>
<link name="upper"><inertial><origin xyz="0.02 -0.015 0.11"/><mass value="1.6"/>
<inertia ixx="0.011" ixy="0.0008" ixz="-0.0006" iyy="0.0105" iyz="0.0011" izz="0.0021"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.015 0.01 0.09"/><mass value="0.9"/>
<inertia ixx="0.0031" ixy="0.0007" ixz="-0.0004" iyy="0.0042" iyz="0.0009" izz="0.0022"/></inertial></link>
<joint name="j1" type="continuous"><parent link="base"/><child link="shoulder"/><origin xyz="0 0 0.1"/>
<axis xyz="0 0 1"/></joint>
<joint name="j2" type="continuous"><parent link="shoulder"/><child link="upper"/><origin xyz="0 0.05 0.28"/>
<axis xyz="0 1 0"/></joint>
<joint name="j3" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.25"/>
<axis xyz="0 1 0"/></joint></robot>"""
NAMES = dict(zip(("j1", "j2", "j3", "shoulder", "upper", "fore", "base"), "qwertzu", strict=True))


def numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def quaternion(axis: Sequence[float], degrees: float) -> str:
    half, unit = np.radians(degrees) / 2.0, np.array(axis, float) / np.linalg.norm(axis)
    return numbers([np.cos(half), *(np.sin(half) * unit)])


def mounted(text: str, axis: Sequence[float], degrees: float, pos: str = "0 0 0") -> str:
    """The model on a mount that is turned."""
    opened = f'<worldbody><body name="mount" pos="{pos}" quat="{quaternion(axis, degrees)}">'
    return text.replace("<worldbody>", opened).replace("</worldbody>", "</body></worldbody>")


def arm(shifts: Sequence[float] = (0.0,) * len(ARM)) -> str:
    """An MJCF of the arm, its links shifted [m]."""
    text = '<mujoco model="arm"><compiler angle="degree"/><worldbody>'
    for i, ((pos, axis, mass, com, moments), shift) in enumerate(zip(ARM, shifts, strict=True)):
        text += f'<body name="l{i}" pos="{numbers(np.array(pos) + shift)}"><joint name="j{i}" axis="{numbers(axis)}"/>'
        text += f'<inertial pos="{numbers(com)}" mass="{mass}" diaginertia="{numbers(moments)}"/>'
    return f"{text}{'</body>' * len(ARM)}</worldbody></mujoco>"


def converted(length: float = 1.0, mass: float = 1.0, mirror: float = 1.0, heavier: str = "") -> str:
    """The URDF in other units, or mirrored in y where `mirror` is -1, with twice the mass of a link."""
    root = ElementTree.fromstring(ARM_URDF)
    sign = np.array([1.0, mirror, 1.0])
    for origin in root.iter("origin"):
        origin.set("xyz", numbers(length * sign * [float(x) for x in origin.attrib["xyz"].split()]))
    for axis in root.iter("axis"):
        axis.set("xyz", numbers(mirror * sign * [float(x) for x in axis.attrib["xyz"].split()]))
    for link in root.iter("link"):
        for value in link.iter("mass"):
            twice = 2.0 if link.get("name") == heavier else 1.0
            value.set("value", repr(twice * mass * float(value.attrib["value"])))
    for inertia in root.iter("inertia"):
        for entry in inertia.attrib:
            odd = mirror if entry in ("ixy", "iyz") else 1.0
            inertia.set(entry, repr(odd * mass * length**2 * float(inertia.attrib[entry])))
    return ElementTree.tostring(root, encoding="unicode")


def renamed(text: str) -> str:
    return re.sub(r'"(\w+)"', lambda match: f'"{NAMES.get(match[1], match[1])}"', text)


def proved(found) -> bool:
    return found.fix is not None and found.fix.on == "file" and found.fix.agrees


@pytest.mark.parametrize(("axis", "degrees"), TURNS)
def test_a_turned_arm_has_one_cause_at_the_ground(axis, degrees, write):
    found = diagnose(write("a.xml", arm()), write("b.xml", mounted(arm(), axis, degrees)))
    (one,) = found.differences
    assert one.item_a == "j0"
    assert one.what == ("zero" if axis == (0, 0, 1) else "placement")
    assert proved(found)


@pytest.mark.parametrize(("axis", "degrees"), TURNS)
def test_a_turned_machine_with_loops_has_one_cause_at_most(axis, degrees, write):
    text = (FOLDER / "a02-fourbar-2" / "a02-fourbar-2-full.xml").read_text(encoding="utf-8")
    found = diagnose(write("a.xml", text), write("b.xml", mounted(text, axis, degrees)))
    assert len(found.causes) == (0 if axis == (0, 0, 1) else 1)
    assert found.fix is None or proved(found)


def test_a_machine_with_several_joints_at_the_ground_starts_higher_as_a_whole(write):
    text = (FOLDER / "a02-fourbar-2" / "a02-fourbar-2-full.xml").read_text(encoding="utf-8")
    found = diagnose(write("a.xml", text), write("b.xml", mounted(text, (0, 0, 1), 0, "0 0 0.3")))
    (cause,) = found.causes
    assert (cause.name, {each.what for each in found.differences}) == (WHOLE, {"placement"})
    assert "300 mm" in found.headline
    assert len(found.differences) == 3
    assert proved(found)


def test_a_whole_that_is_turned_comes_before_what_else_differs(write):
    b = mounted(arm((0.0, 0.0, 3e-4, 0.0, 0.0)), (0, 0, 1), 180)
    found = diagnose(write("a.xml", arm()), write("b.xml", b))
    assert [(each.item_a, each.what) for each in found.differences] == [("j0", "zero"), ("j2", "placement")]
    assert found.headline.startswith("j0")
    assert proved(found)


@pytest.mark.parametrize("degrees", [0, 90, -90])
def test_two_files_of_a_robot_that_differ_by_tenths_of_a_millimetre_stand_turned(degrees, write):
    b = mounted((DATA / "six-axis.xml").read_text(encoding="utf-8"), (0, 0, 1), degrees)
    found = diagnose(DATA / "six-axis.urdf", write("b.xml", b))
    first, *others = found.causes
    assert first.name == WHOLE
    assert found.headline.startswith("the whole is elsewhere in B, turned by ")
    assert all(abs(cause.weight) < 1.5 for cause in others)
    assert all(each.what != "sign" for each in found.differences)


@pytest.mark.parametrize("names", [str, renamed])
@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"length": 1e3}, ["in mm", "in kg mm^2"]),
        ({"length": 1 / 0.0254}, ["in inches"]),
        ({"length": 1e2, "mass": 1e3}, ["in cm", "in g", "in g cm^2"]),
        ({"length": 1 / 0.0254, "mass": 1 / 0.45359237}, ["in inches", "in lb", "in lb in^2"]),
        ({"mirror": -1.0}, ["mirrored in y"]),
    ],
)
@pytest.mark.parametrize("back", [False, True])
def test_other_units_or_a_mirror_are_one_cause_of_all_facts(change, said, names, back, write):
    files = write("a.urdf", ARM_URDF), write("b.urdf", names(converted(**change)))
    found = diagnose(*(files[::-1] if back else files))
    (cause,) = found.causes
    assert cause.name == WHOLE
    assert len(cause.differences) == len(found.differences) > 4
    assert all(each.split()[-1] in cause.sentence for each in said)
    assert proved(found)


def test_what_the_whole_leaves_is_a_cause_of_its_own(write):
    found = diagnose(write("a.urdf", ARM_URDF), write("b.urdf", converted(1e3, heavier="upper")))
    whole, other = found.causes
    assert whole.name == WHOLE
    (number,) = other.differences
    assert (found.differences[number].item_a, found.differences[number].what) == ("upper", "mass")
    assert other.of_rest == pytest.approx(1.0)
    assert proved(found)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('mass="8.4"', 'mass="9.4"'),
        ('name="j2" axis="0.0 1.0 0.0"', 'name="j2" axis="0.0 -1.0 0.0"'),
        ('pos="0.425 -0.13 0.0"', 'pos="0.425 -0.17 0.0"'),
        ('name="l2" pos', 'name="l2" euler="0 0 90" pos'),
        ('diaginertia="0.004 0.03 0.03"', 'diaginertia="0.004 0.028 0.03"'),
    ],
)
def test_a_single_edit_is_never_told_of_the_whole(old, new, write):
    text = arm()
    assert old in text
    found = diagnose(write("a.xml", text), write("b.xml", text.replace(old, new)))
    assert [cause.name == WHOLE for cause in found.causes] == [False]
