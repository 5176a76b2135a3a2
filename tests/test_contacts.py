import math
import re

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.biped import BASE, LINK, SOLE, biped, contact, gait
from support.data import data
from support.engines import IN_DOUBLES
from support.gate import Item, files_in
from support.judging import agreed
from support.stance import needed, unbalanced

TIME = "time = { duration = 1, step = 0.1 }\n"


@pytest.fixture
def stand(tmp_path):

    def stood(text: str, legs: int = 1, more: str = "") -> screwgauge.Scene:
        (tmp_path / "biped.toml").write_text(biped(legs) + more)
        (tmp_path / "stand.toml").write_text(f'mechanism = "biped.toml"\n{text}')
        return screwgauge.load_scene(tmp_path / "stand.toml")

    return stood


def one_foot(kind: str = "weld", more: str = "") -> str:
    return TIME + gait(1) + contact("foot1", kind, more)


def two_feet(second: str = "") -> str:
    return TIME + gait(1) + (second or gait(2)) + contact("foot1") + contact("foot2")


def columns(results, quantity: str, engine: str, names: list[str]) -> np.ndarray:
    every = [*results.components(quantity)]
    return results.values(quantity, engine)[:, [every.index(name) for name in names]]


@pytest.mark.slow
@pytest.mark.parametrize("feet", [1, 2])
def test_stance_agrees_and_contacts_carry_weight_and_inertia(stand, feet):
    scene = stand(one_foot() if feet == 1 else two_feet(), feet)
    results = agreed(screwgauge.run(scene, engines=IN_DOUBLES))
    assert (results.errors[results.errors["quantity"] == "actuator_force"]["max_scaled"] < 1e-11).all()
    assert len(results.components("actuator_force")) == 3 * feet
    for engine in IN_DOUBLES:
        assert unbalanced(scene, results, engine, [f"foot{k}.contact" for k in range(1, feet + 1)]) < 1e-12


@pytest.mark.slow
def test_weld_is_the_fixed_joint_that_a_description_has(stand):
    scene = stand(one_foot())
    height = 0.9 - 2 * LINK * math.cos(0.2) + SOLE[2]
    stance = f"""
[joints.stance]
kind = "fixed"
parent = "ground"
child = "foot1"
parent_frame.position = [{SOLE[0]}, 0, {height!r}]
child_frame.position = [{SOLE[0]}, 0, {SOLE[2]}]
"""
    joints = "independent = { hip1 = 'hip1', knee1 = 'knee1', ankle1 = 'ankle1' }"
    text = re.sub(r"\[independent\]\n(\".*\n)*", "", biped()).replace('name = "biped"\n', f'name = "biped"\n{joints}\n')
    folder = scene.file.parent
    (folder / "fixed.toml").write_text(text + stance)
    (folder / "twin.toml").write_text(f'mechanism = "fixed.toml"\n{TIME}{gait(1)}')
    twin = screwgauge.load_scene(folder / "twin.toml")
    forces = [screwgauge.run(each, engines=["screw"]).values("actuator_force", "screw") for each in (scene, twin)]
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-12, atol=1e-12 * np.abs(forces[0]).max())


@pytest.mark.slow
def test_given_motion_of_a_base_takes_what_the_ground_would_exert(stand):
    base = "".join(
        f'motion."{name}" = {{ offset = 0.{k}, harmonics = [[{k}, 0.1, 0.2]] }}\n' for k, name in enumerate(BASE, 2)
    )
    scene = stand(TIME + gait(1) + base)
    results = agreed(screwgauge.run(scene, engines=[*IN_DOUBLES, "lagrange"]))
    assert results.components("actuator_force") == ("hip1", "knee1", "ankle1", *BASE)
    for engine in ("screw", "mujoco"):
        force = needed(scene, results, engine)[:, :3]
        exerted = columns(results, "actuator_force", engine, [*BASE[:3]])
        assert np.abs(exerted - force).max() < 1e-12 * np.abs(force).max()
    assert any("ground would have to exert" in sentence and "base.q3" in sentence for sentence in results.warnings)


@pytest.mark.slow
def test_truth_knows_contacts_and_held_bases(stand):
    pytest.importorskip("flint")
    agreed(screwgauge.run(stand(one_foot()).at([0.0, 0.5]), engines=["truth", "screw"]))
    base = "".join(f'motion."{name}" = {{ harmonics = [[2, 0.1, 0.2]] }}\n' for name in BASE)
    results = agreed(screwgauge.run(stand(TIME + gait(1) + base).at([0.0, 0.5]), engines=["truth", "screw"]))
    assert results.components("actuator_force")[3:] == BASE


@pytest.mark.slow
def test_welded_base_has_its_wrench_among_reactions(stand):
    scene = stand(TIME + gait(1) + '[[contacts]]\nbody = "torso"\nkind = "weld"\nname = "crane"\n')
    results = agreed(screwgauge.run(scene, engines=IN_DOUBLES))
    held = columns(results, "reaction", "screw", [f"crane.{axis}.coupling" for axis in "xyz"])
    force = needed(scene, results, "screw")[:, :3]
    assert np.abs(held - force).max() < 1e-12 * np.abs(force).max()


def test_contacts_hold_bodies_where_the_motion_starts(stand):
    scene = stand(one_foot())
    joint = scene.mechanism.joint("foot1.contact")
    np.testing.assert_allclose(joint.parent_frame.p, [SOLE[0], 0, 0.9 - 2 * LINK * np.cos(0.2) + SOLE[2]], atol=1e-15)
    assert scene.mechanism.home[2] == 0.9
    later = scene.at([0.5, 0.7])
    assert later.mechanism is scene.mechanism
    assert not scene.changed


def test_stance_says_where_the_other_leg_stands(stand):
    free = TIME + gait(1) + contact("foot1") + contact("foot2")
    scene = stand(free + "[stance]\nknee2 = 0.6\nhip2 = -0.3\nankle2 = -0.3\n", 2)
    assert scene.mechanism.joint("knee2").home == 0.6
    assert [*scene.mechanism.independent] == ["hip1", "knee1", "ankle1"]
    with pytest.raises(ScrewgaugeError, match="knee1"):
        stand(free + "[stance]\nknee1 = 0.6\n", 2)
    with pytest.raises(ScrewgaugeError, match="needs a contact"):
        stand(TIME + gait(1) + "[stance]\nknee1 = 0.6\n")


def test_rule_and_what_follows_are_named(stand):
    said = " ".join(stand(two_feet(), 2).mechanism.remarks)
    assert "6 actuators drive 3 freedoms" in said
    assert "min_norm" in said
    assert "hip2, knee2, ankle2 follow from hip1, knee1, ankle1" in said
    assert "slide" not in said


def test_motion_that_slides_a_foot_says_how_far(stand):
    said = " ".join(stand(two_feet(gait(2, hip=0.102)), 2).mechanism.remarks)
    t = np.linspace(0.0, 1.0, 11)
    off = 0.002 * np.sin(3 * t)  # of the hip, about which the sole turns
    knee, ankle = 0.4 + 0.1 * np.sin(4 * t), -0.2 + 0.05 * np.sin(5 * t)
    sole = -1j * LINK * (1 + np.exp(-1j * knee)) + complex(SOLE[0], SOLE[2]) * np.exp(-1j * (knee + ankle))
    way = (2 * np.sin(np.abs(off) / 2) * np.abs(sole)).max()
    found = re.search(r"slide 'foot2.contact' by ([\d.]+) mm and ([\d.]+) mrad", said)
    assert found, said
    assert float(found[1]) == pytest.approx(1e3 * way, rel=5e-3)
    assert float(found[2]) == pytest.approx(1e3 * np.abs(off).max(), rel=5e-3)
    with pytest.raises(ScrewgaugeError, match=r"slide 'foot2.contact' by \d+ mm.*remove hip2, knee2, ankle2 from"):
        stand(two_feet(gait(2, hip=0.3)), 2)


def test_straight_legs_are_named(stand):
    straight = two_feet(gait(2, knee=0.0)).replace(gait(1), gait(1, knee=0.0))
    with pytest.raises(ScrewgaugeError, match="hip1, knee1, ankle1, hip2, knee2, ankle2"):
        stand(straight, 2)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (contact("fot1"), "did you mean 'foot1'"),
        (contact("ground"), "unknown body"),
        (contact("foot1", "glue"), "weld, hinge, point"),
        (contact("foot1", "hinge"), "axis"),
        (contact("foot1", "hinge", "axis = [0, 0, 0]"), "zero"),
        (contact("foot1", "hinge", "axis = [0, 2, 0]"), "norm 2"),
        (contact("foot1", "weld", "axis = [0, 1, 0]"), "a weld has no axis"),
        (contact("foot1", "weld", "name = 'hip1'"), "'hip1' is already"),
        (contact("foot1", "weld", "name = 'base.x'"), "'base.x' is already"),
        (contact("foot1", "weld", "name = 'no name'"), "is not a name"),
        (contact("foot1") + contact("foot1"), "two contacts have the name"),
        (contact("foot1") + contact("foot1", "weld", "name = 'b'"), "remove one of these joints"),
        (contact("foot1") + contact("torso"), "no degree of freedom"),
        ("contacts = 3\n", "not a list"),
        (contact("foot1") + "[models]\nmujoco = 'own.xml'\n", "are not in own.xml"),
        (contact("foot1", "weld", "pont = 3"), "unknown key 'pont'"),
    ],
)
def test_contacts_that_cannot_be_are_refused_by_name(stand, lines, says):
    text = TIME + gait(1)
    with pytest.raises(ScrewgaugeError) as caught:
        stand(lines + text if lines.startswith("contacts") else text + lines)
    assert says in str(caught.value)


ROD = data("rod-part.toml")


@pytest.mark.parametrize(
    ("more", "says"),
    [("", "no degree of freedom"), (ROD.format("b", "a"), "hold a, so that no coordinate")],
    ids=["all", "b"],
)
def test_contacts_that_hold_what_is_driven_are_refused(more, says, tmp_path):
    independent = "independent = { a = 'a', b = 'b' }" if more else "independent = { a = 'a' }"
    rods = f'name = "rods"\n{independent}\n{ROD.format("a", "ground")}actuated = true\n{more}'
    (tmp_path / "rods.toml").write_text(rods)
    lines = 'motion.a.offset = 0.3\n[[contacts]]\nbody = "a"\nkind = "weld"\n'
    (tmp_path / "held.toml").write_text(f'mechanism = "rods.toml"\n{TIME}{lines}')
    with pytest.raises(ScrewgaugeError, match=says):
        screwgauge.load_scene(tmp_path / "held.toml")


@pytest.mark.slow
def test_foot_on_a_hinge_tips_by_the_forces(stand):
    scene = stand("time = { duration = 0.2, step = 0.05 }\n" + gait(1) + contact("foot1", "hinge", "axis = [0, 1, 0]"))
    assert [freedom.label for freedom in scene.undriven] == ["foot1.contact"]
    agreed(screwgauge.run(scene))


@pytest.mark.slow
def test_hand_of_a_fixed_base_slides_on_a_point(tmp_path):
    arm = screwgauge.load_scene("arm7")
    body = arm.mechanism.bodies[-1].name
    labels = ["q1", "q2", "q3", "q7"]
    motion = "".join(f"motion.{label} = {{ offset = 0.4, harmonics = [[3, 0, 0.1]] }}\n" for label in labels)
    (tmp_path / "touch.toml").write_text(
        f'mechanism = "arm7"\n{TIME}{motion}[[contacts]]\nbody = "{body}"\nkind = "point"\npoint = [0, 0, 0.1]\n'
    )
    scene = screwgauge.load_scene(tmp_path / "touch.toml")
    assert [*scene.mechanism.independent] == labels
    agreed(screwgauge.run(scene, engines=IN_DOUBLES))


@pytest.mark.slow
def test_simulation_holds_contacts(stand):
    start = "forward.start = { hip1 = -0.2, knee1 = 0.4, ankle1 = -0.2 }"
    lines = f"time = {{ duration = 0.3, step = 0.1 }}\n{start}\n{contact('foot1')}"
    agreed(screwgauge.run(stand(lines), engines=["screw", "mujoco"]))


def test_columns_of_a_motion_choose_what_is_independent(stand, tmp_path):
    t = np.linspace(0.0, 1.0, 5)
    rows = np.stack([t, *[x for start in (-0.2, 0.4, -0.2) for x in (start + 0.0 * t, 0.0 * t, 0.0 * t)]], axis=1)
    names = ["t", *[f"{name}1{order}" for name in ("hip", "knee", "ankle") for order in ("", "d", "dd")]]
    lines = [",".join([*names, "note"]), *(",".join([*map(repr, row.tolist()), "text"]) for row in rows)]
    (tmp_path / "gait.csv").write_text("\n".join(lines) + "\n")
    scene = stand('motion.csv = "gait.csv"\n' + contact("foot1"))
    assert [*scene.mechanism.independent] == ["hip1", "knee1", "ankle1"]


def test_gate_says_what_contacts_are_taken_for(stand):
    row = screwgauge.check(stand(one_foot()).file).rows[0]
    assert row.ok
    assert any("pull as well as push" in sentence for sentence in row.remarks)


def test_gate_finds_its_rows_again_though_descriptions_are_made_anew(stand):
    item = Item("stand", (str(stand(one_foot()).file),))
    before = files_in(item)
    assert {path.name for path in before} == {"stand.toml", "biped.toml"}
    assert files_in(item) == before
