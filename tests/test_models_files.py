import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from support.errors import OutputError, UnknownNameError
from support.mechanism import FOLDER, Mechanism, load_mechanism, mechanism_names
from support.models import PARTS, lay_out, model_texts, write_mjcf, write_models, write_urdf
from support.tolerances import PLACED

EXTRA_ELEMENTS = {"geom", "contact", "sensor", "exclude", "camera", "light", "asset", "tendon"}


@pytest.mark.slow
@pytest.mark.parametrize("name", mechanism_names())
def test_kept_files_are_those_written_now(name: str) -> None:
    texts = model_texts(load_mechanism(name))
    assert len(texts) == 6
    for file, text in texts.items():
        kept = (FOLDER / name / file).read_text(encoding="utf-8")
        (words, numbers), (kept_words, kept_numbers) = (words_and_numbers(each) for each in (text, kept))
        assert kept_words == words, f"write {file} again"
        # processors multiply and add in different orders, which the last bit of a rotation shows
        np.testing.assert_allclose(kept_numbers, numbers, rtol=PLACED, atol=PLACED, err_msg=f"write {file} again")


def words_and_numbers(text: str) -> tuple[list[str], list[float]]:
    number = r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])"
    return re.split(number, text), [float(each) for each in re.findall(number, text)]


@pytest.mark.parametrize(("cut", "coordinates", "closures", "rows"), [("minimal", 14, 4, 12), ("full", 26, 4, 24)])
def test_both_cuts_have_their_counts(paper: Mechanism, cut: str, coordinates: int, closures: int, rows: int) -> None:
    mujoco = pytest.importorskip("mujoco")
    pinocchio = pytest.importorskip("pinocchio")
    tree = lay_out(paper, cut)
    assert len(tree.coordinates) == coordinates
    assert len(tree.closures) == closures
    model = mujoco.MjModel.from_xml_string(write_mjcf(paper, cut))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert (model.nq, model.nv, model.neq, data.nefc) == (coordinates, coordinates, closures, rows)
    assert tuple(model.joint(i).name for i in range(model.njnt)) == tree.coordinates
    urdf = pinocchio.buildModelFromXML(write_urdf(paper, cut))
    assert (urdf.nq, urdf.nv) == (coordinates, coordinates)
    assert set(urdf.names) == {"universe", *tree.coordinates}


def test_full_cut_shares_the_platform_among_five_pieces(paper: Mechanism) -> None:
    links = lay_out(paper, "full").links
    pieces = [link for link in links if link.original == "platform"]
    whole = paper.body("platform")
    assert {link.name for link in pieces} == {
        "platform",
        *(f"platform@{joint}" for joint in ("leg2.wrist", "leg3.wrist", "leg4.wrist", "s")),
    }
    assert sum(link.body.mass for link in pieces) == pytest.approx(whole.mass, rel=PLACED, abs=0)
    np.testing.assert_allclose(sum(link.body.inertia for link in pieces), whole.inertia, rtol=PLACED)
    assert all(link.body.mass > 0.0 for link in links)


def test_mjcf_is_lean_unless_asked(paper: Mechanism) -> None:
    root = ET.fromstring(write_mjcf(paper, "minimal"))
    assert not EXTRA_ELEMENTS & {element.tag for element in root.iter()}
    assert not [element for element in root.iter() if {"range", "limited"} & set(element.attrib)]
    flag = root.find("option/flag")
    assert flag is not None
    assert flag.attrib == {"contact": "disable", "limit": "disable", "sensor": "disable"}


@pytest.mark.parametrize("cut", ["minimal", "full"])
def test_parts_asked_for_are_there_and_change_no_mechanics(paper: Mechanism, cut: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    lean = mujoco.MjModel.from_xml_string(write_mjcf(paper, cut))
    rich = mujoco.MjModel.from_xml_string(write_mjcf(paper, cut, include=frozenset(PARTS)))
    assert lean.ngeom == lean.nsensor == 0
    assert rich.ngeom > 9
    assert rich.nsensor > 2 * rich.nv
    for field in ("body_mass", "body_inertia", "body_ipos", "jnt_axis", "jnt_pos", "body_pos", "body_quat"):
        np.testing.assert_array_equal(getattr(rich, field), getattr(lean, field), err_msg=field)
    data = mujoco.MjData(rich)
    mujoco.mj_resetDataKeyframe(rich, data, 0)
    mujoco.mj_forward(rich, data)
    assert data.ncon == 0


def test_limits_are_written_when_asked(paper: Mechanism) -> None:
    slide = replace(paper.joint("leg1.slide"), limits=np.array([[0.4, 0.9]]))
    joints = tuple(slide if joint.name == slide.name else joint for joint in paper.joints)
    limited = replace(paper, joints=joints)
    assert 'limited="true" range="0.4 0.9"' in write_mjcf(limited, "minimal", include={"limits"})
    assert 'lower="0.4" upper="0.9"' in write_urdf(limited, "minimal", include={"limits"})
    assert "range" not in write_mjcf(limited, "minimal")


def test_unknown_parts_and_cuts_are_named(paper: Mechanism) -> None:
    with pytest.raises(UnknownNameError, match=r"'geom'.*did you mean 'geoms'"):
        write_mjcf(paper, "minimal", include={"geom"})
    with pytest.raises(UnknownNameError, match=r"'ful'.*did you mean 'full'"):
        write_urdf(paper, "ful")


def test_write_models_leaves_six_files_and_no_more(paper: Mechanism, tmp_path: Path) -> None:
    paths = write_models(paper, tmp_path / "new" / "folder")
    assert sorted(paths) == sorted((tmp_path / "new" / "folder").iterdir())
    assert len(paths) == 6


def test_a_folder_that_cannot_be_written_is_said(paper: Mechanism, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file, not a folder", encoding="utf-8")
    with pytest.raises(OutputError, match=r"taken: .* cannot be written .*; choose"):
        write_models(paper, tmp_path / "taken")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_pinocchio_reads_all_trees_of_the_mjcf(paper: Mechanism, write) -> None:
    """Its loader keeps only the first body below worldbody, so ground is that body."""
    pinocchio = pytest.importorskip("pinocchio")
    path = write("model.xml", write_mjcf(paper, "minimal"))
    loaded = pinocchio.buildModelFromMJCF(str(path))
    model = loaded[0] if isinstance(loaded, tuple) else loaded
    assert model.nv == 14
    assert sum(inertia.mass for inertia in model.inertias) == pytest.approx(paper.mass, rel=PLACED, abs=0)
