from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import tomli_w

import screwgauge
from support.command import main
from support.engines import IN_DOUBLES, ask, model_files
from support.errors import UnknownNameError
from support.mechanism import load_mechanism, mechanism_path, read_tables
from support.scene import GivenMotion
from support.solve import LONG, ClosedMotion
from support.tolerances import LINEAR
from support.trees import MujocoTree, PinocchioTree, smallest_model

ASKED = ("mass_matrix",)
#: The largest number of a run is changed by this share of it.
PLANTED = 1e-6


def few(name: str):
    scene = screwgauge.load_scene(name)
    return scene.at(scene.t[:: len(scene.t) // 5])


def inertia(scene, engine: str):
    """Components and values. Shape (n, m)."""
    files = model_files(scene.mechanism.name, engine)
    values = ask(engine, files, scene.problem(frozenset(ASKED))).values["mass_matrix"]
    return values.components, values.units, values.array


def forces(scene, engine: str, ydd):
    motion = scene.motion
    problem = replace(scene.problem(["generalized_force"]), task=GivenMotion(motion.t, motion.y, motion.yd, ydd))
    return ask(engine, model_files(scene.mechanism.name, engine), problem).values["generalized_force"].array


@pytest.mark.parametrize("engine", IN_DOUBLES)
def test_a_slider_crank_has_the_reduced_inertia_of_its_closed_form(engine):
    scene = few("slider-crank")
    crank, rod, piston = load_mechanism("slider-crank").bodies
    angle, r, length = scene.motion.y[:, 0], 0.1, 0.3
    tilt = -np.arcsin(r / length * np.sin(angle))
    turning = -r * np.cos(angle) / (length * np.cos(tilt))
    slide = -r * np.sin(angle) - length * np.sin(tilt) * turning
    along = rod.com[0]
    way = -r * np.sin(angle) - along * np.sin(tilt) * turning, r * np.cos(angle) + along * np.cos(tilt) * turning
    expected = crank.inertia[2, 2] + crank.mass * crank.com[0] ** 2 + rod.inertia[2, 2] * turning**2
    expected = expected + rod.mass * (way[0] ** 2 + way[1] ** 2) + piston.mass * slide**2
    names, units, found = inertia(scene, engine)
    assert (names, units) == (("crank,crank",), ("kg m^2",))
    assert np.ptp(expected) > 0.5 * expected.max()
    assert found[:, 0] == pytest.approx(expected, rel=LINEAR, abs=0.0)


@pytest.mark.parametrize("engine", IN_DOUBLES)
def test_a_pole_on_a_cart_has_inertia_in_three_units(engine, write):
    scene = screwgauge.load_scene(
        write("s.toml", 'mechanism = "cart-pole"\nmotion = { cart = { harmonics = [[1, 0, 0.1]] }, '
                        'angle = { offset = "pi/2", harmonics = [[2, 0, 1.2]] } }\ntime = { duration = 3, step = 0.5 }')
    )  # fmt: skip
    names, units, found = inertia(scene, engine)
    cart, pole = scene.mechanism.bodies
    arm, one = -pole.com[2], np.ones(len(scene.t))
    swung = pole.mass * arm * np.cos(scene.motion.y[:, 1])
    expected = [(cart.mass + pole.mass) * one, swung, (pole.inertia[1, 1] + pole.mass * arm**2) * one]
    assert (names, units) == (("cart,cart", "angle,cart", "angle,angle"), ("kg", "kg m", "kg m^2"))
    assert found == pytest.approx(np.stack(expected, axis=1), rel=0.0, abs=LINEAR)
    results = screwgauge.run(scene, ["screw", engine] if engine != "screw" else ["screw", "mujoco"], ASKED)
    assert results.ok
    assert {*results.judge["residual"]} == {"loop_closure", "mass_matrix"}


@pytest.mark.parametrize("engine", IN_DOUBLES)
@pytest.mark.parametrize("name", ["3ups-upu-s-fast", "five-bar", "arm7"])
def test_a_column_is_what_a_unit_acceleration_adds_to_the_forces(name, engine):
    scene = few(name)
    found, still = inertia(scene, engine)[2], 0.0 * scene.motion.ydd
    rest, k = forces(scene, engine, still), still.shape[1]
    columns = np.stack([forces(scene, engine, still + unit) - rest for unit in np.eye(k)], axis=1)
    assert found == pytest.approx(columns[(..., *np.triu_indices(k))], rel=0.0, abs=LINEAR * np.abs(rest).max())
    M = np.zeros((len(found), k, k))
    M[(..., *np.triu_indices(k))] = found
    assert (np.linalg.eigvalsh(M, UPLO="U") > 0.0).all()


@pytest.mark.parametrize(("owner", "engine"), [(PinocchioTree, "pinocchio"), (MujocoTree, "mujoco")])
def test_a_mistake_in_the_matrix_of_a_tree_is_seen_by_the_pair_and_by_the_judge(owner, engine, monkeypatch):
    right = owner.mass_matrix
    monkeypatch.setattr(owner, "mass_matrix", lambda tree, q: right(tree, q) * (1.0 + PLANTED))
    check_seen(engine)


def test_a_mistake_in_the_matrix_of_the_solver_is_seen_by_the_pair_and_by_the_judge(monkeypatch):
    right = ClosedMotion.inertia_matrix.func
    monkeypatch.setattr(ClosedMotion, "inertia_matrix", property(lambda at: right(at) * (1.0 + PLANTED)))
    check_seen("screw")


def check_seen(engine: str) -> None:
    results = screwgauge.run(few("five-bar"), ["screw", "pinocchio", "mujoco"], ASKED)
    assert results.exit_status == 1
    wrong = results.pairs[~results.pairs["ok"]]
    assert len(wrong) == 2
    assert ((wrong["a"] == engine) | (wrong["b"] == engine)).all()
    assert wrong["max_scaled"].to_numpy() == pytest.approx(PLANTED, rel=0.01, abs=0.0)
    judged = results.judge[~results.judge["ok"]]
    assert [*zip(judged["engine"], judged["residual"], strict=True)] == [(engine, "mass_matrix")]


def test_it_is_computed_only_where_it_is_named(write, inside, capsys):
    scene = few("five-bar")
    assert "mass_matrix" not in scene.quantities
    assert "mass_matrix" not in {*screwgauge.run(scene, ["screw", "pinocchio"]).pairs["quantity"]}
    text = 'mechanism = "five-bar"\nmotion = { left = { offset = 0 }, right = { offset = 0 } }\n'
    write("named.toml", f'{text}quantities = ["mass_matrix"]\ntime = {{ times = [0] }}\n')
    assert screwgauge.load_scene("named.toml").quantities == ASKED
    assert main(["run", "named.toml", "--engines", "screw,mujoco", "--csv", "m.csv", "--quantities", *ASKED]) == 0
    read = pd.read_csv("m.csv")
    names = ("left,left", "left,right", "right,right")
    assert [*read.columns] == ["t [s]", *(f"mass_matrix/{name} [kg m^2]" for name in names)]
    with pytest.raises(UnknownNameError):
        screwgauge.run(screwgauge.load_scene("a02-fourbar-2"), ["screw"], ASKED)  # a simulation


@pytest.mark.parametrize("quantity", ["mass_matrix", "axis_moment"])
def test_an_engine_that_lacks_it_says_so(quantity):
    pytest.importorskip("flint", reason="python-flint is not installed")
    results = screwgauge.run(few("five-bar"), ["truth", "screw", "mujoco"], [quantity, "joint_position"])
    assert results.ok
    assert quantity in results.solutions["truth"].lacks


@pytest.mark.parametrize("backend", ["array", "numpy"])
def test_whatever_solves_a_long_motion_the_array_solver_answers_it(backend):
    scene = screwgauge.load_scene("five-bar")
    long = scene.at(np.linspace(0.0, 2.0, LONG + 1))
    found = ask("screw", model_files("five-bar", "screw"), long.problem(frozenset(ASKED)), backend=backend)
    solver = screwgauge.compile(scene, ASKED, backend="numpy")
    motion = long.motion
    compiled = solver(motion.y, motion.yd, motion.ydd, t=motion.t)["mass_matrix"]
    assert compiled == pytest.approx(found.values["mass_matrix"].array, rel=0.0, abs=1e-15)
    assert solver.notes


def test_the_order_of_coordinates_makes_no_difference(write):
    scene = few("3ups-upu-s-fast")
    tables = read_tables(scene.mechanism_file, mechanism_path)
    tables["independent"] = dict(reversed(tables["independent"].items()))
    path = write("backwards.toml", tomli_w.dumps(tables))
    results = screwgauge.run(replace(scene, models={"screw": path}), ["screw", "pinocchio"], ASKED)
    assert results.ok, results.pairs.to_string()
    assert np.ptp(results.values("mass_matrix", "pinocchio")[:, [0, 2]], axis=1).max() > 1e-3


def test_a_tree_without_one_of_its_own_has_it_from_its_forces():
    scene, files = few("five-bar"), model_files("five-bar", "mujoco")
    found = smallest_model(files).solve(scene.problem(ASKED)).values["mass_matrix"].array
    assert found == pytest.approx(inertia(scene, "mujoco")[2], rel=0.0, abs=LINEAR * np.abs(found).max())
