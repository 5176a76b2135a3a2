import numpy as np
import pytest

import screwgauge
from support.command import main
from support.errors import ClosureError, SingularPoseError
from support.singular import REFUSED, near_change_points, textbook_linkages
from support.stress import CASES, OK, climb
from support.stress import REFUSED as SAID

KNOWN = {one.name: one for one in textbook_linkages()}
SAMPLES = (5, 41, 201, 401)
MANY = [n if n < 100 else pytest.param(n, marks=pytest.mark.slow) for n in SAMPLES]
#: Random ones that the fast tests look at, of all.
FEW, ALL = 6, 60
COUNTS = [FEW, pytest.param(ALL, marks=pytest.mark.campaign)]


def run(scene) -> screwgauge.Results:
    return screwgauge.run(scene, ["screw"], ["joint_position"])


def test_no_sample_lies_at_the_singular_pose():
    for one in KNOWN.values():
        assert one.answer == REFUSED
        for n in SAMPLES:
            assert np.abs(np.linspace(0.0, one.lasts, n) - one.at).min() > 1e-4


@pytest.mark.sampled(2)
@pytest.mark.parametrize("samples", MANY)
@pytest.mark.parametrize("name", KNOWN)
def test_a_motion_over_a_singular_pose_is_refused_with_time_joints_and_a_way_on(name, samples, tmp_path):
    one = KNOWN[name]
    scene = one.scene(tmp_path, samples)
    with pytest.raises(SingularPoseError) as caught:
        screwgauge.run(scene)
    i = int(np.searchsorted(scene.t, one.at))
    assert caught.value.where == f"between t = {scene.t[i - 1]:g} s and {scene.t[i]:g} s"
    assert {*caught.value.what.replace(",", " ").split()} & {*one.linkage["joints"]}
    assert caught.value.remedy


@pytest.mark.parametrize("name", KNOWN)
def test_the_gate_does_not_pass_it(name, tmp_path, capsys):
    KNOWN[name].scene(tmp_path, SAMPLES[0])
    assert main(["check", str(tmp_path / "scene.toml")]) != 0
    assert "agree" not in capsys.readouterr().out.lower()


@pytest.mark.slow
def test_each_engine_refuses_it_by_itself():
    rows = climb(CASES["change-points"], 0.0, quick=True)
    assert {row.verdict for row in rows} == {SAID}, [(row.engine, row.told) for row in rows if row.verdict != SAID]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("samples", SAMPLES[:2])
@pytest.mark.parametrize("gap", [0.0, -1e-9])
@pytest.mark.parametrize("count", COUNTS)
def test_where_branches_meet_or_miss_each_other_random_linkages_are_refused(count, gap, samples, tmp_path):
    answered = []
    for one in near_change_points(count, gap):
        try:
            run(one.scene(tmp_path / one.name, samples))
        except (SingularPoseError, ClosureError):
            continue
        answered.append(one.name)
    assert answered == []


@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("samples", SAMPLES[:2])
@pytest.mark.parametrize("gap", [1e-6, 1e-3])
@pytest.mark.parametrize("count", [FEW, pytest.param(ALL, marks=pytest.mark.campaign)])
def test_next_to_a_change_point_random_linkages_are_answered(count, gap, samples, tmp_path):
    for one in near_change_points(count, gap):
        assert run(one.scene(tmp_path / one.name, samples)).ok, one.name


@pytest.mark.slow
def test_engines_agree_next_to_a_change_point():
    assert {row.verdict for row in climb(CASES["change-points"], 1e-2, quick=True)} == {OK}


@pytest.mark.campaign
@pytest.mark.parametrize("first", range(0, 400, 50))
def test_regular_motions_raise_no_false_alarm(first):
    for seed in range(first, first + 50):
        assert run(screwgauge.random(seed)).ok, seed
