import numpy as np
import pandas as pd
import pytest

import screwgauge
from support.command import main
from support.data import data
from support.engines import IN_DOUBLES, ask, model_files
from support.equations import Dynamics
from support.errors import DescriptionError, UnknownNameError
from support.solve import LONG
from support.tolerances import LINEAR
from support.trees import smallest_model

ASKED = ("axis_moment",)
#: A moment is changed by this share of it.
PLANTED = 1e-6
K, REST, C, MOTOR = 40.0, 0.35, 6.0, 0.7
CRANK = f"""
mechanism = "slider-crank"
motion = {{ crank = {{ offset = 0.3, harmonics = [[5, 0, 1]] }} }}
time = {{ duration = 1, step = 0.1 }}
[[springs]]
coordinate = "slide"
stiffness = {K}
rest = {REST}
damping = {C}
[[springs]]
coordinate = "crank"
stiffness = 2
[[motors]]
coordinate = "crank"
polynomial = [0.5, 0.2]
[[motors]]
coordinate = "pin"
polynomial = [{MOTOR}]
[[springs]]
first = "ground"
first_point = [0, 0.3, 0]
second = "rod"
second_point = [0.1, 0, 0]
stiffness = 90
"""
SWING = data("hanging-bar-scene.toml")


def few(name: str):
    scene = screwgauge.load_scene(name)
    return scene.at(scene.t[:: len(scene.t) // 5])


@pytest.fixture
def crank(write):
    return screwgauge.load_scene(write("crank.toml", CRANK))


def test_a_pendulum_with_spring_and_motor_transmits_what_its_inertia_and_weight_need(write):
    write("pendulum.toml", data("hanging-bar.toml"))  # a bar that hangs down at home, and turns about y
    scene = screwgauge.load_scene(write("swing.toml", SWING))
    results = screwgauge.run(scene, ["screw", "pinocchio", "mujoco"], [*ASKED, "actuator_force"])
    assert results.ok
    angle, rate, second = np.stack([scene.motion.y, scene.motion.yd, scene.motion.ydd])[..., 0]
    needed = (0.3 + 2.0 * 0.5**2) * second + 2.0 * 9.81 * 0.5 * np.sin(angle)
    driven = needed + 3.0 * (angle - 0.5) + 0.7 * rate - np.cos(2.0 * scene.t)
    for engine in results.solutions:
        assert results.values("axis_moment", engine)[:, 0] == pytest.approx(needed, rel=LINEAR, abs=LINEAR)
        assert results.values("actuator_force", engine)[:, 0] == pytest.approx(driven, rel=LINEAR, abs=LINEAR)


@pytest.mark.parametrize("engine", IN_DOUBLES)
def test_a_coordinate_has_its_actuator_spring_damper_and_motor_and_else_nothing(engine, crank):
    values = ask(engine, model_files("slider-crank", engine), crank.problem([*ASKED, "actuator_force"])).values
    found, angle, rate = values["axis_moment"], crank.motion.y[:, 0], crank.motion.yd[:, 0]
    r, length = 0.1, 0.3
    root = np.sqrt(length**2 - (r * np.sin(angle)) ** 2)
    slide = r * np.cos(angle) + root
    speed = -r * np.sin(angle) * rate * (1.0 + r * np.cos(angle) / root)
    expected = {
        "crank": values["actuator_force"].array[:, 0] - 2.0 * angle + 0.5 + 0.2 * crank.t,
        "pin": np.full(len(angle), MOTOR),
        "wrist": np.zeros(len(angle)),
        "slide": -K * (slide - REST) - C * speed,
    }
    assert dict(zip(found.components, found.units, strict=True)) == dict.fromkeys(expected, "N m") | {"slide": "N"}
    for name, moment in zip(found.components, found.array.T, strict=True):
        assert moment == pytest.approx(expected[name], rel=0.0, abs=LINEAR * np.abs(found.array).max()), name


def planted(values: np.ndarray) -> np.ndarray:
    wrong = values.copy()
    wrong[:, 1] *= 1.0 + PLANTED
    return wrong


def test_a_mistake_of_the_solver_is_seen_by_the_pair_and_by_the_judge(crank, monkeypatch):
    right = Dynamics.axis_moment.func
    monkeypatch.setattr(Dynamics, "axis_moment", property(lambda at: planted(right(at))))
    results = screwgauge.run(crank, ["screw", "pinocchio", "mujoco"], ASKED)
    assert results.exit_status == 1
    wrong = results.pairs[~results.pairs["ok"]]
    assert [*wrong["a"]] == ["screw", "screw"]
    judged = results.judge[~results.judge["ok"]]
    assert {*zip(judged["engine"], judged["residual"], strict=True)} == {("screw", "virtual_work")}


def test_only_redundant_actuators_have_moments_that_a_rule_fixes():
    scene = few("3ups-upu-s-fast")
    errors = screwgauge.run(scene, ["screw", "pinocchio"], [*ASKED, "actuator_force"]).errors
    rows = errors[errors["quantity"] == "axis_moment"].set_index("component")
    driven = {scene.mechanism.coordinates[i] for i in scene.mechanism.actuated_columns}
    assert {*rows.index[~rows["unique"].astype(bool)]} == driven
    assert {*rows.loc[[*driven], "rule"]} == {"min_norm"}


def test_it_is_computed_only_where_it_is_named(write, inside):
    assert "axis_moment" not in {*screwgauge.run(few("five-bar"), ["screw", "pinocchio"]).pairs["quantity"]}
    write("crank.toml", f'quantities = ["axis_moment"]\n{CRANK}')
    assert main(["run", "crank.toml", "--engines", "screw,mujoco", "--csv", "m.csv", "--quantities", *ASKED]) == 0
    units = {"crank": "N m", "pin": "N m", "wrist": "N m", "slide": "N"}
    assert [*pd.read_csv("m.csv").columns[1:]] == [f"axis_moment/{name} [{unit}]" for name, unit in units.items()]
    with pytest.raises(UnknownNameError):
        screwgauge.run(screwgauge.load_scene("a02-fourbar-2"), ["screw"], ASKED)  # a simulation


def test_a_log_of_torque_sensors_is_reviewed(crank, inside):
    values = screwgauge.run(crank, ["screw"], ASKED).quantity("axis_moment")
    log = pd.DataFrame(values.array * [-1.0, 1.0, 1.0, 1.0], crank.t, values.components)
    log.to_csv("log.csv", index_label="t")
    reviewed = screwgauge.review("log.csv", crank, ASKED)
    assert [fault.kind for fault in reviewed.columns[0].faults] == ["sign"]
    assert [column.faults for column in reviewed.columns[1:]] == [()] * 3


def test_too_few_actuators_leave_no_moment(write):
    text = 'mechanism = "cart-pole"\nmotion = { cart.offset = 0, angle.offset = 0 }\ntime = { times = [0] }\n'
    with pytest.raises(DescriptionError):
        screwgauge.run(screwgauge.load_scene(write("s.toml", text)), ["screw"], ASKED)


def test_programs_and_compiled_solvers_give_it():
    scene = screwgauge.load_scene("ruse")
    long = scene.at(np.linspace(0.0, 2.0, LONG + 1))
    files, problem = model_files("ruse", "screw"), long.problem(frozenset(ASKED))
    right = ask("screw", files, problem, backend="array").values["axis_moment"].array
    traced = ask("screw", files, problem, backend="numpy").values["axis_moment"].array
    motion, solver = long.motion, screwgauge.compile(scene, ASKED, backend="numpy")
    compiled = solver(motion.y, motion.yd, motion.ydd, t=motion.t)["axis_moment"]
    for other in (traced, compiled):
        assert other == pytest.approx(right, rel=0.0, abs=LINEAR * np.abs(right).max())


def test_an_open_tree_of_ones_own_gives_it(crank):
    files = model_files("slider-crank", "mujoco")
    found = smallest_model(files).solve(crank.problem(ASKED)).values["axis_moment"].array
    right = ask("screw", model_files("slider-crank", "screw"), crank.problem(ASKED)).values["axis_moment"].array
    assert found == pytest.approx(right, rel=0.0, abs=LINEAR * np.abs(right).max())
