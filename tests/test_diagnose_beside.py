"""A diagnosis reads what lies beside a URDF and closes its loops; loops of one side alone are never the same."""

from __future__ import annotations

import shutil

import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.command import main
from support.diagnosis import summary
from support.errors import ModelFileError
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
        assert found.loops.mobility == (2, 2)
        side = "AB"[(a, b).index(urdf(folders[0]))]
        assert f"what closes loops of {side} is said by {NAME}.loops.toml beside it" in found.notes


@pytest.mark.slow
def test_loops_of_one_side_alone_are_never_the_same(folders):
    bare = only(folders[0], f"{NAME}.urdf")
    for a, b in ((bare, NAME), (NAME, bare), (bare, folders[1] / f"{NAME}.xml"), (urdf(folders[1]), bare)):
        found = screwgauge.diagnose(a, b)
        assert not found.same, found.verdict
        assert found.exit_status == 1
        assert "a closure of left.rod and right.rod in " in found.verdict
        assert {*found.loops.mobility} == {2, 4}
        side = "AB"[(a, b).index(bare)]
        assert (
            f"{side} is a URDF, which cannot say what closes loops, and no file beside it does (--loops names one)"
            in found.notes
        )
    both = screwgauge.diagnose(bare, bare)
    assert both.same
    assert not any("--loops" in note for note in both.notes)


def test_two_urdfs_with_other_robot_yamls_beside_them_differ(folders):
    a, b = yaml_only(folders[0]), yaml_only(folders[1])
    assert a.read_text(encoding="utf-8") == b.read_text(encoding="utf-8")
    assert screwgauge.diagnose(a, b).same
    b = b.with_name("robot.yaml")
    b.write_text(b.read_text(encoding="utf-8").replace("3d", "6d").replace("3D", "6D"), encoding="utf-8")
    found = screwgauge.diagnose(a, urdf(folders[1]))
    assert not found.same
    assert "a weld in B, a point in A" in found.verdict


@pytest.mark.slow
def test_loops_elsewhere_are_named_for_each_side(folders, tmp_path, command):
    a, b = (only(folder, f"{NAME}.urdf", f"{NAME}.loops.toml") for folder in folders)
    beside = [path.with_suffix(".loops.toml") for path in (a, b)]
    loops = [shutil.move(path, tmp_path / f"{i}.loops.toml") for i, path in enumerate(beside)]
    assert screwgauge.diagnose(a, b, loops=loops).loops.mobility == (2, 2)
    assert screwgauge.diagnose(a, b, loops=loops[0]).loops.mobility == (2, 2)  # one for both
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
