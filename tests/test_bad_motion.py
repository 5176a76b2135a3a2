import re
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError, load_scene
from support.errors import ClosureError, JointLimitError, SingularPoseError
from support.geometry import SINGULAR, condition
from support.scene import check_scene
from support.solve import layout, loop_equations, posed, positions

SINGULAR_B = 0.356801  # [rad] where the leg forces no longer carry the platform about y, a being 0

LIMITS = '[joints."leg1.slide"]\nlimits = [[0.55, 0.62]]'
LENGTHS = '[independent]\na = "leg1.q3"\nb = "leg2.q3"'
GOOD_CSV = "t,a,b,ad,bd,add,bdd\n0,0,0,0.1,0,0,0\n0.1,0.01,0,0.1,0,0,0\n0.3,0.03,0,0.1,0,0,0\n"


def b_over_time(*coefficients: float) -> str:
    return f"motion = {{ a = {{}}, b = {{ polynomial = {list(coefficients)} }} }}"


def test_a_joint_limit_is_enforced_with_time_pose_and_limits(changed_scene, refused):
    times = "time = { times = [0, 1, 2, 3] }"
    said = refused("run", changed_scene(LIMITS, motion=b_over_time(0, 0.05), time=times))
    found = re.search(r"t = (\d) s: .*'leg1.q3' = (\S+) m .* \[0.55, 0.62\]", said)
    assert found, said
    assert not 0.55 <= float(found[2]) <= 0.62
    assert int(found[1]) == 2  # the first sample beyond
    assert "widen the limits" in said


def test_the_limit_message_tells_the_pose(changed_scene, refused):
    said = refused("run", changed_scene(LIMITS, motion=b_over_time(0, 0.05), time="time = { times = [0, 2] }"))
    assert "a = 0, b = 0.1" in said


def test_a_motion_within_the_limits_is_accepted(changed_scene):
    check_scene(load_scene(changed_scene(LIMITS, motion=b_over_time(0, 0.01))))


def test_limits_of_cut_joints_count() -> None:
    scene = load_scene("five-bar")
    (cut,) = layout(scene.mechanism).cuts
    limited = replace(cut, limits=np.column_stack([cut.home - 0.01, cut.home + 0.01]))
    joints = tuple(limited if joint is cut else joint for joint in scene.mechanism.joints)
    with pytest.raises(JointLimitError, match=f"t = 0.05 s: joint coordinate '{cut.coordinates[0]}' = 1.05802 rad"):
        check_scene(replace(scene, mechanism=replace(scene.mechanism, joints=joints)))


def test_limits_of_every_coordinate_of_a_composite_joint_count(changed_scene, refused):
    limits = "[joints.s]\nlimits = [[-1, 1], [-1, 0.04], [-1, 1]]"
    said = refused("run", changed_scene(limits))
    assert all(fact in said for fact in ("t = 0 s: ", "'s.q2' = 0.05 rad", "[-1, 0.04]"))


def test_a_motion_to_where_a_leg_locks_is_refused(changed_scene, refused):
    motion = "motion = { a = { polynomial = [0.6, 2] }, b = { offset = 0.6 } }"
    said = refused("run", changed_scene(LENGTHS, motion=motion, time="time = { times = [0, 0.01, 1] }"))
    assert "between t = 0.01 s and 1 s: " in said
    assert "singular pose near a = 1.09744, b = 0.6" in said
    assert "leg3.base locks" in said


@pytest.mark.slow
def test_a_far_pose_that_can_be_reached_is_not_refused(paper_scene):
    far = paper_scene(
        mechanism='mechanism = "3ups-upu-s-offset"',  # its third rotation grows to -0.9 rad
        motion="motion = { a = { polynomial = [0, 1] }, b = { polynomial = [0, 0.3] } }",
        time="time = { times = [0, 0.5, 0.7, 0.8, 1.2] }",
    )
    results = screwgauge.run(load_scene(far), quantities=["joint_position"])
    assert results.ok, results.pairs.to_string()
    assert results.values("joint_position")[-1, -1] < -0.8


@pytest.mark.slow
@pytest.mark.parametrize(
    ("direction", "said"), [(1, "between t = 1 s and 2 s"), (-1, "t = 0 s: a singular pose separates")]
)
def test_passing_it_is_noticed_across_parts_of_a_long_motion(direction, said, paper_scene, monkeypatch):
    monkeypatch.setattr("screwgauge.scene.preflight.PART", 2)  # samples 1 and 2 are in different parts
    scene = load_scene(paper_scene(motion=b_over_time(SINGULAR_B - 0.015 * direction, 0.01 * direction)))
    with pytest.raises(SingularPoseError, match=said):
        check_scene(scene.at([0, 1, 2, 3]))


def singular_b(scene) -> float:
    lay = layout(scene.mechanism)

    def sign(b: float) -> float:
        return float(np.linalg.slogdet(loop_equations(lay).matrix(posed(lay, 0.0, b))[0])[0])

    low, high = SINGULAR_B - 1e-3, SINGULAR_B + 1e-3
    assert sign(low) * sign(high) < 0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if sign(middle) == sign(low) else (low, middle)
    return low


@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("beside", [0.0, 1e-14, -1e-14])
def test_sampling_a_singular_pose_is_refused(beside, paper_scene, refused):
    b = singular_b(load_scene(paper_scene())) + beside
    assert b == pytest.approx(SINGULAR_B, abs=1e-6)
    said = refused("run", paper_scene(motion=b_over_time(b), time="time = { times = [0.25] }"))
    assert "t = 0.25 s: the pose a = 0, b = 0.356801 is singular (condition " in said
    assert float(re.search(r"condition ([\d.e+]+|inf)\)", said)[1]) > 1e12


def test_a_badly_conditioned_pose_below_the_limit_is_accepted(paper_scene):
    scene = load_scene(paper_scene(motion=b_over_time(SINGULAR_B - 1e-3), time="time = { times = [0] }"))
    lay = layout(scene.mechanism)
    assert 1e3 < condition(loop_equations(lay).matrix(positions(lay, scene.motion.y, scene.t)))[0] < SINGULAR
    check_scene(scene)


def test_reaching_a_singular_pose_and_turning_back_is_no_passage(paper_scene):
    scene = load_scene(paper_scene(motion=b_over_time(SINGULAR_B - 0.01, 0, -0.01)))
    check_scene(scene.at([-1, -0.5, 0, 0.5, 1]))


@pytest.fixture
def csv_scene(write, paper_scene):
    def make(text: str, time: str = ""):
        write("motion.csv", text)
        return paper_scene(motion='motion = { csv = "motion.csv" }', time=time)

    return make


def test_a_csv_motion_is_read_on_its_own_times(csv_scene):
    motion = load_scene(csv_scene(GOOD_CSV)).motion
    assert motion.t.tolist() == [0.0, 0.1, 0.3]
    assert motion.y.tolist() == [[0.0, 0.0], [0.01, 0.0], [0.03, 0.0]]
    assert motion.yd[:, 0].tolist() == [0.1, 0.1, 0.1]


def test_numbers_of_a_csv_are_read_to_the_last_bit(csv_scene):
    values = [float(v) for v in np.random.default_rng(7).normal(size=200)]
    rows = [f"{i},{v!r},0,0,0,0,0" for i, v in enumerate(values)]
    scene = load_scene(csv_scene("\n".join(["t,a,b,ad,bd,add,bdd", *rows])))
    assert scene.motion.y[:, 0].tolist() == values


def test_columns_that_are_no_derivatives_get_a_warning(csv_scene):
    t = np.linspace(0.0, 1.0, 11)
    columns = {"t": t, "a": 0.1 * np.sin(3 * t), "ad": 0.3 * np.cos(3 * t), "add": -0.9 * np.sin(3 * t)}
    columns |= dict.fromkeys(("b", "bd", "bdd"), 0.0 * t)

    def told(**wrong):
        given, said = columns | wrong, []
        rows = [",".join(map(repr, map(float, row))) for row in zip(*given.values(), strict=True)]
        scene = load_scene(csv_scene("\n".join([",".join(given), *rows])))
        screwgauge.run(scene, engines=["screw"], quantities=["joint_position"], warn=said.append)
        return [sentence for sentence in said if "derivative" in sentence]

    assert told() == []
    assert told(b=t * 0.0 + 1e-17) == []
    assert [s.partition(" (")[0] for s in told(add=-columns["add"])] == ["motion.csv: add is not the derivative of ad"]
    (said,) = told(ad=np.rad2deg(columns["ad"]), add=np.rad2deg(columns["add"]))
    assert all(fact in said for fact in ("motion.csv: ad ", " of a ", "by up to 5.57", "by 0.0997", "check units"))


def test_labels_whose_derivatives_collide_are_refused_in_a_csv(write, changed_scene, refused):
    write("motion.csv", GOOD_CSV)
    labels = 'independent = { a = "s.q1", b = "s.q2", ad = "s.q3" }'
    said = refused("run", changed_scene(labels, motion='motion = { csv = "motion.csv" }'))
    assert "columns t, a, ad, add, b, bd, bdd, ad, add, addd" in said


@pytest.mark.parametrize("times", [[0.05], [0, 0.2], [-1], [0.3, 0.4], [1e300]])
def test_times_that_a_csv_does_not_have_are_refused(times, csv_scene):
    scene = load_scene(csv_scene(GOOD_CSV))
    with pytest.raises(ScrewgaugeError, match=r"motion\.csv: .* at t = .* s; .*not interpolated"):
        scene.at(times)


def test_times_that_a_csv_has_may_be_chosen_in_any_order(csv_scene):
    assert load_scene(csv_scene(GOOD_CSV)).at([0.3, 0.1]).motion.y[:, 0].tolist() == [0.03, 0.01]


def test_python_raises_what_the_command_line_says(paper_scene):
    scene = load_scene(paper_scene(motion=b_over_time(0.3, 0.1)))
    with pytest.raises(SingularPoseError):
        screwgauge.run(scene.at([0, 1]), engines=["screw"])
    assert issubclass(SingularPoseError, ScrewgaugeError)
    assert issubclass(ClosureError, ScrewgaugeError)
