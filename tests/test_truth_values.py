import numpy as np
import pytest

import screwgauge
from support.data import DATA
from support.equations import reaction_names
from support.mechanism import load_mechanism, mechanism_tables
from support.scene import sampled
from support.tolerances import AGREE, LINEAR, NEAREST, RADIUS, SOLVER


@pytest.fixture(scope="module", params=["3ups-upu-s", "3ups-upu-s-fast", "3ups-upu-s-offset"])
def results(request):
    scene = screwgauge.load_scene(request.param)
    rows = np.linspace(0, len(scene.motion) - 1, 9).astype(int)
    return screwgauge.run(scene.at(scene.t[rows]), engines=["screw", "truth"])


@pytest.mark.slow
def test_radius_of_every_quantity_is_below_the_promise(results):
    truth = results.solutions["truth"]
    assert {"joint_acceleration", "body_angular_acceleration", "generalized_force", "reaction"} <= set(truth.errors)
    for quantity, values in truth.values.items():
        radius = results.radius(quantity)
        assert radius.shape == values.array.shape
        assert (radius > 0).all() or quantity == "joint_position"
        for unit in set(values.units):
            columns = [i for i, has in enumerate(values.units) if has == unit]
            scaled = radius[:, columns].max() / np.abs(values.array[:, columns]).max()
            assert scaled <= RADIUS, f"{quantity} [{unit}]: {scaled:.1e}"


def test_solver_is_as_close_to_the_truth_as_promised(results):
    table = results.pairs[results.pairs["a"] == "truth"]
    assert set(table["quantity"]) == set(results.solutions["truth"].values)
    assert set(table["b"]) == {"screw"}
    worst = table["max_scaled"].max()
    assert worst <= SOLVER, f"{worst:.1e}"


def test_truth_satisfies_the_judge(results):
    judged = results.judge[results.judge["engine"] == "truth"]
    assert {"loop_acceleration", "newton_euler", "power_balance"} <= set(judged["residual"])
    assert judged["max_scaled"].max() < NEAREST


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "rscr", "pendulum"])
def test_any_mechanism_has_a_truth(name):
    results = screwgauge.run(sampled(DATA / f"{name}-scene.toml", slice(None, None, 5)), engines=["screw", "truth"])
    assert results.ok, results.failures
    assert results.pairs["max_scaled"].max() < LINEAR


@pytest.mark.parametrize("name", ["3ups-upu-s", *(DATA / f"{x}.toml" for x in ("slider-crank", "rscr", "pendulum"))])
def test_reactions_have_the_names_of_the_other_engines(name):
    from flint import ctx

    from support.truth import Linkage, State, number, unknowns

    mechanism = load_mechanism(name)
    names, units = reaction_names(mechanism.joints, mechanism.couplings)
    with ctx.workprec(192):
        linkage = Linkage(mechanism, mechanism_tables(name))
        home = [[number(float(x))] for x in mechanism.home]
        found = unknowns(linkage, State(home, None, linkage.place(home)))
    assert [part.name for part in found] == list(names)
    assert [part.unit for part in found] == list(units)


def test_overconstrained_mechanism_is_said_to_be_so():
    scene = screwgauge.load_scene(DATA / "four-bar-scene.toml").at([0.0])
    truth = screwgauge.run(scene, engines=["truth"]).solutions["truth"]
    assert any("overconstrained" in note for note in truth.notes)


def test_rule_of_equation_56_agrees_with_the_solver():
    from dataclasses import replace

    scene = replace(screwgauge.load_scene("3ups-upu-s"), rule="spherical_axial").at([0.5, 1.0, 2.0])
    results = screwgauge.run(scene, engines=["screw", "truth"], quantities=["actuator_force", "reaction"])
    assert results.pairs["max_scaled"].max() < AGREE
