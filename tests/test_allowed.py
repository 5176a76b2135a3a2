import json
import re
import shutil
import xml.etree.ElementTree as ET
from itertools import product
from pathlib import Path

import pytest

import screwgauge
from screwgauge import ScrewgaugeError, load_scene
from support.command import main
from support.models import Options, import_model
from support.repository import edited, worse

HEAD = """mechanism = "four-bar.toml"
engines = [{engines}]
time = {{ times = [0, 0.25, 0.5] }}
"""
MOVING = "motion.crank = { offset = 1.0, harmonics = [[20, 0.2, 0.1]] }\n"
STILL = "motion.crank.polynomial = [1.0]\n"
FORWARD = 'forward = {{ start.crank = 1.0, rtol = {0}, atol = {0} }}\nquantities = ["joint_position"]\n'
LOAD = '[[loads]]\non = "coupler"\nby = "environment"\nforce = [0, 0, {}]\n'
SPRING = '[[springs]]\ncoordinate = "a"\nstiffness = {}\n'
SIZES, FORCES = (0.5, 1e99), ("actuator_force", "tree_force")
#: What hides a difference of masses.
HIDING = {
    "still": STILL,
    "slow": "motion.crank.polynomial = [1.0, 1e-9]\n",
    "huge load": MOVING + LOAD.format("1e12"),
    "huge load, still": STILL + LOAD.format("-1e15"),
    "stiff spring": MOVING + SPRING.format("1e12"),
    "stiff spring, still": STILL + SPRING.format("1e15"),
    **{
        f"{names} alone": f'{MOVING}quantities = ["{names}"]\n'
        for names in ("joint_position", "joint_velocity", "joint_acceleration", "com_acceleration")
    },
    **{
        f"{quantity} to {size:g}": f'{MOVING}quantities = ["{quantity}"]\ntolerances.{quantity} = {size:g}\n'
        for size, quantity in product(SIZES, FORCES)
    },
    "coarse integration": FORWARD.format(0.5),
}
#: Key in ``allow`` -> change of the four-bar's MJCF.
EDITS = {
    "coupler.inertia": lambda text: worse(text, 0.01),
    "coupler.mass": lambda text: text.replace('mass="1.2"', 'mass="1.21"'),
    "model.gravity": lambda text: text.replace("-9.81", "-9.8"),
}


def gate(folder: Path, text: str, allow: tuple[str, ...] = (), engines: str = '"screw", "mujoco"') -> Path:
    head = f'{HEAD.format(engines=engines)}allow = {json.dumps(allow)}\nmodels.mujoco = "four-bar.xml"\n'
    (folder / "gate.toml").write_text(head + text, encoding="utf-8")
    return folder / "gate.toml"


@pytest.mark.slow
@pytest.mark.parametrize("smoke", [False, True])
@pytest.mark.parametrize("hiding", HIDING)
def test_whatever_hides_a_known_difference_the_gate_is_not_green(theirs, hiding, smoke):
    file = gate(theirs, HIDING[hiding])
    assert screwgauge.check(file, smoke=smoke).ok
    edited(theirs / "four-bar.xml", EDITS["coupler.inertia"])
    found = screwgauge.check(file, smoke=smoke)
    assert found.exit_status == 1, found
    assert "coupler: inertia yy" in found.rows[0].sentence


@pytest.mark.parametrize("key", EDITS)
def test_what_the_scene_allows_passes_and_is_named(theirs, key):
    edited(theirs / "four-bar.xml", EDITS[key])
    tolerant = "".join([MOVING, *(f"tolerances.{name} = 1e-2\n" for name in FORCES), 'quantities = ["actuator_force"]'])
    others = tuple({*EDITS} - {key})
    assert screwgauge.check(gate(theirs, tolerant, others)).rows[0].status == "unlike"
    found = screwgauge.check(gate(theirs, tolerant, (key,)))
    assert (found.exit_status, [*found.rows[0].admitted]) == (0, [key]), found
    assert str(found).startswith("✓ OK, but:")


def test_a_run_ends_with_the_same_word(theirs, command):
    edited(theirs / "four-bar.xml", EDITS["coupler.inertia"])
    results = screwgauge.run(screwgauge.load_scene(gate(theirs, STILL)))
    assert (results.outcome, results.exit_status, bool(results)) == ("unlike", 1, False)
    assert {*results.mismatches} == {"coupler.inertia"}
    assert command("run", gate(theirs, STILL), status=1).out.startswith("✗ MODELS DIFFER")
    assert main(["run", str(gate(theirs, STILL, ("coupler.inertia",))), "--out", "allowed"]) == 0


@pytest.mark.parametrize("motion", [MOVING, STILL])
def test_inertia_that_no_engine_has_is_allowed_by_its_joint(theirs, motion):
    edited(theirs / "four-bar.xml", lambda text: text.replace('<joint name="a" ', '<joint name="a" armature="0.5" '))
    (row,) = screwgauge.check(gate(theirs, motion)).rows
    assert (row.status, 'allow = ["a.armature"]' in row.sentence) == ("rigid", True)
    found = screwgauge.check(gate(theirs, motion, ("a.armature",)))
    assert (found.exit_status, [*found.rows[0].admitted]) == (0, ["a.armature"])


@pytest.mark.parametrize("engine", ["screw", "pinocchio"])
def test_descriptions_and_urdf_are_compared_as_mjcf_is(theirs, engine):
    file = {"screw": "own.toml", "pinocchio": "four-bar.urdf"}[engine]
    shutil.copy(theirs / "four-bar.toml", theirs / "own.toml")
    scene = gate(theirs, STILL, engines='"mujoco", "screw", "pinocchio"')
    edited(scene, lambda text: text.replace('models.mujoco = "four-bar.xml"', f'models.{engine} = "{file}"'))
    assert screwgauge.check(scene).ok
    masses = {"screw": ("mass = 1.2", "mass = 1.21"), "pinocchio": ('mass value="1.2"', 'mass value="1.21"')}
    edited(theirs / file, lambda text: text.replace(*masses[engine]))
    (row,) = screwgauge.check(scene).rows
    assert not row.ok
    assert "coupler: mass" in row.sentence


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("cuopler.inertia", "did you mean 'coupler'"),
        ("coupler.inertai", "did you mean 'inertia'"),
        ("coupler", "unknown property"),
        ("", "unknown property"),
        (".mass", "unknown body or joint"),
        ("models.pinocchio.unread", "did you mean 'models.mujoco'"),
        ("coupler.unread", "choose one of: models.mujoco"),
    ],
)
def test_entries_of_nothing_are_refused_with_the_names_there_are(theirs, entry, message):
    (row,) = screwgauge.check(gate(theirs, MOVING, (entry,))).rows
    assert (row.status, message in row.sentence) == ("refused", True), row.sentence


def test_an_entry_that_admits_nothing_is_named(theirs):
    (row,) = screwgauge.check(gate(theirs, MOVING, ("coupler.inertia", "models.mujoco.unread"))).rows
    assert (row.status, len(row.doubts)) == ("agree", 2)
    alone = screwgauge.run(screwgauge.load_scene(gate(theirs, MOVING, ("coupler.inertia",))), ["screw"])
    assert not alone.doubts  # whether the file of another engine differs is not known


def test_a_file_may_be_left_unread(theirs):
    assert screwgauge.check(gate(theirs, MOVING, engines='"screw"')).rows[0].status == "unread"
    found = screwgauge.check(gate(theirs, MOVING, ("models.mujoco.unread",), engines='"screw"'))
    assert (found.exit_status, [*found.rows[0].admitted]) == (0, ["models.mujoco.unread"])


@pytest.mark.parametrize(("size", "said"), [(1e-2, False), (0.011, True), (1e99, True)])
@pytest.mark.parametrize("of", ["scene", "file"])
def test_tolerances_above_a_hundredth_stand_in_the_last_line_everywhere(theirs, size, said, of):
    given = {"actuator_force": size}
    text = MOVING + (f"tolerances.actuator_force = {size:g}\n" if of == "scene" else "")
    found = screwgauge.check(gate(theirs, text), tolerances=given if of == "file" else None)
    assert found.ok
    assert (f"actuator_force to {size:.3g} (gate)" in str(found).splitlines()[-1]) is said
    told = ET.fromstring(found.junit()).find("testcase/system-out")
    assert (told is not None and f"actuator_force to {size:.3g}" in told.text) is said
    assert [line.partition(" ")[0] for line in found.annotations()] == ["::warning"] * said


def test_the_tolerance_of_a_coarse_integration_is_wide(theirs):
    (row,) = screwgauge.check(gate(theirs, HIDING["coarse integration"])).rows
    assert [each.partition(" ")[0] for each in row.admitted] == ["joint_position"]


def test_a_gate_drops_no_but(theirs):
    edited(theirs / "four-bar.urdf", lambda text: re.sub(r'effort="[^"]*"', 'effort="7"', text, count=1))
    scene = gate(theirs, MOVING, engines='"screw", "pinocchio"')
    edited(scene, lambda text: text.replace('models.mujoco = "four-bar.xml"', 'models.pinocchio = "four-bar.urdf"'))
    results = screwgauge.run(screwgauge.load_scene(scene))
    assert (results.outcome, len(results.reservations)) == ("agree", 1)
    found = screwgauge.check(scene)
    assert [*found.rows[0].doubts] == results.reservations
    assert str(found).startswith("✓ OK, but:")
    assert results.reservations[0][:40] in str(found)


@pytest.mark.parametrize("engine", ["mujoco", "screw"])
def test_one_engine_alone_hides_nothing(theirs, engine):
    edited(theirs / "four-bar.xml", EDITS["coupler.inertia"])
    allow = ("coupler.inertia",)
    statuses = [screwgauge.check(gate(theirs, STILL, some, f'"{engine}"')).rows[0].status for some in ((), allow)]
    assert statuses == (["unlike", "judged"] if engine == "mujoco" else ["unread", "unread"])


BODY = '<body name="a"><joint name="j"/><inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/></body>'
OUTSIDE = {
    "m.xml": (
        "<mujoco><include file='../parts/p.xml'/></mujoco>",
        f"<mujoco><worldbody>{BODY}</worldbody></mujoco>",
        "p.xml",
    ),
    "m.sdf": (
        "<sdf version='1.9'><world name='w'><include><uri>../parts/p.sdf</uri></include></world></sdf>",
        "<sdf version='1.9'><model name='p'><link name='a'/></model></sdf>",
        "p.sdf",
    ),
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_files_outside_the_folder_are_opened_with_leave(name, tmp_path, command):
    text, part, file = OUTSIDE[name]
    for folder in ("here", "parts"):
        (tmp_path / folder).mkdir()
    (tmp_path / "here" / name).write_text(text, encoding="utf-8")
    (tmp_path / "parts" / file).write_text(part, encoding="utf-8")
    path = tmp_path / "here" / name
    with pytest.raises(ScrewgaugeError, match="lies outside the model's folder"):
        import_model(path)
    for leave in ("../parts/", f"../parts/{file}"):
        assert "a" in import_model(path, Options(allow=[leave])).mechanism.body_index
    assert command("import", path, "-o", tmp_path / "out.toml", "--allow", "../parts/").out
    with pytest.raises(ScrewgaugeError, match="lies outside the model's folder"):
        import_model(path, Options(allow=["../other/"]))


def test_a_scene_allows_meshes_and_files_outside(tmp_path):
    for folder in ("here", "parts"):
        (tmp_path / folder).mkdir()
    text, part, file = OUTSIDE["m.xml"]
    (tmp_path / "here" / "m.xml").write_text(text, encoding="utf-8")
    (tmp_path / "parts" / file).write_text(part, encoding="utf-8")
    scene = tmp_path / "here" / "s.toml"
    motion = "motion.j.harmonics = [[1, 0.1, 0]]\ntime = { duration = 1, step = 0.5 }\n"
    scene.write_text(f'mechanism = "m.xml"\n{motion}', encoding="utf-8")
    with pytest.raises(ScrewgaugeError, match="lies outside the model's folder"):
        load_scene(scene)
    scene.write_text(f'mechanism = "m.xml"\nallow = ["../parts/", "meshes"]\n{motion}', encoding="utf-8")
    assert load_scene(scene).mechanism.body("a").mass == 1.0
    assert screwgauge.run(load_scene(scene), ("screw", "mujoco"), ("generalized_force",)).ok
