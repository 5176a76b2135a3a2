"""One factor on many parts is one cause, and of several the one with the largest share of torques leads."""

from __future__ import annotations

import numpy as np
import pytest

import screwgauge

LINK = (
    '<body name="l{i}" pos="{x} 0 0.1"><joint name="j{i}" axis="{axis}" damping="{damping}"/>'
    '<inertial pos="0.1 0.02 0.05" mass="{mass}" diaginertia="{moment} {moment} {moment}"/>'
)


def arm(mass=1.0, moment=1.0, damping=1.0, last=1.0):
    """Four unlike links in a chain, all of one property scaled by a factor; the last mass by another one."""
    links = [
        LINK.format(
            i=i,
            x=0.3 * (i > 0),
            axis=("0 0 1", "0 1 0")[i % 2],
            damping=0.1 * (i + 1) * damping,
            mass=(2.0 - 0.4 * i) * mass * (last if i == 3 else 1.0),
            moment=0.01 * (i + 1) * moment,
        )
        for i in range(4)
    ]
    return f"<mujoco><worldbody>{''.join(links)}{'</body>' * 4}</worldbody></mujoco>"


@pytest.fixture
def found(write):
    def of(**changes):
        return screwgauge.diagnose(write("a.xml", arm()), write("b.xml", arm(**changes)))

    return of


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"mass": 1.001}, "masses of all 4 bodies: 1.001 times those of A in B (+0.10 %: l0, l1, l2 and 1 more)"),
        ({"mass": 1000.0}, "masses of all 4 bodies: 1000 times those of A in B (x 1000, as if written in g: l0, l1, "),
        ({"moment": 2.0}, "inertias of all 4 bodies: 2 times those of A in B (+100.00 %: l0, l1, l2 and 1 more)"),
        ({"damping": 2.0}, "damping of all 4 joints: 2 times those of A in B (+100.00 %: j0, j1, j2 and 1 more)"),
    ],
)
def test_one_factor_on_many_parts_is_one_cause(changes, said, found):
    diagnosis = found(**changes)
    assert diagnosis.verdict.startswith(said)
    (cause,) = diagnosis.causes
    assert len(cause.differences) == len(diagnosis.differences) == 4
    assert cause.share == pytest.approx(1.0)
    assert " It explains 100.0000 % of the torque difference" in diagnosis.verdict


def test_a_default_that_one_has_in_many_places_is_one_cause(write):
    plain = arm(damping=0.0)
    found = screwgauge.diagnose(write("a.xml", plain), write("b.xml", plain.replace('damping="0.0"', 'damping="0.5"')))
    assert found.verdict.startswith("damping of all 4 joints: 0.5 N m s/rad in B, 0 in A (j0, j1, j2 and 1 more)")


def test_the_cause_with_the_largest_share_leads_and_shares_add_up(found):
    diagnosis = found(damping=1.001, last=3.0)
    assert diagnosis.headline == "l3: mass 2.400 kg in B, 0.8000 kg in A (+200.00 %), and 1 more cause."
    assert diagnosis.causes[1].sentence.startswith("damping of all 4 joints: 1.001 times those of A in B")
    first, second = (cause.share for cause in diagnosis.causes)
    assert first > 0.99 > second > 0.0
    assert first + second == pytest.approx(1.0)


def test_a_small_cause_beside_an_absurd_one_is_weighed_against_the_rest(found):
    """Of all of the difference its share would be 1e-9, and chance."""
    diagnosis = found(damping=1.01, last=1e9)
    assert diagnosis.headline.startswith("l3: mass 8e+08 kg in B, 0.8000 kg in A (x 1e9)")
    first, second = diagnosis.causes
    assert first.share == pytest.approx(1.0)
    assert np.isnan(first.of_rest)
    assert second.of_rest == pytest.approx(1.0)
    assert "100.0 % of the rest  damping of all 4 joints" in repr(diagnosis)


def test_a_tensor_that_is_larger_by_one_factor_says_which(write):
    text, moment = arm(), 'diaginertia="0.02 0.02 0.02"'
    found = screwgauge.diagnose(write("a.xml", text), write("b.xml", text.replace(moment, 'diaginertia="2e7 2e7 2e7"')))
    assert " in A (x 1e9): inertia is in g mm^2." in found.headline


def test_a_slide_in_place_of_a_hinge_is_one_fact(write):
    text = arm()
    found = screwgauge.diagnose(
        write("a.xml", text), write("b.xml", text.replace('name="j2"', 'name="j2" type="slide"'))
    )
    said = [each.sentence for each in found.differences if each.what in ("kind", "branch")]
    assert said == ["j2: a hinge in A, a slide in B; it and all that it carries are compared where it is held"]
