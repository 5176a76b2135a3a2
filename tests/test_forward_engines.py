"""Pinocchio and MuJoCo driven forward: they undo their own inverse dynamics and follow the established problems."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import screwgauge
from screwgauge.forward.problem import ForwardProblem, Method, Motor
from screwgauge.models.catalog import load_mechanism
from screwgauge.models.generate import write_models
from screwgauge.reference.errors import ModelFileError, UnknownNameError
from screwgauge.reference.forward import Forces, energy
from screwgauge.reference.kinematics import rates
from screwgauge.reference.pose import layout, pose
from screwgauge.reference.springs import JointSpring, PointSpring

DATA = Path(__file__).parent / "data"
ENDINGS = {"pinocchio": ".urdf", "mujoco": ".xml"}
ROUND_TRIP = (
    1e-11  # two dense solutions, conditions of a few hundred: 1e-13 of the largest acceleration is seen
)


def integrator(engine):
    return importlib.import_module(f"screwgauge.forward.{engine}").integrate


def constant(coordinate, amount):
    return Motor(coordinate, np.array([amount]), np.zeros((0, 3)))


@pytest.mark.parametrize("engine", ENDINGS)
@pytest.mark.parametrize("name", ["3ups-upu-s", "3ups-upu-s-fast", DATA / "four-bar-scene.toml"], ids=str)
def test_inverse_then_forward_returns_the_accelerations(name, engine, tmp_path):
    scene = screwgauge.load_scene(name)
    scene = scene.at(scene.motion.t[np.linspace(0, len(scene.motion) - 1, 5).astype(int)])
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
            scene.gravity,
            scene.loads,
            (),
            tuple(constant(name, f) for name, f in zip(driven, forces[i], strict=True)),
            motion.y[i],
            motion.yd[i],
            np.array([t]),
        )
        found = integrator(engine)(problem)
        assert np.abs(found.a[0] - wanted[i]).max() < ROUND_TRIP * np.abs(wanted).max()


@dataclass(frozen=True)
class Case:
    """An established problem: what acts, what is known of it, and what of that is looked at."""

    mechanism: str
    columns: dict[str, tuple[str, tuple[float, float, float], int] | str]
    until: float
    error: float  # of the observable, a hundred times what was seen or the tolerance of the steps
    gravity: tuple[float, float, float] = (0.0, -9.81, 0.0)
    start: tuple[float, ...] | None = None
    rates: tuple[float, ...] | None = None
    springs: tuple[object, ...] = ()
    motors: tuple[Motor, ...] = ()
    method: Method = field(default_factory=lambda: Method("DOP853", 1e-11, 1e-11))


def ends(body, x, y, z, names):
    return {name: (body, (x, y, z), axis) for axis, name in enumerate(names)}


ANDREWS = PointSpring(
    "ground",
    np.array([0.014, 0.072, 0.0]),
    "K3",
    np.array([0.02, -0.018, 0.0]),
    stiffness=4530.0,
    rest=0.07785,
)
GOVERNOR = tuple(
    PointSpring(
        "slider",
        np.array([0.05 * side, 0.0, 0.0]),
        rod,
        np.array([0.5 * side, 0.0, 0.0]),
        stiffness=8e5,
        rest=0.5,
        damping=4e4,
    )
    for rod, side in (("right", 1.0), ("left", -1.0))
)
CASES = {
    "a01-pendulum": Case("a01-pendulum", ends("bob", 0, -1, 0, ("x_m", "y_m")), 10.0, 1e-9),
    # up to two singular poses; the error grows at each
    "a02-fourbar-2": Case(
        "a02-fourbar-2",
        ends("upright0", 0, 1, 0, ("B0x_m", "B0y_m")),
        2.0,
        1e-7,
        rates=(-1.0,),
        method=Method("DOP853", 1e-10, 1e-10),
    ),
    "a02-fourbar-40": Case(
        "a02-fourbar-40",
        ends("upright0", 0, 1, 0, ("B0x_m", "B0y_m")),
        0.5,
        1e-6,
        rates=(-1.0,),
        method=Method("DOP853", 1e-7, 1e-7),
    ),
    "a03-andrews-ivp": Case(
        "a03-andrews",
        {**ends("K1", 0.007, 0, 0, ("Fx_m", "Fy_m")), "beta_rad": "beta"},
        0.03,
        1e-10,
        gravity=(0.0, 0.0, 0.0),
        springs=(ANDREWS,),
        motors=(constant("beta", 0.033),),
    ),
    "a04-bricard-thin": Case(
        "a04-bricard-thin", ends("rod2", 0, -1, 0, ("P3x_m", "P3y_m", "P3z_m")), 3.0, 1e-9
    ),
    "a04-bricard-box": Case(
        "a04-bricard-box", ends("rod2", 0, -1, 0, ("P3x_m", "P3y_m", "P3z_m")), 3.0, 1e-9
    ),
    "a05-governor": Case(
        "a05-governor",
        {"s_m": "slide", "alpha_rad": "right"},
        2.0,
        1e-7,
        gravity=(0.0, 0.0, -9.81),
        rates=(2.0 * np.pi, 0.0, 0.0, 0.0),
        springs=GOVERNOR,
        method=Method("Radau", 1e-7, 1e-7),
    ),
}
REFUSED = {("a01-pendulum", "mujoco"), ("a04-bricard-thin", "mujoco")}


def problem_of(name, engine, **changes):
    """The problem, the layout of its mechanism and what is known."""
    case = CASES[name]
    lay = layout(load_mechanism(case.mechanism))
    known = pd.read_csv(DATA / "benchmarks" / f"{name}.csv", comment="#")
    known = known[known["t_s"] <= case.until + 1e-9]
    folder = Path(str(load_mechanism.__code__.co_filename)).parent / case.mechanism
    home = lay.mechanism.home[lay.mechanism.independent_columns]
    problem = ForwardProblem(
        folder / f"{case.mechanism}{ENDINGS[engine]}",
        folder / f"{case.mechanism}.loops.toml",
        np.array(case.gravity),
        (),
        case.springs,
        case.motors,
        home if case.start is None else np.array(case.start),
        np.zeros_like(home) if case.rates is None else np.array(case.rates),
        known["t_s"].to_numpy(),
        case.method,
    )
    return replace(problem, **changes), lay, known


def observed(name, lay, q):
    """The components of `CASES`, in order. Shape (n, m)."""
    at, columns = pose(lay, q), []
    for item in CASES[name].columns.values():
        if isinstance(item, str):
            columns.append(q[:, lay.mechanism.coordinates.index(item)])
        else:
            body, point, axis = item
            i = lay.mechanism.body_index[body]
            columns.append(at.p[:, i, axis] + at.R[:, i, axis] @ np.array(point))
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("engine", ENDINGS)
@pytest.mark.parametrize("name", CASES)
def test_established_problem(name, engine):
    problem, lay, known = problem_of(name, engine)
    if (name, engine) in REFUSED:
        with pytest.raises(ModelFileError, match=r"MuJoCo cannot load it \(.*inertia must have positive"):
            integrator(engine)(problem)
        return
    found = integrator(engine)(problem)
    assert (found.stopped, len(found.q)) == ("", len(known))
    error = np.abs(observed(name, lay, found.q) - known[list(CASES[name].columns)])
    assert error.to_numpy().max() < CASES[name].error
    still = pose(lay, found.q)
    rate = rates(lay, still, found.v[:, lay.mechanism.independent_columns])
    # joints that were cut, too; at a singular pose the others do not determine them
    if "a02" not in name:
        assert np.abs(rate.w - found.v).max() < 1e-9 * max(1.0, np.abs(found.v).max())
    E = energy(lay, rate, Forces(gravity=problem.gravity, springs=problem.springs))
    assert np.abs(E - E[0] - found.work).max() < 10 * CASES[name].error * max(1.0, np.abs(E).max())


@pytest.mark.parametrize("engine", ENDINGS)
def test_cut_joints_follow_whole_turns(engine):
    """Two four-bars: the angle at the end of each bar turns with the crank, five times in ten seconds."""
    problem, lay, _ = problem_of("a02-fourbar-2", engine, times=np.array([0.0, 3.0]))
    found = integrator(engine)(problem)
    names = lay.mechanism.coordinates
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


def test_integration_that_stops_keeps_what_was_computed():
    """The ends of a spring meet on the way: there it has no direction."""
    spring = PointSpring("ground", np.zeros(3), "bob", np.zeros(3), stiffness=1.0, rest=0.1)
    problem, *_ = problem_of("a01-pendulum", "pinocchio", springs=(spring,))
    with pytest.raises(screwgauge.ScrewgaugeError, match="its points meet"):
        integrator("pinocchio")(problem)


@pytest.mark.parametrize("engine", ENDINGS)
def test_bad_problems_are_said(engine):
    def refused(match, error, **changes):
        with pytest.raises(error, match=match):
            integrator(engine)(problem_of("a02-fourbar-2", engine, **changes)[0])

    refused("unknown method 'RK5'", UnknownNameError, method=Method("RK5"))
    refused("unknown coordinate 'd9'", UnknownNameError, motors=(constant("d9", 1.0),))
    refused(r"start of shape \(2,\) for 1 independent", screwgauge.ScrewgaugeError, start=np.zeros(2))
    refused("has no loops file", ModelFileError, loops=None)
