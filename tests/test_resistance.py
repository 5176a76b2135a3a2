import re

import numpy as np
import pytest

import screwgauge
from screwgauge.problem import Problem, States
from support.acting import Applied
from support.data import data
from support.engines import ask, model_files
from support.errors import DescriptionError
from support.judging import reference_values
from support.mechanism import load_mechanism
from support.models import description, import_model, left_out, write_models

ENGINES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full", "lagrange")
#: Numbers that are solved from loops of equations, relative to the largest.
SOLVED = 1e-12

HINGE = data("hinge-part.toml")
ROD = """
[bodies.{}]
mass = 1
com = [0.1, 0, 0.02]
inertia = {{ xx = 0.01, yy = 0.02, zz = 0.02 }}
"""
#: Angles of a parallelogram's hinges per angle of its crank.
TURNS = {"a": 1.0, "b": -1.0, "c": 1.0, "d": -1.0}
MOTION = """
mechanism = "{}"
gravity = [0, 0, -9.81]
motion.a = {{ offset = 1.1, harmonics = [[5, 0.2, 0.3], [2, 0.1, 0]] }}
time = {{ duration = 1, step = 0.05 }}
"""


def parallelogram(**more: str) -> str:
    hinges = (
        ("a", "ground", "crank", 1.1, 0.0),
        ("b", "crank", "coupler", -1.1, 0.3),
        ("c", "coupler", "rocker", 1.1, 0.5),
        ("d", "rocker", "ground", -1.1, -0.3),
    )
    parts = ['name = "parallelogram"\n[independent]\na = "a"\n', *(ROD.format(x) for x in ("crank", "coupler"))]
    parts.append(ROD.format("rocker").replace("com = [0.1", "com = [-0.1"))
    for name, parent, child, home, x in hinges:
        lines = "\n".join(filter(None, ("actuated = true" * (name == "a"), more.get(name, ""))))
        text = HINGE.format(name=name, parent=parent, child=child, home=home, x=x, more=lines)
        if name == "d":  # the far pivot of the ground, half a metre away
            text = text.replace("parent_frame = { position = [-0.3, 0, 0] }", "") + (
                "parent_frame = { position = [-0.3, 0, 0] }\nchild_frame = { position = [0.5, 0, 0] }\n"
            )
        parts.append(text)
    return "".join(parts)


@pytest.fixture
def torque(write):
    def ask(engines=ENGINES, **more: str):
        write("linkage.toml", parallelogram(**more))
        scene = screwgauge.load_scene(write("move.toml", MOTION.format("linkage.toml")))
        results = screwgauge.run(scene, engines, ("actuator_force",))
        assert results.ok, repr(results)
        return {name: results.values("actuator_force", name)[:, 0] for name in engines}, scene.motion

    return ask


def law(what: str, amounts: dict[str, float], motion) -> np.ndarray:
    along = {"rotor": motion.ydd[:, 0], "damping": motion.yd[:, 0], "friction": np.sign(motion.yd[:, 0])}[what]
    power = 1.0 if what == "friction" else 2.0
    return sum(amount * abs(TURNS[name]) ** power for name, amount in amounts.items()) * along


@pytest.mark.parametrize("what", ["rotor", "damping", "friction"])
@pytest.mark.parametrize("amounts", [{"a": 0.3}, {"b": 0.2}, {"a": 0.3, "b": 0.2, "c": 0.1, "d": 0.4}], ids=repr)
def test_a_parallelogram_takes_the_sum_of_its_hinges(what, amounts, torque):
    engines = (*ENGINES, "truth")
    plain, motion = torque(engines)
    got, _ = torque(engines, **{name: f"{what} = [{amount}]" for name, amount in amounts.items()})
    expected = law(what, amounts, motion)
    for name in engines:
        assert got[name] - plain[name] == pytest.approx(expected, rel=0, abs=SOLVED * np.abs(got[name]).max()), name


GEARED = data("geared-wheel.toml")


def test_a_rotor_behind_a_gear_is_a_wheel_that_turns_as_much_faster(torque, write):
    expected, _ = torque(("screw",), a="rotor = [0.2]")
    wheel = GEARED.replace("mass = 0\n", "mass = 1\ninertia = { xx = 0.002, yy = 0.002, zz = 0.002 }\n")
    write("linkage.toml", parallelogram() + wheel)
    scene = screwgauge.load_scene(write("move.toml", MOTION.format("linkage.toml")))
    for name in ENGINES:
        got = screwgauge.run(scene, [name], ("actuator_force",)).values("actuator_force")[:, 0]
        assert got == pytest.approx(expected["screw"], rel=0, abs=SOLVED * np.abs(got).max()), name


SLIDER = data("planar-slider-crank.toml")


@pytest.mark.parametrize("what", ["rotor", "damping", "friction"])
def test_a_piston_resists_along_its_stroke(what, write):
    amount, torques = 3.0, []
    for more in ("", f"{what} = {amount}\n"):
        write("linkage.toml", SLIDER + more)
        scene = screwgauge.load_scene(write("move.toml", MOTION.format("linkage.toml")))
        results = screwgauge.run(scene, (*ENGINES, "truth"), ("actuator_force",))
        assert results.ok, repr(results)
        torques.append({name: results.values("actuator_force", name)[:, 0] for name in (*ENGINES, "truth")})
    a, w, b = (x[:, 0] for x in (scene.motion.y, scene.motion.yd, scene.motion.ydd))
    r, l, s = 0.2, 0.5, np.sin(a)
    root = np.sqrt(l**2 - r**2 * s**2)
    slope = -r * s - r**2 * s * np.cos(a) / root  # x = r cos a + root
    curve = -r * np.cos(a) - r**2 * (np.cos(a) ** 2 - s**2) / root - r**4 * s**2 * np.cos(a) ** 2 / root**3
    along = {"rotor": slope * b + curve * w**2, "damping": slope * w, "friction": np.sign(slope * w)}[what]
    for name, got in torques[1].items():
        gained = got - torques[0][name]
        assert gained == pytest.approx(amount * along * slope, rel=0, abs=SOLVED * np.abs(got).max()), name


def test_the_shares_are_told_apart_and_sum_up(write):
    write("linkage.toml", parallelogram(a="rotor = [0.3]\ndamping = [0.2]", d="friction = [0.1]"))
    scene = screwgauge.load_scene(write("move.toml", MOTION.format("linkage.toml")))
    wanted = ("actuator_force", "resistance", "axis_moment", "mass_matrix", "joint_acceleration", "joint_velocity")
    results = screwgauge.run(scene, ENGINES, wanted)
    assert results.ok, repr(results)
    assert screwgauge.run(scene, ("screw", "truth"), ("resistance",)).ok
    shares = results.quantity("resistance")
    assert [*shares.components] == ["a.rotor", "a.damping", "d.friction"]
    w, b = scene.motion.yd[:, 0], scene.motion.ydd[:, 0]
    expected = np.stack([0.3 * b, 0.2 * w, -0.1 * np.sign(w)], axis=1)
    assert results.values("resistance") == pytest.approx(expected, rel=0, abs=SOLVED)
    through = results.values("axis_moment")[:, 0]
    left = results.values("actuator_force")[:, 0] - expected[:, 0] - expected[:, 1]
    assert through == pytest.approx(left, rel=0, abs=SOLVED * np.abs(left).max())


def simulated(write, text: str, lines: str, engines=("screw", "pinocchio", "mujoco")):
    write("one.toml", text)
    scene = f'mechanism = "one.toml"\ngravity = [0, 0, 0]\n[time]\n{lines}'
    return screwgauge.run(screwgauge.load_scene(write("forward.toml", scene)), engines)


def test_a_motion_that_rests_says_where_friction_has_no_direction(write):
    write("linkage.toml", parallelogram(a="friction = [0.3]"))
    rests = MOTION.replace("harmonics = [[5, 0.2, 0.3], [2, 0.1, 0]]", "harmonics = [[5, 0.2, 0]]")
    scene = screwgauge.load_scene(write("move.toml", rests.format("linkage.toml")))
    results = screwgauge.run(scene, ENGINES, ("actuator_force", "resistance"))
    assert results.ok
    assert results.values("resistance")[0, 0] == 0.0
    (said,) = (text for text in results.warnings if "rests" in text)
    assert re.search("1 of 21 samples.* t = 0 s, in a .up to 0.3 N m", said)
    torques = results.values("actuator_force")[:, 0].copy()
    torques[0] += 0.2  # what the friction may be there
    for changed, agrees in ((0, True), (3, False)):
        torques[changed] += 0.05
        beside = scene.beside(log=screwgauge.Recorded(scene.t, {"a": torques}, error={"actuator_force": 1e-12}))
        assert screwgauge.run(beside, ("screw", "log"), ("actuator_force",)).ok == agrees


ARM = (
    'name = "arm"\n[independent]\nh = "h"\n'
    + ROD.format("arm")
    + HINGE.format(name="h", parent="ground", child="arm", home=0, x=0, more="rotor = 0.5\n")
)
INERTIA = 0.02 + 0.1**2 + 0.02**2 + 0.5


def test_a_damped_arm_slows_down_by_an_exponential(write):
    lines = "duration = 2\nstep = 0.1\n[forward]\nrates = { h = 3 }\n"
    results = simulated(write, ARM + "damping = 0.7\n", lines)
    assert results.ok, repr(results)
    expected = 3.0 * np.exp(-0.7 / INERTIA * results.scene.t)
    for name in ("screw", "pinocchio", "mujoco"):
        assert results.values("joint_velocity", name)[:, 0] == pytest.approx(expected, rel=0, abs=1e-9), name


def test_an_arm_that_its_friction_stops_is_told_with_joint_and_time(write):
    stop = 3.0 * INERTIA / 0.8
    lines = "duration = 4\nstep = 0.1\n[forward]\nrates = { h = 3 }\n"
    results = simulated(write, ARM + "friction = 0.8\n", lines)
    assert results.exit_status != 0
    before = results.scene.t < stop
    for name in ("screw", "pinocchio", "mujoco"):
        rates = results.values("joint_velocity", name)[:, 0]
        assert rates[before] == pytest.approx(3.0 - 0.8 / INERTIA * results.scene.t[before], rel=0, abs=1e-9), name
        assert np.isnan(rates[~before]).all()
    assert f"'h' comes to rest at {stop:.6g} s" in repr(results)


def test_models_and_descriptions_keep_rotors_and_friction(write, tmp_path):
    amounts = "rotor = [0.3]\ndamping = [0.2]\nfriction = [0.1]"
    path = write("linkage.toml", parallelogram(a=amounts, b=amounts, c=amounts, d=amounts))
    mechanism = load_mechanism(path)
    assert len(mechanism.resistances) == 12
    again = load_mechanism(write("again.toml", description(mechanism)))
    assert again.resistances == mechanism.resistances
    files = [file for file in write_models(mechanism, tmp_path) if file.suffix in (".xml", ".urdf")]
    assert len(files) == 4
    assert not any("minimal cut lacks" in text for text in left_out(mechanism))
    lacking = [text for text in left_out(load_mechanism("geared-five-bar")) if "minimal cut lacks" in text]
    assert len(lacking) == 2  # damping and dry friction of the right elbow
    for file in files:
        found = {(one.name, one.amount) for one in import_model(file).mechanism.resistances}
        assert found == {(one.name, one.amount) for one in mechanism.resistances}, file.name


@pytest.mark.parametrize("bad", ["rotor = [-1]", "damping = [nan]", "friction = [1, 2]", 'rotor = ["much"]'])
def test_wrong_amounts_are_refused(bad, write):
    with pytest.raises(DescriptionError, match=r"joints\.a"):
        load_mechanism(write("linkage.toml", parallelogram(a=bad)))


@pytest.mark.parametrize(
    ("what", "said"), [("rotor", "rotors"), ("damping", "damping of joints"), ("friction", "dry friction")]
)
def test_a_log_of_a_machine_without_them_is_told_so(what, said, torque, write):
    plain, motion = torque(("screw",))
    write("linkage.toml", parallelogram(a=f"{what} = [0.4]", c=f"{what} = [0.2]"))
    scene = screwgauge.load_scene(write("move.toml", MOTION.format("linkage.toml")))
    review = screwgauge.review(screwgauge.Recorded(motion.t, {"a": plain["screw"]}), scene, ["actuator_force"])
    assert {(fault.kind, fault.of) for column in review.columns for fault in column.faults} == {("missing", said)}
    assert review.explained
    (right,) = torque(("screw",), a=f"{what} = [0.4]", c=f"{what} = [0.2]")[0].values()
    table = screwgauge.Recorded(motion.t, {"a": 2.0 * plain["screw"] - right})
    (column,) = screwgauge.review(table, scene, ["actuator_force"]).columns
    assert [(fault.kind, fault.of) for fault in column.faults] == [("reversed", said)]


@pytest.mark.parametrize("ending", [".urdf", "-full.urdf", ".xml", "-full.xml"])
def test_model_files_are_the_same_as_their_description(ending, tmp_path):
    write_models(load_mechanism("geared-five-bar"), tmp_path)
    assert screwgauge.diagnose("geared-five-bar", tmp_path / f"geared-five-bar{ending}").same


def test_friction_that_holds_one_of_several_freedoms_ends_a_simulation(write):
    write("leg.toml", 'extends = "belt-leg"\nname = "leg"\n[joints.ankle]\nfriction = [0, 0.1]\n')
    start = "start = { hip = -0.4, motor = 0.5, left = 0.2, right = -0.1 }\n"
    start += "rates = { hip = 1, motor = -1, left = 2, right = 1 }\n"
    scene = f'mechanism = "leg.toml"\ntime = {{ duration = 0.1, step = 0.005 }}\n[forward]\n{start}'
    said = " ".join(repr(screwgauge.run(screwgauge.load_scene(write("forward.toml", scene)))).split())
    assert said.count("'roll' comes to rest at 0.00851433 s") == 3


@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
def test_states_take_what_joints_resist(engine, write, tmp_path):
    write_models(load_mechanism(write("arm.toml", ARM + "damping = 0.7\nfriction = 0.2\n")), tmp_path)
    states = States(("h",), np.array([[0.1]]), np.array([[2.0]]), tau=np.array([[1.0]]))
    problem = Problem(Applied(gravity=np.zeros(3)), states, frozenset({"joint_acceleration"}))
    answer = ask(engine, model_files("arm", engine, tmp_path), problem).values["joint_acceleration"].array
    assert answer[0, 0] == pytest.approx((1.0 - 0.7 * 2.0 - 0.2) / INERTIA, rel=SOLVED, abs=0)


def test_reference_values_are_of_all_coordinates():
    scene = screwgauge.load_scene("geared-five-bar")
    values = reference_values(scene, scene.t[:2], ["joint_velocity"]).values["joint_velocity"]
    assert values.components == scene.mechanism.coordinates


def test_a_simulation_passes_dead_points_of_a_joint_with_friction(write):
    write("one.toml", SLIDER + "friction = 2\n")
    lines = "time = { duration = 0.5, step = 0.05 }\ngravity = [0, 0, 0]\n[forward]\nrates = { a = 20 }\n"
    results = screwgauge.run(screwgauge.load_scene(write("forward.toml", f'mechanism = "one.toml"\n{lines}')))
    assert results.ok, repr(results)
    slide = results.values("joint_velocity", "screw")[:, results.components("joint_velocity").index("s")]
    assert np.sum(np.diff(np.sign(slide)) != 0) >= 3
