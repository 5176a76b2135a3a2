from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.engines import Error, Values, ask, model_files
from support.judging import LIMIT
from support.report import verdict
from support.scene import natural_scales

QUANTITIES = (
    "joint_velocity",
    "joint_acceleration",
    "body_angular_velocity",
    "com_acceleration",
    "generalized_force",
    "actuator_force",
    "reaction",
)
#: What a liar says of its error: scaled, and absolute.
CLAIMS = {
    "scaled": (1e9, 0.0),
    "scaled without end": (np.inf, 0.0),
    "scaled to half": (0.5, 0.0),
    "scaled, no number": (np.nan, 0.0),
    "absolute": (0.0, 1e9),
    "absolute without end": (0.0, np.inf),
    "both": (1e9, 1e9),
}


def off(factor, scaled=0.0, absolute=0.0, **more):
    """Our numbers times a factor."""

    def solve(problem):
        right = ask("screw", model_files("slider-crank", "screw"), problem)
        n = len(problem.task)
        values = {q: Values(v.components, v.units, v.array * factor) for q, v in right.values.items()}
        errors = {q: Error(np.full(n, scaled), dict.fromkeys(v.units, absolute)) for q, v in values.items()}
        return replace(right, values=values, errors=errors, **more)

    return solve


@pytest.fixture
def crank():
    return screwgauge.load_scene("slider-crank").at(np.linspace(0.1, 1.0, 4))


def of_two(scene, *quantities):
    return screwgauge.run(scene, engines=["screw", "mujoco"], quantities=quantities)


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("claim", CLAIMS)
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_claim_is_no_agreement(quantity, claim, known, stand_in, crank):
    stand_in(mujoco=off(2.0, *CLAIMS[claim], **({} if known else {"assembly": None})))
    results = of_two(crank, quantity)
    assert results.exit_status == 1
    assert not results.pairs["ok"].all()
    assert known or results.unjudged == ("mujoco",)


def test_what_is_admitted_up_to_half_of_the_digits_explains_as_much(stand_in, crank):
    stand_in(mujoco=off(1.0 + 0.5 * LIMIT, LIMIT))
    assert of_two(crank, "actuator_force").ok
    stand_in(mujoco=off(1.0 + 3.0 * LIMIT, LIMIT))
    assert of_two(crank, "actuator_force").outcome == "differ"


def test_more_is_not_decided_at_as_many_samples_as_it_is_claimed_for(stand_in, crank):
    stand_in(mujoco=off(1.0 + 3.0 * LIMIT, 4.0 * LIMIT))
    results = of_two(crank, "actuator_force")
    assert (results.outcomes, results.exit_status) == (("undecided",), 1)
    assert results.undecided == (np.abs(results.values("actuator_force", "screw")) > 0.0).any(axis=1).sum()
    assert verdict(results).word == "✗ NOT DECIDED"
    assert f"{results.undecided} of 4 samples" in verdict(results).text


def test_a_difference_beyond_the_claim_is_decided(stand_in, crank):
    stand_in(mujoco=off(1.0 + 1e-3, 1e-4))
    assert of_two(crank, "actuator_force").outcome == "differ"


def test_the_scene_admits_what_it_likes(stand_in, crank):
    stand_in(mujoco=off(2.0))
    admitted = dict.fromkeys(("actuator_force", "generalized_force"), 4.0)
    assert of_two(crank, "actuator_force").outcome == "differ"
    results = of_two(replace(crank, tolerances=admitted), "actuator_force")
    assert results.ok, results


def test_an_engine_that_nothing_judges_does_not_pass(stand_in, crank):
    stand_in(mujoco=off(1.0, assembly=None))
    results = of_two(crank, "actuator_force")
    assert results.pairs["ok"].all()
    assert (results.outcomes, results.unjudged, results.exit_status) == (("unjudged",), ("mujoco",), 1)
    assert verdict(results).word == "✗ NOT JUDGED"


#: Right numbers whose rounding is that of a formulation in world axes: a few units of the last digit of the largest
#: force, at the length of the machine.
ROUNDINGS = 16.0
FAIR = ("slider-crank", "screw-press", "double-cardan", "sarrus", "bennett", "stewart")


def rounded(name, size, planted=0.0, where=0):
    def solve(problem):
        right = ask("screw", model_files(name, "screw"), problem)
        values = dict(right.values)
        for quantity in ("actuator_force", "reaction"):
            one = values[quantity]
            arm = np.where([unit == "N m" for unit in one.units], size, 1.0)
            load = np.abs(one.array / arm).max()
            noise = np.cos(np.arange(one.array.size, dtype=float) ** 2).reshape(one.array.shape)
            array = one.array + ROUNDINGS * np.finfo(float).eps * load * arm * noise
            if quantity == "reaction":
                columns = [k for k, unit in enumerate(one.units) if unit == one.units[where]]
                array[:, where] += planted * np.abs(one.array[:, columns]).max()
            values[quantity] = Values(one.components, one.units, array)
        return replace(right, values=values, errors={})

    return solve


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", FAIR)
def test_right_numbers_that_come_without_a_word_on_their_errors_pass(name, stand_in):
    scene = screwgauge.load_scene(name)
    scene = scene.at(np.linspace(scene.t[0], scene.t[-1], 5))
    size = natural_scales(scene.mechanism)["m"]
    stand_in(mujoco=rounded(name, size))
    assert of_two(scene, "actuator_force", "reaction").ok
    results = screwgauge.run(scene, ["screw"], ["reaction"])
    left_open = {*results.undetermined}
    for where, component in [*enumerate(results.components("reaction"))][::5]:
        stand_in(mujoco=rounded(name, size, 1e-9, where))
        assert component in left_open or not of_two(scene, "actuator_force", "reaction").ok, component
