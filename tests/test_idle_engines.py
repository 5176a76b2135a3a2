import re
from dataclasses import replace

import numpy as np
import pytest

from screwgauge.problem import ModelFiles
from support.acting import Applied, Load
from support.data import data
from support.engines import ENGINES, Problem, ask, model_files
from support.mechanism import load_mechanism, mechanism_path
from support.models import write_models
from support.scene import GivenMotion
from support.tolerances import AGREE

#: Engines that solve idle accelerations by inverse dynamics of their own.
SOLVE = [name for name in ("pinocchio", "mujoco", "lagrange", "exudyn", "truth") if ENGINES[name].installed]
ASKED = frozenset({"joint_acceleration", "com_acceleration", "generalized_force", "actuator_force", "reaction"})


def files(mechanism, engine, folder):
    if not ENGINES[engine].cut:
        return ModelFiles(folder / f"{mechanism.name}.toml")
    return model_files(mechanism.name, engine, folder)


def without_actuators(name, write):
    text = mechanism_path(name).read_text(encoding="utf-8")
    for joint in TAKEN[name][0]:
        head = re.search(rf'^\[joints\."?{re.escape(joint)}"?\]$', text, re.MULTILINE)
        before, after = text[: head.end()], text[head.end() :]
        text = before + after.replace("actuated = true\n", "", 1)
    return load_mechanism(write(f"{name}.toml", text))


def motion(mechanism, idle, n=7):
    t, k = np.linspace(0.2, 0.7, n), len(mechanism.independent)
    w, a = 2.0 + np.arange(k), 0.1 / (1.0 + np.arange(k))
    y = mechanism.home[mechanism.independent_columns] + a * np.sin(w * t[:, None])
    ydd = -a * w**2 * np.sin(w * t[:, None])
    ydd[:, [*idle]] = 1e3
    return GivenMotion(t, y, a * w * np.cos(w * t[:, None]), ydd, idle=tuple(idle))


@pytest.mark.parametrize("engine", SOLVE)
def test_a_pole_on_a_cart_swings_as_its_equation_says(engine, write, tmp_path):
    mechanism = load_mechanism(write("cart.toml", data("cart.toml")))
    write_models(mechanism, tmp_path)
    given = motion(mechanism, [1])
    found = ask(engine, files(mechanism, engine, tmp_path), Problem(Applied(), given, ASKED))
    y, yd, ydd = given.y[:, 1], given.yd[:, 1], given.ydd[:, 0]
    m, L, inertia, g = 1.0, 0.7, 2e-2, 9.81
    swing = -m * L * (g * np.sin(y) + ydd * np.cos(y)) / (inertia + m * L**2)
    force = 3.0 * ydd + m * L * (swing * np.cos(y) - yd**2 * np.sin(y))
    assert np.abs(found.values["joint_acceleration"].array[:, 1] - swing).max() < AGREE * np.abs(swing).max()
    assert np.abs(found.values["actuator_force"].array[:, 0] - force).max() < AGREE * np.abs(force).max()


#: Mechanism -> joints that lose their actuators, and idle coordinates.
TAKEN = {
    "five-bar": (["right"], ["right"]),
    "stewart": (["leg2.slide", "leg5.slide"], ["z", "q1"]),
    "arm7": (["joint2", "joint5"], ["q2", "q5"]),
}


PENDULUM = data("idle-pendulum.toml")


@pytest.mark.parametrize("engine", SOLVE)
@pytest.mark.parametrize("rule", ["min_norm", "spherical_axial"])
def test_redundant_actuators_obey_their_rule_beside_what_swings(rule, engine, write, tmp_path):
    text = mechanism_path("3ups-upu-s").read_text(encoding="utf-8")
    text = re.sub(r"^(\[independent\].*)$", r'\1\nswing = "pendulum"', text, flags=re.MULTILINE) + PENDULUM
    mechanism = load_mechanism(write("3ups-upu-s.toml", text))
    assert_delivered(mechanism, [0], engine, tmp_path, rule)


@pytest.mark.parametrize("engine", SOLVE)
def test_what_nothing_drives_falls(engine, write, tmp_path):
    mechanism = load_mechanism(write("cart.toml", data("cart.toml").replace("actuated = true", "")))
    assert_delivered(mechanism, [0, 1], engine, tmp_path)


@pytest.mark.parametrize("engine", SOLVE)
@pytest.mark.parametrize("name", TAKEN)
def test_actuators_deliver_all_that_the_motion_needs(name, engine, write, tmp_path):
    mechanism = without_actuators(name, write)
    idle = [list(mechanism.independent).index(label) for label in TAKEN[name][1]]
    assert_delivered(mechanism, idle, engine, tmp_path)


def assert_delivered(mechanism, idle, engine, folder, rule="min_norm"):
    write_models(mechanism, folder)
    given = motion(mechanism, idle)
    force, torque = np.array([1.0, 2.0, 3.0]), np.array([0.3, 0.2, 0.1])
    applied = Applied(loads=(Load(mechanism.bodies[-1].name, None, force, torque),))
    found = ask(engine, files(mechanism, engine, folder), Problem(applied, given, ASKED, rule)).values
    description = files(mechanism, "screw", folder)
    full = replace(given, ydd=found["joint_acceleration"].array[:, mechanism.independent_columns], idle=())
    again = ask("screw", description, Problem(applied, full, ASKED | {"joint_velocity"})).values
    Q, f = again["generalized_force"].array, found["actuator_force"].array
    size = max(np.abs(Q).max(), np.abs(f).max(initial=0.0), 1.0)
    for i in range(Q.shape[1]):
        unit = replace(full, yd=np.eye(Q.shape[1])[[i] * len(given)])
        v = ask("screw", description, Problem(applied, unit, frozenset({"joint_velocity"})))
        B = v.values["joint_velocity"].array[:, mechanism.actuated_columns]
        assert np.abs((B * f).sum(axis=1) - Q[:, i]).max() < 10 * AGREE * size
