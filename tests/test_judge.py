from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.at_origin import BodyAccelerations, Motion, opposite, replace_bracket
from support.engines import Solution, Values
from support.judging import answer_at, compared, judge
from support.scene import natural_scales


@pytest.fixture(scope="module")
def scene():
    scene = screwgauge.load_scene("3ups-upu-s-fast")
    return scene.at(scene.motion.t[:2000:100])


@pytest.fixture(scope="module")
def solution(scene) -> Solution:
    return screwgauge.run(scene, engines=["screw"]).solutions["screw"]


def faults(scene) -> dict[str, str]:
    results = screwgauge.run(scene, engines=["screw"])
    assert results.exit_status == 1
    bad = results.judge[~results.judge["ok"]]
    assert np.isfinite(bad["worst_t"]).all()
    return dict(zip(bad["residual"], bad["worst_component"], strict=True))


def test_nothing_is_found_where_nothing_is_wrong(scene):
    assert screwgauge.run(scene, engines=["screw"]).ok


def test_sign_of_the_lie_bracket(scene, monkeypatch):
    replace_bracket(monkeypatch, opposite)
    assert "loop_acceleration" in faults(scene)


def test_dropped_gyroscopic_term(scene, monkeypatch):
    right = BodyAccelerations.needs

    def without(self, g):
        J, w, found = np.array([body.inertia for body in mechanism.bodies]), self.bodies.turning.w, right(self, g)
        found[:, 1:, 3:] -= np.cross(w, (J @ w[..., None])[..., 0])
        return found

    mechanism = scene.mechanism
    monkeypatch.setattr(BodyAccelerations, "needs", without)
    found = set(faults(scene))
    assert {"newton_euler", "virtual_work"} <= found
    assert "power_balance" not in found  # w x J w does no work: power alone would not have told


def test_point_accelerations_as_eq_49_prints_them(scene, monkeypatch):
    """``v_C = w x r_C`` instead of ``v_O + w x r_C``."""

    right = Motion.com_acceleration.func

    def printed(self):
        return right(self) - np.cross(self.V[:, 1:, :3], self.V[:, 1:, 3:])

    monkeypatch.setattr(Motion, "com_acceleration", property(printed))
    assert "body_motion" in faults(scene)


def test_lever_arms_with_the_sign_of_eq_55(scene, monkeypatch):
    """From the joint to the centre of mass, as the subscripts of eq. (55) say."""
    right, platform = BodyAccelerations.needs, scene.mechanism.body_index["platform"]

    def printed(self, g):
        found = right(self, g)
        found[:, platform, 3:] -= 2.0 * np.cross(scene.mechanism.body("platform").com, found[:, platform, :3])
        return found

    monkeypatch.setattr(BodyAccelerations, "needs", printed)
    assert faults(scene)["newton_euler"].startswith("platform.m")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("quantity", "component", "residual", "named"),
    [
        ("joint_position", "leg3.q2", "loop_closure", "leg3.wrist"),
        ("joint_velocity", "leg4.q3", "loop_rate", "leg4.wrist"),
        ("joint_acceleration", "leg2.q1", "loop_acceleration", "leg2.wrist"),
        ("joint_position", "s.q1", "loop_closure", ("a as prescribed", "s.")),
        ("com_acceleration", "leg1.upper.y", "body_motion", "leg1.upper.y"),
        ("body_angular_velocity", "leg2.lower.x", "body_motion", "leg2.lower.x"),
        ("reaction", "leg4.slide.mx", "newton_euler", "leg4."),
        ("actuator_force", "leg1", "newton_euler", "leg1."),
        ("generalized_force", "b", "virtual_work", "b"),
    ],
)
def test_one_wrong_number_is_named_with_its_place_and_time(scene, solution, quantity, component, residual, named):
    found = judge(scene.mechanism, scene.problem(()), _disturbed(solution, quantity, component, row=7))
    rows = found[(found["residual"] == residual) & ~found["ok"]]
    assert any(name.startswith(named) for name in rows["worst_component"]), found[~found["ok"]].to_string()
    assert scene.motion.t[7] in set(rows["worst_t"])


def _disturbed(solution: Solution, quantity: str, component: str, row: int) -> Solution:
    values = solution.values[quantity]
    array = values.array.copy()
    array[row, values.components.index(component)] += 1e-6 * np.abs(array).max()
    return replace(solution, values={**solution.values, quantity: Values(values.components, values.units, array)})


def test_what_is_not_a_number_fails(scene, solution):
    values = solution.values["reaction"]
    array = values.array.copy()
    array[3, 5] = np.nan
    lost = replace(solution, values={**solution.values, "reaction": Values(values.components, values.units, array)})
    rows = judge(scene.mechanism, scene.problem(()), lost).set_index(["residual", "unit"])
    assert not rows.loc[("newton_euler", "N"), "ok"]
    assert "not a number" in rows.loc[("newton_euler", "N"), "reason"]


def test_a_single_sample_at_a_dead_centre_is_no_false_alarm():
    """At t = 0 the actuators' power is zero, its terms are not."""
    assert screwgauge.run(screwgauge.load_scene("3ups-upu-s").at([0.0])).ok


def test_engines_that_solved_different_samples_are_not_compared(scene):
    results = screwgauge.run(scene, engines=["screw"], quantities=["joint_position"])
    first = replace(results.solutions["screw"], rows=np.array([0, 1]))
    other = replace(first, engine="other", rows=np.array([2, 3]))
    both = {"screw": first, "other": other}
    errors, pairs = compared(scene, both)
    assert errors.empty
    assert pairs["reason"].tolist() == ["no sample in common"]
    assert not pairs["ok"].any()


def test_what_is_zero_is_measured_by_a_millionth_of_its_natural_scale(scene):
    solution = screwgauge.run(scene, engines=["screw"], quantities=["joint_position"]).solutions["screw"]
    answer = answer_at(scene.mechanism, scene.problem(()), solution, np.arange(2))
    natural = natural_scales(scene.mechanism)["N m"]
    for share, ok in ((0.9e-17, True), (1.1e-17, False)):
        row = answer.residual("any", "N m", ["a", "b"], np.array([[0.0, 0.0], [share * natural, 0.0]]), 0.0, ())
        assert row.ok == ok
        assert row.error == pytest.approx(1e6 * share, rel=1e-12, abs=0.0)
        assert (row.component, row.t) == ("a", scene.motion.t[1])


def test_a_pair_is_unique_where_all_of_its_components_are(scene):
    first = screwgauge.run(scene, engines=["screw"], quantities=["reaction", "com_acceleration"]).solutions["screw"]
    both = {"screw": first, "other": replace(first, engine="other")}
    errors, pairs = compared(scene, both)
    by_unit = errors.groupby(["quantity", "unit"])["unique"]
    assert (by_unit.any() & ~by_unit.all()).sum() == 1  # forces of the joints: some are, some are not
    assert pairs.set_index(["quantity", "unit"])["unique"].to_dict() == by_unit.all().to_dict()
