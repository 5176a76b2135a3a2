import os
import re
import tomllib
from pathlib import Path

import pytest
from fuzz import document, places

from screwgauge import ScrewgaugeError, load_scene
from support.command import LIMITS, main, named_file, read_file
from support.errors import DescriptionError, ModelFileError
from support.mechanism import ROD, load_mechanism
from support.models import read_loops

BOM = b"\xef\xbb\xbf"
SCENE = 'mechanism = "rod.toml"\nmotion = { csv = "motion.csv" }\n'
CSV = "t,x,xd,xdd\n0,0,0,0\n1,0,0,0\n"
FILES = {"scene.toml": SCENE, "rod.toml": ROD, "motion.csv": CSV}


@pytest.fixture
def folder(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("name", FILES)
def test_a_byte_order_mark_is_no_part_of_the_text(name, folder):
    (folder / name).write_bytes(BOM + FILES[name].encode())
    assert len(load_scene(folder / "scene.toml").t) == 2


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: os.mkfifo(path), "(it is not a regular file)"),
        (lambda path: path.symlink_to("/dev/zero"), "(it is not a regular file)"),
        (lambda path: path.mkdir(), "(is a directory)"),
        (lambda path: None, "(it does not exist)"),
        (lambda path: path.symlink_to(path), "levels of symbolic links"),
        (lambda path: path.write_bytes(b"# \xe4\n"), "is not UTF-8 text"),
    ],
)
def test_what_is_no_text_file_is_refused_at_once(name, make, said, folder, refused):
    (folder / name).unlink()
    make(folder / name)
    refusal = refused("run", folder / "scene.toml")
    assert f"{folder / name}: " in refusal
    assert said in refusal


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_too_large_is_refused_unread(name, folder, refused, monkeypatch):
    monkeypatch.setitem(LIMITS, "MB of CSV", 1)
    monkeypatch.setitem(LIMITS, "MB", 1)
    with (folder / name).open("r+b") as file:
        file.truncate(1_000_001)
    most = "MB of CSV" if name.endswith("csv") else "MB"
    assert f"{name}: cannot be read (it has more than 1 {most})" in refused("run", folder / "scene.toml")


def test_a_path_of_null_bytes_is_refused(folder):
    with pytest.raises(DescriptionError, match="cannot be read"):
        read_file(folder / "a\0b")


@pytest.mark.parametrize("name", ["no/such.toml", "./scene", "such.toml", "/"])
@pytest.mark.parametrize("load", [load_scene, load_mechanism])
def test_a_missing_path_is_no_unknown_name(name, load):
    with pytest.raises(DescriptionError, match=r"cannot be read \((it does not exist|is a directory)\)"):
        load(name)


def test_the_users_own_folder_is_known_in_every_path(folder, monkeypatch):
    monkeypatch.setenv("HOME", str(folder))
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    text = SCENE.replace('"rod', '"~/rod').replace('"motion', '"~/motion') + 'models.screw = "~/rod.toml"\n'
    (elsewhere / "scene.toml").write_text(text, encoding="utf-8")
    (elsewhere / "more.toml").write_text('extends = "~/rod.toml"\nname = "more"\n', encoding="utf-8")
    scene = load_scene("~/elsewhere/scene.toml")
    assert scene.models["screw"] == scene.mechanism_file == folder / "rod.toml"
    assert load_mechanism("~/elsewhere/more.toml").name == "more"
    assert named_file(folder, "~nobody-of-that-name/x") == folder / "~nobody-of-that-name/x"


@pytest.mark.parametrize("key", ["title", "description", '"\\u001b[31m"', "figures = [{ panels"])
@pytest.mark.parametrize("character", ["\\u001b[2J", "\\u0000", "\\u009b", "\\u007f", "\\b"])
def test_control_characters_are_refused(key, character, folder):
    (folder / "scene.toml").write_text(f'title = "{character}"\n{SCENE}', encoding="utf-8")
    with pytest.raises(DescriptionError, match=r"contains the control character U\+00"):
        load_scene(folder / "scene.toml")


@pytest.mark.parametrize(
    ("what", "old", "new"),
    [
        ("samples", "motion =", "time = { duration = 1, step = 1e-9 }\nmotion ="),
        ("harmonics", 'csv = "motion.csv"', f"x.harmonics = {[[0, 0, 0]] * 1001}"),
        ("coefficients", 'csv = "motion.csv"', f"x.polynomial = {[0] * 101}"),
        ("entries", "motion =", f"loads = {[0] * 1001}\nmotion ="),
        ("panels", "motion =", "figures = [{ title = '', quantity = 'joint_position', unit = '', panels = "
         f"{{ {', '.join(f'p{i} = []' for i in range(25))} }} }}]\nmotion ="),
    ],
)  # fmt: skip
def test_a_scene_of_more_than_anyone_can_work_with_is_refused(what, old, new, folder):
    (folder / "scene.toml").write_text(SCENE.replace(old, new), encoding="utf-8")
    with pytest.raises(DescriptionError, match=re.escape(f"{what}, more than {LIMITS[what]:.6g}")):
        load_scene(folder / "scene.toml")


def test_a_csv_with_too_many_columns_is_refused(folder):
    (folder / "motion.csv").write_text("# a comment\n" + "t," * 1_000_000 + "x\n", encoding="utf-8")
    with pytest.raises(DescriptionError, match="1e\\+06 CSV columns, more than 1000"):
        load_scene(folder / "scene.toml")


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("0,0,0,0\n" + "," * 1_000_000, "1e+06 CSV columns, more than 1000"),
        ("," * 1_000_000, "1e+06 CSV columns, more than 1000"),
        ('"\n",' * 100_000, "a quoted string spans several lines"),
        ("0,0,0,0,0\n", "more fields than the header"),
    ],
)
def test_a_row_with_too_many_fields_is_refused_at_once(rows, said, folder):
    """Pandas took a minute for a first row of a million fields."""
    (folder / "motion.csv").write_text(f"t,x,xd,xdd\n{rows}", encoding="utf-8")
    with pytest.raises(DescriptionError, match=re.escape(said)):
        load_scene(folder / "scene.toml")


@pytest.mark.parametrize("what", ["bodies", "joints"])
def test_a_mechanism_of_too_many_parts_is_refused(what, folder):
    more = "\n".join(f"{what}.x{i} = {{}}" for i in range(LIMITS[what]))
    (folder / "rod.toml").write_text(ROD + more, encoding="utf-8")
    with pytest.raises(DescriptionError, match=f"rod.toml: {LIMITS[what] + 1} {what}, more than {LIMITS[what]}"):
        load_mechanism(folder / "rod.toml")


def test_a_number_that_is_a_novel_is_refused(folder):
    (folder / "rod.toml").write_text(ROD.replace("mass = 1", f'mass = "{"1+" * 500_000}1"'), encoding="utf-8")
    with pytest.raises(DescriptionError, match="characters, more than 1000"):
        load_mechanism(folder / "rod.toml")


@pytest.mark.parametrize("name", ["scene.toml", "rod.toml"])
@pytest.mark.parametrize("number", [f"0x{'f' * 5000}", "9" * 5000, f"0b1{'0' * 5000}", f"-{'9' * 400}"])
def test_a_whole_number_of_thousands_of_digits_is_refused_wherever_it_stands(number, name, folder):
    """Of hexadecimal digits TOML reads any count, and no complaint could print them."""
    for *above, last in places(tomllib.loads(FILES[name])):
        node = table = tomllib.loads(FILES[name])
        for key in above:
            node = node[key]
        node[last] = "NUMBER"
        (folder / name).write_text(document(table).replace('"NUMBER"', number), encoding="utf-8")
        with pytest.raises(ScrewgaugeError) as refusal:
            load_scene(folder / "scene.toml")
        assert str(folder / name) in str(refusal.value)


@pytest.mark.slow
@pytest.mark.parametrize("size", ["nuser_body", "nkey"])
def test_an_mjcf_that_reserves_memory_without_end_is_refused(size, paper_models, tmp_path, paper_scene, refused):
    text = f'<mujocoinclude><size {size}="1000000000"/></mujocoinclude>'
    (tmp_path / "sizes.xml").write_text(text, encoding="utf-8")
    text = paper_models["3ups-upu-s.xml"].replace("</mujoco>", '<include file="sizes.xml"/></mujoco>')
    (tmp_path / "own.xml").write_text(text, encoding="utf-8")
    said = refused("run", paper_scene(models='models.mujoco = "own.xml"'), "--engines", "screw,mujoco")
    assert f"own.xml, {size} of size: 1e+09 entries, more than {LIMITS['entries']}" in said


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "suffix"), [("pinocchio", ".urdf"), ("mujoco", ".xml")])
@pytest.mark.parametrize("damage", ["bom", "latin-1", "links", "fifo", "declared"])
def test_a_model_file_is_read_as_all_others(
    engine, suffix, damage, paper_models, tmp_path, paper_scene, refused, capfd
):
    text = paper_models[f"3ups-upu-s{suffix}"].encode()
    end = text.rindex(b"</")
    many = {".urdf": b"<link name='x'/>", ".xml": b'<worldbody><replicate count="2001"><body/></replicate></worldbody>'}
    data = {
        "bom": BOM + text,
        "latin-1": text + b"<!-- \xe4 -->",
        "declared": b'<?xml version="1.0" encoding="UTF-7"?>' + text,
        "links": text[:end] + (many[suffix] * 2001 if suffix == ".urdf" else many[suffix]) + text[end:],
    }
    if damage == "fifo":
        os.mkfifo(tmp_path / f"own{suffix}")
    else:
        (tmp_path / f"own{suffix}").write_bytes(data[damage])
    scene = paper_scene(models=f'models.{engine} = "own{suffix}"')
    command = ["run", str(scene), "--engines", f"screw,{engine}", "--quantities", "generalized_force"]
    if damage == "bom":
        assert main([*command, "--out", str(tmp_path / "out")]) == 0
        return
    said = refused(*command)
    assert re.search("is not UTF-8 text|the encoding 'UTF-7'|links, more than 2000|does not exist", said)


@pytest.mark.parametrize("key", ["bodies", "joints", "closures", "tree", "independent"])
def test_a_loops_file_with_a_number_in_the_place_of_a_list_is_refused(key, paper_models, write):
    data = tomllib.loads(paper_models["3ups-upu-s.loops.toml"])
    with pytest.raises(ModelFileError, match=f"{key}: -1 is not a"):
        read_loops(write("own.loops.toml", document(data | {key: -1})))


def test_limits_are_documented():
    text = (Path(__file__).parents[1] / "harness/scenes/README.md").read_text(encoding="utf-8")
    for what, most in LIMITS.items():
        assert re.search(rf"^\| {what}\b.* \| {most} \|$", text, re.MULTILINE), what
