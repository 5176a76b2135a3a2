"""The engines' own steppers: their orders, MuJoCo's softness that no step removes, springs as its own."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import screwgauge
from screwgauge.engines.mujoco.mover import MujocoMover
from screwgauge.engines.mujoco.steps import sprung_model
from screwgauge.engines.mujoco.tree import MujocoTree
from screwgauge.engines.tree.closure import make_loops
from screwgauge.engines.tree.forces import tree_forces
from screwgauge.engines.tree.stepper import INTEGRATORS, REFINABLE, Stepper, hold, integrate_steps, opening
from screwgauge.models.catalog import mechanism_path
from screwgauge.models.loops import read_loops
from screwgauge.problem import ForwardProblem
from screwgauge.reference.applied import JointSpring, Load, PointSpring
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.pose import layout
from screwgauge.scene.observe import observe
from screwgauge.scene.start import make_problem

ENDINGS = {"pinocchio": ".urdf", "mujoco": ".xml"}


def model_files(name, engine):
    folder = mechanism_path(name).parent
    return folder / f"{name}{ENDINGS[engine]}", folder / f"{name}.loops.toml"


def error(name, stepper, until):
    """Largest error of the observable, and what the stepper returned."""
    scene = screwgauge.load_scene(name)
    rows = np.flatnonzero(scene.known.t <= until)[::5]
    scene = scene.at(scene.known.t[rows])
    problem = make_problem(scene, scene.forward, *model_files(scene.mechanism.name, stepper.engine))
    found = integrate_steps(problem, stepper)
    values = observe(layout(scene.mechanism), scene.observables, found.q).array
    return np.abs(values - scene.known.values[rows[: len(values)]]).max(), found


def order(name, until, steps, **stepper):
    """Slope of the error over the step."""
    errors = [error(name, Stepper(dt=dt, **stepper), until)[0] for dt in steps]
    return np.log(errors[0] / errors[1]) / np.log(steps[0] / steps[1])


@pytest.mark.parametrize(
    ("integrator", "expected", "steps"), [("Euler", 1.0, (4e-3, 2e-3)), ("RK4", 4.0, (2e-2, 1e-2))]
)
def test_pinocchio_steps_converge_on_a_closed_loop(integrator, expected, steps):
    found = order("a04-bricard-box", 1.0, steps, engine="pinocchio", integrator=integrator)
    assert found == pytest.approx(expected, abs=0.3)


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
    """The governor: stiff springs and dampers as tendons, seen by the implicit integrators."""
    if integrator == "discrete" and not hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
        pytest.skip("this MuJoCo has no discrete integrator")
    found = order("a05-governor", 0.25, steps, engine="mujoco", integrator=integrator)
    assert found == pytest.approx(expected, abs=0.3)


def test_rk4_of_mujoco_is_as_exact_as_the_reference_where_it_is_stable():
    assert error("a05-governor", Stepper("mujoco", "RK4", 2e-4), 0.25)[0] < 1e-11


def test_loops_of_mujoco_are_soft_at_any_step_and_refinement_closes_them():
    """Two four-bars, default softness: a floor that no step removes. Refined, Euler's error follows the step."""

    def pair(**more):
        return [error("a02-fourbar-2", Stepper("mujoco", "Euler", dt, **more), 2.0)[0] for dt in (2e-3, 1e-3)]

    raw, refined = pair(), pair(solimp=0.9999, passes=5)
    assert raw[1] > 0.8 * raw[0]
    assert refined[0] < 0.05 * raw[0]
    assert refined[1] < 0.7 * refined[0]


@pytest.fixture(scope="module")
def held():
    """The loaded default scene at its first pose, its actuators holding it by constant forces for 0.2 s."""
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0])
    run = screwgauge.run(scene, engines=["screw"], quantities=["actuator_force"])
    force = run.values("actuator_force", "screw")[0]
    # of the pose at rest: nothing in the scene accelerates at its first time
    driven = [joint.coordinates[0] for joint in scene.mechanism.actuators]
    y = scene.motion.y[0]

    def problem(engine):
        return ForwardProblem(
            *model_files("3ups-upu-s", engine),
            scene.applied.g,
            scene.applied.loads,
            (),
            hold(dict(zip(driven, force, strict=True))),
            y,
            np.zeros_like(y),
            np.linspace(0.0, 0.2, 5),
        )

    return problem


@pytest.mark.parametrize("integrator", INTEGRATORS["mujoco"])
def test_held_mechanism_opens_its_loops_by_millimetres(held, integrator):
    """7.3 mm in the end, by default, for every step and integrator; 15 um at the largest impedance."""
    if integrator == "discrete" and not hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
        pytest.skip("this MuJoCo has no discrete integrator")
    problem = held("mujoco")
    gaps = [opening(problem, integrate_steps(problem, Stepper("mujoco", integrator, dt)))[-1] for dt in (2e-3, 1e-3)]
    assert gaps == pytest.approx([7.2e-3, 7.2e-3], rel=0.02)
    hard = integrate_steps(problem, Stepper("mujoco", integrator, 1e-3, solimp=0.9999))
    assert opening(problem, hard)[-1] == pytest.approx(1.5e-5, rel=0.1)


@pytest.mark.parametrize("integrator", REFINABLE)
def test_refined_steps_keep_the_loops_of_the_held_mechanism_closed(held, integrator):
    problem = held("mujoco")
    found = integrate_steps(problem, Stepper("mujoco", integrator, 1e-3, solimp=0.9999, passes=4))
    assert opening(problem, found).max() < 1e-8  # what is left is the drift of the step
    same = integrate_steps(held("pinocchio"), Stepper("pinocchio", "Euler", 1e-3))
    assert np.abs(found.q - same.q).max() < 1e-7
    assert opening(held("pinocchio"), same).max() < 1e-14


def springs_of_the_governor():
    """One along a joint, one between points, one beside it."""
    pull = PointSpring("ground", np.array([0.3, 0.1, 0.2]), "right", np.array([0.4, 0.0, 0.1]), 800.0, 0.3, 25.0)
    between = PointSpring("slider", np.array([0.05, 0, 0]), "left", np.array([-0.5, 0, 0]), 900.0, 0.0, 3.0)
    return (JointSpring("right", 30.0, 0.4, 2.0), pull, between)


def test_springs_of_mujoco_are_ours():
    """Passive forces of the sprung model against those from poses and Jacobians."""
    model_file, loops_file = model_files("a05-governor", "mujoco")
    problem = ForwardProblem(
        model_file,
        loops_file,
        np.zeros(3),
        (),
        springs_of_the_governor(),
        (),
        np.zeros(4),
        np.zeros(4),
        np.zeros(1),
    )
    file = read_loops(loops_file)
    tree = MujocoTree(model_file, file, problem.gravity)
    model, left = sprung_model(problem, tree)
    assert (left.springs, left.motors, left.loads) == ([], (), ())
    forces, mover = tree_forces(problem, tree, make_loops(tree, file)), MujocoMover(tree)
    data, tau = mujoco.MjData(model), np.zeros(4)
    for seed in range(5):
        q, v = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 4))
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        mover.place(q, v)
        forces.act(0.0, q, v, mover.body, tau)
        assert np.abs(data.qfrc_passive - tau).max() < 1e-12 * np.abs(tau).max()


def test_what_varies_is_held_over_each_step_and_said():
    """A load beside the centre of mass and springs at a cut joint: they end near the motion of finer steps."""
    scene = screwgauge.load_scene("a02-fourbar-2").at(np.array([0.0, 0.1, 0.3]))
    load = Load("bar1", np.array([1.0, 0.0, 0.0]), np.array([3.0, -2.0, 0.0]), np.zeros(3))
    rest = {"loads": (load,), "springs": (JointSpring("c0", 5.0, 0.1, 0.2),)}
    found = {}
    for engine, stepper in {
        "mujoco": Stepper("mujoco", "Euler", 1e-4, solimp=0.9999, passes=5),
        "pinocchio": Stepper("pinocchio", "RK4", 5e-3),
        "pinocchio Euler": Stepper("pinocchio", "Euler", 1e-3),
    }.items():
        problem = make_problem(scene, scene.forward, *model_files(scene.mechanism.name, stepper.engine))
        found[engine] = integrate_steps(replace(problem, **rest), stepper)
    assert "held over each step" in found["mujoco"].notes[-1]
    # first order in the step of 0.1 ms against fourth order
    assert np.abs(found["mujoco"].q - found["pinocchio"].q).max() < 5e-4
    # first order in the step of 1 ms; the trapezoidal rule would be worse than RK4 is
    assert np.abs(found["mujoco"].work - found["pinocchio Euler"].work).max() < 5e-2
    assert np.abs(found["mujoco"].work[1:]).min() > 0.05
    assert np.isnan(found["pinocchio"].work).all()


def test_steps_that_blow_up_keep_what_was_computed():
    found = error("a05-governor", Stepper("mujoco", "Euler", 2e-3), 2.0)[1]
    assert found.stopped.startswith("t = 0.0")
    assert "no longer finite; take smaller steps" in found.stopped
    assert len(found.q) == len(found.work) == 1
    assert any("MuJoCo warns: Nan" in note for note in found.notes)


def test_bad_steppers_are_said():
    with pytest.raises(UnknownNameError, match="unknown engine 'drake'"):
        Stepper("drake", "Euler", 1e-3)
    with pytest.raises(UnknownNameError, match="unknown integrator 'implicit'"):
        Stepper("pinocchio", "implicit", 1e-3)
    with pytest.raises(DescriptionError, match="step 0 s"):
        Stepper("mujoco", "Euler", 0.0)
    with pytest.raises(DescriptionError, match="its constraints are rigid"):
        Stepper("pinocchio", "Euler", 1e-3, solimp=0.9)
    with pytest.raises(DescriptionError, match="RK4 solves for accelerations inside its step"):
        Stepper("mujoco", "RK4", 1e-3, passes=3)
    with pytest.raises(DescriptionError, match=r"solimp 0\.99999"):
        error("a05-governor", Stepper("mujoco", "Euler", 1e-3, solimp=0.99999), 0.1)
