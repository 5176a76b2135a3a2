import re
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge.engines.error_estimate import SolvedPart, Trust, error_of
from support.engines import Solution, Values
from support.freedoms import mobility_at_home
from support.judging import Allowance, compare, compared, judge
from support.near import BASE, moving_at
from support.planar import Bar, at_random, four_bar, moving, slider_crank
from support.scene import check_actuation, check_scene
from support.tolerances import NOTICED, ROUNDING

pytestmark = pytest.mark.slow

FORCES = ("generalized_force", "actuator_force", "reaction")


def said(results) -> list[str]:
    """What is out of tolerance."""
    return [table[~table["ok"]].to_string() for table in (results.pairs, results.judge)]


def check_clear(results) -> None:
    assert results.ok, said(results)
    assert [key for key, error in results.guard.items() if not error.ok] == []


def test_a_slider_crank_with_its_mass_on_the_line_of_its_slide(write):
    text = slider_crank([Bar(0.2), Bar(0.7), Bar(0.0, mass=3.0)], 0.6)
    results = screwgauge.run(moving(write, text, [0.6, 0.9, 1.4], 3.0))
    check_clear(results)
    zero = results.pairs[results.pairs["reason"].str.startswith("zero within")]
    assert {*zip(zero["quantity"], zero["unit"], strict=True)} == {("reaction", "N m")}
    (apart,) = re.findall(r"apart from (.*?)\. ", " ".join(repr(results).split()))
    assert "reaction in N·m" in apart  # which the digits of the headline are not of
    page = results.to_html()
    assert "reaction" not in re.findall(r"worst numbers.*?</table>", page, re.DOTALL)[0]


def test_a_slider_crank_at_its_dead_centre(write):
    text = slider_crank([Bar(0.2), Bar(0.7), Bar(0.0)], 0.0)
    check_clear(screwgauge.run(moving(write, text, [0.0], 10.0)))


@pytest.mark.slow
@pytest.mark.parametrize("crank", [0.695, 0.6992, 0.69935])
def test_reactions_that_are_zero_near_a_dead_centre_are_no_lost_digits(write, crank):
    text = slider_crank([Bar(crank), Bar(0.7), Bar(0.0)], 1.5)
    results = screwgauge.run(moving(write, text, [1.5, np.pi / 2], 1.0))
    check_clear(results)
    rows = results.pairs[(results.pairs["quantity"] == "reaction") & (results.pairs["unit"] == "N m")]
    assert rows["max_scaled"].max() < 1e-10
    assert rows["tolerance"].max() < 1e-5  # of a millionth of the natural scale


def test_an_error_is_measured_by_no_less_than_a_millionth_of_the_natural_scale():
    trust = Trust(np.full(2, 60.0), np.full(2, 20.0), np.ones(2), load=np.full(2, 1e-4))
    noise = np.array([[1e-19], [0.0]])
    part = SolvedPart({"reaction": noise}, trust, np.zeros(0, dtype=np.intp), {"reaction": np.zeros((0, 1))})
    error = error_of("reaction", [part], Values(("m",), ("N m",), noise), length=1.0, mass=1.0)
    assert error.largest < 1e-9


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (0.0, -9.81, 0.0), (0.0, 0.0, 0.0)])
def test_a_parallelogram_at_a_constant_rate_has_no_angular_accelerations(write, gravity):
    text = four_bar([Bar(0.3), Bar(0.8, com=(0.4, 0.0, 0.0)), Bar(0.3)], 0.8, 1.0)
    results = screwgauge.run(moving(write, text, [1.0, 1.3, 1.5], 2.0, g=gravity))
    check_clear(results)
    assert np.abs(results.values("joint_acceleration")).max() < ROUNDING
    why = results.pairs[results.pairs["quantity"] == "joint_acceleration"]["reason"]
    assert (why.eq("") | why.str.contains("rounding of its largest summands")).all()


def test_light_carriers_between_heavy_bodies(write):
    text = four_bar([Bar(0.3, 1e-6), Bar(0.8, 10.0, (0.4, 0.1, 0.0)), Bar(0.5, 1e-6)], 0.7, 1.0)
    check_clear(screwgauge.run(moving(write, text, [1.0, 1.2], 5.0, 1.0)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_planar_mechanisms_at_random_agree(write, seed):
    results = screwgauge.run(at_random(write, seed))
    assert results.exit_status == 0, said(results)
    assert all(np.isfinite(error.largest) for error in results.guard.values())


@pytest.mark.slow
def test_a_share_of_any_force_is_noticed(write):
    seen = 0
    for seed in range(12):
        scene = at_random(write, seed)
        right = screwgauge.run(scene, engines=["screw"]).solutions["screw"]
        counts = mobility_at_home(scene.mechanism)
        for quantity in ("joint_velocity", "joint_acceleration", "com_acceleration", *FORCES):
            values = right.values[quantity]
            alone = replace(right, values={quantity: values})
            for unit in dict.fromkeys(values.units):
                for wrong, size in disturbed(alone, quantity, unit):
                    problem, both = scene.problem(()), {"screw": alone, "other": wrong}
                    errors, _ = compare(scene.mechanism, problem, both, {}, counts, Allowance(scene.tolerance))
                    rows = errors[(errors["quantity"] == quantity) & (errors["unit"] == unit)]
                    if size < rows["scale"].max() or size < 1e3 * right.errors[quantity].absolute[unit]:
                        continue  # it vanishes beside the natural scale, or beside its summands
                    compared = rows[(rows["max_abs"] > 0.0) & (rows["rule"] != "undetermined")]
                    assert not compared["ok"].any(), (seed, compared.to_string())
                    seen += len(compared)
    assert seen > 100


def disturbed(solution: Solution, quantity: str, unit: str):
    values = solution.values[quantity]
    columns = [i for i, has in enumerate(values.units) if has == unit]
    size = float(np.abs(values.array[:, columns]).max())
    for column in columns:
        array = values.array.copy()
        array[-1, column] += NOTICED * size
        wrong = {**solution.values, quantity: Values(values.components, values.units, array)}
        yield replace(solution, engine="other", values=wrong), size


@pytest.mark.slow
@pytest.mark.parametrize("body", range(3))
def test_a_mass_off_by_a_billionth_is_noticed(write, body):
    def text(share: float) -> str:
        masses = [1.0, 2.0, 0.5]
        masses[body] *= 1.0 + share
        bars = [Bar(x, m, (0.1, 0.0, 0.02)) for x, m in zip((0.3, 0.8, 0.5), masses, strict=True)]
        return four_bar(bars, 0.7, 1.0)

    right = moving(write, text(0.0), [1.0, 1.2], 5.0, 1.0)
    solution = screwgauge.run(right, engines=["screw"]).solutions["screw"]
    other = screwgauge.run(moving(write, text(NOTICED), [1.0, 1.2], 5.0, 1.0), engines=["screw"]).solutions["screw"]
    assert not judge(right.mechanism, right.problem(()), other)["ok"].all()
    both = {"screw": solution, "other": replace(other, engine="other")}
    pairs = compared(right, both)[1]
    assert {"actuator_force", "reaction"} <= set(pairs[~pairs["ok"]]["quantity"])


def test_a_small_force_among_large_ones_is_seen(write):
    scene = moving(write, slider_crank([Bar(0.2), Bar(0.7), Bar(0.0)], 0.6), [0.6], 1.0)
    right = screwgauge.run(scene, engines=["screw"]).solutions["screw"]
    assert all(size < 1e-12 for error in right.errors.values() for size in error.absolute.values())


@pytest.mark.slow
@pytest.mark.parametrize("decade", np.arange(-9.0, -6.5, 0.5))
def test_next_to_a_lock_the_actuators_still_drive_every_freedom(decade):
    scene = moving_at([[0.0, BASE + 10.0**decade]])
    counts = check_scene(scene)
    check_actuation(scene, counts, ["actuator_force"])
    assert (counts.constraint_rank, counts.actuation_redundancy) == (counts.constraints, 2)
