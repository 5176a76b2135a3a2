from functools import partial

import pytest
from campaigns.public import Public, public_models
from campaigns.readers import PAGE, reader_matrix
from campaigns.two_readers import SAME

ARM = """<mujoco model="arm"><option gravity="0 0 {gravity}"/><worldbody><body name="upper" pos="0 0 1">
<joint name="shoulder" axis="0 1 0" {joint}/><inertial pos="0.1 0.02 -0.2" mass="1" diaginertia="0.1 0.12 0.09"/>
<body name="lower" pos="0.3 0 0"><joint name="elbow" axis="1 0 0"/>
<inertial pos="0 0.1 0.05" mass="0.5" diaginertia="0.03 0.02 0.01"/></body></body>{more}</worldbody></mujoco>"""
SECOND = """<body name="other"><joint name="hinge" axis="0 1 0"/>
<inertial pos="0.1 0 0" mass="2" diaginertia="1 1 1"/></body>"""
FLAT = """<robot name="flat"><link name="base"/><link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.5" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"""


@pytest.mark.campaign
def test_what_libraries_read_apart_has_a_cause(campaign):
    models = public_models(campaign.models, campaign.count)
    rows = campaign.carry_out(PAGE, "readers", partial(reader_matrix, models))
    assert rows["loads"].any()
    assert (rows["cause"] != "")[~rows["loads"] | (rows["torque"] > SAME) | rows["torque"].isna()].all()


CASES = {  # what the other library reads: torques alike, rigid bodies alike, the cause
    "plain.xml": (ARM.format(gravity=-9.81, joint="", more=""), True, True, ""),
    "damped.xml": (
        ARM.format(gravity=-9.81, joint='damping="0.5"', more=""),
        *(False, True, "inverse dynamics of pinocchio leave out damping"),
    ),
    "space.xml": (ARM.format(gravity=0, joint="", more=""), False, False, "(0, 0, 0) m/s^2 in A"),
    "trees.xml": (ARM.format(gravity=-9.81, joint="", more=SECOND), False, False, "body other, which pinocchio drops"),
    "flat.urdf": (FLAT, False, False, "MuJoCo refuses it"),
}


@pytest.mark.parametrize("name", CASES)
def test_what_the_other_library_reads(name, tmp_path):
    text, torque, rigid, cause = CASES[name]
    (tmp_path / name).write_text(text, encoding="utf-8")
    table = reader_matrix([Public(tmp_path / name, name, "here")], lambda step, share: None)
    own, other = table.to_dict("records")
    assert own["loads"]
    assert (other["torque"] < SAME, other["rigid"] < SAME) == (torque, rigid)
    assert cause in other["cause"]
    assert bool(cause) == bool(other["cause"])
    assert cause in (PAGE.write(table, tmp_path / "out") / "report.md").read_text(encoding="utf-8").replace("\\", "")
