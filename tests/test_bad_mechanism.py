"""What a description may say, and what no mechanism can do; all else is refused by `claims/refusals.toml`."""

import numpy as np
import pytest

from screwgauge import ScrewgaugeError, load_scene, run, stream
from screwgauge.api import compile
from support.errors import DescriptionError
from support.geometry import linear, number, rotation
from support.mechanism import ROD, Body, load_mechanism
from support.scene import check_home
from support.solve import at_home, motion_at
from support.tolerances import PLACED


@pytest.mark.parametrize("command", ["run", "models"])
def test_unknown_mechanism_is_refused(command, refused, write):
    scene = write("scene.toml", 'mechanism = "3ups-upu"\n')
    said = refused(command, scene if command == "run" else "3ups-upu")
    assert "unknown mechanism '3ups-upu'" in said
    assert "did you mean '3ups-upu-s'" in said


@pytest.mark.parametrize("name", ["x" * 5000, "", ".", "\udcff"])
def test_what_is_no_path_is_an_unknown_mechanism(name):
    with pytest.raises(ScrewgaugeError, match="unknown mechanism"):
        load_mechanism(name)


def body(*moments: float) -> Body:
    return Body("b", 1.0, np.zeros(3), np.diag(moments))


@pytest.mark.parametrize("moments", [(0, 0, 0), (0, 1, 1), (1e-9, 1e-9, 0), (1, 1, 2), (0.5, 0.5, 1.0), (1e9, 0, 1e9)])
def test_points_and_thin_rods_and_discs_are_legal(moments):
    assert body(*moments).mass == 1.0


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_triangle_inequality_has_a_tolerance_of_1e_12_of_the_trace(scale):
    inside, outside = 0.9e-12, 1.1e-12
    body(0.5 * scale, 0.5 * scale, scale * (1 + 2 * inside))
    with pytest.raises(DescriptionError, match="triangle"):
        body(0.5 * scale, 0.5 * scale, scale * (1 + 2 * outside))
    body(scale, scale, -2 * inside * scale)  # the same slack keeps a rounded rod legal
    with pytest.raises(DescriptionError, match="semidefinite"):
        body(scale, scale, -2.2 * outside * scale)


def test_a_rod_turned_into_any_axes_stays_legal():
    for angle in np.linspace(0.1, 3.0, 17):
        R = rotation(np.array([0.6, 0.0, 0.8]), np.array(angle)) @ rotation(
            np.array([0.0, 1.0, 0.0]), np.array(2 * angle)
        )
        Body("rod", 1.0, np.zeros(3), R @ np.diag([0.0, 1.0, 1.0]) @ R.T)


def test_a_unit_axis_may_be_written_as_an_expression(write):
    path = write("rod.toml", ROD.replace("[[1, 0, 0]]", '[["1/sqrt(2)", "sqrt(2)/2", 0]]'))
    assert np.linalg.norm(load_mechanism(path).joints[0].axes) == pytest.approx(1.0, abs=PLACED)


def dependent(mechanism, pair: tuple[str, str]) -> bool:
    lay, home = at_home(mechanism)
    rates = motion_at(lay, home, np.zeros((1, 2))).joint_map[0]
    return linear.rank(rates[mechanism.columns(pair)]) < 2


@pytest.mark.parametrize("pair", [("leg1.q1", "s.q1"), ("leg1.q2", "s.q2"), ("leg1.q3", "leg3.q3"), ("s.q3", "s.q1")])
def test_dependent_coordinates_are_refused(pair, paper, changed_scene, refused):
    assert dependent(paper, pair)
    said = refused("run", changed_scene(f'[independent]\na = "{pair[0]}"\nb = "{pair[1]}"'))
    assert f"changed.toml, independent: the coordinates a = {pair[0]}, b = {pair[1]} are not independent" in said


@pytest.mark.parametrize("pair", [("s.q1", "s.q2"), ("leg1.q3", "leg2.q3")])
def test_independent_coordinates_are_accepted(pair, paper, changed_scene):
    assert not dependent(paper, pair)
    path = changed_scene(f'[independent]\na = "{pair[0]}"\nb = "{pair[1]}"').with_name("changed.toml")
    check_home(load_mechanism(path))


@pytest.mark.parametrize("value", [True, False, None, [], {}, [1], {"x": 1}, 1j, b"1", object()])
def test_what_is_no_text_and_no_number_is_refused(value):
    with pytest.raises(DescriptionError):
        number(value, "here")


@pytest.mark.parametrize(
    ("text", "value"),
    [("3*sqrt(3)/10", 0.3 * 3**0.5), ("-pi/6", -np.pi / 6), (" 2**-3 ", 0.125), ("1e-3", 1e-3)],
)
def test_expressions_are_read(text, value):
    assert number(text, "") == pytest.approx(value, rel=PLACED, abs=0)


def test_debug_shows_the_traceback_and_still_exits_with_2(command):
    said = command("run", "nothing", "--debug", status=2).err
    assert "Traceback" in said
    assert "unknown scene 'nothing'" in said


@pytest.mark.slow
@pytest.mark.parametrize(("idle", "driven"), [((1, 2, 3, 4), 0), ((2, 3, 4), 1), ((2, 4), 1)])
def test_actuators_that_cannot_make_the_motion_are_refused(idle, driven, changed_scene, refused):
    changes = "".join(f'[joints."leg{leg}.slide"]\nactuated = false\n' for leg in idle)
    scene = changed_scene(changes)
    said = refused("run", scene, "--engines", "screw", "--quantities", "actuator_force,joint_position")
    assert f"joints drive {driven} of 2 freedoms" in said
    # where nobody chose, what they cannot make is left out, and said to be
    results = run(load_scene(scene).at([0.0]), ["screw"])
    (solution,) = (solution for _, solution in stream(load_scene(scene), [np.zeros(1)]))
    solver = compile(load_scene(scene), backend="numpy")
    answers = (results.solutions["screw"].values, solution.values, solver.components)
    for values, said in zip(answers, (results.warnings, solution.notes, solver.notes), strict=True):
        assert {"actuator_force", "reaction"}.isdisjoint({*values})
        assert f"drive {driven} of 2 freedoms" in said[0]


def test_a_mechanism_without_actuators_still_moves(changed_scene):
    changes = "".join(f'[joints."leg{leg}.slide"]\nactuated = false\n' for leg in (1, 2, 3, 4))
    scene = load_scene(changed_scene(changes))
    wanted = ["joint_acceleration", "generalized_force"]
    assert run(scene, engines=["screw", "pinocchio", "mujoco"], quantities=wanted).exit_status == 0


@pytest.mark.parametrize("idle", [(4,), (3, 4)])
def test_the_axial_rule_needs_as_many_redundant_actuators_as_it_fixes(idle, changed_scene, refused):
    changes = "".join(f'[joints."leg{leg}.slide"]\nactuated = false\n' for leg in idle)
    said = refused("run", changed_scene(changes, rule='rule = "spherical_axial"'))
    assert f"needs 2 redundant actuators, not {2 - len(idle)}" in said
