import hashlib
import json
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import pytest

import screwgauge
from screwgauge.study.comparison import SCHEMA, provenance
from screwgauge.study.run import run
from support.command import main
from support.models import write_models

DATE = datetime(2020, 2, 2, 2, 2, 2, tzinfo=UTC)


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture
def edited(paper_scene, tmp_path) -> Path:
    scene = screwgauge.load_scene(paper_scene())
    write_models(scene.mechanism, tmp_path)
    (tmp_path / "3ups-upu-s.xml").rename(tmp_path / "mine.xml")
    return paper_scene(models='models = { mujoco = "mine.xml" }')


def test_files_are_named_as_given_with_their_hashes(edited, tmp_path):
    found = run(
        screwgauge.load_scene(edited), ["screw", "pinocchio", "mujoco"], ["joint_position"], date=DATE
    ).provenance
    description = Path(screwgauge.load_scene(edited).mechanism_file)
    assert found["scene_file"] == str(edited)
    assert found["scene_sha256"] == sha256(edited)
    assert found["description"] == {"file": "built-in 3ups-upu-s.toml", "sha256": sha256(description)}
    assert found["models"]["screw"] == found["description"]
    assert found["models"]["mujoco"] == {"file": str(tmp_path / "mine.xml"), "sha256": sha256(tmp_path / "mine.xml")}
    assert found["models"]["pinocchio"]["file"] == "generated 3ups-upu-s.urdf"
    assert found["models"]["pinocchio"]["sha256"] == sha256(tmp_path / "3ups-upu-s.urdf")  # written alike
    assert (found["date"], found["schema"]) == ("2020-02-02T02:02:02+00:00", SCHEMA)


def test_one_changed_byte_of_a_model_shows(edited, tmp_path):
    scene = screwgauge.load_scene(edited)
    files = {"mujoco": tmp_path / "mine.xml"}
    before = provenance(scene, files, date=DATE)
    with files["mujoco"].open("a", encoding="utf-8") as file:
        file.write(" ")
    after = provenance(scene, files, date=DATE)
    assert before.pop("models") != after.pop("models")
    assert before == after


def test_a_simulation_names_its_files_too():
    found = screwgauge.run(
        screwgauge.load_scene("a01-pendulum").at([0.0, 0.5]), engines=["screw", "pinocchio"]
    ).provenance
    assert found["scene_file"] == "built-in a01-pendulum.toml"
    assert found["models"]["screw"]["file"] == "built-in a01-pendulum.toml"
    assert found["models"]["pinocchio"]["file"] == "generated a01-pendulum.urdf"
    assert all(len(model["sha256"]) == 64 for model in found["models"].values())


def test_a_file_that_has_gone_since_has_no_hash(edited):
    scene = screwgauge.load_scene(edited)
    edited.unlink()
    assert provenance(scene, {}, date=DATE)["scene_sha256"] is None


def test_dates_are_in_universal_time():
    date = datetime(2020, 2, 2, 1, 0, tzinfo=timezone(timedelta(hours=2)))
    assert provenance(None, {}, date=date) == {"date": "2020-02-01T23:00:00+00:00", "schema": SCHEMA}


@pytest.mark.slow
def test_report_and_summary_name_the_files(edited, tmp_path, capsys):
    assert main(["run", str(edited), "--quantities", "generalized_force", "--out", str(tmp_path / "out")]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["models"]["mujoco"]["sha256"] == sha256(tmp_path / "mine.xml")
    assert set(summary) >= {"models", "scene_file", "description", "date", "schema"}
    for name in ("report.md", "report.html"):
        text = (tmp_path / "out" / name).read_text(encoding="utf-8").replace("<wbr>", "")
        for words in (
            str(edited),
            "mine.xml",
            "generated 3ups-upu-s.urdf",
            sha256(tmp_path / "mine.xml"),
            summary["date"],
        ):
            assert words in text


def test_names_of_built_in_files_show_no_place(tmp_path):
    found = provenance(screwgauge.load_scene("3ups-upu-s"), {}, date=DATE)
    assert str(Path(screwgauge.__file__).parent) not in json.dumps(found)
