from dataclasses import replace

import mujoco
import numpy as np
import pytest

import screwgauge
from support.acting import Applied, JointSpring, Load, PointSpring, hold
from support.engines import get_engine, model_files, simulate, simulate_scene
from support.errors import DescriptionError, UnknownNameError
from support.models import read_loops
from support.scene import InitialValue, observe
from support.solve import layout
from support.tolerances import CLOSED, DRIFT, FIRST_ORDER, FIRST_ORDER_WORK, LINEAR, ORDER
from support.trees import (
    INTEGRATORS,
    REFINABLE,
    MujocoMover,
    MujocoTree,
    TreeForces,
    close_tree,
    has_integrator,
    opening,
    sprung_model,
)

pytestmark = pytest.mark.slow


def error(name, until, engine, **stepper):
    scene = screwgauge.load_scene(name)
    rows = np.flatnonzero(scene.known.t <= until)[::5]
    scene = scene.at(scene.known.t[rows])
    found = simulate_scene(engine, scene, **stepper)
    values = observe(layout(scene.mechanism), scene.observables, found.q).array
    return np.abs(values - scene.known.array[rows[: len(values)]]).max(), found


def order(name, until, steps, **stepper):
    errors = [error(name, until, dt=dt, **stepper)[0] for dt in steps]
    return np.log(errors[0] / errors[1]) / np.log(steps[0] / steps[1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "expected", "steps"), [("Euler", 1.0, (4e-3, 2e-3)), ("RK4", 4.0, (2e-2, 1e-2))]
)
def test_pinocchio_steps_converge_on_a_closed_loop(integrator, expected, steps):
    found = order("a04-bricard-box", 1.0, steps, engine="pinocchio", integrator=integrator)
    assert found == pytest.approx(expected, abs=ORDER)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "expected", "steps"),
    [
        ("Euler", 1.0, (2e-4, 1e-4)),
        ("implicit", 1.0, (2e-4, 1e-4)),
        ("implicitfast", 1.0, (2e-4, 1e-4)),
        ("discrete", 1.0, (2e-4, 1e-4)),
    ],
)
def test_mujoco_steps_converge_without_loops(integrator, expected, steps):
    if not has_integrator(integrator):
        pytest.skip("no discrete integrator")
    found = order("a05-governor", 0.25, steps, engine="mujoco", integrator=integrator)
    assert found == pytest.approx(expected, abs=ORDER)


def test_rk4_of_mujoco_is_as_exact_as_the_reference_where_it_is_stable():
    assert error("a05-governor", 0.25, "mujoco", integrator="RK4", dt=2e-4)[0] < 1e-11


def test_loops_of_mujoco_are_soft_at_any_step_and_refinement_closes_them():
    """By default a floor remains at any step; refined, Euler's error follows the step."""

    def pair(**more):
        return [error("a02-fourbar-2", 2.0, "mujoco", dt=dt, **more)[0] for dt in (2e-3, 1e-3)]

    raw, refined = pair(), pair(solimp=0.9999, passes=5)
    assert raw[1] > 0.8 * raw[0]
    assert refined[0] < 0.05 * raw[0]
    assert refined[1] < 0.7 * refined[0]


@pytest.fixture(scope="module")
def held():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0])
    run = screwgauge.run(scene, engines=["screw"], quantities=["actuator_force"])
    force = run.values("actuator_force", "screw")[0]
    # of the pose at rest: nothing in the scene accelerates at its first time
    driven = [joint.coordinates[0] for joint in scene.mechanism.actuators]
    applied = replace(scene.applied, motors=hold(dict(zip(driven, force, strict=True))))
    task = InitialValue(scene.motion.y[0], np.zeros(2), 0.0, np.linspace(0.0, 0.2, 5))

    def step(engine, **stepper):
        """Coordinates, and openings [m]. Shape (5,)."""
        files = model_files("3ups-upu-s", engine)
        found = simulate(engine, files, applied, task, **stepper)
        return found.q, opening(files, found.q, scene.mechanism.coordinates)

    return step


@pytest.mark.slow
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_held_mechanism_opens_its_loops_by_millimetres(held, integrator):
    """7.3 mm by default, 15 um at the largest impedance."""
    if not has_integrator(integrator):
        pytest.skip("no discrete integrator")
    apart = [held("mujoco", integrator=integrator, dt=dt)[1][-1] for dt in (2e-3, 1e-3)]
    assert apart == pytest.approx([7.2e-3, 7.2e-3], rel=0.02)
    hard = held("mujoco", integrator=integrator, dt=1e-3, solimp=0.9999)[1]
    assert hard[-1] == pytest.approx(1.5e-5, rel=0.1)


@pytest.fixture(scope="module")
def held_by_pinocchio(held):
    return held("pinocchio", dt=1e-3)


@pytest.mark.parametrize("integrator", REFINABLE)
def test_refined_steps_keep_the_loops_of_the_held_mechanism_closed(held, held_by_pinocchio, integrator):
    q, apart = held("mujoco", integrator=integrator, dt=1e-3, solimp=0.9999, passes=4)
    assert apart.max() < DRIFT
    same, closed = held_by_pinocchio
    assert np.abs(q - same).max() < 10.0 * DRIFT
    assert closed.max() < CLOSED


def springs_of_the_governor():
    pull = PointSpring("ground", np.array([0.3, 0.1, 0.2]), "right", np.array([0.4, 0.0, 0.1]), 800.0, 0.3, 25.0)
    between = PointSpring("slider", np.array([0.05, 0, 0]), "left", np.array([-0.5, 0, 0]), 900.0, 0.0, 3.0)
    return (JointSpring("right", 30.0, 0.4, 2.0), pull, between)


def test_springs_of_mujoco_are_ours():
    files = model_files("a05-governor", "mujoco")
    applied = Applied(np.zeros(3), springs=springs_of_the_governor())
    file = read_loops(files.loops)
    tree = MujocoTree(files.model, file)
    model, left, _ = sprung_model(files.model, applied, (), tree)
    assert (left.springs, left.motors, left.loads) == ((), (), ())
    forces, mover = TreeForces(close_tree(tree, file), applied, np.zeros(4)), MujocoMover(tree)
    data, tau = mujoco.MjData(model), np.zeros(4)
    for seed in range(5):
        q, v = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 4))
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        mover.place(q, v)
        forces.act(0.0, q, v, mover.body, tau)
        assert np.abs(data.qfrc_passive - tau).max() < LINEAR * np.abs(tau).max()


@pytest.mark.slow
def test_what_varies_is_held_over_each_step_and_said():
    scene = screwgauge.load_scene("a02-fourbar-2").at(np.array([0.0, 0.1, 0.3]))
    load = Load("bar1", np.array([1.0, 0.0, 0.0]), np.array([3.0, -2.0, 0.0]), np.zeros(3))
    scene = scene.under(loads=(load,), springs=(JointSpring("c0", 5.0, 0.1, 0.2),))
    found = {
        "mujoco": simulate_scene("mujoco", scene, dt=1e-4, solimp=0.9999, passes=5),
        "pinocchio": simulate_scene("pinocchio", scene, integrator="RK4", dt=5e-3),
        "pinocchio Euler": simulate_scene("pinocchio", scene, dt=1e-3),
    }
    assert "constant over each step" in found["mujoco"].notes[-1]
    assert np.abs(found["mujoco"].q - found["pinocchio"].q).max() < FIRST_ORDER
    assert np.abs(found["mujoco"].work - found["pinocchio Euler"].work).max() < FIRST_ORDER_WORK
    assert np.abs(found["mujoco"].work[1:]).min() > 0.05
    assert np.isnan(found["pinocchio"].work).all()


def test_steps_that_blow_up_keep_what_was_computed():
    found = error("a05-governor", 2.0, "mujoco", dt=2e-3)[1]
    assert found.stopped.startswith("t = 0.0")
    assert "smaller steps" in found.stopped
    assert len(found.q) == len(found.work) == 1
    assert any("MuJoCo warns: Nan" in note for note in found.notes)


def test_bad_steppers_are_said():
    def refused(error, match, engine, **stepper):
        with pytest.raises(error, match=match):
            get_engine(engine).load(model_files("a05-governor", engine), **stepper)

    refused(UnknownNameError, "unknown integrator 'implicit'", "pinocchio", integrator="implicit", dt=1e-3)
    refused(UnknownNameError, "unknown integrator 'semi'", "mujoco", integrator="semi", dt=1e-3)
    refused(DescriptionError, "the step is 0 s", "mujoco", dt=0.0)
    refused(DescriptionError, "the step is nan s", "pinocchio", dt=float("nan"))
    refused(UnknownNameError, "engine pinocchio: unknown setting 'solimp'", "pinocchio", dt=1e-3, solimp=0.9)
    refused(DescriptionError, "RK4 cannot step from refined", "mujoco", integrator="RK4", dt=1e-3, passes=3)
    refused(DescriptionError, r"solimp is 0\.99999", "mujoco", dt=1e-3, solimp=0.99999)
    with pytest.raises(UnknownNameError, match="unknown engine 'drak'"):
        get_engine("drak")
