"""Public models imported and driven in three engines: no two of these differ."""

from __future__ import annotations

from functools import partial

import pytest
from campaigns.models import PAGE, imports
from campaigns.public import public_models

from support.tolerances import LINEAR

PENDULUM = """<mujoco model="pendulum"><worldbody><body name="arm"><joint name="hinge" axis="0 1 0" armature="1"/>
<inertial pos="0.1 0 -0.2" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody></mujoco>"""


@pytest.mark.campaign
def test_engines_agree_on_public_models(campaign):
    models = public_models(campaign.models, campaign.count)
    rows = campaign.carry_out(PAGE, "models", partial(imports, models))
    assert (rows["verdict"] == "agree").any()
    wrong = rows[rows["verdict"].isin(["differ", "judged"])]
    assert wrong.empty, wrong[["model", "verdict", "reason"]].to_string()


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
    assert float(rows.loc["pendulum", "loaded"]) < LINEAR  # its rotor is the imported machine's
