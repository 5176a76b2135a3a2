from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from screwgauge.cli import main
from screwgauge.engines.registry import get_engine
from screwgauge.families.draw import families
from screwgauge.models.catalog import mechanism_path
from screwgauge.scene.observables import read_header
from support.data import data
from support.engines import ask, further_engines, model_files
from support.judging import agreed
from support.mechanism import load_mechanism

ENGINES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full", "lagrange", "truth")
OTHERS = ("frozen", "exudyn", "drake")
ASKED = ("jacobian",)
#: Numbers that are solved from loops of equations, relative to the largest.
SOLVED = 1e-12
SCENE = data("jacobian-scene.toml")


@pytest.fixture
def scene(write):
    def read(name: str):
        built = screwgauge.load_scene(name)
        lines = "\n".join(f"motion.{label} = {_inline(table)}" for label, table in built.text["motion"].items())
        body = built.mechanism.bodies[-1].name
        return screwgauge.load_scene(write(f"{name}-rates.toml", SCENE.format(name_of(built), lines, body)))

    return read


def name_of(scene) -> str:
    return str(scene.mechanism_file.stem)


def _inline(table) -> str:
    return "{ " + ", ".join(f"{key} = {value!r}" for key, value in table.items()) + " }"


def rates(results, engine: str) -> dict[str, np.ndarray]:
    values = results.solutions[engine].values["jacobian"]
    return dict(zip(values.components, values.array.T, strict=True))


def test_a_slider_crank_has_the_rates_of_its_closed_form(scene):
    moved = scene("slider-crank")
    results = screwgauge.run(moved, ["screw", "truth"])
    agreed(results)
    angle, r, length = moved.motion.y[:, 0], 0.1, 0.3
    tilt = -np.arcsin(r / length * np.sin(angle))
    turning = -r * np.cos(angle) / (length * np.cos(tilt))
    slide = -r * np.sin(angle) - length * np.sin(tilt) * turning
    crank, rod, piston = (body.name for body in moved.mechanism.bodies)
    (motor,) = moved.mechanism.actuator_names
    found = rates(results, "screw")
    expected = {f"{crank}.wz": 1.0 + 0.0 * angle, f"{rod}.wz": turning, f"{piston}.vx": slide, "tip.vx": slide}
    for name, values in expected.items():
        assert found[f"{name}/{motor}"] == pytest.approx(values, rel=0, abs=SOLVED), name
    solved = results.solutions["screw"].values["jacobian"]
    units = dict(zip(solved.components, solved.units, strict=True))
    assert units[f"{rod}.wz/{motor}"] == "rad/rad"
    assert units[f"tip.vx/{motor}"] == "m/rad"


@pytest.mark.parametrize("name", ["five-bar", "stewart", "3ups-upu-s"])
def test_its_transpose_holds_unit_forces_and_moments(scene, name):
    moved = scene(name).under(gravity=[0, 0, 0])
    found, body = rates(screwgauge.run(moved, ["screw"]), "screw"), moved.mechanism.bodies[-1].name
    still = moved.at([0.0])
    still = still.under(loads=[])
    actuators = moved.mechanism.actuator_names
    for k, axis in enumerate("xyz"):
        unit = np.eye(3)[k].tolist()
        force = {"on": body, "by": "environment", "point": [0.1, -0.2, 0.3], "force": unit}
        torque = {"on": body, "by": "environment", "torque": unit}
        for load, row in ((force, f"tip.v{axis}"), (torque, f"{body}.w{axis}")):
            held = forces(still.under(loads=[load])) - forces(still)
            expected = [-found[f"{row}/{actuator}"][0] for actuator in actuators]
            assert held == pytest.approx(expected, rel=0, abs=1e-10), row


def forces(scene) -> np.ndarray:
    return np.asarray(screwgauge.run(scene, ["mujoco"], ["actuator_force"]).values("actuator_force", "mujoco")[0])


@pytest.mark.parametrize("engine", [*ENGINES[1:], *OTHERS])
@pytest.mark.parametrize("name", ["slider-crank", "stewart", "3ups-upu-s", "planetary-gear"])
def test_every_engine_agrees_and_satisfies_the_judge(scene, name, engine):
    if engine != "frozen" and not get_engine(engine).installed:
        pytest.skip(f"{engine} is not installed")
    with further_engines({"frozen": "support.frozen_engine:FROZEN"}):
        results = screwgauge.run(scene(name), ["screw", engine])
    agreed(results)
    assert {*results.pairs["quantity"]} == {"jacobian"}
    assert [*results.judge[results.judge["residual"] == "jacobian"]["engine"].unique()] == ["screw", engine]


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("family", families())
def test_random_mechanisms_agree(family):
    drawn = screwgauge.random(4, family)
    if len(drawn.mechanism.actuators) < len(drawn.mechanism.independent):
        with pytest.raises(ScrewgaugeError, match="jacobian"):
            screwgauge.run(drawn, ["screw"], ASKED)
        return
    agreed(screwgauge.run(drawn, ENGINES, ASKED))


def test_freedoms_that_no_actuator_drives_rest(write):
    text = mechanism_path("cart-pole", Path(), "").read_text(encoding="utf-8")
    cart = load_mechanism("cart-pole").joint(load_mechanism("cart-pole").independent["cart"])
    write("cart.toml", text.replace(f"[joints.{cart.name}]", f"[joints.{cart.name}]\nactuated = true"))
    lines = 'mechanism = "cart.toml"\nmotion.cart = { harmonics = [[3, 0.1, 0]] }\ntime = { times = [0, 0.2] }\n'
    swung = screwgauge.load_scene(write("swung.toml", lines))
    assert swung.motion.idle
    results = screwgauge.run(swung, [*ENGINES], ASKED)
    agreed(results)
    found = rates(results, "screw")
    pole = swung.mechanism.bodies[-1].name
    assert found[f"{pole}.vx/{cart.name}"] == pytest.approx([1.0, 1.0], rel=1e-15, abs=0)
    assert not found[f"{pole}.wy/{cart.name}"].any()


@pytest.mark.parametrize("backend", ["array", "numpy"])
def test_programs_and_arrays_agree(scene, backend):
    moved = scene("3ups-upu-s")
    found = ask("screw", model_files("3ups-upu-s", "screw"), moved.problem(ASKED), backend=backend).values["jacobian"]
    right = rates(screwgauge.run(moved, ["lagrange"]), "lagrange")
    expected = np.stack([right[name] for name in found.components], axis=1)
    assert found.array == pytest.approx(expected, rel=0, abs=1e-11 * np.abs(expected).max())


def test_the_judge_faults_rates_that_are_off(scene, monkeypatch):
    from screwgauge.engines.kit import rates as kit
    from screwgauge.engines.tree import inverse

    def off(*given, **more):
        array, condition = kit.per_actuator(*given, **more)
        return 1.001 * array, condition

    monkeypatch.setattr(inverse, "per_actuator", off)
    results = screwgauge.run(scene("five-bar"), ["screw", "mujoco"])
    assert results.exit_status == 1
    assert {*results.faults["engine"]} == {"mujoco"}
    assert {*results.faults["residual"]} == {"jacobian"}


def test_a_table_of_it_is_read_back(scene, tmp_path):
    moved = scene("five-bar")
    file, path = tmp_path / "rates.csv", moved.file
    assert main(["run", str(path), "--engines", "screw", "--csv", str(file), "--out", str(tmp_path / "out")]) == 0
    text = path.read_text(encoding="utf-8").replace("time =", f'tables.mine = "{file}"\ntime =')
    path.write_text(text, encoding="utf-8")
    agreed(screwgauge.run(screwgauge.load_scene(path), ["screw", "mine"]))


@pytest.mark.parametrize(
    "entry",
    [
        'name = "tip"\nbody = "nobody"',
        'body = "left.rod"',
        'name = "left.rod"\nbody = "left.rod"',
        'name = "tip"\nbody = "left.rod"\nat = [0, 0, 0]',
    ],
)
def test_bad_points_are_refused(write, entry):
    text = 'mechanism = "five-bar"\nmotion = { left = { offset = 0 }, right = { offset = 0 } }\n'
    with pytest.raises(ScrewgaugeError, match="points"):
        screwgauge.load_scene(write("points.toml", f"{text}time = {{ times = [0] }}\n[[points]]\n{entry}\n"))


def test_units_below_a_bar_are_converted_the_other_way():
    for unit, factor in {"mm/deg": 1e-3 / np.deg2rad(1), "mm/ms": 1.0, "mm/ms^2": 1e3, "rad/m": 1.0}.items():
        assert read_header(f"tip.vx/motor [{unit}]").factor == pytest.approx(factor, rel=1e-14, abs=0), unit
