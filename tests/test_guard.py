import json
import re
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.command import main
from support.engines import solve
from support.judging import LIMIT, Allowance, compare
from support.near import BASE, QUANTITIES, UPU, WRIST, before_upu, errors, moving_at
from support.pages import terminal
from support.report import estimates, run_in_terminal, summary, verdict
from support.scene import check_scene
from support.solve import layout, loop_equations, posed
from support.tolerances import EQUAL, TIGHT

pytestmark = pytest.mark.slow

ENGINES = ["screw", "pinocchio", "mujoco", "truth"]


@pytest.fixture(scope="module")
def ladder():
    return [
        screwgauge.run(moving_at(before_upu(10.0**-k, 3, seed=k), seed=k), engines=ENGINES)
        for k in (1, 2, 3, 4, 5, 6, 8, 10)
    ]


@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES[:3])
def test_estimates_are_never_below_the_error_and_not_far_above(ladder, engine):
    above = []
    for results in ladder:
        found, truth = results.solutions[engine], results.solutions["truth"]
        for quantity in QUANTITIES:
            estimate, error = found.errors[quantity].scaled, errors(found, truth, quantity)
            assert estimate.shape == error.shape
            known = np.isfinite(estimate)
            assert (estimate[known] >= error[known]).all(), (quantity, estimate, error)
            assert (error[~known] > 1e-5).all() or not known.any(), (quantity, estimate, error)
            above += np.log10(estimate[known] / np.maximum(error[known], EQUAL)).tolist()
    assert len(above) > 100
    assert np.mean(above) < TIGHT


def test_the_projected_paths_are_flagged_and_ours_is_not(ladder):
    results = ladder[5]  # 1e-6 rad
    for engine in ("pinocchio", "mujoco"):
        found = results.solutions[engine].errors
        assert found["joint_acceleration"].flagged.all()
        assert found["generalized_force"].flagged.all()
    found = results.solutions["screw"].errors
    assert all(found[quantity].ok for quantity in QUANTITIES if quantity != "reaction")


def test_estimates_hold_near_a_base_lock():
    poses = [[a, BASE + d] for a, d in ((0.1, 1e-2), (-0.2, 1e-3), (0.15, 1e-4), (0.05, 1e-5))]
    results = screwgauge.run(moving_at(poses), engines=["screw", "truth"])
    screw, truth = results.solutions["screw"], results.solutions["truth"]
    for quantity in QUANTITIES:
        assert (screw.errors[quantity].scaled >= errors(screw, truth, quantity)).all(), quantity
    assert screw.errors["joint_acceleration"].flagged[-1]


@pytest.mark.slow
def test_estimates_hold_where_nothing_is_at_rest():
    scene = moving_at(np.random.default_rng(3).uniform(-0.3, 0.3, (10, 2)), scene="3ups-upu-s-offset")
    results = screwgauge.run(scene, engines=["screw", "pinocchio", "truth"])
    for engine in ("screw", "pinocchio"):
        found = results.solutions[engine]
        for quantity in QUANTITIES:
            error = errors(found, results.solutions["truth"], quantity)
            assert (found.errors[quantity].scaled >= error).all(), (engine, quantity)
            assert found.errors[quantity].scaled.max() < LIMIT


@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("distance", [1e-3, 1e-8])
def test_the_full_cut_flags_what_it_loses_at_a_chart_lock(distance):
    """Its tree has the wrist's angles, whose lock affects a force."""
    scene = moving_at([[WRIST + distance, 0.0]])
    results = screwgauge.run(scene, engines=["screw", "pinocchio-full", "truth"])
    found, truth = results.solutions["pinocchio-full"], results.solutions["truth"]
    for quantity in QUANTITIES:
        assert (found.errors[quantity].scaled >= errors(found, truth, quantity)).all(), quantity
    assert found.errors["generalized_force"].flagged.all() == (distance < 1e-5)
    assert results.solutions["screw"].errors["generalized_force"].ok


def test_the_judge_says_what_explains_a_residual():
    results = screwgauge.run(moving_at([[0.1, BASE + 1e-4], [0.1, BASE + 1e-9]]), engines=["screw"])
    bad = results.judge[~results.judge["ok"]]
    assert len(bad)
    assert bad["reason"].str.contains("screw estimates from its conditioning").all()


@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_next_to_singular_poses_nothing_is_wrong_without_a_flag(seed):
    rng = np.random.default_rng(seed)
    away = 10.0 ** rng.uniform(-10, -1, 4)
    near = [
        [rng.uniform(-0.3, 0.3), UPU - away[0]],
        [rng.uniform(-0.3, 0.3), UPU - away[1]],
        [WRIST + away[2], 0.0],
        [0.02 * rng.normal(), BASE + away[3]],
    ]
    scene = moving_at(near, speed=10.0 ** rng.uniform(-2, 1), seed=seed)
    for row in range(len(near)):  # one by one: every sample is measured by its own size
        one = replace(scene, task=scene.motion.part(slice(row, row + 1)))
        results = screwgauge.run(one, engines=["screw", "pinocchio", "truth"])
        if "truth" not in results.solutions:
            continue  # not to be certified: too near
        for engine in ("screw", "pinocchio"):
            found = results.solutions[engine]
            for quantity, estimated in found.errors.items():
                if quantity not in QUANTITIES or not estimated.ok or quantity == "joint_position":
                    continue  # whole turns of a joint next to its lock are a matter of the way there
                error = errors(found, results.solutions["truth"], quantity).max()
                assert error <= LIMIT, (engine, quantity, near[row])


def test_a_pair_out_of_tolerance_says_what_explains_it(ladder):
    pairs = ladder[4].pairs  # 1e-5 rad
    bad = pairs[(pairs["a"] == "truth") & (pairs["b"] == "pinocchio") & ~pairs["ok"]]
    assert {"joint_velocity", "joint_acceleration"} <= set(bad["quantity"])
    assert bad["reason"].str.contains("pinocchio estimates").all()


@pytest.mark.parametrize("away", [1e-5, 1e-6])
def test_next_to_a_singular_pose_what_engines_admit_is_not_decided(away):
    scene = moving_at([[0.1, 0.2], [0.1, BASE + away]])
    results = screwgauge.run(scene, engines=["screw", "pinocchio"])
    assert (results.outcome, results.exit_status, results.undecided) == ("undecided", 1, 1)
    assert not len(results.differences)
    assert not len(results.faults)
    assert verdict(results).word == "✗ NOT DECIDED"
    assert verdict(results).text.startswith("Not decided at 1 of 2 samples: ")
    assert summary(results)["undecided"] == {"samples": 1, "of": 2}
    assert screwgauge.run(replace(scene, task=scene.motion.part(slice(0, 1))), engines=["screw", "pinocchio"]).ok


def altered(scene, errors) -> tuple[bool, float, float, str]:
    """Whether screw and Pinocchio agree with an error in Pinocchio's accelerations. Args: errors: relative to the
    estimates of both or the tolerance, whichever is more.
    """
    wanted = ("joint_acceleration",)
    solutions = {name: solve(scene, (name,), wanted)[0][name] for name in ("screw", "pinocchio")}
    ours, theirs = (solutions[name].values[wanted[0]] for name in solutions)
    column = ours.components.index("leg2.q1")
    size = np.abs(ours.array[:, [unit == "rad/s^2" for unit in ours.units]]).max()
    room = sum(solution.errors[wanted[0]].scaled for solution in solutions.values())
    array = theirs.array.copy()
    array[:, column] = ours.array[:, column] + np.array(errors) * np.maximum(room, 1e-11) * size
    solutions["pinocchio"] = replace(solutions["pinocchio"], values={wanted[0]: replace(theirs, array=array)})
    problem, counted = scene.problem(frozenset(wanted)), check_scene(scene)
    rows, pairs = compare(scene.mechanism, problem, solutions, {}, counted, Allowance(scene.tolerance))
    row = rows[(rows["component"] == "leg2.q1")].iloc[0]
    pair = pairs[pairs["unit"] == "rad/s^2"].iloc[0]
    assert bool(row["ok"]) == bool(pair["ok"])
    assert (row["tolerance"], row["max_scaled"]) == (pair["tolerance"], pair["max_scaled"])
    return bool(pair["ok"]), pair["max_scaled"], pair["tolerance"], pair["reason"]


@pytest.mark.slow
def test_two_engines_agree_within_the_errors_that_their_conditions_explain_sample_by_sample():
    scene = moving_at([[0.1, 0.2], *before_upu(10.0**-2.3, 1, seed=1)])  # one well conditioned, one not
    ok, error, tolerance, reason = altered(scene, [0.0, 0.9])
    assert 1e-10 < error < tolerance < LIMIT
    assert (ok, reason) == (True, f"within {tolerance:.2g}, rounding times the sample's condition number")
    ok, error, tolerance, reason = altered(scene, [0.0, 1.1])
    assert not ok
    assert error > 1e-10 > tolerance
    # what a sample may be off by another one may not
    ok, error, tolerance, _ = altered(scene, [3.0, 0.9])
    assert not ok
    assert 1e-10 > error > tolerance
    # nor where a scene has said what it asks for, or a sample is flagged
    assert not altered(replace(scene, tolerances={"joint_acceleration": 2e-11}), [0.0, 0.9])[0]
    assert not altered(moving_at([[0.1, 0.2], *before_upu(1e-3, 1, seed=1)]), [0.0, 0.9])[0]


def test_the_row_of_a_guard_is_that_of_its_worst_sample(ladder):
    results = ladder[5]
    for row in summary(results)["guard"]:
        error = results.guard[row["engine"], row["quantity"]]
        assert row["condition"] == np.max(error.condition)
        assert (row["estimate"] or np.inf) == np.max(error.scaled)
        assert row["worst_t"] == results.times[int(np.argmax(error.scaled))]
    assert any(np.ptp(error.condition) for error in results.guard.values())


def test_summary_report_and_terminal_tell_of_the_guard(ladder):
    results = ladder[4]
    rows = {(row["engine"], row["quantity"]): row for row in summary(results)["guard"]}
    ours, theirs = rows["screw", "joint_acceleration"], rows["pinocchio", "joint_acceleration"]
    assert (ours["ok"], ours["flagged"]) == (True, 0)
    assert max(ours["estimate"] / LIMIT, ours["condition"] / 1e3) < 1.0
    assert (theirs["ok"], theirs["flagged"]) == (False, 3)
    assert theirs["condition"] > 1e5
    assert theirs["worst_t"] in results.times
    assert "flagged (pinocchio" in terminal(run_in_terminal(results))
    assert "no digit" in str(estimates(results))
    assert "✗ (3 of 3" in str(estimates(results))
    quiet = screwgauge.run(screwgauge.load_scene("3ups-upu-s").at([0.0, 1.0]), engines=["screw"])
    assert "\nconditioning: nothing flagged" in terminal(run_in_terminal(quiet))


def test_a_rule_without_solution_is_blamed_and_not_the_engine():
    times = np.pi * np.arange(3)
    scene = replace(screwgauge.load_scene("3ups-upu-s").at([*times, 1.0]), rule="spherical_axial")
    results = screwgauge.run(scene, engines=["screw", "pinocchio"])
    assert not results.ok
    assert results.judge["ok"].all()
    assert len(results.judge)
    bad = results.pairs[~results.pairs["ok"]]
    assert set(bad["quantity"]) == {"actuator_force", "reaction"}
    assert bad["reason"].str.contains("spherical_axial is singular at 3 of 4").all()
    said = verdict(results)
    assert said.word == "✗ PARTLY"
    assert "judge" not in said.text
    assert "spherical_axial is singular at 3 of 4" in said.text
    json.dumps(summary(results), allow_nan=False)


@pytest.mark.slow
def test_a_locked_chart_is_named_where_rates_are_refused():
    scene = moving_at([[0.0, 0.1], [WRIST, 0.0]])
    scene = replace(scene, task=replace(scene.motion, y=at_lock(scene)))
    results = screwgauge.run(scene, engines=["screw"])
    (refusal,) = results.refusals
    assert results.solutions["screw"].errors["joint_position"].flagged.tolist() == [False, True]
    assert refusal.rows.tolist() == [1]
    assert set(refusal.quantities) == {"joint_velocity", "joint_acceleration"}
    assert "leg2.wrist is in gimbal lock (leg2.q4 and leg2.q6" in refusal.sentence
    assert np.isfinite(results.values("actuator_force")).all()


def at_lock(scene) -> np.ndarray:
    lay = layout(scene.mechanism)
    cut = [joint.name for joint in lay.cuts].index("leg2.wrist")
    step, a = 1e-6, WRIST

    def condition(a: float) -> float:
        found = float(loop_equations(lay).chart_conditions(posed(lay, a, 0.0))[0, cut])
        return found if np.isfinite(found) else np.inf

    while step > 1e-17 and np.isfinite(condition(a)):
        a = max((a - step, a, a + step), key=condition)
        step *= 0.7
    y = scene.motion.y.copy()
    y[1, 0] = a
    return y


@pytest.mark.slow
def test_nothing_compared_is_no_success(paper_scene, tmp_path, capsys):
    engines = ["--engines", "pinocchio,pinocchio-full", "--quantities", "tree_force"]
    status = main(["run", str(paper_scene()), *engines, "--out", str(tmp_path / "o")])
    text = " ".join(capsys.readouterr().out.split())
    assert status == 1
    assert text.startswith("✗ NOTHING COMPARED")
    assert "no quantity in common" in text
    assert "their residuals are within tolerance" in text


def test_one_engine_alone_has_to_be_judged(paper_scene):
    scene = screwgauge.load_scene(paper_scene())
    results = screwgauge.run(scene, engines=["screw"], quantities=["generalized_force"])
    assert results.exit_status == 0
    assert verdict(results).word == "✓ WITHIN TOLERANCE"
    unseen = replace(results, judge=results.judge[:0])
    assert unseen.exit_status == 1
    said = verdict(unseen)
    assert said.word == "✗ NOTHING COMPARED"
    assert re.match("Only screw ran.*nothing", said.text)
