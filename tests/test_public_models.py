"""The study of public models: a row for each, with the reason where it ends early, and a page of them."""

from __future__ import annotations

import pytest
from campaigns import imports
from campaigns.imports import Public, models_in
from campaigns.imports_page import PAGE as page

from screwgauge.reference.errors import DescriptionError

PENDULUM = """<mujoco model="pendulum"><worldbody><body name="arm"><joint name="hinge" axis="0 1 0" armature="1"/>
<inertial pos="0.1 0 -0.2" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    (folder / "pendulum.xml").write_text(PENDULUM, encoding="utf-8")
    (folder / "nothing.urdf").write_text("<robot name='x'><link name='a'/></robot>", encoding="utf-8")
    (folder / "notes.txt").write_text("not looked at", encoding="utf-8")
    return imports.imports(models_in([folder]))


def test_every_model_has_a_row(found):
    rows = found.set_index("model")
    assert sorted(rows.index) == ["nothing", "pendulum"]
    assert rows.loc["pendulum", "verdict"] == "agree"
    assert float(rows.loc["pendulum", "max_scaled"]) < 1e-11
    assert rows.loc["pendulum", ["format", "joints", "freedoms", "loops"]].tolist() == ["MJCF", "R", 1, 0]
    assert "armature of 'hinge'" in rows.loc["pendulum", "left_out"]
    assert rows.loc["nothing", "verdict"] == "refused"
    assert "no degree of freedom" in rows.loc["nothing", "reason"]


def test_the_page_says_who_is_refused_and_why(found, tmp_path):
    page.write(found, tmp_path)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "| platform |" in text.partition("## Environment")[0]
    assert "2 models: " in text
    assert "no degree of freedom" in text
    assert "armature of 'hinge'" in text
    assert (tmp_path / page.NAME).is_file()


def test_packages_that_are_missing_are_named(monkeypatch):
    def missing(name: str) -> None:
        raise imports.PackageNotFoundError(name)

    monkeypatch.setattr(imports, "distribution", missing)
    with pytest.raises(DescriptionError, match=r"example-robot-data is not installed"):
        imports.listed_models()


def test_models_of_packages_are_listed_once():
    class Somewhere:
        def locate_file(self, path: str) -> str:
            return f"/somewhere/{path}"

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(imports, "distribution", lambda name: Somewhere())
        models = imports.listed_models()
    assert len({model.file for model in models}) == len(models) >= 30
    assert isinstance(models[0], Public)
    assert sum(model.floating for model in models) >= 5
