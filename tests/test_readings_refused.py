"""A model file that nobody here wrote is refused in one sentence, before a library could do harm."""

from __future__ import annotations

import os

import pytest

from screwgauge import ScrewgaugeError
from support.command import LIMITS
from support.errors import ModelFileError, UnknownNameError
from support.models import INERTIAL, MATTER, Options, import_model, mjcf
from support.readings import LIBRARIES, libraries_for, read

BODY = f'<body name="a"><joint name="j"/>{INERTIAL}</body>'
HINGE = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>'
ARM = f'<robot name="r"><link name="a"/><link name="b">{MATTER}</link>{HINGE}</robot>'


BOMB = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]><robot name="&b;"/>'
REFUSED = {
    "nothing": ("", "is no model: not well-formed XML"),
    "text": ("no model", "is no model: not well-formed XML"),
    "cut off": ("<robot><link name='a'>", "is no model: not well-formed XML"),
    "html": (
        "<html></html>",
        "its root element is <html>; give a URDF (<robot>), MJCF (<mujoco>) or SDF (<sdf>)",
    ),
    "entities": (BOMB, "declares the entity 'a'; write out what it stands for"),
    "outside entity": (
        '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>',
        "declares the entity 'x'",
    ),
    "xacro": (
        '<robot name="r" xmlns:xacro="http://ros.org"><xacro:include filename="a"/></robot>',
        "is a xacro file, from which a URDF is made; expand it first: xacro model > robot.urdf",
    ),
    "empty robot": ('<robot name="r"/>', "has no link"),
    "empty world": (mjcf(""), "has no body"),
    "one link": ('<robot name="r"><link name="a"/></robot>', "has no degree of freedom, as pinocchio reads it"),
    "fixed": (mjcf(f'<body name="a">{INERTIAL}</body>'), "has no degree of freedom, as mujoco reads it"),
    "two links": (ARM.replace('link name="b"', 'link name="a"'), "'a' is the name of 2 link elements"),
    "two joints": (ARM.replace("</robot>", f"{HINGE}</robot>"), "'j' is the name of 2 joint elements"),
    "two bodies": (mjcf(BODY + BODY.replace('"j"', '"k"')), "'a' is the name of 2 body elements"),
    "unnamed link": (ARM.replace('link name="a"', "link"), "a link has no name; give it one"),
    "not a number": (ARM.replace('value="1"', 'value="nan"'), "value of mass is not a finite number (nan); write one"),
    "infinite": (ARM.replace('value="1"', 'value="-inf"'), "value of mass is not a finite number (-inf); write one"),
    "negative mass": (ARM.replace('value="1"', 'value="-1"'), "mass of body b is -1 kg; give it one that is not neg"),
    "infinite mjcf": (mjcf(BODY.replace('pos="0', 'pos="infinity')), "pos of inertial is not a finite number"),
    "no such link": (ARM.replace('child link="b"', 'child link="x"'), "unknown link 'x'; choose one of: a, b"),
    "no such leader": (ARM.replace("</joint>", '<mimic joint="x"/></joint>'), "unknown joint 'x'; choose one of: j"),
    "no child": (ARM.replace('<child link="b"/>', ""), "joint j has no child; name that link"),
    "two roots": (ARM.replace("</robot>", '<link name="c"/></robot>'), "2 links hang on no joint (a, c)"),
    "no root": (ARM.replace('<link name="a"/>', "").replace('"a"', '"b"'), "every link hangs on a joint"),
    "loop": (
        ARM.replace("</robot>", HINGE.replace('"j"', '"k"') + "</robot>"),
        "link b hangs on two joints; cut the loop",
    ),
    "mimic": (
        ARM.replace("</joint>", '<mimic joint="j" multiplier="x"/></joint>'),
        "multiplier value (x) is not a valid",
    ),
    "meshes": (
        mjcf(
            '<body name="b" childclass="m"><joint name="j"/><geom mesh="x"/></body>',
            '<default><default class="m"><geom type="mesh"/></default></default>'
            '<asset><mesh name="x" file="x.stl"/></asset>',
        ),
        "mass of body b comes from meshes, which are not read; give the body an <inertial>",
    ),
    "ground that moves": (ARM.replace('"b"', '"ground"'), "a body that moves is called 'ground'"),
    "include outside": (mjcf(BODY, '<include file="../other.xml"/>'), "includes '../other.xml', which lies outside"),
    "include absolute": (mjcf(BODY, '<include file="/etc/passwd"/>'), "includes '/etc/passwd', which lies outside"),
    "include too long": (mjcf(BODY, f'<include file="{"x" * 300}"/>'), "cannot be read (file name too long)"),
    "include missing": (mjcf(BODY, '<include file="other.xml"/>'), "cannot be read (it does not exist)"),
    "include itself": (mjcf(BODY, '<include file="model"/>'), "includes 'model' twice"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_files_are_refused(case, write):
    text, said = REFUSED[case]
    path = write("model", text)
    with pytest.raises(ScrewgaugeError) as caught:
        read(path, libraries_for(path)[0])
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def declared(encoding: str, text: str) -> str:
    return f'<?xml version="1.0" encoding="{encoding}"?>\n{text}'


GREY = "<visual><geometry><box size='1 1 1'/></geometry><xacro:grey/></visual>"


@pytest.mark.parametrize("left", [GREY, GREY.replace("visual", "collision"), "<xacro:grey/>"])
@pytest.mark.parametrize("library", ["pinocchio", "mujoco"])
def test_a_call_of_a_macro_that_is_defined_nowhere_is_left_out_and_named(left, library, write):
    """Robots' files are expanded before they are published, and calls of macros that nobody has stay in them."""
    path = write("arm.urdf", ARM.replace('<link name="b">', f'<link name="b">{left}'))
    assert any("xacro:grey of link b" in phrase for phrase in import_model(path, Options(library=library)).left_out)


FOREIGN = ("ISO-8859-1", "windows-1252", "US-ASCII", "UTF-16", "UTF-7", "EBCDIC-CP-US", "x-unknown", "hex", "punycode")


@pytest.mark.parametrize("encoding", FOREIGN)
@pytest.mark.parametrize("text", [ARM, mjcf(BODY)], ids=["urdf", "mjcf"])
def test_a_declared_encoding_that_means_another_text_is_refused(encoding, text, write):
    path = write("model", declared(encoding, text.replace('"a"', '"bé"')))
    with pytest.raises(ScrewgaugeError, match="UTF-8"):
        read(path, libraries_for(path)[0])


@pytest.mark.parametrize("encoding", [name for name in FOREIGN if not name.startswith(("ISO", "win", "US-", "puny"))])
def test_an_encoding_in_which_letters_are_others_or_that_nobody_knows_is_refused(encoding, write):
    with pytest.raises(ScrewgaugeError, match=f"'{encoding}'"):
        read(write("model.urdf", declared(encoding, ARM)), "pinocchio")


@pytest.mark.parametrize("encoding", ["utf-8", "UTF8", "ISO-8859-1", "latin1", "ascii"])
def test_letters_that_all_encodings_share_are_read(encoding, write):
    assert [*read(write("model.urdf", declared(encoding, ARM)), "pinocchio").joints] == ["j"]


def test_names_of_a_file_in_utf_8_are_read_as_they_are(write):
    text = declared("utf-8", ARM.replace('"j"', '"jé"'))
    assert [*read(write("model.urdf", text), "pinocchio").joints] == ["jé"]


def test_an_included_file_in_another_encoding_is_refused(write):
    write("more.xml", declared("UTF-7", "<mujocoinclude/>"))
    with pytest.raises(ScrewgaugeError, match=r"more\.xml: declares the encoding 'UTF-7'"):
        read(write("model.xml", mjcf(BODY, '<include file="more.xml"/>')), "mujoco")


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
    with pytest.raises(ModelFileError, match="lies outside its folder"):
        read(path, "mujoco")


def test_too_many_or_too_deep_links_are_refused(write):
    n = LIMITS["links"] + 1
    many = '<robot name="r">' + "".join(f'<link name="l{i}"/>' for i in range(n)) + "</robot>"
    with pytest.raises(ScrewgaugeError, match=f"{n} links, more than"):
        read(write("many.urdf", many), "pinocchio")
    n = LIMITS["nested elements"] + 1
    with pytest.raises(ScrewgaugeError, match=f"{n} nested elements, more than"):
        read(write("deep.xml", mjcf("<frame>" * n + "</frame>" * n)), "mujoco")


def hanging(inside: str) -> str:
    """A body that swings, and what a file has MuJoCo make beside it."""
    return mjcf(f"{BODY}{inside}")


FREE = f'<body name="b"><freejoint/>{INERTIAL}</body>'
FLEX = '<flexcomp name="f" type="{}" {}="{}" dim="2" radius="0.01" mass="1"/>'
#: Few tags of which MuJoCo makes very much.
MULTIPLIED = {
    "bodies": f'<replicate count="10000000">{FREE}</replicate>',
    "nested": '<replicate count="1000">' * 3 + FREE + "</replicate>" * 3,
    "nested without end": '<replicate count="999999999">' * 400 + FREE + "</replicate>" * 400,
    "in a frame": f'<frame><replicate count="2001">{FREE}</replicate></frame>',
    "sites": '<replicate count="10001"><site/></replicate>',
    "grid": FLEX.format("grid", "count", "400 400 400"),
    "points": FLEX.format("direct", "point", "0 " * 9000),
    "cable": '<composite type="cable" count="3000 1 1" size="1" curve="s"/>',
    "cables": '<replicate count="100"><composite type="cable" count="30 1 1" size="1" curve="s"/></replicate>',
}


@pytest.mark.parametrize("case", MULTIPLIED)
def test_what_a_tag_makes_is_counted_before_a_library_sees_it(case, write):
    with pytest.raises(ScrewgaugeError, match=r"(links|copies), more than"):
        read(write("many.xml", hanging(MULTIPLIED[case])), "mujoco")


def test_models_that_are_attached_in_copies_count_as_often(write):
    write("part.xml", mjcf(BODY * 1).replace("<mujoco", '<mujoco model="part"'))
    attach = '<replicate count="2001"><frame><attach model="part" body="a" prefix="x"/></frame></replicate>'
    asset = '<asset><model name="part" file="part.xml"/></asset>'
    with pytest.raises(ScrewgaugeError, match="links, more than"):
        read(write("many.xml", mjcf(BODY + attach, asset)), "mujoco")


def test_copies_as_many_as_they_may_be_are_read(write):
    swinging = f'<body name="b"><joint name="k"/>{INERTIAL}</body>'
    text = hanging(f'<replicate count="20">{swinging}</replicate><replicate count="100"><site/></replicate>')
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
    with pytest.raises(ModelFileError, match="yourdfpy reads no MJCF"):
        read(path, "yourdfpy")
    with pytest.raises(ModelFileError, match="is MJCF, which says itself what floats"):
        read(path, "mujoco", floating=True)


REFUSALS = {
    "massless": (ARM.replace(MATTER, ""), "mujoco", "give that link mass and moments of inertia above 1e-15"),
    "without moments": (ARM.replace('ixx="1"', 'ixx="0"'), "mujoco", "three positive principal moments"),
    "no body is so long": (ARM.replace('ixx="1"', 'ixx="3"'), "mujoco", "the tensor of a body that can be"),
    "decimal comma": (
        ARM.replace('value="1"', 'value="1,5"'),
        "pinocchio",
        "drops what it cannot read (Inertial: mass [1,5]",
    ),
    "no product": (ARM.replace('ixy="0"', ""), "pinocchio", "missing ixy attribute"),
    "no direction": (ARM.replace("</joint>", '<axis xyz="0 0 0"/></joint>'), "pinocchio", "axis of joint j is 0"),
    "decimal comma in damping": (
        ARM.replace("</joint>", '<dynamics damping="0,5"/></joint>'),
        "yourdfpy",
        "could not convert string to float: '0,5'",
    ),
    "no limits": (ARM.replace("continuous", "prismatic"), "pinocchio", "Joint [j] is of type PRISMATIC without limits"),
    "wrong word": (mjcf(BODY.replace("<joint", "<joit")), "mujoco", "unrecognized"),
    "unknown class": (mjcf(BODY.replace("<joint", '<joint class="x"')), "pinocchio", "Pinocchio refuses it ("),
    "mimic": (
        ARM.replace("</joint>", '<mimic joint="j" multiplier="x"/></joint>'),
        "yourdfpy",
        "multiplier of mimic is no number (x)",
    ),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_what_one_library_refuses_is_said_with_its_reason(case, write, capfd):
    text, library, said = REFUSALS[case]
    with pytest.raises(ModelFileError) as caught:
        read(write("model", text), library)
    assert said in str(caught.value)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("library", [name for name, (forms, _) in LIBRARIES.items() if "urdf" in forms])
def test_nothing_is_written_beside_the_user(library, write, tmp_path, monkeypatch):
    """MuJoCo's own handler of warnings would leave MUJOCO_LOG.TXT."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    text = ARM if library != "mujoco" else mjcf(BODY, '<compiler settotalmass="3"/>')
    reading = read(write("model", text), library)
    assert list(folder.iterdir()) == []
    assert library != "mujoco" or any(said.startswith("what MuJoCo warns of: ") for said in reading.ignored)


def test_prefixes_need_no_declaration(write):
    """As in the files of simulators and planners, whose readers do not mind."""
    text = ARM.replace("</robot>", "<drake:tag/></robot>")
    assert read(write("model.urdf", text), "pinocchio").bodies.keys() == {"b"}


def test_a_library_that_is_not_installed_is_named(write, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "yourdfpy", None)
    with pytest.raises(ModelFileError, match="yourdfpy cannot be loaded"):
        read(write("model.urdf", ARM), "yourdfpy")
