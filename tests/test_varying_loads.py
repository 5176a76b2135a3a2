import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from screwgauge.engines.registry import get_engine
from screwgauge.families.draw import families
from support.data import data
from support.engines import ask, further_engines, model_files
from support.errors import DescriptionError

ENGINES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full", "lagrange")
#: Numbers that are solved from loops of equations, relative to the largest.
SOLVED = 1e-12
BAR = data("bar.toml")
TURN = data("bar-scene.toml")
#: Components that change with time, two of them in no way.
COMPONENTS = (
    "force = [1, { offset = '1/3', polynomial = [0, 2, -1] }, { harmonics = [[3, 1, 2], [7, 0.2, 0]] }]\n"
    "torque = [{ polynomial = [0.1] }, 0.3, { harmonics = [[5, 0.1, 0.2]] }]\n"
)


def with_engine(name: str):
    if name != "frozen" and not get_engine(name).installed:
        pytest.skip(f"{name} is not installed")
    return further_engines({"frozen": "support.frozen_engine:FROZEN"})


@pytest.fixture
def pivot(write):
    def ask(load: str, engines=(*ENGINES, "truth")):
        write("bar.toml", BAR)
        scene = screwgauge.load_scene(write("turn.toml", TURN + load))
        results = screwgauge.run(scene, engines, ("actuator_force",))
        assert results.ok, repr(results)
        inertial = 0.2 * scene.motion.ydd[:, 0]
        return {name: results.values("actuator_force", name)[:, 0] - inertial for name in engines}, scene.motion

    return ask


def test_a_force_that_turns_with_its_body_has_a_constant_arm(pivot):
    torques, _ = pivot('axes = "body"\nforce = [5, 4, 0]\ntorque = [0, 0, 0.5]\n')
    for name, torque in torques.items():
        assert torque == pytest.approx(np.full_like(torque, -2.5), rel=SOLVED, abs=0), name


def test_a_force_over_time_has_the_arm_of_the_moment(pivot):
    torques, motion = pivot("force = [0, { polynomial = [1, 2], harmonics = [[3, 0.5, 0.25]] }, 0]\n")
    t, a = motion.t, motion.y[:, 0]
    expected = -0.5 * np.cos(a) * (1 + 2 * t + 0.5 * np.cos(3 * t) + 0.25 * np.sin(3 * t))
    for name, torque in torques.items():
        assert torque == pytest.approx(expected, rel=0, abs=SOLVED * np.abs(expected).max()), name


def test_a_column_of_a_csv_is_the_force_at_its_times(pivot, write):
    t = np.arange(11) * 0.1
    write("gust.csv", "t,fy,other\n" + "\n".join(f"{x:.10g},{x * x - 0.3!r},{2 * x!r}" for x in t.tolist()))
    torques, motion = pivot('force = [0, { csv = "gust.csv" }, 0]\ntorque = [0,0,{csv="gust.csv",column="other"}]\n')
    expected = -0.5 * np.cos(motion.y[:, 0]) * (t * t - 0.3) - 2 * t
    for name, torque in torques.items():
        assert torque == pytest.approx(expected, rel=0, abs=SOLVED * np.abs(expected).max()), name


def test_without_a_time_grid_the_times_are_those_of_the_csv(write):
    write("bar.toml", BAR)
    write("gust.csv", "t,fy\n0.25,1\n0.5,2\n")
    text = TURN.replace("time = { duration = 1, step = 0.1 }\n", "") + 'force = [0, { csv = "gust.csv" }, 0]\n'
    scene = screwgauge.load_scene(write("turn.toml", text))
    assert scene.t.tolist() == [0.25, 0.5]
    for other in (lambda: scene.at([0.25, 0.3]), lambda: screwgauge.exciting(scene)):
        with pytest.raises(DescriptionError):
            other()


@pytest.mark.parametrize("name", [*ENGINES[1:], "truth", "frozen", "exudyn", "drake"])
@pytest.mark.parametrize("axes", ["world", "body"])
@pytest.mark.parametrize("mechanism", ["slider-crank", "3ups-upu-s"])
def test_every_engine_agrees(write, mechanism, axes, name):
    with with_engine(name):
        results = screwgauge.run(loaded(mechanism, axes, write), engines=["screw", name])
    assert results.exit_status == 0, repr(results)
    assert "actuator_force" in set(results.pairs["quantity"])


def loaded(mechanism: str, axes: str, write):
    scene = screwgauge.load_scene(mechanism)
    body = scene.mechanism.bodies[-1].name
    lines = scene.file.read_text(encoding="utf-8")
    lines += f'[[loads]]\non = "environment"\nby = "{body}"\npoint = [0.1, 0.2, 0.3]\naxes = "{axes}"\n{COMPONENTS}'
    scene = screwgauge.load_scene(write("loaded.toml", lines))
    assert scene.wording().loads is not None
    return scene.at(scene.t[:: max(1, len(scene.t) // 5)][:5])


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("family", families())
def test_random_mechanisms_agree_under_loads_that_vary(family):
    scene = screwgauge.random(3, family)
    rng, bodies = np.random.default_rng(3), [body.name for body in scene.mechanism.bodies]
    loads = [varying(rng, bodies, axes) for axes in ("world", "body")]
    results = screwgauge.run(scene.under(loads=loads), (*ENGINES, "truth"))
    assert results.exit_status == 0, repr(results)


def varying(rng, bodies, axes):
    courses = [
        {"offset": a, "polynomial": [0.0, b], "harmonics": [[1.0 + 4.0 * c * c, a, b]]}
        for a, b, c in rng.normal(size=(6, 3))
    ]
    return {
        "on": str(rng.choice(bodies)),
        "by": "environment",
        "axes": axes,
        "point": rng.normal(size=3).tolist(),
        "force": courses[:3],
        "torque": courses[3:],
    }


def test_simulations_agree_and_keep_their_energy(write):
    text = 'mechanism = "five-bar"\n[forward]\n[time]\nduration = 0.5\nstep = 0.1\n[[loads]]\non = "left.crank"\n'
    text += f'by = "environment"\npoint = [0.1, 0, 0.02]\naxes = "body"\n{COMPONENTS}'
    results = screwgauge.run(screwgauge.load_scene(write("swing.toml", text)), ["screw", "pinocchio", "mujoco"])
    assert results.exit_status == 0, repr(results)
    balance = results.judge[results.judge["residual"] == "energy_balance"]
    assert len(balance) == 3
    assert balance["ok"].all()


def test_a_compiled_solver_takes_times_or_loads(write):
    scene = loaded("slider-crank", "body", write)
    solver, motion = screwgauge.compile(scene, ["actuator_force"]), scene.motion
    given = (motion.y, motion.yd, motion.ydd)
    right = screwgauge.run(scene, ["lagrange"], ["actuator_force"]).values("actuator_force", "lagrange")
    assert solver(*given, t=motion.t)["actuator_force"] == pytest.approx(right, rel=0, abs=1e-10 * np.abs(right).max())
    now = scene.applied.at(motion.t).loads
    load = np.concatenate(
        [np.broadcast_to(x, (len(motion), 3)) for one in now for x in (one.force, one.torque)], axis=1
    )
    assert solver(*given, load=load)["actuator_force"] == pytest.approx(right, rel=0, abs=1e-10 * np.abs(right).max())
    with pytest.raises(ScrewgaugeError, match="pass t or load"):
        solver(*given)


def test_a_load_over_time_has_no_number_without_its_time(write):
    (load,) = loaded("slider-crank", "world", write).applied.loads[-1:]
    assert np.isnan(load.force).all()
    assert np.isfinite(load.at(0.5).force).all()


def test_arrays_and_programs_agree(write):
    scene = loaded("3ups-upu-s", "body", write)
    problem, files = scene.problem(("actuator_force", "reaction")), model_files("3ups-upu-s", "screw")
    arrays, program = (ask("screw", files, problem, backend=backend).values for backend in ("array", "numpy"))
    for name, values in program.items():
        size = np.abs(values.array).max()
        assert np.abs(arrays[name].array - values.array).max() < 1e-11 * size, name
