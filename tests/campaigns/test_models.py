"""Public models imported and driven in three engines: no two of these differ, nor the library of the file's format."""

from functools import partial

import pytest
from campaigns.models import PAGE, imports
from campaigns.own_library import own_library
from campaigns.public import PACKAGES, public_models

from screwgauge.models.importing.model import import_model
from support.tolerances import LINEAR

PENDULUM = """<mujoco model="pendulum"><worldbody><body name="arm"><joint name="hinge" axis="0 1 0" armature="1"/>
<inertial pos="0.1 0 -0.2" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody></mujoco>"""


#: Models of packages, and how many of them at least are read.
ALL, READ = 110, 97


@pytest.mark.campaign
def test_engines_agree_on_public_models(campaign):
    models = public_models(campaign.models, campaign.count)
    rows = campaign.carry_out(PAGE, "models", partial(imports, models))
    assert (rows["verdict"] == "agree").any()
    wrong = rows[rows["verdict"].isin(["differ", "judged", "wrong"])]
    assert wrong.empty, wrong[["model", "verdict", "apart", "reason"]].to_string()
    packaged = rows[rows["version"] != ""]
    if campaign.count is None and {*PACKAGES} == {*packaged["source"]}:
        assert len(packaged) >= ALL
        assert (packaged["bodies"] > 0).sum() >= READ


@pytest.mark.parametrize(
    "edit",
    [('mass="1"', 'mass="1.000001"'), ('armature="1"', 'armature="1.000001"'), ("0.1 0 -0.2", "0.100001 0 -0.2")]
    + [('axis="0 1 0"', f'axis="0 1 0" {one}') for one in ('damping="1e-6"', 'stiffness="1e-6"', 'pos="0 0 1e-6"')],
)
def test_a_machine_is_wrong_beside_another_file(edit, tmp_path):
    one, other = tmp_path / "one.xml", tmp_path / "other.xml"
    one.write_text(PENDULUM, encoding="utf-8")
    other.write_text(PENDULUM.replace(*edit), encoding="utf-8")
    imported = import_model(one)
    assert not own_library(one, imported).wrong
    assert own_library(other, imported).wrong


SDF = """<sdf version="1.9"><model name="pendulum"><link name="base"/>
<joint name="anchor" type="fixed"><parent>world</parent><child>base</child></joint>
<link name="arm"><inertial><pose>0.1 0 -0.2 0 0 0.3</pose><mass>1</mass>
<inertia><ixx>0.1</ixx><iyy>0.12</iyy><izz>0.09</izz></inertia></inertial></link>
<joint name="hinge" type="revolute"><parent>base</parent><child>arm</child>
<axis><xyz>0 1 0</xyz><dynamics><damping>0.1</damping></dynamics></axis></joint></model></sdf>"""


@pytest.mark.parametrize(
    "edit", [("<mass>1<", "<mass>1.000001<"), ("0 0 0.3", "0 0 0.31"), (">0.1</d", ">0.100001</d")]
)
def test_a_machine_is_wrong_beside_what_drake_reads_from_another_file(edit, tmp_path):
    pytest.importorskip("pydrake")
    one, other = tmp_path / "one.sdf", tmp_path / "other.sdf"
    one.write_text(SDF, encoding="utf-8")
    other.write_text(SDF.replace(*edit), encoding="utf-8")
    imported = import_model(one)
    assert not own_library(one, imported).wrong
    assert own_library(other, imported).wrong


def test_every_model_has_a_row_and_its_reason(tmp_path, monkeypatch):
    monkeypatch.setattr("campaigns.public.PACKAGES", {})
    (tmp_path / "pendulum.xml").write_text(PENDULUM, encoding="utf-8")
    (tmp_path / "nothing.urdf").write_text("<robot name='x'><link name='a'/></robot>", encoding="utf-8")
    (tmp_path / "notes.txt").write_text("not looked at", encoding="utf-8")
    table = imports(public_models([tmp_path]), lambda step, share: None)
    rows = table.set_index("model")
    assert rows["verdict"].to_dict() == {"nothing": "refused", "pendulum": "agree"}
    assert rows.loc["pendulum", ["format", "joints", "freedoms", "loops"]].tolist() == ["MJCF", "R", 1, 0]
    text = (PAGE.write(table, tmp_path / "out") / "report.md").read_text(encoding="utf-8")
    assert "no degree of freedom" in text
    assert rows.loc["pendulum", "library"] == "mujoco"
    assert float(rows.loc["pendulum", "apart"]) < LINEAR  # its rotor is the imported machine's
