import re

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import screwgauge
from support.coupled import EVERY_KIND, body, coupling_tables, every_kind, geared_five_bar, moving, started
from support.engines import IN_DOUBLES, ask, model_files
from support.freedoms import mobility_at_home
from support.judging import agreed, faults
from support.mechanism import load_mechanism
from support.models import write_models
from support.planar import Bar, four_bar
from support.scene import SIMULATED
from support.solve import NewtonEuler, layout, moved
from support.tolerances import LINEAR, ROUND_TRIP

pytestmark = pytest.mark.slow

#: The driven joint's neighbour, and the joint that would be cut if it were not coupled.
GEARS = {"right": [0.0, 0.5, 0.3, -0.2], "tip": [np.pi / 3, 0.5, -0.3]}


@pytest.mark.slow
@pytest.mark.parametrize("engines", [IN_DOUBLES, ["screw", "truth"]], ids=["engines", "truth"])
@pytest.mark.parametrize("gear", [None, *GEARS])
def test_polynomials_between_joints_of_every_kind(gear, engines, write):
    if engines[-1] == "truth":
        pytest.importorskip("flint")
    text = every_kind() if gear is None else geared_five_bar("left", gear, GEARS[gear])
    load = "G" if gear is None else "right.rod"
    scene = moving(write, text, {"a": 0.3, "b": -0.2} if gear is None else {"left": 0.0}, load)
    results = agreed(screwgauge.run(scene, engines=engines))
    assert (results.errors["max_scaled"] < 1e-10).all() or gear  # redundant constraints leave some reactions open
    q = dict(zip(results.components("joint_position"), results.values("joint_position", engines[-1]).T, strict=True))
    for name, (of, p) in (EVERY_KIND if gear is None else {gear: ("left", GEARS[gear])}).items():
        assert np.abs(q[name] - Polynomial(p)(q[of] if of else 0 * q[name])).max() < LINEAR


@pytest.mark.slow
@pytest.mark.parametrize("gear", [None, *GEARS])
def test_simulations_agree_and_keep_the_energy(gear, write):
    text = every_kind() if gear is None else geared_five_bar("left", gear, GEARS[gear])
    results = agreed(screwgauge.run(started(write, text, {"a": 0.3, "b": -0.2} if gear is None else {"left": 0.0})))
    assert set(results.solutions) == {"screw", "pinocchio", "mujoco"}
    assert any("curvature is added" in note for note in results.solutions["mujoco"].notes)


@pytest.mark.slow
def test_a_screw_that_mujoco_holds_softly_is_simulated_alike(write):
    text = 'name = "press"\nextends = "screw-press"\n'
    agreed(screwgauge.run(started(write, text, {"screw": 0.0})))


def test_fixed_steps_keep_them_and_mujoco_says_what_its_own_lack(write, tmp_path):
    scene = started(write, geared_five_bar("left", "right", GEARS["right"]), {"left": 0.0})
    scene = scene.at(scene.t[:2])
    write_models(scene.mechanism, tmp_path)
    wanted = screwgauge.run(scene, engines=["screw"]).values("joint_position")

    def stepped(engine: str, **settings):
        return ask(engine, model_files(scene.mechanism.name, engine, tmp_path), scene.problem(SIMULATED), **settings)

    exact = stepped("pinocchio", integrator="RK4", dt=2e-3)
    assert np.abs(exact.values["joint_position"].array - wanted).max() < 1e-11  # 6e-13 is seen
    own = stepped("mujoco", integrator="Euler", dt=2e-4, solimp=0.9999)
    assert np.abs(own.values["joint_position"].array - wanted).max() < 2e-3  # 2e-4 is seen
    assert any(re.search("curvature.*: gear", note) for note in own.notes)


@pytest.mark.slow
def test_a_coupling_that_a_loop_keeps_already_is_redundant(write):
    bars = four_bar([Bar(0.3), Bar(0.5), Bar(0.3)], 0.5, 1.0)
    gear = '[couplings.gear]\ncoordinate = "c"\nof = "a"\npolynomial = [0, 1]\n'
    text = f'name = "parallelogram"\nindependent = {{ a = "a" }}\n{bars}{gear}'
    scene = moving(write, text, {"a": 1.0}, "rocker")
    results = screwgauge.run(scene, engines=["screw", "pinocchio", "mujoco-full"])
    assert results.ok
    row = results.errors[results.errors["component"] == "gear.coupling"]
    assert (row["rule"] == "undetermined").all()
    assert screwgauge.run(started(write, text, {"a": 1.0})).ok


def test_mobility_counts_them(write):
    mechanism = load_mechanism(write("every-kind.toml", every_kind()))
    counted = mobility_at_home(mechanism)
    assert counted.mobility == 2
    assert counted.joint_freedoms == 20
    assert counted.kutzbach == 2
    assert counted.overconstraints == 0
    assert all(counted.unique)


@pytest.mark.parametrize("gear", [None, *GEARS])
def test_the_two_forward_dynamics_of_the_solver_agree_and_couplings_have_no_power(gear, write):
    text = every_kind() if gear is None else geared_five_bar("left", gear, GEARS[gear])
    mechanism = load_mechanism(write("coupled.toml", text))
    lay, k = layout(mechanism), len(mechanism.independent)
    y = mechanism.home[mechanism.independent_columns] + np.array([[0.1, -0.2]])[:, :k]
    at = moved(lay, y, np.full((1, k), 2.0), actuators=np.full(len(mechanism.actuators), 0.7))
    qdd, _ = NewtonEuler(at).response()
    assert qdd[:, mechanism.independent_columns] == pytest.approx(at.ydd, rel=ROUND_TRIP, abs=0)
    assert (mechanism.coupling_rows.matrix(at.q) @ at.joint_velocity[..., None]) == pytest.approx(0.0, abs=1e-13)


def test_the_judge_sees_a_wrong_pull_and_a_broken_coupling(write):
    scene = moving(write, every_kind(), {"a": 0.3, "b": -0.2}, "G")
    scene = scene.at(scene.t[1:3])
    solution = screwgauge.run(scene, engines=["screw"]).solutions["screw"]
    assert faults(scene, solution, "reaction", "tie.c.q2.coupling") == {"newton_euler"}
    assert faults(scene, solution, "reaction", "tie.s.q3.coupling") == {"newton_euler"}
    assert "loop_closure" in faults(scene, solution, "joint_position", "p")
    assert "loop_rate" in faults(scene, solution, "joint_velocity", "f.z")
    assert "loop_acceleration" in faults(scene, solution, "joint_acceleration", "u.q1")


def test_gears_join_two_loops(write):
    one = four_bar([Bar(0.2), Bar(0.6), Bar(0.4)], 0.5, 1.2)
    names = ("crank", "coupler", "rocker", "joints.a", "joints.b", "joints.c", "joints.d")
    two = one
    for name in names:
        two = (
            two.replace(f".{name}]", f".{name}2]").replace(f'"{name}"', f'"{name}2"').replace(f"[{name}]", f"[{name}2]")
        )
    gear = '[couplings.mesh]\ncoordinate = "a2"\nof = "a"\npolynomial = ["1.2 + 1.5*1.2", -1.5]\n'
    text = f'name = "two"\nindependent = {{ a = "a" }}\n{one}{two.replace("actuated = true", "")}{gear}'
    agreed(screwgauge.run(moving(write, text, {"a": 1.2}, "rocker2"), engines=IN_DOUBLES))


def test_the_independent_coordinate_may_be_the_coupled_one(write):
    couplings = {"b": ("a", [0.1, 2.0])}
    joints = "".join(
        f'[joints.{name}]\nkind = "R"\nparent = "{parent}"\nchild = "{child}"\naxes = [[0, 1, 0]]\nhome = [{home}]\n'
        f"parent_frame.position = [0.3, 0, 0]\nactuated = {'true' if name == 'a' else 'false'}\n"
        for name, parent, child, home in (("a", "ground", "A", 0.2), ("b", "A", "B", 0.5))
    )
    text = f'name = "pair"\nindependent = {{ y = "b" }}\n{body("A", 0)}{body("B", 1)}{joints}'
    scene = moving(write, text + coupling_tables(couplings), {"y": 0.5}, "B")
    assert screwgauge.run(scene, engines=IN_DOUBLES).ok
