import json
import re
from dataclasses import replace

import numpy as np
import pytest
from campaigns.alarms import changed

import screwgauge
from screwgauge import exciting
from support.acting import Applied, JointSpring, Load, hold
from support.at_origin import without_brackets
from support.engines import quiet
from support.freedoms import mobility_at_home
from support.judging import NOTHING, coverage
from support.mechanism import Body, spanning_tree
from support.scene import FLOOR, SOLVED, natural_scales
from support.solve import layout, solve_motion

pytestmark = pytest.mark.slow

FORCES = ("tree_force", "generalized_force", "actuator_force", "reaction")
STEP = 1e-4  # share of its size by which a parameter is changed
LINEAR = 0.01  # what is left of a change of that size by its square, and by what scales are measured at
PAIRS = ("xx", "yy", "zz", "xy", "xz", "yz")


def looked_at(scene):
    mechanism, problem = scene.mechanism, scene.problem(scene.quantities)
    counted = mobility_at_home(mechanism)
    solution = solve_motion(layout(mechanism), problem, scene.motion, quiet)
    return coverage(mechanism, problem, {"screw": solution}, counted, scene.tolerance), counted, solution


def few(name: str, n: int = 5):
    scene = screwgauge.load_scene(name)
    return scene.at(scene.t[:: len(scene.t) // n])


def loaded(scene):
    bodies, joint = scene.mechanism.bodies, scene.mechanism.coordinates[0]
    loads = (
        Load(bodies[-1].name, np.array([0.1, 0.2, -0.1]), np.array([3.0, -2.0, 5.0]), np.array([0.5, 0.0, 0.2])),
        Load(bodies[0].name, None, np.array([0.0, 4.0, 1.0]), np.zeros(3)),
    )
    springs = (JointSpring(joint, 10.0, 0.3, 2.0),)
    return scene.under(loads=loads, springs=springs, motors=hold({scene.mechanism.coordinates[-1]: 2.0}))


def shares(found, quantity: str, term: str) -> float:
    return max(row["share"] for row in found.shares if (row["quantity"], row["term"]) == (quantity, term))


def effect(scene, counted, before, after) -> float:
    scales, worst = natural_scales(scene.mechanism), 0.0
    known = dict(zip(counted.names, counted.determined, strict=True))
    for quantity in FORCES:
        has = before.values[quantity]
        for unit in set(has.units):
            columns = [i for i, name in enumerate(has.components) if has.units[i] == unit and known.get(name, True)]
            size = max(np.abs(has.array[:, columns]).max(initial=0.0), FLOOR * scales[unit])
            change = np.abs(after.values[quantity].array - has.array)[:, columns]
            worst = max(worst, change.max(initial=0.0) / size)
    return worst


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider-crank", "bennett", "3-rps", "3ups-upu-s-offset"])
def test_every_parameter_does_what_is_said_and_those_not_tested_do_nothing(name, monkeypatch):
    monkeypatch.setattr(Body, "__post_init__", lambda self: None)  # a thin rod may be given any inertia
    scene = screwgauge.load_scene(name)
    scene = loaded(scene.at(scene.t[5:12:3]))
    found, counted, before = looked_at(scene)
    assert found.missing == ""
    bodies = len(scene.mechanism.bodies)
    own = [row for row in found.parameters if "load" not in row["parameter"]]
    assert len(own) == 10 * bodies
    assert len(found.parameters) == 10 * bodies + 6
    rng = np.random.default_rng(1)
    some = [row for row in own if not row["tested"]][:5] + [own[i] for i in rng.permutation(len(own))[:9]]
    for row in some:
        lay = layout(changed(scene.mechanism, row["parameter"], STEP))
        after = solve_motion(lay, scene.problem(scene.quantities), scene.motion, quiet)
        change = effect(scene, counted, before, after) / STEP
        assert change == pytest.approx(row["effect"], rel=LINEAR, abs=NOTHING), row


@pytest.mark.slow
def test_in_an_exciting_motion_a_millionth_is_seen_of_all_that_is_tested_and_of_nothing_else(monkeypatch):
    monkeypatch.setattr(Body, "__post_init__", lambda self: None)
    scene = exciting(screwgauge.load_scene("bennett"), 2)
    scene = scene.at(scene.t[::25])
    found, counted, before = looked_at(scene)
    assert 0 < len(found.untested) < len(found.parameters)
    for row in found.parameters:
        mechanism = changed(scene.mechanism, row["parameter"], 1e-6)
        after = solve_motion(layout(mechanism), scene.problem(scene.quantities), scene.motion, quiet)
        assert (effect(scene, counted, before, after) > SOLVED) == row["tested"], row


@pytest.mark.slow
@pytest.mark.parametrize("name", ["3-rps", "3ups-upu-s-offset"])
def test_the_share_of_a_term_is_what_is_lost_without_it(name, monkeypatch):
    scene = loaded(few(name))
    found, counted, before = looked_at(scene)

    def lost(term: str, without) -> None:
        after = looked_at(without)[2]
        change = effect(scene, counted, before, after)
        said = max(row["share"] for row in found.shares if row["term"] == term and row["quantity"] in FORCES)
        assert change == pytest.approx(said, rel=1e-9, abs=0), term
        assert said > 0.0

    lost("gravity", scene.under(gravity=np.zeros(3)))
    lost("loads", scene.under(loads=()))
    lost("springs and motors", scene.under(springs=(), motors=()))
    slow = replace(scene.motion, yd=0.0 * scene.motion.yd, ydd=0.0 * scene.motion.ydd)
    nothing = Applied(gravity=np.zeros(3))
    alone = looked_at(replace(scene, applied=nothing))[0]
    assert looked_at(replace(scene, applied=nothing, task=slow))[0].absent == [
        *("gravity", "inertial forces", "gyroscopic moments", "the Lie bracket"),
    ]
    assert shares(alone, "generalized_force", "inertial") == pytest.approx(1.0, abs=0.1)
    without_brackets(monkeypatch)
    lost("bracket", scene)


def test_the_case_of_the_paper_tests_statics_and_a_fast_one_everything():
    found = looked_at(few("3ups-upu-s", 50))[0]
    assert found.untested == []
    assert found.inertia == ("actuator_force", pytest.approx(0.00075, rel=0.01))
    assert "0.075 % of actuator_force" in found.poor
    assert looked_at(few("3ups-upu-s-fast"))[0].poor == ""


def test_the_share_of_the_bracket_does_not_depend_on_where_loops_are_cut(monkeypatch):
    scene = few("slider-crank")
    (usual,) = spanning_tree(scene.mechanism).cuts
    other = scene.mechanism.joints[1].name
    assert usual.name != other
    before = looked_at(scene)[0]
    kept = [joint.name for joint in scene.mechanism.joints if joint.name != other]
    monkeypatch.setattr(
        "screwgauge.judging.identifiability.spanning_tree", lambda mechanism: spanning_tree(mechanism, kept)
    )
    after = looked_at(scene)[0]
    for one, same in zip(before.shares, after.shares, strict=True):
        # a joint that is entered from its other side has other products of the same sum
        if one["quantity"] != "tree_force" and one["term"] not in ("w1 x v2", "w2 x v1"):
            assert same["share"] == pytest.approx(one["share"], rel=1e-9, abs=0), one


def test_a_scene_at_rest_tests_no_inertia():
    scene = few("bennett").at([0.0])
    rest = replace(scene, task=replace(scene.motion, yd=np.zeros((1, 1)), ydd=np.zeros((1, 1))))
    found = looked_at(rest)[0]
    assert {row["parameter"] for row in found.parameters if "inertia" in row["parameter"]} <= set(found.untested)
    assert "mass of link2" not in found.untested
    assert found.inertia == ("actuator_force", 0.0)
    for fact in ("mass of link1 and 22 others", *found.absent):
        assert fact in found.poor


def test_what_a_slow_motion_leaves_out_is_told_from_what_no_motion_shows():
    still = few("arm7")
    still = replace(still, task=replace(still.motion, yd=0.0 * still.motion.yd, ydd=0.0 * still.motion.ydd))
    found = looked_at(still)[0]
    assert "inertial forces" in found.absent
    assert found.hidden == {f"inertia {pair} of link1" for pair in ("xx", "yy", "xy")}
    assert "com z of link1 and 39 others" in found.poor
    assert "inertia xx of link1 and 2 others" in found.poor
    fixed = replace(still, task=replace(still.motion, y=0.0 * still.motion.y))  # at one pose, chance hides things, too
    assert not looked_at(fixed)[0].hidden


def test_the_point_of_a_load_along_its_force_is_not_tested():
    scene = few("arm7")
    body = scene.mechanism.bodies[0].name  # it turns about z alone
    found = looked_at(scene.under(loads=(Load(body, None, np.array([0.0, 0.0, 7.0]), np.zeros(3)),)))[0]
    points = {row["parameter"]: row["tested"] for row in found.parameters if "load" in row["parameter"]}
    assert points == {f"point {axis} of load on {body}": axis != "z" for axis in "xyz"}
    moment = scene.under(loads=(Load(body, None, np.zeros(3), np.ones(3)),))
    assert len(looked_at(moment)[0].parameters) == 70


def test_a_wide_tolerance_tests_less():
    scene = few("3-rps")
    strict, wide = (looked_at(replace(scene, tolerances=tolerances))[0] for tolerances in ({}, _WIDE))
    assert set(strict.untested) < set(wide.untested)


_WIDE = dict.fromkeys((*FORCES, "tree_force_soft"), 1e-2)


@pytest.mark.parametrize(
    ("quantities", "sentence"),
    [
        (["joint_position"], "no force and no acceleration"),
        (["com_acceleration"], "No inertial parameter"),
        (["actuator_force"], "com z of link1 and 8 others"),
        (["tree_force_soft"], "23 of 30 inertial parameters"),
    ],
)
def test_what_is_compared_decides(quantities, sentence):
    results = screwgauge.run(few("bennett"), ["screw"], quantities)
    assert sentence in results.coverage.sentence


def test_of_a_simulation_it_is_said_that_nothing_is_said():
    scene = screwgauge.load_scene("a01-pendulum").at([0.0, 0.1])
    results = screwgauge.run(scene, ["screw"])
    assert "simulations" in results.coverage.sentence


@pytest.mark.slow
def test_verdict_report_and_summary_say_what_is_not_tested(tmp_path, monkeypatch):
    monkeypatch.setattr("screwgauge.report.figures.run.make_plots", lambda results: [])
    results = screwgauge.run(few("slider-crank"), ["screw", "pinocchio"])
    clause = "com z of crank and 21 others"
    assert clause in " ".join(repr(results).split())
    results.write(tmp_path)
    page = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert re.search(f"11 of 33 inertial.*{clause}", page)
    assert "| com z of crank | by no motion |" in page
    said = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["coverage"]
    assert said["sentence"] == results.coverage.sentence
    assert said["parameters"] == 33
    assert {"com z of crank", "w1 x w2 of the Lie bracket"} <= set(said["untested"])
    assert {"quantity", "unit", "term", "share"} == set(said["terms"][0])
