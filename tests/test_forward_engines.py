"""Pinocchio and MuJoCo driven forward: they undo their own inverse dynamics and follow the established problems."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.models.catalog import mechanism_path
from screwgauge.models.generate import write_models
from screwgauge.problem import ForwardProblem, Method
from screwgauge.reference.applied import JointSpring, Motor, PointSpring
from screwgauge.reference.errors import ModelFileError, SingularPoseError, UnknownNameError
from screwgauge.reference.forward import Forces, energy
from screwgauge.reference.kinematics import velocities
from screwgauge.reference.pose import layout, pose
from screwgauge.scene.observe import observe
from screwgauge.scene.start import make_problem

DATA = Path(__file__).parent / "data"
ENDINGS = {"pinocchio": ".urdf", "mujoco": ".xml"}
ROUND_TRIP = 1e-11  # two dense solutions, conditions of a few hundred: 1e-13 of the largest acceleration is seen


def integrator(engine):
    return importlib.import_module(f"screwgauge.forward.{engine}").integrate


def constant(coordinate, amount):
    return Motor(coordinate, np.array([amount]), np.zeros((0, 3)))


@pytest.mark.parametrize("engine", ENDINGS)
@pytest.mark.parametrize("name", ["3ups-upu-s", "3ups-upu-s-fast", DATA / "four-bar-scene.toml"], ids=str)
def test_inverse_then_forward_returns_the_accelerations(name, engine, tmp_path):
    scene = screwgauge.load_scene(name)
    scene = scene.at(scene.t[np.linspace(0, len(scene.motion) - 1, 5).astype(int)])
    run = screwgauge.run(scene, engines=[engine], quantities=["actuator_force", "joint_acceleration"])
    wanted, forces = run.values("joint_acceleration", engine), run.values("actuator_force", engine)
    write_models(scene.mechanism, tmp_path)
    model = scene.mechanism.name
    motion = scene.motion
    driven = [joint.coordinates[0] for joint in scene.mechanism.actuators]
    for i, t in enumerate(motion.t):
        problem = ForwardProblem(
            tmp_path / f"{model}{ENDINGS[engine]}",
            tmp_path / f"{model}.loops.toml",
            scene.applied.g,
            scene.applied.loads,
            (),
            tuple(constant(name, f) for name, f in zip(driven, forces[i], strict=True)),
            motion.y[i],
            motion.yd[i],
            np.array([t]),
        )
        found = integrator(engine)(problem)
        assert np.abs(found.a[0] - wanted[i]).max() < ROUND_TRIP * np.abs(wanted).max()


#: Scene -> how far it is integrated [s], and the largest error of its observable [m and rad]: ten times and more what
#: is seen, which is what the tolerances of the steps leave.
CASES = {
    "a01-pendulum": (10.0, 1e-9),
    "a02-fourbar-2": (2.0, 1e-6),  # two singular poses; the error grows tenfold at each
    "a02-fourbar-40": (0.5, 1e-6),
    "a03-andrews-ivp": (0.03, 1e-10),
    "a04-bricard-thin": (3.0, 1e-10),
    "a04-bricard-box": (3.0, 1e-10),
    "a05-governor": (2.0, 1e-7),
}
REFUSED = {("a01-pendulum", "mujoco"), ("a04-bricard-thin", "mujoco")}


def problem_of(name, engine, until=1.0, **changes):
    """The problem, the scene with its times, and what is known of its observables."""
    scene = screwgauge.load_scene(name)
    rows = np.flatnonzero(scene.known.t <= until)[::10]
    scene = scene.at(scene.known.t[rows])
    folder, model = mechanism_path(scene.mechanism.name).parent, scene.mechanism.name
    problem = make_problem(scene, scene.forward, folder / f"{model}{ENDINGS[engine]}", folder / f"{model}.loops.toml")
    return replace(problem, **changes), scene, scene.known.values[rows]


@pytest.mark.parametrize("engine", ENDINGS)
@pytest.mark.parametrize("name", CASES)
def test_established_problem(name, engine):
    until, error = CASES[name]
    problem, scene, known = problem_of(name, engine, until)
    if (name, engine) in REFUSED:
        with pytest.raises(ModelFileError, match=r"MuJoCo cannot load it \(.*inertia must have positive"):
            integrator(engine)(problem)
        return
    found, lay = integrator(engine)(problem), layout(scene.mechanism)
    assert (found.stopped, len(found.q)) == ("", len(known))
    assert np.abs(observe(lay, scene.observables, found.q).array - known).max() < error
    rate = velocities(lay, pose(lay, found.q), found.v[:, lay.mechanism.independent_columns])
    # joints that were cut, too
    assert np.abs(rate.w - found.v).max() < 1e-9 * max(1.0, np.abs(found.v).max())
    E = energy(lay, rate, Forces(gravity=problem.gravity, springs=problem.springs))
    # a few times the error for forces up to 100 N; dampers are integrated along
    assert np.abs(E - E[0] - found.work).max() < 100 * error


@pytest.mark.parametrize("engine", ENDINGS)
def test_loops_closed_by_welds_move_alike(engine):
    """The full cut of the Bricard mechanism: a copy of a rod is welded to the rod itself."""
    problem, scene, known = problem_of("a04-bricard-box", engine, until=1.0)
    full = {
        "model": problem.model.with_name(f"a04-bricard-box-full{ENDINGS[engine]}"),
        "loops": problem.loops.with_name("a04-bricard-box-full.loops.toml"),
    }
    found = integrator(engine)(replace(problem, **full))
    assert found.engine == f"{engine}-full"
    assert np.abs(observe(layout(scene.mechanism), scene.observables, found.q).array - known).max() < 1e-10


@pytest.mark.parametrize("engine", ENDINGS)
def test_what_progress_raises_ends_the_integration(engine):
    shares = []

    def progress(share):
        shares.append(share)
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        integrator(engine)(problem_of("a02-fourbar-2", engine, progress=progress)[0])
    assert shares == sorted(shares)
    assert len(shares) > 3


@pytest.mark.parametrize("engine", ENDINGS)
def test_cut_joints_follow_whole_turns(engine):
    """Two four-bars: the angle at the end of each bar turns with the crank, five times in ten seconds."""
    problem, scene, _ = problem_of("a02-fourbar-2", engine, times=np.array([0.0, 3.0]))
    found = integrator(engine)(problem)
    names = scene.mechanism.coordinates
    a0, c0, c1 = (found.q[:, names.index(name)] for name in ("a0", "c0", "c1"))
    assert abs(a0[-1]) > 2 * np.pi
    assert np.abs(c0 + a0).max() < 1e-6  # the bar keeps its attitude, so that each end turns back as far
    assert np.abs(c1 + a0).max() < 1e-6
    a = found.a[:, names.index("c0")] + found.a[:, names.index("a0")]
    assert np.abs(a).max() < 1e-4  # next to a singular pose


@pytest.mark.parametrize("engine", ENDINGS)
def test_springs_and_motors_at_a_cut_joint_act_like_those_beside_it(engine):
    """In a parallelogram the cut joint c0 turns as b0 does, so that either may carry the spring."""
    times = np.array([0.0, 0.2, 0.6])

    def motion(coordinate):
        spring = JointSpring(coordinate, stiffness=30.0, rest=0.2, damping=2.0)
        changes = {"springs": (spring,), "motors": (constant(coordinate, 1.5),), "times": times}
        return integrator(engine)(problem_of("a02-fourbar-2", engine, **changes)[0])

    tree, cut = motion("b0"), motion("c0")
    assert np.abs(tree.q - cut.q).max() < 1e-8
    assert np.abs(tree.work - cut.work).max() < 1e-8
    assert np.abs(tree.work[1:]).min() > 0.01


@pytest.mark.parametrize("engine", ENDINGS)
def test_integration_that_stops_keeps_what_was_computed(engine, monkeypatch):
    """As if the accelerations became unsafe once the crank has passed one radian."""
    module = importlib.import_module(f"screwgauge.forward.{engine}")
    mover = getattr(module, f"{engine.capitalize()}Mover")
    accelerate, place = mover.accelerate, mover.place

    def placed(self, q, v):
        self.angle = q[0]
        place(self, q, v)

    def refusing(self, tau):
        if self.angle < -1.0:
            raise SingularPoseError("is not safe", "a pose", "go round it")
        return accelerate(self, tau)

    monkeypatch.setattr(mover, "place", placed)
    monkeypatch.setattr(mover, "accelerate", refusing)
    problem, *_ = problem_of("a02-fourbar-2", engine, times=np.linspace(0.0, 1.0, 21))
    found = integrator(engine)(problem)
    assert found.stopped.startswith("t = 0.")
    assert "no step leads on; a pose: is not safe" in found.stopped
    assert 5 < len(found.q) < 20
    assert {len(part) for part in (found.q, found.v, found.a, found.work, found.condition)} == {len(found.q)}


def test_a_start_without_direction_is_refused():
    spring = PointSpring("ground", np.zeros(3), "bob", np.zeros(3), stiffness=1.0, rest=0.1)
    with pytest.raises(SingularPoseError, match="its points meet"):
        integrator("pinocchio")(problem_of("a01-pendulum", "pinocchio", springs=(spring,))[0])


@pytest.mark.parametrize("engine", ENDINGS)
def test_a_start_that_its_coordinates_do_not_determine_is_refused(engine):
    """All links of the four-bars in one line: which way they bend is not said by the crank."""
    with pytest.raises(SingularPoseError, match="do not determine the motion"):
        integrator(engine)(problem_of("a02-fourbar-2", engine, start=np.array([-0.5 * np.pi]))[0])


@pytest.mark.parametrize("engine", ENDINGS)
def test_bad_problems_are_said(engine):
    def refused(match, error, **changes):
        with pytest.raises(error, match=match):
            integrator(engine)(problem_of("a02-fourbar-2", engine, **changes)[0])

    refused("unknown method 'RK5'", UnknownNameError, method=Method("RK5"))
    refused("unknown coordinate 'd9'", UnknownNameError, motors=(constant("d9", 1.0),))
    refused(r"start of shape \(2,\) for 1 independent", screwgauge.ScrewgaugeError, start=np.zeros(2))
    refused("has no loops file", ModelFileError, loops=None)
