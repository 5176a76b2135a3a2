import re
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge import load_scene
from screwgauge.reference.courses import Course
from support.acting import Applied, Load, Motor
from support.engines import ENGINES, ask, model_files
from support.errors import ClosureError
from support.lagrange import Equations, Unfolded, by_energies, over_arrays
from support.mechanism import load_mechanism
from support.scene import TABLE, GivenMotion, scene_names
from support.tolerances import AGREE, LINEAR, ROUNDING

GIVEN_MOTIONS = [name for name in scene_names() if not load_scene(name).simulated]
#: All that it gives.
ASKED = [name for name, one in TABLE.items() if one.of != "observable" and name not in ENGINES["lagrange"].lacks]

CART = """
name = "cart"
independent.x = "rail"
[bodies]
cart = { mass = 1.0, inertia = { xx = 0.1, yy = 0.1, zz = 0.1 } }
[joints]
rail = { kind = "P", parent = "ground", child = "cart", axes = [[1, 0, 0]], actuated = true }
"""
#: The cart passes the fixed end of its spring at the second sample.
MET = """
mechanism = "cart.toml"
motion.x.polynomial = [0, 1]
time.times = [0, 1, 2]
[[springs]]
first = "ground"
first_point = [1, 0, 0]
second = "cart"
second_point = [0, 0, 0]
stiffness = 3.0
rest = 0.5
"""


def compared(scene, quantities=ASKED, engines=("screw", "lagrange")):
    results = screwgauge.run(scene, engines=engines, quantities=quantities)
    assert not results.failures
    return results


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", GIVEN_MOTIONS)
def test_it_agrees_with_screw_in_every_quantity(name):
    scene = load_scene(name)
    results = compared(scene.at(np.linspace(scene.t[0], scene.t[-1], 5)))
    assert results.exit_status == 0
    assert results.pairs["max_scaled"].max() < AGREE
    assert {*results.pairs["quantity"]} >= {"mass_matrix", "axis_moment"}


def test_it_admits_what_rounding_leaves_and_no_more():
    solution = compared(load_scene("3ups-upu-s").at([0.3, 0.9])).solutions["lagrange"]
    assert {*solution.errors} == {*solution.values}
    assert max(error.largest for error in solution.errors.values()) < AGREE
    assert solution.condition.max() < 1e3


@pytest.mark.parametrize("distance", [1e-3, 1e-5])
def test_next_to_a_singular_pose_it_knows_what_it_loses(distance):
    """The platform gains a freedom at b = 0.356801, where `screw` has a closed form."""
    scene, b = load_scene("3ups-upu-s").at([0.0, 1.0]), 0.356801 - distance
    y, yd = np.array([[0.0274, b - 0.01], [0.0274, b]]), np.array([[0.0, 0.01]] * 2)
    results = compared(replace(scene, task=GivenMotion(np.arange(2.0), y, yd, 0.0 * y)), ["joint_acceleration"])
    wrong = results.pairs[~results.pairs["ok"].astype(bool)]
    assert len(wrong)
    assert wrong["undecided"].all()
    assert results.solutions["lagrange"].errors["joint_acceleration"].largest > wrong["max_scaled"].max()


@pytest.mark.parametrize("name", ["3ups-upu-s", "stewart", "screw-press", "ruse", "geared-five-bar"])
def test_virtual_work_is_the_derivative_of_energies(name):
    """Needs are d/dt dT/dv - d(T - U)/dq, by forward over reverse mode."""
    mechanism = load_mechanism(name)
    rng, n = np.random.default_rng(5), len(mechanism.coordinates)
    state = {"q": mechanism.home + rng.uniform(-0.3, 0.3, (4, n)), "v": rng.normal(size=(4, n))}
    state |= {"a": rng.normal(size=(4, n)), "g": rng.normal(size=3)}
    equations = Equations.of(mechanism)
    needs = equations.balance(4, **state)["needs"]
    assert np.abs(by_energies(equations, state) - needs).max() < ROUNDING * np.abs(needs).max()


@pytest.mark.parametrize("name", ["slider-crank", "ruse", "screw-press", "rccc"])
def test_folding_changes_nothing(name):
    mechanism = load_mechanism(name)
    rng, load = np.random.default_rng(6), Load(mechanism.bodies[-1].name, np.ones(3), np.zeros(3), np.zeros(3))
    folded, plain = (Equations.of(mechanism, Applied(loads=(load,)), trace) for trace in (None, Unfolded(10**7)))
    given = {name: rng.normal(size=(3, len(some))) for name, some in folded.inputs.items() if name != "moved"}
    for what in ("closing", "motion", "balance", "transmitted"):
        found, expected = getattr(folded, what)(3, **given), over_arrays(plain, what, given)
        assert found.keys() == expected.keys()
        for output, array in expected.items():
            size = max(1.0, np.abs(array).max(initial=0.0))
            assert np.abs(found[output] - array).max(initial=0.0) < ROUNDING * size, output


def test_loads_may_change_from_sample_to_sample():
    scene = load_scene("3ups-upu-s").at([0.1, 0.4, 0.9])
    force, torque = np.arange(9.0).reshape(3, 3) * 50.0, np.array([[1.0, -2.0, 3.0]] * 3)
    loads = (Load("platform", np.array([0.1, 0.0, 0.2]), force, torque), Load("leg1.lower", None, torque[0], torque[1]))
    applied = replace(
        scene.applied, loads=loads, motors=(Motor("leg1.q3", Course(np.array([5.0, 7.0]), np.zeros((0, 3)))),)
    )
    problem = replace(scene.problem(["actuator_force", "reaction"]), applied=applied)
    one, other = (ask(name, model_files("3ups-upu-s", name), problem).values for name in ("screw", "lagrange"))
    for name, values in one.items():
        assert other[name].components == values.components
        assert np.abs(other[name].array - values.array).max() < LINEAR * np.abs(values.array).max(), name


def test_both_rules_of_redundant_actuators():
    scene = replace(load_scene("3ups-upu-s-fast").at([0.1, 0.4]), rule="spherical_axial")
    results = compared(scene, ["actuator_force", "reaction"])
    assert results.pairs["max_scaled"].max() < AGREE
    smallest = compared(replace(scene, rule="min_norm"), ["actuator_force"])
    f, g = (found.values("actuator_force", "lagrange") for found in (results, smallest))
    assert (np.linalg.norm(g, axis=1) < np.linalg.norm(f, axis=1)).all()


def test_few_samples_are_on_the_branch_of_many():
    scene = load_scene("double-cardan")
    some = np.linspace(scene.t[0], scene.t[-1], 7)
    few = compared(scene.at(some), ["joint_position"]).values("joint_position", "lagrange")
    many = compared(scene.at(np.union1d(some, scene.t)), ["joint_position"])
    rows = np.searchsorted(many.scene.t, some)
    assert np.abs(many.values("joint_position", "lagrange")[rows] - few).max() < ROUNDING * np.abs(few).max()


def test_a_motion_beyond_reach_is_refused_where_screw_refuses_it():
    scene = load_scene("3-rps").at([0.0, 0.1])
    task = replace(scene.motion, y=scene.motion.y + np.array([[0.0] * 3, [1.0, 0.0, 0.0]]), drive=None)
    problem, said = replace(scene.problem(["joint_position"]), task=task), list[float]()
    for name in ("screw", "lagrange"):
        with pytest.raises(ClosureError, match=r"loops cannot close beyond y = ") as error:
            ask(name, model_files("3-rps", name), problem)
        said.append(float(re.search(r"y = \[(\S+?),? ", str(error.value))[1]))
    assert said[1] == pytest.approx(said[0], abs=1e-3)


def test_a_spring_whose_ends_meet_at_one_sample_has_no_direction(write):
    write("cart.toml", CART)
    scene = screwgauge.load_scene(write("scene.toml", MET))
    failure = screwgauge.run(scene, engines=["lagrange"], quantities=["generalized_force"]).failures["lagrange"]
    assert "spring" in failure.reason
    assert screwgauge.run(scene.at([0.0, 2.0]), engines=["lagrange"], quantities=["generalized_force"]).ok
