import xml.etree.ElementTree as ET
from functools import partial

import numpy as np
import pytest
from campaigns.edits import COUNT, KINDS, PAGE, edits, row, wrong

ARM = """<robot name="arm"><link name="base"/><link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"""


@pytest.mark.campaign
def test_edits_are_named_and_other_forms_are_the_same(campaign):
    table = campaign.carry_out(PAGE, "edits", partial(edits, campaign.count or COUNT))
    assert (table["said"] != "refused").any()
    assert wrong(table).empty, wrong(table).to_string()


@pytest.mark.parametrize(("kind", "verdict"), [("mass", "not same"), ("digits", "same")])
def test_an_edit_has_a_row(kind, verdict, write):
    file, root = write("arm.urdf", ARM), ET.fromstring(ARM)
    cells = row(file, root, KINDS[kind](root, np.random.default_rng(0)), kind)
    assert cells["expected"] == cells["said"] == verdict
    assert cells["named"] is not False
