"""Pairs of files with a known answer and planted edits: a small part of the corpus that campaigns measure at large."""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio
import pytest
from campaigns.corpus import machines, writers
from campaigns.corpus.answers import site
from campaigns.corpus.edit_rows import own_models, single_edit
from campaigns.corpus.mjcf_scrambler import scramble_mjcf
from campaigns.corpus.pair_rows import pair_row
from campaigns.corpus.pairs import MODELS, pairs
from campaigns.corpus.parts import Parts
from campaigns.corpus.planted import Planted
from campaigns.corpus.scrambled import Scrambled
from campaigns.corpus.sentences import Said, measured, named
from campaigns.corpus.urdf_scrambler import scramble_urdf
from campaigns.corpus_pages import found

from support.claims import cases, table

PLANTED, KEYS = table("sentences")["planted"], {"of", "told"}
PAIRS = [
    "five-bar.urdf .xml",
    "planetary-gear.toml -full.xml",
    "3-rps.urdf -full.urdf",
    "double-cardan.urdf -full.urdf",
    "four-bar urdf toml",
    "four-bar mjcf, other pose",
    "arm urdf, disguised mjcf",
    "arm, tilted axis",
    "arm, centre of mass off",
    "delta, lighter rod",
    "five-bar: yaml, renamed mjcf",
    "four-bar: yaml, mjcf cut elsewhere",
    "five-bar: a hinge as one point",
    "stewart: a heavier leg, cut elsewhere",
    "arm7 scrambled",
    "slider-crank scrambled",
]
EDITS = (0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 21, 23, 25, 27, 29, 31, 33, 35, 37, 39)


@pytest.mark.parametrize("name", PAIRS)
def test_a_pair_has_the_answer_that_is_known(name):
    row = pair_row(next(pair for pair in pairs() if pair.name == name))
    assert row["right"] == "yes", row["first"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("edits")


@pytest.mark.parametrize("number", EDITS)
def test_an_edit_leads_with_magnitude_and_sign_and_alone(number, folder):
    row = single_edit(number, own_models(folder), folder)
    assert found(row), f"{row['item']} {row['amount']}: {row['first']}"
    assert row["others"] == 0, row["other"]


# --- the corpus itself


@pytest.mark.parametrize("name", ["slider-crank", "delta", "planetary-gear"])
def test_a_scrambled_machine_has_the_same_forces_and_closed_loops(name):
    root = ET.parse(MODELS / name / f"{name}.xml").getroot()
    done = scramble_mjcf(root, np.random.default_rng(3))
    plain = scramble_mjcf(root, np.random.default_rng(3), frozenset()).root
    a, b = (mujoco.MjModel.from_xml_string(ET.tostring(each, encoding="unicode")) for each in (plain, done.root))
    at, signs, home = [], [], mujoco.MjData(a).qpos.copy()
    for j in range(a.njnt):
        label = mujoco.mj_id2name(a, mujoco.mjtObj.mjOBJ_JOINT, j)
        home[j] += done.homes[label]
        at.append(mujoco.mj_name2id(b, mujoco.mjtObj.mjOBJ_JOINT, done.called("joint", label)))
        signs.append(-1.0 if label in done.flipped else 1.0)
    q, v, c = np.random.default_rng(4).normal(size=(3, a.nv))
    first, second = mujoco.MjData(a), mujoco.MjData(b)
    first.qpos[:], first.qvel[:], first.qacc[:] = home + q, v, c
    second.qpos[at], second.qvel[at], second.qacc[at] = signs * q, signs * v, signs * c
    for model, data in ((a, first), (b, second)):
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        mujoco.mj_inverse(model, data)
    forces = first.qfrc_inverse
    assert np.abs(signs * second.qfrc_inverse[at] - forces).max() < 1e-12 * np.abs(forces).max()
    b.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    closed = mujoco.MjData(b)
    mujoco.mj_fwdPosition(b, closed)
    assert np.abs(closed.efc_pos[: closed.nefc]).max(initial=0.0) < 1e-12


def test_a_scrambled_urdf_has_the_same_forces():
    root = ET.fromstring(writers.write_urdf(machines.tree(3))[0])
    done = scramble_urdf(root, np.random.default_rng(3))
    a, b = (pinocchio.buildModelFromXML(ET.tostring(each, encoding="unicode")) for each in (root, done.root))
    names = [*a.names][1:]
    at = [b.joints[b.getJointId(done.called("joint", name))].idx_q for name in names]
    signs = np.array([-1.0 if name in done.flipped else 1.0 for name in names])
    home = np.array([done.homes[name] for name in names])
    q, v, c = np.random.default_rng(4).normal(size=(3, a.nv))
    other = np.zeros((3, b.nv))
    other[:, at] = signs * [q, v, c]
    forces = pinocchio.rnea(a, a.createData(), home + q, v, c)
    assert signs * pinocchio.rnea(b, b.createData(), *other)[at] == pytest.approx(forces, abs=1e-12)


@pytest.mark.parametrize("row", [*cases(table("sentences")["sentence"], KEYS)])
def test_magnitude_and_sign_are_read_from_a_sentence(row):
    planted = Planted(**{key: np.array(x) if isinstance(x, list) else x for key, x in PLANTED[row["of"]].items()})
    placed = site(planted, Parts(ET.fromstring("<robot/>")), Scrambled(ET.Element("robot")))
    assert [*measured(row["name"], placed)] == row["told"]
    assert named(Said("DIFFER", row["name"]), placed)
    for part, other in (("rod:", "arm:"), ("hip:", "knee:")):
        if part in row["name"]:
            assert not named(Said("DIFFER", row["name"].replace(part, other)), placed)
