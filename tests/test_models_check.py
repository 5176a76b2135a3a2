"""The model check passes what was written, and names what was edited."""

from __future__ import annotations

import math
from collections.abc import Callable
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


def edited(path: Path, text: str, change: Callable[[ET.Element], None]) -> Path:
    root = ET.fromstring(text)
    change(root)
    path.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
    return path


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
    for what in ("mass", "centre of mass", "inertia tensor", "pose at home", "parent and joints"):
        assert len([row for row in full if row.what == what]) == 13
    assert len([row for row in full if row.what == "joint axis at home"]) == 26
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


@pytest.mark.parametrize("swap", [(0, 1), (3, 4), (4, 5)])
def test_swapped_inertia_entries_are_named(asymmetric: Mechanism, tmp_path: Path, swap: tuple[int, int]) -> None:
    def change(root: ET.Element) -> None:
        inertial = element(root, ".//body[@name='leg2.upper']/inertial")
        entries = inertial.get("fullinertia", "").split()
        i, j = swap
        entries[i], entries[j] = entries[j], entries[i]
        inertial.set("fullinertia", " ".join(entries))

    path = edited(tmp_path / "edited.xml", write_mjcf(asymmetric, "minimal"), change)
    rows = wrong(check_file(asymmetric, "minimal", path, "mujoco"))
    assert list(rows) == [("inertia tensor", "leg2.upper")]
    assert "mujoco: inertia tensor of leg2.upper" in check_table(list(rows.values()))


@pytest.mark.parametrize("reader", READERS[1:3])
def test_a_flipped_axis_is_named(paper: Mechanism, tmp_path: Path, reader: str) -> None:
    def change(root: ET.Element) -> None:
        element(root, ".//joint[@name='leg3.q1']/axis").set("xyz", "-1 0 0")

    path = edited(tmp_path / "edited.urdf", write_urdf(paper, "minimal"), change)
    rows = wrong(check_file(paper, "minimal", path, reader))
    assert list(rows) == [("joint axis at home", "leg3.q1")]  # at home q1 = 0: no pose shows it


def _gravity(root: ET.Element) -> None:
    element(root, "option").set("gravity", "0 0 0")


def _motor(root: ET.Element) -> None:
    element(root, "actuator/motor[@name='leg2']").set("joint", "leg3.q3")


def _site(root: ET.Element) -> None:
    element(root, ".//site[@name='leg2.wrist@child']").set("pos", "0 0.5 0.52")


def _mass(root: ET.Element) -> None:
    element(root, ".//body[@name='leg1.lower']/inertial").set("mass", "1.4200001")


def _centre(root: ET.Element) -> None:
    element(root, ".//body[@name='leg1.lower']/inertial").set("pos", "0 1e-9 0.15")


def _rename(root: ET.Element) -> None:
    element(root, ".//body[@name='platform']").set("name", "plate")


def _order(root: ET.Element) -> None:
    body = element(root, ".//body[@name='leg1.lower']")
    first, second = body.findall("joint")
    i, j = list(body).index(first), list(body).index(second)
    body[i], body[j] = second, first


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (_gravity, ("gravity", "")),
        (_motor, ("actuators", "")),
        (_site, ("closure frames", "leg2.wrist")),
        (_mass, ("mass", "leg1.lower")),
        (_centre, ("centre of mass", "leg1.lower")),
        (_rename, ("body names", "")),
        (_order, ("parent and joints", "leg1.lower")),
    ],
)
def test_other_edits_are_named(
    paper: Mechanism, tmp_path: Path, change: Callable[[ET.Element], None], what: tuple[str, str]
) -> None:
    path = edited(tmp_path / "edited.xml", write_mjcf(paper, "minimal"), change)
    assert what in wrong(check_file(paper, "minimal", path, "mujoco"))


def test_an_edited_loops_file_is_named(paper: Mechanism, tmp_path: Path) -> None:
    write_models(paper, tmp_path)
    path = tmp_path / "3ups-upu-s.loops.toml"
    text = path.read_text(encoding="utf-8").replace("child_points = [[0, 0.5,", "child_points = [[0, 0.51,")
    path.write_text(text, encoding="utf-8")
    assert list(wrong(check_file(paper, "minimal", path, "loops"))) == [("closure points and frames", "leg2.wrist")]


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
