import math
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from screwgauge.models import check
from screwgauge.models.check import CheckRow
from support.errors import UnknownNameError
from support.mechanism import FOLDER, Mechanism, load_mechanism, mechanism_names
from support.models import check_file, check_models, check_table, write_mjcf, write_models, write_urdf

READERS = [
    "loops",
    pytest.param("yourdfpy", marks=pytest.mark.skipif("not __import__('importlib.util').util.find_spec('yourdfpy')")),
    "pinocchio",
    "mujoco",
]


@pytest.fixture(scope="module")
def asymmetric() -> Mechanism:
    return load_mechanism("3ups-upu-s-asymmetric")


def wrong(rows: list[CheckRow]) -> dict[tuple[str, str], CheckRow]:
    return {(row.what, row.item): row for row in rows if not row.ok}


def element(root: ET.Element, path: str) -> ET.Element:
    found = root.find(path)
    assert found is not None, path
    return found


@pytest.mark.sampled(4)
@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("name", mechanism_names())
def test_kept_files_say_what_the_description_says(name: str, reader: str) -> None:
    mechanism = load_mechanism(name)
    rows = check_models(mechanism, FOLDER / name, readers=[reader])
    assert rows
    assert all(row.ok for row in rows), check_table(rows)


def test_every_property_is_compared(paper: Mechanism, tmp_path: Path) -> None:
    write_models(paper, tmp_path)
    rows = check_models(paper, tmp_path, readers=["mujoco"])
    full = [row for row in rows if "-full" in row.file]
    for what in ("mass", "centre of mass", "inertia tensor", "home pose", "parent and joints"):
        assert len([row for row in full if row.what == what]) == 13
    assert len([row for row in full if row.what == "home axis"]) == 26
    assert {"body names", "coordinate names", "total mass", "gravity", "actuators"} < {row.what for row in full}


def test_fullinertia_has_mujocos_order(asymmetric: Mechanism) -> None:
    """MJCF: xx yy zz xy xz yz; URDF: xx xy xz yy yz zz. All six entries of this tensor differ."""
    xx, xy, xz, yy, yz, zz = 6.87e-1, 4.3e-2, -6.1e-2, 7.24e-1, 3.7e-2, 9.21e-1
    inertia = asymmetric.body("platform").inertia
    np.testing.assert_array_equal(inertia, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    mjcf = ET.fromstring(write_mjcf(asymmetric, "minimal"))
    written = element(mjcf, ".//body[@name='platform']/inertial").get("fullinertia", "")
    assert [float(value) for value in written.split()] == [xx, yy, zz, xy, xz, yz]
    urdf = ET.fromstring(write_urdf(asymmetric, "minimal"))
    entries = element(urdf, ".//link[@name='platform']/inertial/inertia").attrib
    assert {key: float(value) for key, value in entries.items()} == {
        "ixx": xx,
        "ixy": xy,
        "ixz": xz,
        "iyy": yy,
        "iyz": yz,
        "izz": zz,
    }


PAPER, ASYMMETRIC, URDF = "3ups-upu-s.xml", "3ups-upu-s-asymmetric.xml", "3ups-upu-s.urdf"
TENSOR = "0.0099 0.0094 0.00097 0.00019 -0.00028 0.00033"
AXIS = '<child link="leg3.base.cross1" />\n    <axis xyz="1 0 0" />'
TURNED = AXIS.replace('"1', '"-1')
HINGES = ['<joint name="leg1.q1" type="hinge" axis="1 0 0" />', '<joint name="leg1.q2" type="hinge" axis="0 1 0" />']
FIRST, SECOND = ("\n        ".join(some) for some in (HINGES, HINGES[::-1]))
#: File as written, reader, old and new text, the only property and item that differ; or one of them.
ONE = [
    (ASYMMETRIC, "mujoco", TENSOR, "0.0094 0.0099 0.00097 0.00019 -0.00028 0.00033", "inertia tensor", "leg2.upper"),
    (ASYMMETRIC, "mujoco", TENSOR, "0.0099 0.0094 0.00097 -0.00028 0.00019 0.00033", "inertia tensor", "leg2.upper"),
    (ASYMMETRIC, "mujoco", TENSOR, "0.0099 0.0094 0.00097 0.00019 0.00033 -0.00028", "inertia tensor", "leg2.upper"),
    # at home q1 = 0: no pose shows it
    *((URDF, reader, AXIS, TURNED, "home axis", "leg3.q1") for reader in ("pinocchio", "yourdfpy")),
    ("3ups-upu-s.loops.toml", "loops", "child_points = [[0, 0.5,", "child_points = [[0, 0.51,",
     "closure points and frames", "leg2.wrist"),
]  # fmt: skip
AMONG = [
    (PAPER, "mujoco", "0 0 -9.81", "0 0 0", "gravity", ""),
    (PAPER, "mujoco", 'joint="leg2.q3"', 'joint="leg3.q3"', "actuators", ""),
    (PAPER, "mujoco", "0 0.5 0.5196152422706632", "0 0.5 0.52", "closure frames", "leg2.wrist"),
    (PAPER, "mujoco", 'mass="1.42"', 'mass="1.4200001"', "mass", "leg1.lower"),
    (PAPER, "mujoco", 'pos="0 0 0.15"', 'pos="0 1e-9 0.15"', "centre of mass", "leg1.lower"),
    (PAPER, "mujoco", 'body name="platform"', 'body name="plate"', "body names", ""),
    (PAPER, "mujoco", FIRST, SECOND, "parent and joints", "leg1.lower"),
]


@pytest.mark.parametrize(("file", "reader", "old", "new", "what", "item"), [*ONE, *AMONG])
def test_an_edit_is_named(file, reader, old, new, what, item, write):
    name = file.partition(".")[0]
    text = (FOLDER / name / file).read_text(encoding="utf-8")
    assert old in text
    rows = wrong(check_file(load_mechanism(name), "minimal", write(file, text.replace(old, new, 1)), reader))
    assert (what, item) in rows
    assert len(rows) == 1 or (file, reader, old, new, what, item) in AMONG
    assert f"{reader}: {what} of {item or 'the model'}" in check_table([*rows.values()])


def test_a_file_that_cannot_be_read_is_a_row(paper: Mechanism, write) -> None:
    (row,) = check_file(paper, "minimal", write("broken.xml", "<mujoco><worldbody>"), "mujoco")
    assert (row.ok, row.what) == (False, "file")
    assert math.isnan(row.difference)
    assert "XML" in row.found


def test_a_missing_library_is_a_row(paper: Mechanism, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    rows = check_models(paper, FOLDER / paper.name, readers=["mujoco"])
    assert [row.ok for row in rows] == [False, False]
    assert "mujoco" in rows[0].found


def test_only_installed_libraries_read_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check, "find_spec", lambda name: None)
    assert check.installed_readers() == ("loops",)


def test_an_unknown_reader_is_named(paper: Mechanism, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'mujoco'"):
        check_models(paper, tmp_path, readers=["mujco"])
