"""A diagnosis reads what lies beside a URDF and closes its loops; loops of one side alone are never the same."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError, models
from support.command import main
from support.diagnosis import summary
from support.errors import ClosureError, ModelFileError, OutputError
from support.mechanism import load_mechanism
from support.models import write_models

pytestmark = pytest.mark.slow

NAME = "five-bar"


@pytest.fixture
def folders(tmp_path):
    """The model files of one mechanism in two folders, with loops file and `robot.yaml` beside them."""
    found = []
    for side in ("one", "other"):
        write_models(load_mechanism(NAME), folder := tmp_path / side, include=frozenset({"yaml"}))
        found.append(folder)
    return found


def urdf(folder):
    return folder / f"{NAME}.urdf"


def only(folder, *names):
    """Leaves files of these names alone, the others go; returns the URDF, called robot.urdf."""
    for path in folder.iterdir():
        if path.name not in names:
            path.unlink()
    return folder / names[0]


def yaml_only(folder, *edit):
    text = (folder / f"{NAME}.yaml").read_text(encoding="utf-8")
    assert not edit or edit[0] in text
    (folder / "robot.yaml").write_text(text.replace(*edit) if edit else text, encoding="utf-8")
    return only(folder, f"{NAME}.urdf", "robot.yaml")


def test_the_loops_file_beside_a_urdf_is_read(folders):
    for a, b in ((urdf(folders[0]), NAME), (NAME, urdf(folders[0])), (urdf(folders[0]), folders[1] / f"{NAME}.xml")):
        found = screwgauge.diagnose(a, b)
        assert found.same, found.verdict
        assert found.found.mobility == (2, 2)
        side = "AB"[(a, b).index(urdf(folders[0]))]
        assert f"{side}: {NAME}.loops.toml beside it says what closes the loops" in found.notes


@pytest.mark.parametrize(("side", "body"), [("parent", "leg2.upper"), ("child", "platform")])
def test_points_of_a_loops_file_close_the_loop(side, body, tmp_path):
    """One point is where the list of points has it, as each of two is."""
    write_models(load_mechanism("3ups-upu-s"), tmp_path)
    given = tmp_path / "3ups-upu-s.urdf"
    loops = given.with_suffix(".loops.toml")
    text = loops.read_text(encoding="utf-8")
    at = text.index(f"{side}_points = [[", text.index('joint = "leg2.wrist"')) + len(f"{side}_points = [[")
    moved, end = tmp_path / "moved.loops.toml", text.index(",", at)
    moved.write_text(f"{text[:at]}{float(text[at:end]) + 0.01}{text[end:]}", encoding="utf-8")
    (fact,) = screwgauge.diagnose(given, given, loops=(loops, moved)).found.facts
    assert (fact.part, fact.what, fact.of) == ("leg2.wrist", "end", body)
    assert float(np.linalg.norm(fact.b)) == pytest.approx(0.01)


@pytest.mark.slow
def test_loops_of_one_side_alone_are_never_the_same(folders):
    bare = only(folders[0], f"{NAME}.urdf")
    for a, b in ((bare, NAME), (NAME, bare), (bare, folders[1] / f"{NAME}.xml"), (urdf(folders[1]), bare)):
        found = screwgauge.diagnose(a, b)
        assert not found.same, found.verdict
        assert found.exit_status == 1
        assert {*found.found.mobility} == {2, 4}
        assert {(fact.what, fact.side) for fact in found.found.facts} == {("link", "BA"[(a, b).index(bare)])}
        side = "AB"[(a, b).index(bare)]
        assert any(note.startswith(f"{side}: a URDF cannot say what closes loops") for note in found.notes)
    both = screwgauge.diagnose(bare, bare)
    assert both.same
    assert not any("--loops" in note for note in both.notes)


@pytest.mark.slow
def test_loops_elsewhere_are_named_for_each_side(folders, tmp_path, command):
    a, b = (only(folder, f"{NAME}.urdf", f"{NAME}.loops.toml") for folder in folders)
    beside = [path.with_suffix(".loops.toml") for path in (a, b)]
    loops = [shutil.move(path, tmp_path / f"{i}.loops.toml") for i, path in enumerate(beside)]
    assert screwgauge.diagnose(a, b, loops=loops).found.mobility == (2, 2)
    assert screwgauge.diagnose(a, b, loops=loops[0]).found.mobility == (2, 2)  # one for both
    assert not screwgauge.diagnose(a, b, loops=(loops[0], None)).same
    assert not screwgauge.diagnose(a, b, loops=(None, loops[1])).same
    assert screwgauge.diagnose(a, NAME, loops=loops[0]).same
    out = str(tmp_path / "out")
    assert main(["diagnose", str(a), str(b), "--loops", f"{loops[0]},{loops[1]}", "--out", out]) == 0
    assert main(["diagnose", str(a), str(b), "--loops", f",{loops[1]}", "--out", out]) == 1
    assert "✓ SAME" in command("diagnose", a, NAME, "--loops", str(loops[0]), "--out", out).out


def test_a_loops_file_for_what_says_its_own_loops_is_refused(folders):
    loops, mjcf = folders[0] / f"{NAME}.loops.toml", folders[0] / f"{NAME}.xml"
    for b in (mjcf, NAME):
        with pytest.raises(ModelFileError, match="says itself what closes its loops; leave --loops out"):
            screwgauge.diagnose(urdf(folders[0]), b, loops=(None, loops))
    with pytest.raises(ModelFileError, match="say themselves what closes their loops; leave --loops out"):
        screwgauge.diagnose(mjcf, NAME, loops=loops)
    for wrong in ((loops,), (loops, loops, loops), 3, [1, 2]):
        with pytest.raises(ScrewgaugeError, match="give one file, or one for each side"):
            screwgauge.diagnose(urdf(folders[0]), NAME, loops=wrong)


def test_the_loops_file_is_named_with_its_digest_in_the_record(folders, tmp_path):
    facts = summary(screwgauge.diagnose(urdf(folders[0]), NAME))["models"]
    assert facts["A"]["loops"]["file"].endswith(f"{NAME}.loops.toml")
    assert len(facts["A"]["loops"]["sha256"]) == 64
    assert facts["B"]["loops"] is None


def test_limits_of_a_description_are_compared_where_the_model_file_has_some(tmp_path, inside):
    text = """name = "arm"
    independent.a = "a"
    bodies.one = { mass = 1, com = [0.1, 0, 0], inertia = { xx = 1e-2, yy = 1e-2, zz = 1e-2 } }
    [joints]
    a = { kind = "R", parent = "ground", child = "one", axes = [[0, 1, 0]], actuated = true, limits = [[-1, 1]] }
    """
    Path("arm.toml").write_text(text, encoding="utf-8")
    mechanism = load_mechanism("arm.toml")
    for include in (frozenset[str](), frozenset({"limits"})):
        write_models(mechanism, tmp_path, include=include)
        assert screwgauge.diagnose("arm.toml", "arm.urdf").same
    urdf_text = Path("arm.urdf").read_text(encoding="utf-8")
    Path("other.urdf").write_text(urdf_text.replace('upper="1"', 'upper="0.5"'), encoding="utf-8")
    (fact,) = screwgauge.diagnose("arm.toml", "other.urdf").found.facts
    assert (fact.part, fact.what, [*fact.a], [*fact.b]) == ("a", "limits", [-1.0, 1.0], [-1.0, 0.5])


def test_gravity_of_an_import_is_that_of_its_scene(inside):
    """A description cannot say it; its scene can, and the model files that are made of both."""
    text = (
        '<mujoco model="m"><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 1 0"/>'
        '<inertial pos="0.1 0 0.02" mass="1" diaginertia="0.01 0.02 0.02"/></body></worldbody></mujoco>'
    )
    Path("still.xml").write_text(text, encoding="utf-8")
    assert main(["import", "still.xml"]) == 0
    for made in ("still.toml", "still.xml"):
        assert main(["models", made, "--out", "made", "--check"]) == 0
        assert screwgauge.diagnose("still.xml", "made/m.xml").same
    assert screwgauge.diagnose("still.xml", "still.toml").same
    Path("still.scene.toml").unlink()
    assert any(
        note.startswith("B: ") and "gravity" in note for note in screwgauge.diagnose("still.xml", "still.toml").notes
    )


@pytest.mark.parametrize("other", ["description", "full model file"])
def test_masses_that_are_divided_among_copies_are_told_as_the_file_has_them(other, write, tmp_path):
    heavy = write("heavy.toml", 'extends = "five-bar"\nname = "heavy"\nbodies."right.rod".mass = 250\n')
    light = write("light.toml", 'extends = "five-bar"\nname = "light"\nbodies."right.rod".mass = 240\n')
    if other == "full model file":
        write_models(load_mechanism(light), tmp_path / "files")
        light = tmp_path / "files" / "light-full.xml"
    for files, masses in (((heavy, light), [250.0, 240.0]), ((light, heavy), [240.0, 250.0])):
        found = screwgauge.diagnose(*files)
        (fact,) = found.found.facts
        assert (fact.part, fact.what) == ("right.rod", "mass")
        assert [float(fact.a), float(fact.b)] == pytest.approx(masses)
        (entry,) = summary(found)["differences"]
        assert [float(entry["a"]), float(entry["b"])] == pytest.approx(masses)


@pytest.mark.parametrize("sides", [("open", "closed"), ("closed", "open"), ("open", "open")])
def test_a_description_that_closes_nowhere_is_refused_as_by_models(sides, write, refused):
    text = Path(models.__file__).parent.joinpath("five-bar", "five-bar.toml").read_text(encoding="utf-8")
    files = {"closed": write("closed.toml", text)}
    open_ = 'extends = "five-bar"\nname = "open"\njoints.tip.child_frame.position = [9, 0.3, 0]\n'
    files["open"] = write("open.toml", open_)
    said = refused("diagnose", *(files[side] for side in sides))
    assert said == refused("models", files["open"])
    assert "no pose closes its loops" in said


INERTIAL = '<inertial pos="0.1 0 0.02" mass="1" diaginertia="0.01 0.02 0.02"/>'


def test_models_that_close_nowhere_are_refused_with_loop_size_and_file(write):
    """A hinge that is held at two angles."""
    held = '<equality><joint joint1="a" polycoef="0.5 0 0 0 0"/><joint joint1="a"/></equality>'
    body = f'<worldbody><body><joint name="a" axis="0 1 0"/>{INERTIAL}</body></worldbody>'
    files = [write(name, f"<mujoco>{body}{held}</mujoco>") for name in ("a.xml", "b.xml")]
    with pytest.raises(ClosureError, match=r"a\.xml: loops do not close"):
        screwgauge.diagnose(*files)


def test_a_file_that_no_value_mends_is_not_written(write, tmp_path):
    bodies = "".join(f'<body><joint name="{name}" axis="0 1 0"/>{INERTIAL}</body>' for name in "ac")
    text = '<mujoco><worldbody>{}</worldbody><actuator><motor name="m" joint="{}"/></actuator></mujoco>'
    found = screwgauge.diagnose(*(write(f"{name}.xml", text.format(bodies, name)) for name in "ac"))
    assert found.not_fixed
    with pytest.raises(OutputError, match="nothing to write"):
        found.write_fix(tmp_path / "fixed.xml")
