"""What somebody may have done to a file is found from the facts; an edit that no slip makes has no reason."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from screwgauge.diagnosis.answer import phrase
from screwgauge.diagnosis.causes.reasons import Reason, reasons
from screwgauge.diagnosis.explanation import Explanation, explained
from screwgauge.diagnosis.machine.alignment import partners
from screwgauge.models.readings.read import libraries_for, read

URDF = """<?xml version="1.0"?>
<robot name="arm"><mujoco><compiler fusestatic="false"/></mujoco>
<link name="base"/>
<link name="shoulder"><inertial><origin xyz="0.01 0.02 0.14" rpy="0 0 0"/><mass value="2.4"/>
 <inertia ixx="0.021" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.004"/></inertial></link>
<link name="upper"><inertial><origin xyz="0.02 -0.015 0.11" rpy="0.3 0.2 -0.4"/><mass value="1.6"/>
 <inertia ixx="0.011" ixy="0.0008" ixz="-0.0006" iyy="0.0105" iyz="0.0011" izz="0.0021"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.015 0.01 0.09" rpy="0 0 0"/><mass value="0.9"/>
 <inertia ixx="0.0031" ixy="0.0007" ixz="-0.0004" iyy="0.0042" iyz="0.0009" izz="0.0022"/></inertial></link>
<link name="gripper"><inertial><origin xyz="0.03 0.01 0.06" rpy="0 0 0"/><mass value="0.8"/>
 <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.0013" iyz="0" izz="0.0034"/></inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="shoulder"/><origin xyz="0 0 0.1" rpy="0 0 0"/>
 <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="50" velocity="3"/>
 <dynamics damping="0.5" friction="0.3"/></joint>
<joint name="j2" type="revolute"><parent link="shoulder"/><child link="upper"/>
 <origin xyz="0.03 0.05 0.28" rpy="0.4 0 0.6"/><axis xyz="0 1 0"/>
 <limit lower="-1.57" upper="2.3" effort="50" velocity="3"/><dynamics damping="0.2" friction="0.1"/></joint>
<joint name="j3" type="revolute"><parent link="upper"/><child link="fore"/>
 <origin xyz="0 0.02 0.25" rpy="0 1.5708 0.2"/><axis xyz="0 1 0"/>
 <limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
<joint name="gr" type="fixed"><parent link="fore"/><child link="gripper"/>
 <origin xyz="0 0.05 0.2" rpy="1.5 0 0.7"/></joint>
</robot>"""

MJCF = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="shoulder" pos="0 0 0.1">
 <joint name="j1" axis="0 0 1" range="-2 2" armature="0.5" damping="2" stiffness="3"/>
 <inertial pos="0.01 0.02 0.14" mass="2.4" diaginertia="0.021 0.02 0.004"/>
 <geom type="box" size="0.05 0.04 0.15" contype="0" conaffinity="0"/>
 <body name="upper" pos="0.03 0.05 0.28" euler="0.4 0.5 0.6"><joint name="j2" axis="0 1 0" range="-2 2"/>
  <inertial pos="0.02 -0.015 0.11" quat="0.8 0.2 -0.4 0.4" mass="1.6" diaginertia="0.011 0.0105 0.0021"/>
  <geom type="capsule" size="0.03 0.1" contype="0" conaffinity="0"/>
  <body name="fore" pos="0 0.02 0.25" quat="0.1 0.7 0.5 0.5"><joint name="j3" axis="0 1 0" range="-2 2"/>
   <inertial pos="0.015 0.01 0.09" mass="0.9" fullinertia="0.0031 0.0042 0.0022 0.0007 -0.0004 0.0009"/>
  </body></body></body></worldbody>
 <equality><joint joint1="j3" joint2="j2" polycoef="0.25 1.5 0 0 0"/></equality>
 <actuator><motor name="m1" joint="j1" gear="20"/></actuator></mujoco>"""

GEOMS = re.sub(r"<inertial[^>]*/>", "", MJCF).replace(
    "</body></body></body>", '<geom size="0.05"/></body></body></body>'
)

#: Inertia of `fore` in the URDF, to be written differently.
_FORE = 'ixx="0.0031" ixy="0.0007" ixz="-0.0004" iyy="0.0042" iyz="0.0009" izz="0.0022"'


def _scaled(factor: float) -> str:
    return re.sub(r'"([^"]*)"', lambda number: f'"{float(number[1]) * factor:.10g}"', _FORE)


def _edited(text: str, edits: dict[str, str]) -> str:
    for old, new in edits.items():
        assert old in text
        text = text.replace(old, new)
    return text


def _files(folder: Path, texts: tuple[str, str]) -> tuple[Path, Path]:
    a, b = (folder / f"{side}.{'urdf' if '<robot' in text else 'xml'}" for side, text in zip("ab", texts, strict=True))
    a.write_text(texts[0])
    b.write_text(texts[1])
    return a, b


def _explained(files: tuple[Path, Path]) -> Explanation:
    a, b = (read(file, libraries_for(file)[0]) for file in files)
    return explained(a, b, partners(a, b))


def _reasons(folder: Path, a: str, b: str) -> list[Reason]:
    files = _files(folder, (a, b))
    explanation = _explained(files)
    assert explanation.facts
    return reasons(explanation.facts, explanation.pair, files)


#: The gripper and its joint in the URDF; the inertial of the shoulder in the MJCF.
_LINK = URDF[URDF.index('<link name="gripper"') : URDF.index('<joint name="j1"')]
_JOINT = URDF[URDF.index('<joint name="gr"') : URDF.index("</robot>")]
_GRIPPER = {_LINK: "", _JOINT: ""}
#: The same without a rotation between the two; `fore` with the gripper in it, not turned, computed by hand.
_ALONG = URDF.replace('rpy="1.5 0 0.7"', 'rpy="0 0 0"')
_GRIPPER_ALONG = {_LINK: "", _JOINT.replace('rpy="1.5 0 0.7"', 'rpy="0 0 0"'): ""}
_WHOLE = {'xyz="0.015 0.01 0.09"': 'xyz="0.0220588235294 0.0335294117647 0.17"', '"0.9"': '"1.7"'}
_SUM = 'ixx="0.0071" ixy="0.0007" ixz="-0.0004" iyy="0.0055" iyz="0.0009" izz="0.0056"'
_JOINED = (
    'ixx="0.020398823529411768" ixy="0.0003823529411764706" ixz="-0.00148" iyy="0.01783529411764706" iyz="-0.0027" '
    'izz="0.006754117647058824"'
)
_SHOULDER = '<inertial pos="0.01 0.02 0.14" mass="2.4" diaginertia="0.021 0.02 0.004"/>'
_COM, _PLACE, _LIMITS = '"0.02 -0.015 0.11"', 'xyz="0.03 0.05 0.28"', 'lower="-1.57" upper="2.3"'
_INERTIAL, _TURN, _QUAT = 'rpy="0.3 0.2 -0.4"', 'rpy="0.4 0 0.6"', 'quat="0.1 0.7 0.5 0.5"'
_RADIAN, _RANGE, _COUPLING = 'angle="radian"', 'axis="0 1 0" range="-2 2"', '"0.25 1.5 0 0 0"'

#: Text of A; edits that make B of it; slip, names and numbers that it tells, and how many facts it explains.
Case = tuple[str, dict[str, str], str, tuple[str | float, ...], int]
SLIPS: list[Case] = [
    (URDF, {'"2.4"': '"2400"'}, "unit", ("g",), 1),
    (URDF, {'"2.4"': '"5.291"'}, "unit", ("lb",), 1),
    (URDF, {'"2.4"': '"0.0024"'}, "unit of A", ("g",), 1),
    (URDF, {'"2.4"': '"0"'}, "left out", (), 1),
    (URDF, {'"2.4"': '"24"'}, "decimal point", (1,), 1),
    (URDF, {'"2.4"': '"x"', '"1.6"': '"2.4"', '"x"': '"1.6"'}, "exchanged", ("shoulder", "upper"), 2),
    (URDF, {'"0.8"': '"800"'}, "unit", ("g",), 3),
    (URDF, _GRIPPER, "missing part", ("gripper", "B"), 3),
    (_ALONG, _GRIPPER_ALONG | _WHOLE | {_FORE: _SUM}, "merged without parallel axis", ("gripper", "B"), 1),
    (URDF, _GRIPPER | _WHOLE | {_FORE: _JOINED}, "merged without rotation", ("gripper", "B"), 2),
    (URDF, {_COM: '"20 -15 110"'}, "unit", ("mm",), 1),
    (URDF, {_COM: '"0.7874 -0.5906 4.3307"'}, "unit", ("inches",), 1),
    (URDF, {_COM: '"0 0 0"'}, "left out", (), 1),
    (URDF, {_COM: '"0.02 0.015 0.11"'}, "mirrored", ("y",), 1),
    (URDF, {_COM: '"0.11 -0.015 0.02"'}, "order", ("zyx",), 1),
    (URDF, {_COM: '"0.02 -0.15 0.11"'}, "decimal point", (1,), 1),
    (URDF, {_FORE: _scaled(1e6)}, "unit", ("kg mm^2",), 1),
    (URDF, {_FORE: _scaled(1e7)}, "unit", ("g cm^2",), 1),
    (URDF, {'iyy="0.0042"': 'iyy="0.042"'}, "decimal point", (1,), 1),
    (URDF, {"0.0007": "-0.0007", '"-0.0004"': '"0.0004"', "0.0009": "-0.0009"}, "products of other sign", (), 1),
    (URDF, {'ixz="-0.0004"': 'ixz="0.0004"'}, "other sign", (), 1),
    (URDF, {"0.0007": "0", "-0.0004": "0", "0.0009": "0"}, "no products", (), 1),
    (URDF, {'ixx="0.0031"': 'ixx="0.0042"', 'iyy="0.0042"': 'iyy="0.0031"'}, "order of moments", (), 1),
    (URDF, {_INERTIAL: 'rpy="0 0 0"'}, "not turned", ("A",), 1),
    (URDF, {_INERTIAL: 'rpy="17.188734 11.459156 -22.918312"'}, "degrees", ("B",), 1),
    (MJCF, {'quat="0.8 0.2 -0.4 0.4" mass': 'quat="0.2 -0.4 0.4 0.8" mass'}, "w last", ("B",), 1),
    (URDF, {_TURN: 'rpy="22.918 0 34.377"'}, "degrees", ("B",), 1),
    (URDF, {_TURN: 'rpy="0.6 0 0.4"'}, "sequence", ("B", "XYZ", "zyx"), 1),
    (URDF, {'rpy="0 1.5708 0.2"': 'rpy="0 90 11.459"'}, "degrees", ("B",), 1),
    (MJCF, {'euler="0.4 0.5 0.6"': 'euler="22.918 28.648 34.377"'}, "degrees", ("B",), 1),
    (MJCF, {_RADIAN: 'angle="radian" eulerseq="XYZ"'}, "sequence", ("B", "XYZ", "xyz"), 1),
    (MJCF, {_QUAT: 'quat="0.7 0.5 0.5 0.1"'}, "w last", ("B",), 1),
    (MJCF, {_QUAT: 'quat="1 0 0 0"'}, "no rotation", (), 1),
    (MJCF, {_QUAT: 'quat="-0.1 0.7 0.5 0.5"'}, "transposed", (), 1),
    (URDF, {_PLACE: 'xyz="30 50 280"'}, "unit", ("mm",), 1),
    (URDF, {_PLACE: 'xyz="0.03 -0.05 0.28"'}, "mirrored", ("y",), 1),
    (URDF, {_PLACE: 'xyz="0.03 0.05 2.8"'}, "decimal point", (1,), 1),
    (URDF, {_LIMITS: 'lower="-90" upper="131.78"'}, "unit", ("degrees",), 1),
    (MJCF, {_RANGE: 'axis="0 1 0" range="-114.59 114.59"'}, "unit", ("degrees",), 2),
    (URDF, {_LIMITS: 'lower="-2.3" upper="1.57"'}, "counted back", (), 1),
    (URDF, {'upper="2.3"': 'upper="23"'}, "decimal point", (1,), 1),
    (MJCF, {'damping="2"': 'damping="0.0349066"'}, "unit", ("N m s/deg",), 1),
    (MJCF, {"-9.81": "9.81"}, "upside down", (), 1),
    (MJCF, {"-9.81": "-9810"}, "unit", ("mm/s^2",), 1),
    (MJCF, {"0 0 -9.81": "-9.81 0 0"}, "turned", (90.0,), 1),
    (MJCF, {"-9.81": "0"}, "left out", (), 1),
    (MJCF, {'"0.5"': '"0.00125"', 'gear="20"': 'gear="1"'}, "before the gear", ("B", 20.0), 2),
    (MJCF, {'"0.5"': '"0.00125"'}, "before the gear", ("B", 20.0), 1),
    (MJCF, {'"0.5"': '"0.025"'}, "gear once", ("B", 20.0), 1),
    (MJCF, {_COUPLING: '"1.5 0.25 0 0 0"'}, "exchanged coefficients", (), 1),
    (MJCF, {_COUPLING: '"0.25 0.66666667 0 0 0"'}, "inverse multiplier", (), 1),
    (MJCF, {_COUPLING: '"0.25 -1.5 0 0 0"'}, "other sign", (), 1),
    (MJCF, {_COUPLING: '"14.323945 1.5 0 0 0"'}, "offset in degrees", (), 1),
    (MJCF, {_RADIAN: 'angle="radian" settotalmass="9.8"'}, "settotalmass", ("B", 9.8), 1),
    (GEOMS, {"<worldbody>": '<default><geom density="2700"/></default><worldbody>'}, "density", (1e3, 2.7e3), 1),
    (MJCF, {_RADIAN: 'angle="radian" inertiafromgeom="true"'}, "inertiafromgeom", ("B",), 5),
    (MJCF, {_SHOULDER: ""}, "default density", ("B",), 2),
]


@pytest.mark.parametrize("case", SLIPS, ids=[f"{case[2]} {i}" for i, case in enumerate(SLIPS)])
def test_a_slip_is_named_from_its_facts(case: Case, tmp_path: Path) -> None:
    """The slip is among the reasons, once, with what it names and all that it explains; words hold these values."""
    text, edits, slip, values, count = case
    found = _reasons(tmp_path, text, _edited(text, edits))
    (reason,) = [each for each in found if each.slip == slip]
    for value, expected in zip(reason.values, values, strict=True):
        assert value == (expected if isinstance(expected, str) else pytest.approx(expected, rel=1e-6))
    assert len(reason.facts) == count
    assert phrase(reason)


#: Numbers of the texts that take part in the motion, by what stands before them.
_NUMBERS = re.compile(r'(?:xyz|value|pos|mass|i[xyz]{2}|damping|armature|range|lower|upper)="([^"]+)"')


def _changed(text: str, at: random.Random) -> str:
    """One number that is neither 0 nor 1, by a factor that nobody slips by."""
    places = [m.span(1) for m in _NUMBERS.finditer(text)]
    while True:
        start, end = at.choice(places)
        words = text[start:end].split()
        i = at.randrange(len(words))
        if float(words[i]) not in (0.0, 1.0):
            words[i] = f"{float(words[i]) * at.uniform(1.07, 1.9):.6g}"
            return text[:start] + " ".join(words) + text[end:]


@pytest.mark.parametrize("text", [URDF, MJCF, GEOMS], ids=["urdf", "mjcf", "geoms"])
@pytest.mark.parametrize("seed", range(20))
def test_a_number_that_nobody_slips_by_has_no_reason(text: str, seed: int, tmp_path: Path) -> None:
    """A factor between 1.07 and 1.9 is none of the slips."""
    found = _reasons(tmp_path, text, _changed(text, random.Random(seed)))
    assert [(each.slip, each.values) for each in found] == []


#: Edits that a careless table would give a reason: zero vectors, rotations of one angle, tensors with equal moments.
NONE: list[tuple[str, dict[str, str]]] = [
    (URDF, {_TURN: 'rpy="0.4 0 0.7"'}),
    (URDF, {_TURN: 'rpy="0 0.9 0"'}),
    (URDF, {'xyz="0 0 0.1"': 'xyz="0.02 0 0.1"'}),
    (URDF, {'lower="-2" upper="2"': 'lower="-114" upper="114"'}),
    (URDF, {'"2.4"': '"5.2"'}),
    (MJCF, {'diaginertia="0.011 0.0105 0.0021"': 'diaginertia="0.011 0.011 0.0021"'}),
    (MJCF, {_SHOULDER: _SHOULDER.replace("0.01 0.02 0.14", "0.01 0.02 0.1")}),
    (MJCF, {'armature="0.5"': 'armature="0.0013"'}),
    (MJCF, {'armature="0.5"': 'armature="0"'}),
    (MJCF, {'gear="20"': 'gear="30"'}),
    (MJCF, {_COUPLING: '"0.3 1.4 0 0 0"'}),
    (GEOMS, {'size="0.05 0.04 0.15"': 'size="0.05 0.05 0.15"'}),
]


@pytest.mark.parametrize(("text", "edits"), NONE)
def test_a_chance_match_is_no_reason(text: str, edits: dict[str, str], tmp_path: Path) -> None:
    """None of these values is made from A's by a slip."""
    assert [(each.slip, each.values) for each in _reasons(tmp_path, text, _edited(text, edits))] == []
