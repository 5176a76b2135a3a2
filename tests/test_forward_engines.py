import re
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge import Scene
from support.acting import JointSpring, PointSpring, hold
from support.data import DATA
from support.engines import ModelFiles, model_files, simulate, simulate_scene
from support.errors import ModelFileError, SingularPoseError, UnknownNameError
from support.models import write_models
from support.scene import InitialValue, Integration, observe
from support.solve import METHODS, SIZES, layout, motion_at
from support.tolerances import DENSE, ENERGY_PER_ERROR, FOLLOWED, LINEAR, ROUND_TRIP
from support.trees import MujocoMover, PinocchioMover

MOVERS = {"pinocchio": PinocchioMover, "mujoco": MujocoMover}
ENGINES = tuple(MOVERS)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
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
    files = model_files(model, engine, tmp_path)
    for i, t in enumerate(motion.t):
        held = replace(scene.applied, motors=hold(dict(zip(driven, forces[i], strict=True))))
        found = simulate(engine, files, held, InitialValue(motion.y[i], motion.yd[i], float(t), np.array([t])))
        assert np.abs(found.a[0] - wanted[i]).max() < ROUND_TRIP * np.abs(wanted).max()


#: Scene -> how far it is integrated [s].
UNTIL = {
    "a01-pendulum": 10.0,
    "a02-fourbar-2": 2.0,  # two singular poses
    "a02-fourbar-40": 0.5,
    "a03-andrews-ivp": 0.03,
    "a04-bricard-thin": 3.0,
    "a04-bricard-box": 3.0,
    "a05-governor": 2.0,
}


def scene_of(name: str, until: float = 1.0, **applied: object) -> tuple[Scene, np.ndarray]:
    scene = screwgauge.load_scene(name)
    rows = np.flatnonzero(scene.known.t <= until)[::10]
    return scene.at(scene.known.t[rows]).under(**applied), scene.known.array[rows]


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", UNTIL)
def test_established_problem(name, engine):
    scene, known = scene_of(name, UNTIL[name])
    error = FOLLOWED[name]
    found, lay = simulate_scene(engine, scene), layout(scene.mechanism)
    assert (found.stopped, len(found.q)) == ("", len(known))
    if engine == "mujoco":
        refined = re.search(r"(\S+) refinements on average, at most (\d+)", " ".join(found.notes))
        assert bool(refined) == (name not in ("a01-pendulum", "a05-governor"))  # without closed loops
        assert not refined or 1.0 <= float(refined[1]) <= int(refined[2])
    assert np.abs(observe(lay, scene.observables, found.q).array - known).max() < error
    at = motion_at(lay, found.q, found.v[:, lay.mechanism.independent_columns], applied=scene.applied)
    # joints that were cut, too
    assert np.abs(at.joint_velocity - found.v).max() < DENSE * max(1.0, np.abs(found.v).max())
    E = at.energy
    assert np.abs(E - E[0] - found.work).max() < ENERGY_PER_ERROR * error  # dampers are integrated along


@pytest.mark.parametrize("engine", ENGINES)
def test_loops_closed_by_welds_move_alike(engine):
    scene, known = scene_of("a04-bricard-box")
    full = model_files("a04-bricard-box", f"{engine}-full")
    found = simulate(engine, full, scene.applied, scene.start)
    assert found.engine == f"{engine}-full"
    assert (
        np.abs(observe(layout(scene.mechanism), scene.observables, found.q).array - known).max()
        < FOLLOWED["a04-bricard-box"]
    )


@pytest.mark.parametrize("engine", ENGINES)
def test_what_progress_raises_ends_the_integration(engine):
    shares = []

    def progress(share):
        shares.append(share)
        if share > 0.5:
            raise KeyboardInterrupt

    scene = scene_of("a02-fourbar-2")[0]
    with pytest.raises(KeyboardInterrupt):
        simulate(engine, model_files("a02-fourbar-2", engine), scene.applied, scene.start, progress)
    assert shares == sorted(shares)
    assert len(shares) > 3


@pytest.mark.parametrize("engine", ENGINES)
def test_cut_joints_follow_whole_turns(engine):
    scene = screwgauge.load_scene("a02-fourbar-2").at([0.0, 3.0])
    found = simulate_scene(engine, scene)
    names = scene.mechanism.coordinates
    a0, c0, c1 = (found.q[:, names.index(name)] for name in ("a0", "c0", "c1"))
    assert abs(a0[-1]) > 2 * np.pi
    assert np.abs(c0 + a0).max() < LINEAR  # the bar keeps its attitude, so that each end turns back as far
    assert np.abs(c1 + a0).max() < LINEAR
    a = found.a[:, names.index("c0")] + found.a[:, names.index("a0")]
    assert np.abs(a).max() < 1e-11  # next to a singular pose


@pytest.mark.parametrize("engine", ENGINES)
def test_springs_and_motors_at_a_cut_joint_act_like_those_beside_it(engine):
    """In a parallelogram the cut joint c0 turns as b0 does."""
    scene = screwgauge.load_scene("a02-fourbar-2").at([0.0, 0.2, 0.6])

    def motion(coordinate):
        spring = JointSpring(coordinate, stiffness=30.0, rest=0.2, damping=2.0)
        return simulate_scene(engine, scene.under(springs=(spring,), motors=hold({coordinate: 1.5})))

    tree, cut = motion("b0"), motion("c0")
    assert np.abs(tree.q - cut.q).max() < LINEAR
    assert np.abs(tree.work - cut.work).max() < LINEAR
    assert np.abs(tree.work[1:]).min() > 0.01


@pytest.mark.parametrize("engine", ENGINES)
def test_integration_that_stops_keeps_what_was_computed(engine, monkeypatch):
    """Accelerations become unsafe once the crank has passed one radian."""
    mover = MOVERS[engine]
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
    found = simulate_scene(engine, screwgauge.load_scene("a02-fourbar-2").at(np.linspace(0.0, 1.0, 21)))
    assert found.stopped.startswith("t = 0.")
    assert "a pose: is not safe" in found.stopped
    assert 5 < len(found.q) < 20
    assert {len(part) for part in (found.q, found.v, found.a, found.work, found.condition)} == {len(found.q)}


def test_a_start_without_direction_is_refused():
    spring = PointSpring("ground", np.zeros(3), "bob", np.zeros(3), stiffness=1.0, rest=0.1)
    with pytest.raises(SingularPoseError, match="its end points coincide"):
        simulate_scene("pinocchio", scene_of("a01-pendulum", springs=(spring,))[0])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_start_that_its_coordinates_do_not_determine_is_refused(engine):
    """With all links in line the crank does not determine how they bend."""
    scene = screwgauge.load_scene("a02-fourbar-2")
    in_line = replace(scene.start, start=np.array([-0.5 * np.pi]))
    with pytest.raises(SingularPoseError, match="do not determine the motion"):
        simulate_scene(engine, replace(scene, task=in_line))


@pytest.mark.parametrize("engine", ENGINES)
def test_bad_problems_are_said(engine):
    scene = scene_of("a02-fourbar-2")[0]
    files = model_files("a02-fourbar-2", engine)

    def refused(match, error, files=files, applied=scene.applied, **task):
        with pytest.raises(error, match=match):
            simulate(engine, files, applied, replace(scene.start, **task))

    refused("unknown method 'RK5'", UnknownNameError, integration=Integration("RK5"))
    refused("unknown coordinate 'd9'", UnknownNameError, applied=scene.under(motors=hold({"d9": 1.0})).applied)
    refused(r"start must have shape \(1,\), got \(2,\)", screwgauge.ScrewgaugeError, start=np.zeros(2))
    refused("has no loops file", ModelFileError, files=ModelFiles(files.model))


class Sticking(METHODS["DOP853"]):
    def step(self):
        if 0.3 < self.t < 0.4 and self.sticks:
            self.h_abs, self.sticks = 1e-9, self.sticks - 1
            assert self.sticks, "nobody minds"
        return super().step()


@pytest.fixture(scope="module")
def boxes():
    scene = screwgauge.load_scene("a04-bricard-box").at(np.linspace(0.0, 0.6, 25))
    return scene, simulate_scene("pinocchio", scene)


@pytest.mark.slow
@pytest.mark.parametrize("tries", [1, 3, 99])
def test_where_steps_shrink_it_goes_back_to_the_last_step_of_usual_size(tries, boxes, monkeypatch):
    begun = []

    def begin(*args, first_step=None, **options):
        solver = Sticking(*args, first_step=first_step, **options)
        solver.sticks = 400 * (len(begun) < tries)  # more than a phase of the motion takes
        begun.append((solver.t, first_step))
        return solver

    scene, easy = boxes
    monkeypatch.setitem(METHODS, "DOP853", begin)
    found = simulate_scene("pinocchio", scene)
    again = begun[1:]
    assert all(0.2 < t < 0.4 and 1e-4 < size < 1.0 for t, size in again)
    assert len({size for _, size in again}) == len(again) == min(tries, len(SIZES))
    assert np.abs(found.q - easy.q[: len(found.q)]).max() < FOLLOWED["a04-bricard-box"]
    if tries > len(SIZES):
        assert "shrunk to 1e-09 s" in found.stopped
    else:
        assert found.stopped == ""
        assert f"{tries} steps were repeated" in " ".join(found.notes)
