"""A model file that nobody here wrote is refused in one sentence, before a library could do harm."""

import os

import pytest

from screwgauge import ScrewgaugeError
from support.command import LIMITS
from support.errors import ModelFileError, UnknownNameError
from support.models import INERTIAL, MATTER, Options, import_model, mjcf
from support.readings import LIBRARIES, read

BODY = f'<body name="a"><joint name="j"/>{INERTIAL}</body>'
HINGE = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>'
ARM = f'<robot name="r"><link name="a"/><link name="b">{MATTER}</link>{HINGE}</robot>'


def declared(encoding: str, text: str) -> str:
    return f'<?xml version="1.0" encoding="{encoding}"?>\n{text}'


GREY = "<visual><geometry><box size='1 1 1'/></geometry><xacro:grey/></visual>"


@pytest.mark.parametrize("left", [GREY, GREY.replace("visual", "collision"), "<xacro:grey/>"])
@pytest.mark.parametrize("library", ["pinocchio", "mujoco"])
def test_a_call_of_a_macro_that_is_defined_nowhere_is_left_out_and_named(left, library, write):
    """Robots' files are expanded before they are published, and calls of macros that nobody has stay in them."""
    path = write("arm.urdf", ARM.replace('<link name="b">', f'<link name="b">{left}'))
    assert any("xacro:grey of link b" in phrase for phrase in import_model(path, Options(library=library)).left_out)


@pytest.mark.parametrize("encoding", ["utf-8", "UTF8", "ISO-8859-1", "latin1", "ascii"])
def test_letters_that_all_encodings_share_are_read(encoding, write):
    assert [*read(write("model.urdf", declared(encoding, ARM)), "pinocchio").joints] == ["j"]


def test_names_of_a_file_in_utf_8_are_read_as_they_are(write):
    text = declared("utf-8", ARM.replace('"j"', '"jé"'))
    assert [*read(write("model.urdf", text), "pinocchio").joints] == ["jé"]


def test_a_file_that_is_not_there_is_refused(tmp_path):
    for path in (tmp_path / "none.urdf", tmp_path):
        with pytest.raises(ScrewgaugeError, match="cannot be read"):
            read(path, "pinocchio")


def test_no_file_outside_the_folder_is_opened_by_a_link(write, tmp_path):
    outside = write("secret.xml", "<mujoco/>")
    folder = tmp_path / "robot"
    folder.mkdir()
    os.symlink(outside, folder / "inside.xml")
    path = folder / "model.xml"
    path.write_text(mjcf(BODY, '<include file="inside.xml"/>'), encoding="utf-8")
    with pytest.raises(ModelFileError, match="lies outside the model's folder"):
        read(path, "mujoco")


def test_copies_as_many_as_they_may_be_are_read(write):
    swinging = f'<body name="b"><joint name="k"/>{INERTIAL}</body>'
    text = mjcf(f'{BODY}<replicate count="20">{swinging}</replicate><replicate count="100"><site/></replicate>')
    assert len(read(write("some.xml", text), "mujoco").joints) == 21


SIZES = ("nuser_body", "nuser_jnt", "nuser_geom", "nuser_site", "nuser_tendon", "nuser_sensor", "nkey", "njmax")


@pytest.mark.parametrize("size", [*(f'{name}="1000000000"' for name in SIZES), 'memory="900G"'])
def test_memory_that_a_file_asks_for_is_not_taken(size, write):
    assert [*read(write("large.xml", mjcf(BODY, f"<size {size}/>")), "mujoco").joints] == ["j"]


@pytest.mark.parametrize("library", ["mujoco", "pinocchio"])
def test_chains_as_long_as_they_may_be_are_read(library, write):
    n = LIMITS["nested elements"] // 2 - 10
    chain = (
        "".join(f'<body name="b{i}"><joint name="j{i}"/>{INERTIAL}<frame>' for i in range(n)) + "</frame></body>" * n
    )
    joints = read(write("long.xml", mjcf(chain)), library).joints
    assert len(joints) == (n if library == "mujoco" else 1)  # Pinocchio reads nothing that is in frames


def test_libraries_and_formats_that_do_not_meet_are_named(write):
    path = write("model.xml", mjcf(BODY))
    with pytest.raises(UnknownNameError, match="did you mean 'mujoco'"):
        read(path, "mujco")
    with pytest.raises(ModelFileError, match="yourdfpy does not read MJCF"):
        read(path, "yourdfpy")
    with pytest.raises(ModelFileError, match=r"is MJCF.* floating base"):
        read(path, "mujoco", floating=True)


@pytest.mark.parametrize("library", [name for name, (forms, _) in LIBRARIES.items() if "urdf" in forms])
def test_nothing_is_written_beside_the_user(library, write, tmp_path, monkeypatch):
    """MuJoCo's own handler of warnings would leave MUJOCO_LOG.TXT."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    text = ARM if library != "mujoco" else mjcf(BODY, '<compiler settotalmass="3"/>')
    reading = read(write("model", text), library)
    assert list(folder.iterdir()) == []
    assert library != "mujoco" or any(said.startswith("warning of MuJoCo: ") for said in reading.ignored)


def test_prefixes_need_no_declaration(write):
    """As in the files of simulators and planners, whose readers do not mind."""
    text = ARM.replace("</robot>", "<drake:tag/></robot>")
    assert read(write("model.urdf", text), "pinocchio").bodies.keys() == {"b"}


def test_a_library_that_is_not_installed_is_named(write, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "yourdfpy", None)
    with pytest.raises(ModelFileError, match="yourdfpy cannot be loaded"):
        read(write("model.urdf", ARM), "yourdfpy")
