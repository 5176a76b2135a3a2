import json

import pytest

from support import robots
from support.command import main


@pytest.fixture
def arms(tmp_path, inside):
    return [str(path) for path in robots.write(tmp_path)]


@pytest.mark.slow
def test_the_same_is_0_and_a_difference_1_with_report_json_and_fix(arms, tmp_path, command):
    assert "SAME" in command("diagnose", *arms).out
    other = robots.edited(tmp_path / "arm.xml", 'damping="0.14"', 'damping="0.24"', "other.xml")
    out, fix = tmp_path / "out", tmp_path / "fixed.xml"
    said = command("diagnose", arms[0], other, "--out", out, "--fix", fix, status=1).out
    said = " ".join(said.split())
    assert all(fact in said for fact in ("joint4: damping 0.2400 N m s/rad in B", "0.1400 N m s/rad in A"))
    assert {path.name for path in out.iterdir()} >= {"report.md", "report.html", "diagnosis.json", "plots"}
    assert {path.name for path in (out / "plots").iterdir()} == {
        *("machines.svg", "torques-by-joint.svg", "torques-by-cause.svg")
    }
    found = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    assert found["differences"][0]["what"] == "damping"
    assert found["fix"]["proved"]
    assert found["models"]["B"]["sha256"]
    report = (out / "report.md").read_text(encoding="utf-8")
    assert report.index("| no. | share | class | cause |") < report.index(
        "| screwgauge |"
    )  # causes before any environment
    for heading in ("What the differences change", "Which joint is which", "What was not read", "Files"):
        assert f"## {heading}" in report
    assert json.loads(command("diagnose", arms[0], fix, "--json").out)["same"]
    said = command("diagnose", arms[0], other, "--json", "--fix", tmp_path / "again.xml", status=1)
    assert not json.loads(said.out)["same"]  # and nothing stands behind it
    assert said.err.startswith("fixed: ")


def test_a_fix_has_the_format_of_b(arms, tmp_path, capsys):
    other = robots.edited(tmp_path / "arm.xml", 'damping="0.14"', 'damping="0.24"', "other.xml")
    assert main(["diagnose", arms[0], str(other), "--fix", "fixed.urdf"]) == 2
    said = capsys.readouterr().err
    assert all(fact in said for fact in ("fixed.urdf: ", "MJCF", "--fix"))
    assert not (tmp_path / "fixed.urdf").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot", "not well-formed XML"),
        ("<thing/>", "its root element is <thing>"),
        ('<robot name="x"><link name="a"/></robot>', "no degree of freedom"),
    ],
)
def test_bad_input_is_2_in_one_sentence(arms, tmp_path, write, command, text, words):
    bad = write("bad.urdf", text)
    said = command("diagnose", arms[0], bad, "--out", tmp_path / "out", status=2).err
    assert words in said
    assert "Traceback" not in said
    assert not (tmp_path / "out").exists()


def test_names_that_do_not_exist_are_2(arms, write, command):
    assert "unknown library 'drake'" in command("diagnose", arms[0], f"{arms[1]}@drake", status=2).err
    assert main(["diagnose", arms[0], "nothing.xml"]) == 2
    mapping = write("map.toml", 'joint0 = "jointX"\n')
    assert "jointX" in command("diagnose", *arms, "--map", mapping, status=2).err
    mapping.write_text("joint0 = 3\n", encoding="utf-8")
    assert main(["diagnose", *arms, "--map", str(mapping)]) == 2
    mapping.write_text("joint0", encoding="utf-8")
    assert main(["diagnose", *arms, "--map", str(mapping)]) == 2


def test_a_map_overrides_names(arms, tmp_path, capsys):
    swapped = (tmp_path / "arm.xml").read_text(encoding="utf-8")
    swapped = swapped.replace('"joint2"', '"x"').replace('"joint4"', '"joint2"').replace('"x"', '"joint4"')
    (tmp_path / "swapped.xml").write_text(swapped, encoding="utf-8")
    assert main(["diagnose", arms[1], "swapped.xml"]) == 1
    assert "joint2 is joint4, joint4 is joint2" in " ".join(capsys.readouterr().out.split())
    (tmp_path / "map.toml").write_text('joint2 = "joint4"\njoint4 = "joint2"\n', encoding="utf-8")
    assert main(["diagnose", arms[1], "swapped.xml", "--map", "map.toml"]) == 0


def test_no_fix_is_written_where_there_is_nothing_to_fix(arms, tmp_path, command):
    assert "no corrected file can be written" in command("diagnose", *arms, "--fix", "fixed.xml", status=2).err
    assert not (tmp_path / "fixed.xml").exists()
