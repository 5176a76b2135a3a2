import importlib.util
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given

import screwgauge
from support.acting import Course, JointSpring, Motor
from support.data import data
from support.engines import ModelFiles, get_engine
from support.errors import UnknownNameError
from support.geometry import rotation
from support.mechanism import load_mechanism
from support.scene import GIVEN, GivenMotion
from support.solve import LONG, ScrewModel, check_traceable, layout
from support.strategies import FEW, scenes
from support.traced import NotTraceableError

pytestmark = pytest.mark.slow

needs_llvm = pytest.mark.skipif(not importlib.util.find_spec("llvmlite"), reason="llvmlite is not installed")
BACKENDS = ("numpy", pytest.param("llvm", marks=needs_llvm))
#: Of the numbers of the same sample, badly conditioned ones left out: the program's and the array solver's rounding.
LOCAL = 1e-10
#: Scaled: the same equations in another order.
SAME = 1e-11


def solved(scene, backend, **settings):
    model = ScrewModel(layout(scene.mechanism), backend=backend, **settings)
    return model.solve(scene.problem(GIVEN))


def worst(mine, other):
    found = {}
    for name, values in other.values.items():
        assert mine.values[name].components == values.components
        for unit in dict.fromkeys(values.units):
            columns = [i for i, u in enumerate(values.units) if u == unit]
            a, b = mine.values[name].array[:, columns], values.array[:, columns]
            assert np.array_equal(np.isnan(a), np.isnan(b)), name
            slack = 2.0 * max(solution.errors[name].absolute[unit] for solution in (mine, other))
            away, size = np.nanmax(np.abs(a - b), initial=0.0), np.nanmax(np.abs(b), initial=0.0)
            found[name, unit] = 0.0 if away <= slack else away / (size or 1.0)
    return max(found.items(), key=lambda item: item[1])


def by_program(solution):
    return int(solution.notes[0].split(" of ")[0])


@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", ["3ups-upu-s", "3ups-upu-s-fast", "3ups-upu-s-offset"])
def test_as_close_to_the_truth_as_promised(name, backend):
    pytest.importorskip("flint", reason="python-flint is not installed")
    scene = screwgauge.load_scene(name)
    scene = scene.at(scene.t[:: len(scene.t) // 40])
    mine = solved(scene, backend)
    assert by_program(mine) == len(scene.t)
    some = scene.at(scene.t[[0, 7, 33]])
    truth = get_engine("truth").load(ModelFiles(scene.mechanism_file)).solve(some.problem(GIVEN[:6] + GIVEN[8:]))
    for quantity, values in truth.values.items():
        picked = mine.values[quantity].at(np.array([0, 7, 33])).array
        for unit in dict.fromkeys(values.units):
            columns = [i for i, u in enumerate(values.units) if u == unit]
            size = np.abs(mine.values[quantity].array[:, columns]).max() or 1.0
            error = np.abs(picked[:, columns] - values.array[:, columns]).max() / size
            assert error <= 1e-12, (quantity, unit, error)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["3-rps", "delta", "a03-andrews", "planetary-gear"])
def test_loops_that_are_predicted_and_trees(name):
    mechanism = load_mechanism(name)
    rng = np.random.default_rng(5)
    k = len(mechanism.independent)
    t = np.linspace(0.0, 1.0, 30)
    size = 0.02 * rng.uniform(0.5, 1.0, k)
    w = rng.uniform(1.0, 4.0, k)
    home = mechanism.home[mechanism.independent_columns]
    arm = np.sin(np.outer(t, w))
    motion = GivenMotion(t, home + size * arm, size * w * np.cos(np.outer(t, w)), -size * w * w * arm)
    scene = replace(screwgauge.load_scene("3ups-upu-s").under(loads=()), mechanism=mechanism, task=motion, text={})
    mine, other = solved(scene, "numpy"), solved(scene, "array")
    assert worst(mine, other)[1] <= SAME
    assert mine.notes


@pytest.mark.slow
@FEW
@given(scenes("planar-4", "rccc", "rscr", "rrsrr", "bennett", "7r", "serial", "spherical-loop", "rssr"))
def test_random_mechanisms(scene):
    scene = scene.at(np.linspace(scene.t[0], scene.t[-1], 40))
    assert worst(solved(scene, "numpy"), solved(scene, "array"))[1] <= SAME


@cache
def on_both_sides(backend):
    """Random states around b = 0.357 rad."""
    rng = np.random.default_rng(0)
    y, yd, ydd = rng.uniform(-0.9, 0.9, (800, 2)), rng.normal(size=(800, 2)), rng.normal(size=(800, 2))
    motion = GivenMotion(np.arange(800.0), y, yd, ydd)
    return solved(replace(screwgauge.load_scene("3ups-upu-s"), task=motion, drive=None, text={}), backend)


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_random_states_on_both_sides_of_the_leg_singularity(backend):
    """Expressions that agree at home differ by kilonewtons beyond."""
    mine, other = on_both_sides(backend), on_both_sides("array")
    assert by_program(mine) > 500
    for name, values in other.values.items():
        away, size = np.abs(mine.values[name].array - values.array), np.abs(values.array)
        if name == "joint_position":  # half a turn to the left is half a turn to the right
            away = np.minimum(away, np.abs(away - 2.0 * np.pi))
        right = np.isfinite(size).all(axis=1)
        assert (away[right].max(axis=1) <= LOCAL * size[right].max(axis=1)).all(), name
        size = size[right].max()
        bound = (mine.errors[name].scaled + other.errors[name].scaled)[right] * size
        assert (away[right].max(axis=1) <= bound).all(), name


@pytest.mark.parametrize("backend", BACKENDS)
def test_home_at_rest_has_numbers(backend):
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0])
    found = solved(scene, backend)
    assert by_program(found) == 1
    assert all(np.isfinite(values.array).all() for values in found.values.values())


@pytest.mark.parametrize("backend", BACKENDS)
def test_coordinates_of_the_tree_that_rest_are_known_where_poses_are_predicted(backend, tmp_path):
    # the slide of this slider-crank might turn, but rests: its angle, 0.3 rad at home, is in the tree
    (tmp_path / "resting.toml").write_text(data("resting.toml"), encoding="utf-8")
    path = tmp_path / "scene.toml"
    motion = "motion.crank.harmonics = [[3, 0, 0.4]]\ntime = { duration = 1, step = 0.02 }\n"
    path.write_text(f'mechanism = "resting.toml"\n{motion}', encoding="utf-8")
    scene = screwgauge.load_scene(path)
    found = solved(scene, backend)
    assert by_program(found) == len(scene.t)
    assert worst(found, solved(scene, "array"))[1] <= SAME


def test_badly_conditioned_samples_are_left_to_the_array_solver_and_counted():
    b = 0.356801 - np.array([0.2, 0.1, 1e-4, 1e-7])
    y = np.stack([np.full(4, 0.1), b], axis=1)
    motion = GivenMotion(np.arange(4.0), y, np.ones((4, 2)), np.ones((4, 2)))
    scene = replace(screwgauge.load_scene("3ups-upu-s"), task=motion, drive=None, text={})
    mine, other = solved(scene, "numpy"), solved(scene, "array")
    assert mine.notes[0].startswith("2 of 4 samples were solved")
    assert mine.notes[0].endswith("solver (2 badly conditioned)")
    assert np.array_equal(mine.values["reaction"].array[2:], other.values["reaction"].array[2:])


def under(**applied):
    return lambda scene: scene.under(**applied)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("3ups-upu-s", lambda scene: replace(scene, rule="spherical_axial")),
        ("3ups-upu-s", under(springs=(JointSpring("leg2.q4", 30.0, 0.1, 2.0),))),
        ("five-bar", under(motors=(Motor("tip", Course(np.array([0.3, 0.2]), np.array([[4.0, 0.5, 0.1]]))),))),
    ],
)
def test_programs_answer_to_rules_springs_and_motors(name, change):
    scene = change(screwgauge.load_scene(name))
    scene = scene.at(np.linspace(0.3, 1.3, 7))
    found = solved(scene, "numpy")
    assert by_program(found) >= 6
    _, error = worst(found, solved(scene, "array"))
    assert error < SAME * (1e3 if scene.rule == "spherical_axial" else 1.0)


def test_fewer_actuators_than_freedoms_are_left_to_the_arrays():
    scene = screwgauge.load_scene("five-bar")
    joints = tuple(
        replace(joint, actuated=False) if joint.name == "left" else joint for joint in scene.mechanism.joints
    )
    lay = layout(replace(scene.mechanism, joints=joints))
    with pytest.raises(NotTraceableError, match="fewer actuators than degrees"):
        check_traceable(lay, scene.problem(["actuator_force"]))


def test_long_motions_are_traced_unless_the_arrays_are_asked_for():
    scene = screwgauge.load_scene("3ups-upu-s")
    long, short = scene.at(scene.t[:LONG]), scene.at(scene.t[: LONG - 1 : 40])
    assert by_program(solved(long, None)) == LONG
    assert solved(short, None).notes == solved(short, "array").notes == ()


def test_there_is_no_other_backend():
    with pytest.raises(UnknownNameError, match="unknown backend 'numba'"):
        get_engine("screw").load(ModelFiles(screwgauge.load_scene("3ups-upu-s").mechanism_file), backend="numba")


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ball_whose_middle_angle_is_beyond_a_right_angle_is_read_so(backend):
    scene = screwgauge.load_scene("3-rps")
    mechanism, home = scene.mechanism, np.array([0.2, 2.0, -0.3])
    balls = {joint.name: joint for joint in layout(mechanism).cuts}
    assert {joint.kind for joint in balls.values()} == {"S"}
    for name, ball in balls.items():
        assert not ball.home.any()
        turns = [rotation(axis, np.array(angle)) for axis, angle in zip(ball.axes, home, strict=True)]
        back = np.linalg.multi_dot(turns).T
        balls[name] = replace(ball, home=home, parent_frame=replace(ball.parent_frame, R=ball.parent_frame.R @ back))
    turned = replace(mechanism, joints=tuple(balls.get(joint.name, joint) for joint in mechanism.joints))
    scene = replace(scene.at(scene.t[:: len(scene.t) // 20]), mechanism=turned)
    mine = solved(scene, backend)
    assert by_program(mine) == len(scene.t)
    assert worst(mine, solved(scene, "array"))[1] <= LOCAL
