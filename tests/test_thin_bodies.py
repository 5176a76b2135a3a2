import re
from collections.abc import Callable, Sequence
from pathlib import Path

import mujoco
import numpy as np
import pytest
import tomli_w

import screwgauge
from screwgauge import load_scene
from screwgauge.models.mjcf import inertial, without_stand_ins
from support.data import data
from support.engines import IN_DOUBLES
from support.geometry import Array, quaternion_rotation, rotation
from support.judging import agreed
from support.mechanism import Body, load_mechanism, mechanism_tables
from support.models import left_out, write_models

#: Of the largest moment: rounding of a quaternion and of the product that turns moments with it.
TURNED = 3e-15
#: The same of what MuJoCo's compiler turns itself, see `models.check`.
COMPILED = 5e-14
UP = np.nextafter(0.3, 1.0)
MOMENTS = {
    "point": (0.0, 0.0, 0.0),
    "rod": (0.0, 1.0, 1.0),
    "plate": (0.1, 0.2, 0.3),
    "plate of decimals": (0.1, 0.2, 0.1 + 0.2),
    "more than a plate by rounding": (0.1, 0.2, float(np.nextafter(0.1 + 0.2, 1.0))),
    "two lengths by rounding": (0.0, 0.3, float(UP)),
    "almost a rod": (1e-14, 1.0, 1.0),
    "nearly singular": (1e-9, 0.4, 0.4),
    "below zero by rounding": (-1e-16, 1.0, 1.0),
    "block": (0.2, 0.3, 0.4),
    "ball": (1.0, 1.0, 1.0),
}
TURNS = {"straight": (0.0, 0.0, 0.0), "along y": (0.0, 0.0, np.pi / 2), "askew": (0.3, -1.1, 0.7)}


def body(moments: Array, turn: tuple[float, ...], size: float) -> Body:
    R = np.eye(3)
    for axis, angle in zip(np.eye(3), turn, strict=True):
        R = R @ rotation(axis, np.array(angle))
    I = R @ np.diag(size * np.array(moments)) @ R.T if any(turn) else np.diag(size * np.array(moments))
    return Body("b", 1.0, np.array([0.1, -0.2, 0.3]), 0.5 * (I + I.T))


def compiled(one: Body) -> mujoco.MjModel:
    said = " ".join(f'{name}="{text}"' for name, text in inertial(one).items())
    text = (
        '<mujoco><compiler boundinertia="0" balanceinertia="false"/><worldbody><body><joint type="slide"/>'
        f"<inertial {said}/></body></worldbody></mujoco>"
    )
    return mujoco.MjModel.from_xml_string(text)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS)
@pytest.mark.parametrize("moments", MOMENTS.values(), ids=MOMENTS)
def test_mujoco_has_the_tensor_that_the_description_has(moments, turn, size) -> None:
    one = body(moments, turn, size)
    model, full = compiled(one), "fullinertia" in inertial(one)
    _, found = without_stand_ins(model.body_mass, model.body_inertia)
    R = quaternion_rotation(model.body_iquat[1])
    off = np.abs(R @ np.diag(found[1]) @ R.T - one.inertia).max()
    assert off <= (COMPILED if full or 1e-14 in moments else TURNED) * np.abs(one.inertia).max()
    np.testing.assert_array_equal(model.body_ipos[1], one.com)
    assert np.abs(model.body_inertia[1] - found[1]).max() <= 1e-15


def test_a_moment_that_no_mjcf_can_say_and_that_counts_is_not_replaced() -> None:
    """MuJoCo compares with 1e-15 kg m^2, whatever the mechanism's size."""
    with pytest.raises(ValueError, match="mass and inertia"):
        compiled(body((0.3, 0.4, 0.5), TURNS["askew"], 1e-15))


def test_a_tensor_that_no_body_has_is_written_as_one_that_can_be_and_said(arm: Callable[..., Path]) -> None:
    """Descriptions may miss A + B >= C by 1e-12 of the trace, MuJoCo by nothing."""
    mechanism = load_mechanism(arm(bob([0, 0, 1], xx=1, yy=1, zz=-1e-12)))
    (_, sentence) = left_out(mechanism)
    assert re.match(r"MJCF: .* bob differs .* by 1e-12 kg m\^2", sentence)


#: Motion of the double pendulum.
MOVED = """
motion.one.polynomial = [0.1, 1, 2]
motion.two.harmonics = [[5, 0.3, 0.2]]
time = { duration = 0.4, step = 0.1 }
"""


def bob(com: Sequence[float], mass: float = 1, **inertia: float) -> str:
    entries = ", ".join(f"{key} = {value}" for key, value in inertia.items())
    return f"bob = {{ mass = {mass}, com = {[*com]}, inertia = {{ {entries} }} }}"


@pytest.fixture
def arm(write) -> Callable[..., Path]:
    return lambda bob: write("arm.toml", data("rod-and-bob.toml").format(bob=bob))


def test_what_stands_for_zero_is_named_in_the_file_by_models_and_by_a_run(arm, write, tmp_path) -> None:
    path = arm(bob([0.2, 0, 0.4], 1.3))
    mechanism = load_mechanism(path)
    (sentence,) = left_out(mechanism)
    assert re.search(r"1e-15 kg m\^2 .* rod, bob", sentence)
    write_models(mechanism, tmp_path / "models")
    assert sentence.removeprefix("MJCF: ") in (tmp_path / "models" / "arm.xml").read_text(encoding="utf-8")
    scene = write("s.toml", f'mechanism = "{path.name}"\n{MOVED}')
    results = screwgauge.run(load_scene(scene), engines=["mujoco"])
    assert sentence.removeprefix("MJCF: ") in results.solutions["mujoco"].notes


def test_a_mechanism_without_thin_bodies_says_nothing(paper) -> None:
    assert not left_out(paper)


@pytest.mark.slow
@pytest.mark.parametrize(
    "bob",
    [
        bob([0.2, 0, 0.4], 1.3),
        "bob = { mass = 1.3, inertia = {} }",  # on its own axis, where it has no inertia at all
        "bob = { mass = 0 }",
        bob([0.03, 0.04, 0], 1e-3, xx=6.4e-7, yy=3.6e-7, zz=1e-6, xy=-4.8e-7),
        bob([0, 0, 1], xx=1, yy=1, zz=-1e-12),
    ],
    ids=["point", "point on its axis", "nothing", "thin along its axis", "impossible by 1e-12"],
)
def test_forces_of_thin_bodies_agree_in_all_engines(bob, arm, write) -> None:
    scene = load_scene(write("s.toml", f'mechanism = "{arm(bob).name}"\n{MOVED}'))
    agreed(screwgauge.run(scene, engines=["truth", *IN_DOUBLES]))


@pytest.mark.slow
def test_a_platform_on_legs_without_axial_inertia_agrees_in_all_engines(write) -> None:
    tables = mechanism_tables("stewart")
    for name, one in tables["bodies"].items():
        if name != "platform":
            axis = np.array(tables["joints"][f"{name.split('.')[0]}.slide"]["axes"][0], dtype=float)
            I = 0.01 * float(one["mass"]) * (axis @ axis * np.eye(3) - np.outer(axis, axis))
            entries = {f"{'xyz'[i]}{'xyz'[j]}": float(I[i, j]) for i in range(3) for j in range(i, 3)}
            one["inertia"] = entries
    write("rods.toml", tomli_w.dumps({**tables, "name": "rods"}))
    scene = (Path(screwgauge.__file__).parent / "scenes" / "stewart.toml").read_text(encoding="utf-8")
    path = write("s.toml", scene.replace('mechanism = "stewart"', 'mechanism = "rods.toml"'))
    agreed(screwgauge.run(load_scene(path).at([0.0, 0.3, 1.1]), engines=IN_DOUBLES))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a01-pendulum", "a04-bricard-thin"])
def test_thin_mechanisms_fall_alike_in_all_engines(name: str) -> None:
    results = screwgauge.run(load_scene(name).at([0.0, 0.05, 0.1]))
    assert [*results.solutions][:3] == ["screw", "pinocchio", "mujoco"]
    agreed(results)


def test_a_fix_gives_an_mjcf_a_thin_rod(arm, write, tmp_path) -> None:
    rod = bob([0.3, 0.4, 0], xx=6.4e-3, yy=3.6e-3, zz=1e-2, xy=-4.8e-3)
    thick = bob([0.3, 0.4, 0], xx=2e-2, yy=2e-2, zz=2e-2, xy=-4.8e-3)
    for name, body in (("a", rod), ("b", thick)):
        write_models(load_mechanism(arm(body)), tmp_path / name)
    b, fixed = tmp_path / "b" / "arm.xml", tmp_path / "fixed.xml"
    found = screwgauge.diagnose(tmp_path / "a" / "arm.urdf", b)
    assert found.exit_status == 1
    found.write_fix(fixed)
    assert screwgauge.diagnose(tmp_path / "a" / "arm.urdf", fixed).exit_status == 0
