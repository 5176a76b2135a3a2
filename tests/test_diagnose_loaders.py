"""One file, two libraries: which of them leaves out what is said, and the proof is one of readings."""

from __future__ import annotations

import pytest

import screwgauge
from screwgauge.casebook.book import CASES as BOOK
from screwgauge.diagnosis.properties import PROPERTIES
from support import robots
from support.diagnosis import STATES
from support.errors import OutputError
from support.readings import draw, read

BAR = (
    '<mujoco><option gravity="0 0 -1.62"/><worldbody><body name="bar" gravcomp="0.3"><joint name="j" axis="0 1 0" '
    'stiffness="3"/><inertial pos="0.2 0 0.1" mass="2" diaginertia="0.01 0.02 0.02"/></body></worldbody></mujoco>'
)


@pytest.fixture
def bar(write):
    return write("bar.xml", BAR)


@pytest.mark.parametrize("sides", [("mujoco", "pinocchio"), ("pinocchio", "mujoco")])
def test_a_loader_that_leaves_something_out_is_named_and_the_proof_agrees(bar, sides, tmp_path):
    found = screwgauge.diagnose(*(f"{bar}@{library}" for library in sides))
    assert {each.what for each in found.differences} == {"gravity", "stiffness", "gravcomp"}
    assert "pinocchio does not use what the file says of " in found.verdict
    for what in ("gravity", "stiffness", "compensated share of weight"):
        assert what in found.verdict.partition("does not use what the file says of")[2]
    assert "mujoco does not use" not in found.verdict
    assert "(casebook: " in found.verdict
    assert {"pin-mjcf-gravity", "pin-mjcf-gravcomp", "pin-mjcf-springs"} <= {
        *found.verdict.replace(",", " ").replace(")", " ").split()
    }
    with pytest.raises(OutputError, match="A and B are one file"):
        found.write_fix(tmp_path / "fixed.xml")


def test_what_the_library_of_b_does_not_read_from_the_changed_file_is_named(bar, tmp_path, write):
    other = write("other.xml", BAR.replace('mass="2"', 'mass="2.02"'))
    found = screwgauge.diagnose(f"{bar}@mujoco", f"{other}@pinocchio")
    assert all(case in found.verdict for case in ("pin-mjcf-gravity", "pin-mjcf-springs", "pin-mjcf-gravcomp"))
    assert {*found.found.fix.unheard} == {"gravity", "stiffness", "gravcomp"}
    found.write_fix(tmp_path / "fixed.xml")
    assert screwgauge.diagnose(bar, tmp_path / "fixed.xml").same
    copy = write("copy.xml", BAR)
    found = screwgauge.diagnose(f"{bar}@mujoco", f"{copy}@pinocchio")
    assert "pinocchio does not use what the file says of" in found.verdict


def test_cases_that_are_named_are_in_the_casebook():
    named = {case for each in PROPERTIES.values() for case in (*each.cases.values(), each.call)}
    assert named - {""} <= {*BOOK}


def test_what_calls_of_libraries_leave_out_is_noted_though_the_readings_agree(tmp_path):
    path = robots.write(tmp_path)[0]
    found = screwgauge.diagnose(f"{path}@mujoco", f"{path}@pinocchio")
    assert found.same
    (note,) = [note for note in found.notes if "urdf-damping-one-side" in note]
    assert note.startswith("mj_inverse of A contains damping, rnea of B does not: called as they are, they differ by")
    alike = screwgauge.diagnose(f"{path}@mujoco", f"{path}@mujoco")
    assert not [note for note in alike.notes if "casebook" in note]


def test_the_difference_of_calls_is_that_of_the_libraries(tmp_path):
    import re

    import mujoco
    import numpy as np
    import pinocchio

    path = robots.write(tmp_path)[0]
    found = screwgauge.diagnose(f"{path}@mujoco", f"{path}@pinocchio", seed=3)
    said = re.search(r"differ by ([\d.]+) [N m]+ at (\w+)", next(n for n in found.notes if "casebook" in n))
    place = list(found.b.reading.joints).index(said[2])
    one, other = mujoco.MjModel.from_xml_path(str(path)), pinocchio.buildModelFromUrdf(str(path))
    one.dof_frictionloss[:] = 0.0
    one.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    states, data, apart = draw(found.b.reading, STATES, 3), mujoco.MjData(one), []
    for q, v, a in zip(states.q, states.qd, states.qdd, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(one, data)
        apart.append(data.qfrc_inverse - pinocchio.rnea(other, other.createData(), q, v, a))
    assert float(said[1]) == pytest.approx(np.abs(apart)[:, place].max(), rel=1e-3)


LINK = (
    '<link name="{0}"><inertial><origin xyz="0.2 0 0.1"/><mass value="2"/>'
    '<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="{3}"><parent link="{1}"/><child link="{2}"/><axis xyz="0 1 0"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/>{4}</joint>'
)


def chain(path, first, second):
    """A base and three links; the middle joint is fixed."""
    joints = (("a", "w", "p", "revolute", ""), ("b", "p", "q", "fixed", first), ("c", "q", "r", "revolute", second))
    parts = [LINK.format(name) for name in "pqr"] + [JOINT.format(*joint) for joint in joints]
    path.write_text(f'<robot name="chain"><link name="w"/>{"".join(parts)}</robot>', encoding="utf-8")
    return path


def test_a_fixed_joint_follows_nothing(tmp_path):
    path = chain(tmp_path / "chain.urdf", '<mimic joint="a" multiplier="2"/>', "")
    found = screwgauge.diagnose(f"{path}@pinocchio", f"{path}@mujoco")
    assert found.same, found.verdict


@pytest.mark.parametrize("library", ["pinocchio", "yourdfpy"])
def test_what_follows_a_fixed_joint_is_held(tmp_path, library):
    path = chain(tmp_path / "chain.urdf", "", '<mimic joint="b" offset="0.1" multiplier="2"/>')
    (coupling,) = read(path, library).couplings.values()
    assert (coupling.joint, coupling.function.lead, coupling.function.polynomial.tolist()) == ("c", "", [0.1])
