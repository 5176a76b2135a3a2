"""Couplings of several joints in two files: what is the same, which coefficient differs, and the file put right."""

from __future__ import annotations

import re

import numpy as np
import pytest

import screwgauge
from support.mechanism import FOLDER

LEG = (FOLDER / "belt-leg" / "belt-leg.xml").read_text(encoding="utf-8")
SUM = '<fixed name="sum">'
#: What is written in place of what, of which joint, and by how much its constant and coefficients differ.
CHANGED = {
    "a coefficient": (('"left" coef="-0.5"', '"left" coef="-0.55"'), "pitch", [0.0, 0.05, 0.0, 0.0, 0.0]),
    "the constant": (('polycoef="0 0', 'polycoef="0.2 0'), "pitch", [0.2, 0.0, 0.0, 0.0, 0.0]),
    "the joint that follows": (('"pitch" coef="1"', '"pitch" coef="2"'), "pitch", [0.0, -0.25, -0.25, 0.5, 0.5]),
}
#: Name of a tendon, and its joints: solved for another joint, or with the tendon ``sum`` added.
SAME = {
    "another joint follows": ("belt", {"hip": 1, "knee": 1, "motor": -1}),
    "rows combined": ("difference", {"roll": 1, "pitch": 1, "left": -1, "hip": 1, "knee": 1}),
}


def changed(here: str, there: str) -> str:
    """The leg with another text in the tendon and the equality that are called ``sum``."""
    before, name, after = LEG.partition(SUM)
    assert here in after
    return before + name + after.replace(here, there, 1)


@pytest.mark.parametrize("what", CHANGED)
def test_a_coefficient_that_differs_is_named_and_put_right(what, write, tmp_path):
    instead, joint, apart = CHANGED[what]
    found = screwgauge.diagnose(write("a.xml", LEG), write("b.xml", changed(*instead)))
    (fact,) = [fact for fact in found.found.facts if fact.kind == "model"]
    assert (fact.what, fact.part) == ("polynomial", joint)
    assert fact.more == ("left", "right", "hip", "knee")
    assert fact.b - fact.a == pytest.approx(apart, abs=1e-12)
    found.write_fix(tmp_path / "mended.xml")
    assert screwgauge.diagnose(write("a.xml", LEG), tmp_path / "mended.xml").same


@pytest.mark.parametrize("what", SAME)
def test_couplings_that_leave_the_same_motions_are_the_same(what, write):
    name, shares = SAME[what]
    joints = "".join(f'<joint joint="{joint}" coef="{share}"/>' for joint, share in shares.items())
    other = re.sub(f'(<fixed name="{name}">).*?(?=</fixed>)', rf"\1{joints}", LEG, flags=re.DOTALL)
    assert other.count(joints) == 1
    assert screwgauge.diagnose(write("a.xml", LEG), write("b.xml", other)).same


def test_a_joint_that_a_coupling_leaves_out_is_named(write):
    without = changed('      <joint joint="knee" coef="1" />\n', "")
    found = screwgauge.diagnose(write("a.xml", LEG), write("b.xml", without))
    (fact,) = [fact for fact in found.found.facts if fact.kind == "model"]
    assert (fact.what, fact.part) == ("leading joint", "pitch")
    assert "knee" in fact.more[0]
    assert "knee" not in fact.more[1]
    assert np.isfinite(fact.size)
