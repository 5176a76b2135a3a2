"""What XML alone does not show is resolved by MuJoCo: models that are attached, masses that come from meshes."""

import os
import shutil
import struct
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.command import main
from support.data import DATA, data
from support.errors import ModelFileError
from support.models import Options, import_model
from support.readings import collect_warnings, prepare, read, read_source
from support.scene import sampled

INERTIAL = '<inertial pos="0.1 0.02 0" mass="0.{0}333333333333333" diaginertia="0.01 0.02 0.025"/>'
#: An arm that attaches a hand and, turned, the same hand again; the hand attaches fingers. Some have no names.
ATTACHED = DATA / "attached"


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    shutil.copytree(ATTACHED, tmp_path, dirs_exist_ok=True)
    return tmp_path / "arm.xml"


def by_mujoco(path: Path) -> Any:
    with collect_warnings():
        return mujoco.MjModel.from_xml_path(str(path))


def test_what_is_attached_is_read_with_all_that_it_has(arm):
    reading, model = read(arm, "mujoco"), by_mujoco(arm)
    assert len(reading.joints) == model.njnt == 6
    assert len(reading.bodies) == model.nbody - 1 == 6
    assert {"left_wrist", "right_wrist"} < reading.joints.keys()
    assert reading.joints["right_wrist"].limits == pytest.approx((-np.pi / 3, np.pi / 3), rel=1e-15, abs=0)
    assert sorted(gear for _, gear in reading.actuators.values()) == [3.0, 3.0]
    # to the last digit, of which XML that MuJoCo writes keeps six
    masses = [body.mass for body in reading.bodies.values()]
    assert masses == model.body_mass[1:].tolist()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    places = [body.pose[:3, 3] for body in reading.bodies.values()]
    assert np.array_equal(places, data.xpos[1:])
    assert any("wind: parent has 0 0 0" in phrase for phrase in reading.ignored)


@pytest.mark.slow
def test_an_arm_is_imported_with_its_limbs_and_moves(arm, tmp_path):
    imported = import_model(arm)
    assert len(imported.mechanism.independent) == 6
    assert imported.mechanism.mass == pytest.approx(read(arm, "mujoco").mass, rel=1e-15, abs=0)
    assert any("finger.xml, hand.xml" in said for said in imported.remarks)
    assert screwgauge.run(sampled(arm, [3, 50])).ok
    assert main(["diagnose", str(arm), str(arm), "--out", str(tmp_path / "out")]) in (0, 1)


def test_a_library_that_drops_what_is_attached_is_not_imported_from(arm):
    assert read(arm, "pinocchio").ignored[0] == "attached models, which pinocchio drops"
    with pytest.raises(ModelFileError, match=r"attached models.* another library"):
        import_model(arm, Options(library="pinocchio"))


def test_what_is_attached_by_a_link_to_outside_is_refused(arm, tmp_path):
    outside = tmp_path / "hand.xml"
    folder = tmp_path / "robot"
    folder.mkdir()
    shutil.copy(ATTACHED / "parts/hand.xml", outside)
    os.symlink(outside, folder / "link.xml")
    (folder / "arm.xml").write_text(data("attached/arm.xml").replace("parts/hand.xml", "link.xml"), encoding="utf-8")
    with pytest.raises(ModelFileError, match=r"'link\.xml'.*outside"):
        import_model(folder / "arm.xml")


def test_models_that_attach_each_other_without_end_are_refused(tmp_path):
    for i in range(12):
        asset = f'<asset><model name="m" file="{i + 1}.xml"/></asset>' if i < 11 else ""
        attach = '<attach model="m" prefix="a_"/><attach model="m" prefix="b_"/>' if i < 11 else ""
        body = f'<body name="b{i}"><joint name="j{i}"/>{INERTIAL.format(1)}{attach}</body>'
        text = f'<mujoco model="m{i}">{asset}<worldbody>{body}</worldbody></mujoco>'
        (tmp_path / f"{i}.xml").write_text(text, encoding="utf-8")
    with pytest.raises(ScrewgaugeError, match="11 nested models, more than 10"):
        read(tmp_path / "0.xml", "mujoco")


def test_what_is_attached_many_times_counts_as_often(tmp_path):
    for i in range(4):
        asset = f'<asset><model name="m" file="{i + 1}.xml"/></asset>' if i < 3 else ""
        attach = "".join(f'<attach model="m" prefix="{k}_"/>' for k in range(20)) if i < 3 else ""
        body = f'<body name="b"><joint name="j"/>{INERTIAL.format(1)}{attach}</body>'
        text = f'<mujoco model="m{i}">{asset}<worldbody>{body}</worldbody></mujoco>'
        (tmp_path / f"{i}.xml").write_text(text, encoding="utf-8")
    assert len(read(tmp_path / "1.xml", "mujoco").bodies) == 421
    with pytest.raises(ScrewgaugeError, match="8421 links, more than 2000"):
        prepare(tmp_path / "0.xml")


def test_flexible_bodies_are_refused_as_the_freedoms_would_differ_without_them(write):
    flex = '<flexcomp type="grid" count="3 3 1" spacing=".1 .1 .1" name="f" dim="2" radius=".01" mass="1"/>'
    body = f'<body name="a"><joint name="j"/>{INERTIAL.format(1)}</body>'
    path = write("cloth.xml", f"<mujoco><worldbody>{body}{flex}</worldbody></mujoco>")
    with pytest.raises(ModelFileError, match="flexible bodies"):
        import_model(path)


def test_frames_and_copies_are_imported_whole(write):
    body = f'<body name="{{}}" pos="0.1 0 0"><joint axis="0 0 1"/>{INERTIAL.format(1)}</body>'
    text = f'{body.format("o")}<frame euler="10 20 30">{body.format("a")}</frame>'
    text += f'<replicate count="3" offset="0 1 0">{body.format("b")}</replicate>'
    path = write("copies.xml", f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    assert [*import_model(path).mechanism.body_index][1:] == ["o", "a", "b0", "b1", "b2"]
    with pytest.raises(ModelFileError, match="which pinocchio drops"):
        import_model(path, Options(library="pinocchio"))


def stl(size: float) -> bytes:
    """A tetrahedron."""
    points = size * np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 1.0, 0.0], [0.1, 0.3, 1.0]])
    faces = (points[list(face)] for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
    rows = (struct.pack("<12fH", 0, 0, 0, *face.ravel(), 0) for face in faces)
    return bytes(80) + struct.pack("<I", 4) + b"".join(rows)


#: Bodies that weigh what their meshes do: by a class, by a density, together with a sphere, as a fixed part.
MESHES = data("shells.xml")


@pytest.fixture
def shells(tmp_path: Path) -> Path:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "BIG.stl").write_bytes(stl(0.2))
    (tmp_path / "meshes" / "small.stl").write_bytes(stl(0.1))
    (tmp_path / "shells.xml").write_text(MESHES.format(""), encoding="utf-8")
    return tmp_path / "shells.xml"


@pytest.mark.parametrize("compiler", ["", ' inertiafromgeom="true"', ' settotalmass="5"', ' boundmass="0.3"'])
def test_mass_and_inertia_of_meshes_are_those_of_mujoco(compiler, shells):
    shells.write_text(MESHES.format(compiler), encoding="utf-8")
    (shells.parent / "meshes" / "gone.stl").write_bytes(stl(0.1))
    model = by_mujoco(shells)
    (shells.parent / "meshes" / "gone.stl").unlink()  # it weighs nothing that moves
    source = prepare(shells, meshes=True)
    whole = sum(read_source(source, "mujoco").bodies[name].mass for name in "ab")
    assert whole == pytest.approx(model.body_mass[1:].sum(), rel=1e-15, abs=0)
    for element in source.root.iter("body"):
        own, i = element.find("inertial"), model.body(element.get("name")).id
        scale = model.body("a").mass[0] / float(source.root.find(".//body[@name='a']/inertial").get("mass"))
        if own is not None:
            assert float(own.get("mass")) * scale == pytest.approx(model.body_mass[i], rel=1e-14, abs=0)
            assert [*map(float, own.get("pos").split())] == pytest.approx(model.body_ipos[i], rel=1e-13, abs=1e-16)
    two = read_source(source, "pinocchio")  # which reads no settotalmass
    if not compiler:
        assert sum(body.mass for body in two.bodies.values()) == pytest.approx(whole, rel=1e-13, abs=0)


def test_meshes_are_read_on_request_only(shells, tmp_path, command, capfd):
    out = str(tmp_path / "shells.toml")
    told = command("import", shells, "-o", out, status=2).err
    assert all(fact in told for fact in ("mass of body a", "meshes", "<inertial>", "--meshes of import"))
    assert main(["import", str(shells), "-o", out, "--meshes"]) == 0
    assert "MuJoCo computes mass and inertia of a, b, c" in capfd.readouterr().out
    mass = import_model(shells, Options(meshes=True)).mechanism.mass
    assert screwgauge.load_scene(out).mechanism.mass == pytest.approx(mass, rel=1e-15, abs=0)


def test_a_check_takes_mass_from_meshes_of_one_model_and_of_pairs(shells, command):
    heavy = shells.with_name("heavy.xml")
    heavy.write_text(MESHES.format("").replace('density="300"', 'density="330"'), encoding="utf-8")
    assert "comes from meshes" in command("check", shells, status=2).out
    assert screwgauge.check(shells, meshes=True).ok
    found = screwgauge.check(shells, heavy, meshes=True)
    assert (found.exit_status, "a: mass" in found.rows[0].sentence) == (1, True), found
    assert command("check", shells, shells, "--meshes", status=0).out
    assert "--meshes applies only to model files" in command("check", "five-bar", "--meshes", status=2).err


def test_meshes_of_what_is_attached_are_read_too(shells, write):
    text = f"""<mujoco><asset><model name="s" file="shells.xml"/></asset><worldbody><body name="top">
    <joint name="t"/>{INERTIAL.format(1)}<attach model="s" body="a" prefix="x_"/></body></worldbody></mujoco>"""
    path = write("top.xml", text)
    alone, whole = (read_source(prepare(each, meshes=True), "mujoco") for each in (shells, path))
    for name in "ab":
        one, two = alone.bodies[name], whole.bodies[f"x_{name}"]
        assert (one.mass, one.com.tolist(), one.inertia.tolist()) == (two.mass, two.com.tolist(), two.inertia.tolist())
    with pytest.raises(ModelFileError, match=r"shells\.xml: mass of body a"):
        read(path, "mujoco")


@pytest.mark.parametrize("way", ["../BIG.stl", "/etc/hostname", "link.stl", "pipe.stl"])
def test_no_mesh_outside_the_folder_is_opened(way, shells, tmp_path):
    folder = tmp_path / "robot"
    folder.mkdir()
    for name in ("shells.xml", "meshes"):
        (tmp_path / name).rename(folder / name)
    (tmp_path / "secret.stl").write_bytes(stl(0.2))
    os.symlink(tmp_path / "secret.stl", folder / "meshes" / "link.stl")
    os.mkfifo(folder / "meshes" / "pipe.stl")
    (folder / "shells.xml").write_text(MESHES.format("").replace("BIG.stl", way), encoding="utf-8")
    said = (
        "it is not a regular file" if "pipe" in way else "cannot be read" if "BIG" in way else "which lies outside the"
    )
    with pytest.raises(ScrewgaugeError, match=said):
        prepare(folder / "shells.xml", meshes=True)


def test_a_mesh_that_is_none_is_refused(shells):
    (shells.parent / "meshes" / "BIG.stl").write_bytes(b"no mesh at all")
    with pytest.raises(ModelFileError, match="MuJoCo refuses it"):
        prepare(shells, meshes=True)


def test_a_diagnosis_reads_meshes_and_proves_what_differs(shells, tmp_path, write, command, capfd):
    other = write("other.xml", MESHES.format("").replace('density="300"', 'density="330"'))
    fixed, out = tmp_path / "fixed.xml", ["--out", str(tmp_path / "out")]
    assert main(["diagnose", str(shells), str(other), *out]) == 2
    assert "--meshes of import" in capfd.readouterr().err
    told = command("diagnose", shells, other, *out, "--meshes", "--fix", fixed, status=1).out
    assert "a: mass" in told
    assert "+10.00 %" in told
    assert str(tmp_path / "other.xml") in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert main(["diagnose", str(shells), str(fixed), *out, "--meshes"]) == 0
    assert main(["diagnose", str(shells), str(other), *out, "--meshes", "--fix", str(other)]) == 2
    assert "choose another file" in capfd.readouterr().err
