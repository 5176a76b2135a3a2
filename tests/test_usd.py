"""USD is read as UsdPhysics has it: units, matter, joints between frames, loops, drives, mimics, files beside."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.geometry import quaternion, rotation_matrix
from support.graphs import usd_name, usd_of, wanted
from support.mechanism import load_mechanism
from support.models import Imported, Options, Wanted, description, import_model, write_models
from support.motions import forces, worst
from support.readings import Reading, read

pxr = pytest.importorskip("pxr", reason="usd-core (extra: usd)")

#: Rounding of what a file states in few digits, and of 32 bits; both times the condition of closed loops.
FORCES, SINGLE = 1e-11, 1e-6
#: Mechanism, kind of the joints that close its loops, and what its numbers are rounded to in a file.
CASES = [
    ("slider-crank", "P", FORCES),
    ("five-bar", "R", FORCES),
    ("3-upu", "U", SINGLE),
    ("3-rps", "S", SINGLE),
    ("rccc", "C", SINGLE),
    ("delta", "S", SINGLE),
    ("double-cardan", "U", SINGLE),
    ("sarrus", "R", SINGLE),
    ("arm7", "", SINGLE),
]
HEAD = '#usda 1.0\n(\ndefaultPrim = "w"\nmetersPerUnit = {unit}\nkilogramsPerUnit = {kilo}\nupAxis = "{up}"\n)\n'
BODY = (
    'def {kind} "{name}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI", "PhysicsCollisionAPI"]) '
    "{{\ndouble3 xformOp:translate = ({at})\n"
    'uniform token[] xformOpOrder = ["xformOp:translate"]\n{more}\n}}\n'
)
MASS = (
    "float physics:mass = {}\nfloat3 physics:diagonalInertia = (0.1, 0.2, 0.25)\n"
    "point3f physics:centerOfMass = (0, 0, 1)"
)


def body(name: str, at: str = "0, 0, 0", more: str = MASS.format(2), kind: str = "Xform") -> str:
    return BODY.format(name=name, at=at, more=more, kind=kind)


def joint(name: str, kind: str, body0: str, body1: str, more: str = "", api: str = "") -> str:
    ends = "".join(f"rel physics:body{k} = </w/{b}>\n" for k, b in enumerate((body0, body1)) if b)
    return f'def Physics{kind}Joint "{name}" (prepend apiSchemas = [{api or chr(34) * 2}]) {{\n{ends}{more}\n}}\n'


def stage(parts: str, unit: float = 1.0, kilo: float = 1.0, up: str = "Z", scene: str = "") -> str:
    head = HEAD.format(unit=unit, kilo=kilo, up=up)
    return f'{head}def Xform "w" {{\ndef PhysicsScene "scene" {{\n{scene}\n}}\n{parts}\n}}\n'


def reading(tmp_path: Path, text: str) -> Reading:
    (tmp_path / "m.usda").write_text(text, encoding="utf-8")
    return read(tmp_path / "m.usda", "screwgauge")


HINGE = joint("j", "Revolute", "", "a", 'uniform token physics:axis = "Y"')


def imported(name: str, last: str, unit: float, tmp_path: Path) -> Imported:
    """What import makes of a USD of a mechanism."""
    mechanism, file = load_mechanism(name), tmp_path / "m.usda"
    file.write_text(usd_of(mechanism, last, unit), encoding="utf-8")
    own = wanted(mechanism)
    independent = {label: usd_name(c) for label, c in own.independent.items()}
    return import_model(file, Options(wanted=Wanted(independent, [usd_name(c) for c in own.actuated])))


@pytest.mark.parametrize("unit", [1.0, 0.01])
@pytest.mark.parametrize(("name", "last", "bound"), CASES)
def test_a_usd_is_the_mechanism_that_it_was_made_of(name, last, bound, unit, tmp_path):
    mechanism, found = load_mechanism(name), imported(name, last, unit, tmp_path).mechanism
    one, other = (forces(m, m.home[m.independent_columns], tmp_path) for m in (mechanism, found))
    one, other = ({key: x for key, x in each.items() if key.startswith("generalized")} for each in (one, other))
    assert worst(one, other) < bound


@pytest.mark.parametrize(
    ("seed", "family"), [(12, "planar-4"), (11, "planar-5"), (19, "planar-6"), (2, "delta"), (22, "sarrus")]
)
def test_slides_and_hinges_of_loops_stand_at_right_angles_in_spite_of_32_bits(seed, family, tmp_path):
    mechanism = screwgauge.random(seed, family).mechanism
    (tmp_path / "m.usda").write_text(usd_of(mechanism), encoding="utf-8")
    assert len(import_model(tmp_path / "m.usda").mechanism.independent) == len(mechanism.independent)


def test_engines_agree_on_a_usd(tmp_path):
    imported("five-bar", "R", 1.0, tmp_path)
    results = screwgauge.run(screwgauge.load_scene(str(tmp_path / "m.usda")), ("screw", "pinocchio", "mujoco"))
    assert results.ok, results
    assert not results.failures


def test_a_usd_is_the_same_as_a_description_of_it(tmp_path):
    found = imported("slider-crank", "P", 0.01, tmp_path).mechanism
    (tmp_path / "found.toml").write_text(description(found), encoding="utf-8")
    write_models(found, tmp_path)
    assert screwgauge.diagnose(tmp_path / "m.usda", tmp_path / "found.toml").same
    other = screwgauge.diagnose(tmp_path / "m.usda", tmp_path / f"{found.name}.xml")
    assert not [fact for fact in other.differences if fact.kind == "model"]


def test_units_are_those_of_the_stage(tmp_path):
    more = MASS.format(500) + "\n"
    at = joint("j", "Revolute", "", "a", "point3f physics:localPos0 = (10, 0, 0)")
    found = reading(tmp_path, stage(body("a", "10, 0, 0", more) + at, unit=0.01, kilo=0.001))
    assert found.bodies["a"].pose[:3, 3] == pytest.approx([0.1, 0.0, 0.0])
    assert found.bodies["a"].mass == pytest.approx(0.5)
    assert found.bodies["a"].com == pytest.approx([0.0, 0.0, 0.01])
    assert np.diag(found.bodies["a"].inertia) == pytest.approx(1e-7 * np.array([0.1, 0.2, 0.25]))


@pytest.mark.parametrize(
    ("up", "scene", "gravity"),
    [
        ("Y", "", [0.0, -9.81, 0.0]),
        ("Z", "", [0.0, 0.0, -9.81]),
        ("Z", "vector3f physics:gravityDirection = (2, 0, 0)\nfloat physics:gravityMagnitude = 300", [3.0, 0.0, 0.0]),
        ("Z", "bool newton:gravityEnabled = 0", [0.0, 0.0, 0.0]),
    ],
)
def test_gravity_is_that_of_the_scene(up, scene, gravity, tmp_path):
    assert reading(tmp_path, stage(body("a") + HINGE, 0.01, up=up, scene=scene)).gravity == pytest.approx(gravity)


def test_moments_stand_along_principal_axes(tmp_path):
    R = rotation_matrix([{"axis": [0, 0, 1], "angle": 0.3}, {"axis": [1, 0, 0], "angle": 0.7}], "test")
    axes = ", ".join(map(repr, quaternion(R).tolist()))
    found = reading(
        tmp_path, stage(body("a", more=f"{MASS.format(1)}\nquatf physics:principalAxes = ({axes})") + HINGE)
    )
    wished = R @ np.diag([0.1, 0.2, 0.25]) @ R.T
    assert found.bodies["a"].inertia == pytest.approx(wished, abs=1e-7)


#: Collider and what is stated of its body -> mass and first moment about the middle.
COLLIDERS = {
    "box by density": ("Cube", "double size = 2\nfloat physics:density = 10", 80.0, 80.0 * 8 / 12),
    "box by mass": ("Cube", "double size = 2\nfloat physics:mass = 3", 3.0, 3.0 * 8 / 12),
    "ball of water": ("Sphere", "double radius = 0.5", 1000 * math.pi / 6, 1000 * math.pi / 6 * 0.1),
    "cylinder": (
        "Cylinder",
        'double radius = 1\ndouble height = 2\nuniform token axis = "X"\nfloat physics:density = 1',
        2 * math.pi,
        math.pi,
    ),
}


@pytest.mark.parametrize("case", COLLIDERS)
def test_colliders_give_what_mass_is_not_stated(case, tmp_path):
    kind, more, mass, moment = COLLIDERS[case]
    found = reading(tmp_path, stage(body("a", more=more, kind=kind) + HINGE)).bodies["a"]
    assert found.mass == pytest.approx(mass)
    assert found.inertia[0, 0] == pytest.approx(moment)


CUBE = (
    "point3f[] points = [(0,0,0), (1,0,0), (1,2,0), (0,2,0), (0,0,3), (1,0,3), (1,2,3), (0,2,3)]\n"
    "int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]\n"
    "int[] faceVertexIndices = [0,3,2,1, 4,5,6,7, 0,1,5,4, 1,2,6,5, 2,3,7,6, 3,0,4,7]\nfloat physics:density = 10\n"
)


def test_a_mesh_is_as_heavy_as_what_it_encloses(tmp_path):
    found = reading(tmp_path, stage(body("a", more=CUBE, kind="Mesh") + HINGE)).bodies["a"]
    assert found.mass == pytest.approx(60.0)
    assert found.com == pytest.approx([0.5, 1.0, 1.5])
    assert found.inertia == pytest.approx(5.0 * np.diag([13.0, 10.0, 5.0]), abs=1e-12)


def test_coordinates_are_those_of_the_frames_at_the_poses(tmp_path):
    turn = "quatf physics:localRot0 = (0.9800666, 0, 0.1986693, 0)\nquatf physics:localRot1 = (1, 0, 0, 0)\n"
    more = f'{turn}uniform token physics:axis = "Y"\nfloat physics:lowerLimit = -90\nfloat physics:upperLimit = 45'
    hinge = reading(tmp_path, stage(body("a") + joint("j", "Revolute", "", "a", more))).joints["j"]
    assert hinge.home == pytest.approx(-0.4, abs=1e-6)
    assert hinge.limits == pytest.approx((-math.pi / 2, math.pi / 4))
    slide = 'point3f physics:localPos0 = (0.25, 0, 0)\nuniform token physics:axis = "X"\nfloat physics:upperLimit = 3'
    found = reading(tmp_path, stage(body("a", "1, 0, 0") + joint("j", "Prismatic", "", "a", slide))).joints["j"]
    assert (found.home, found.limits) == (0.75, (-math.inf, 3.0))


@pytest.mark.parametrize("turns", [("rotX", "rotY"), ("rotY", "rotZ"), ("rotX", "rotZ"), ("rotX", "rotY", "rotZ")])
def test_angles_of_several_hinges_are_found_beyond_a_right_angle(turns, tmp_path):
    angles = dict(zip(turns, (2.5, -2.0, 0.3) if len(turns) == 2 else (2.5, -1.2, 0.3), strict=False))
    axes = {"rotX": [1, 0, 0], "rotY": [0, 1, 0], "rotZ": [0, 0, 1]}
    R = rotation_matrix([{"axis": axes[turn], "angle": angle} for turn, angle in angles.items()], "test")
    locked = [token for token in ("transX", "transY", "transZ", *axes) if token not in turns]
    bounds = [f"float limit:{each}:physics:low = 1\nfloat limit:{each}:physics:high = -1" for each in locked]
    bounds += [f"float limit:{turn}:physics:low = -179" for turn in turns]
    more = "\n".join([*bounds, f"quatf physics:localRot1 = ({', '.join(map(repr, quaternion(R).tolist()))})"])
    api = ", ".join(f'"PhysicsLimitAPI:{token}"' for token in (*locked, *turns))
    found = reading(tmp_path, stage(body("a") + joint("j", "", "", "a", more, api)))
    assert [found.joints[f"j.{turn}"].home for turn in turns] == pytest.approx([*angles.values()], abs=1e-6)
    assert not any("apart" in said and "poses" in said for said in found.remarks)


def test_frames_that_do_not_meet_are_closed_and_said(tmp_path):
    tilt = joint("j", "Revolute", "", "a", 'point3f physics:localPos0 = (0, 0, 1e-8)\nuniform token physics:axis = "Y"')
    found = reading(tmp_path, stage(body("a") + tilt))
    assert found.bodies["a"].pose[2, 3] == pytest.approx(1e-8)
    (said,) = found.remarks
    assert re.search(r"\bj\b.*1e-08", said)
    far = tilt.replace("1e-8", "0.5")
    assert "0.5" in reading(tmp_path, stage(body("a") + far)).remarks[0]


def test_a_joint_of_six_freedoms_has_those_that_no_limit_locks(tmp_path):
    locked = ["transX", "transY", "rotX"]
    api = ", ".join(f'"PhysicsLimitAPI:{token}"' for token in locked)
    more = "\n".join(f"float limit:{token}:physics:low = 1\nfloat limit:{token}:physics:high = -1" for token in locked)
    found = reading(tmp_path, stage(body("a") + joint("j", "", "", "a", more, api)))
    assert list(found.joints) == ["j.transZ", "j.rotY", "j.rotZ"]
    assert [one.kind for one in found.joints.values()] == ["slide", "hinge", "hinge"]


def test_hinges_between_the_same_bodies_follow_each_other_and_it_is_said(tmp_path):
    more = 'uniform token physics:axis = "{}"'
    two = "".join(joint(name, "Revolute", "", "a", more.format(axis)) for name, axis in (("j", "X"), ("k", "Y")))
    found = reading(tmp_path, stage(body("a") + two))
    assert found.bodies["a"].joints == ("j", "k")
    assert not found.closures
    assert "j, k" in found.remarks[0]


def test_two_hinges_of_a_door_are_one_freedom(tmp_path):
    high = "point3f physics:localPos0 = (0, 2, 0)\npoint3f physics:localPos1 = (0, 2, 0)\n"
    door = HINGE + HINGE.replace('"j"', '"k"').replace("uniform", f"{high}uniform")
    (tmp_path / "m.usda").write_text(stage(body("a") + door), encoding="utf-8")
    assert not read(tmp_path / "m.usda", "screwgauge").remarks
    assert [*import_model(tmp_path / "m.usda").mechanism.independent] == ["j"]


def test_what_is_excluded_from_the_articulation_closes_a_loop(tmp_path):
    slide = 'uniform token physics:axis = "X"\nbool physics:excludeFromArticulation = 1'
    bodies = body("a") + body("b", "1, 0, 0")
    parts = (
        bodies
        + joint("p", "Prismatic", "", "b", slide)
        + HINGE
        + HINGE.replace('"j"', '"k"').replace(
            "rel physics:body1 = </w/a>", "rel physics:body0 = </w/a>\nrel physics:body1 = </w/b>"
        )
    )
    found = reading(tmp_path, stage(parts))
    assert {name for one in found.bodies.values() if one.copy_of for name in one.joints} == {"p"}


def test_drives_move_joints_and_their_gains_are_kept(tmp_path):
    drive = "float drive:angular:physics:stiffness = 3\nfloat drive:angular:physics:damping = 2"
    more = f'uniform token physics:axis = "Y"\n{drive}'
    found = reading(tmp_path, stage(body("a") + joint("j", "Revolute", "", "a", more, '"PhysicsDriveAPI:angular"')))
    assert [one.joint for one in found.actuators.values()] == ["j"]
    (gains,) = (dict(each.values) for each in found.content if each.kind == "drives")
    assert (gains["stiffness"], gains["damping"]) == (3.0, 2.0)


def test_actuators_of_newton_and_mujoco_drive_the_joints_that_they_name(tmp_path):
    motors = (
        'def NewtonActuator "m" {\nrel newton:targets = </w/j>\nfloat newton:kp = 5\n}\n'
        'def MjcActuator "n" {\nrel mjc:target = </w/k>\ndouble[] mjc:gear = [30, 0, 0, 0, 0, 0]\n}\n'
    )
    ball = joint("s", "Spherical", "b", "c") + 'def MjcActuator "o" {\nrel mjc:target = </w/s>\n}\n'
    parts = body("a") + body("b") + body("c") + HINGE + joint("k", "Revolute", "a", "b") + ball
    found = reading(tmp_path, stage(parts + motors))
    assert {name: tuple(one) for name, one in found.actuators.items()} == {"m": ("j", 1.0), "n": ("k", 30.0)}
    assert "newton:kp" in " ".join(each.what for each in found.content)


def test_joints_between_the_same_bodies_close_a_loop_where_the_file_says_that_they_add_no_mobility(tmp_path):
    two = HINGE + joint("k", "Prismatic", "", "a", 'uniform token physics:axis = "Y"')
    said = 'def Xform "root" {\nuniform bool newton:jointsAddMobility = 0\n}\n'
    assert not reading(tmp_path, stage(body("a") + two)).closures
    assert reading(tmp_path, stage(body("a") + two + said)).closures


def test_gains_of_drives_are_compared_between_two_usds(tmp_path):
    for name, gain in (("a", 3), ("b", 4)):
        more = f'uniform token physics:axis = "Y"\nfloat drive:angular:physics:stiffness = {gain}'
        text = stage(body("a") + joint("j", "Revolute", "", "a", more, '"PhysicsDriveAPI:angular"'))
        (tmp_path / f"{name}.usda").write_text(text, encoding="utf-8")
    (fact,) = screwgauge.diagnose(tmp_path / "a.usda", tmp_path / "b.usda").differences
    assert (fact.what, fact.a, fact.b) == ("drives", {"stiffness": 3.0}, {"stiffness": 4.0})


@pytest.mark.parametrize(
    ("more", "what", "amount"),
    [
        ("float newton:armature = 0.5", "armature", 0.5),
        ("float physxJoint:armature = 0.25", "armature", 0.25),
        ("float newton:damping = 2", "damping", math.degrees(2.0)),
        ("float newton:friction = 0.1", "friction", 0.1),
    ],
)
def test_schemas_of_simulators_state_what_joints_exert(more, what, amount, tmp_path):
    hinge = joint("j", "Revolute", "", "a", f'uniform token physics:axis = "Y"\n{more}')
    assert getattr(reading(tmp_path, stage(body("a") + hinge)).joints["j"], what) == pytest.approx(amount)


@pytest.mark.parametrize(
    ("api", "more", "law"),
    [
        (
            "NewtonMimicAPI",
            "rel newton:mimicJoint = </w/j>\nfloat newton:mimicCoef0 = 90\nfloat newton:mimicCoef1 = 2",
            2.0,
        ),
        (
            "PhysxMimicJointAPI:rotY",
            "rel physxMimicJoint:rotY:referenceJoint = </w/j>\nfloat physxMimicJoint:rotY:gearing = -3\n"
            "float physxMimicJoint:rotY:offset = -90",
            3.0,
        ),
    ],
)
def test_a_joint_follows_by_the_schemas_of_simulators(api, more, law, tmp_path):
    follower = joint("k", "Revolute", "a", "b", f'uniform token physics:axis = "Y"\n{more}', f'"{api}"')
    found = reading(tmp_path, stage(body("a") + body("b") + HINGE + follower))
    assert found.couplings["k"].function.polynomials["j"] == pytest.approx([math.pi / 2, law])


def test_bodies_and_joints_come_by_references_payloads_and_instances(tmp_path):
    (tmp_path / "leg.usda").write_text(stage(body("a") + HINGE), encoding="utf-8")
    use = 'def Xform "{}" (\nprepend {} = @leg.usda@\ninstanceable = true\n) {{}}\n'
    head = HEAD.format(unit=1, kilo=1, up="Z")
    found = reading(
        tmp_path, f'{head}def Xform "w" {{\n{use.format("x", "references")}{use.format("y", "payload")}}}\n'
    )
    assert list(found.bodies) == ["w.x.a", "w.y.a"]
    assert list(found.joints) == ["w.x.j", "w.y.j"]


@pytest.mark.parametrize(("name", "data"), [("m.usda", b"#usda 1.0\ndef"), ("m.usd", b"x"), ("m.usdz", b"PK\x03\x04")])
def test_broken_files_are_refused(name, data, tmp_path, capfd):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ScrewgaugeError, match="cannot be read as USD"):
        read(tmp_path / name, "screwgauge")
    assert capfd.readouterr().err == ""


def test_a_kinematic_body_stands_where_no_joint_moves_it(tmp_path):
    base = body("a", more=f"{MASS.format(2)}\nbool physics:kinematicEnabled = 1")
    found = reading(tmp_path, stage(base + body("b") + joint("k", "Revolute", "a", "b")))
    assert ([*found.bodies], [*found.joints], [*found.fixed]) == (["b"], ["k"], ["a"])
    assert any("kinematic" in each.what for each in found.content)


def test_a_centre_of_mass_that_is_not_stated_is_the_origin_and_nothing_is_said(tmp_path):
    stated = "float physics:mass = 2\nfloat3 physics:diagonalInertia = (0.1, 0.2, 0.25)"
    found = reading(tmp_path, stage(body("a", more=stated) + HINGE))
    assert found.bodies["a"].com == pytest.approx([0.0, 0.0, 0.0])
    assert not found.content


def test_what_changes_with_time_is_read_as_it_is_at_first(tmp_path):
    moving = body("a").replace("translate = (0, 0, 0)", "translate.timeSamples = {3: (0, 0, 2), 4: (0, 0, 5)}")
    at = joint("j", "Revolute", "", "a", "point3f physics:localPos0 = (0, 0, 2)")
    assert reading(tmp_path, stage(moving + at)).bodies["a"].pose[2, 3] == pytest.approx(2.0)


def test_limits_beyond_all_bounds_are_none(tmp_path):
    more = 'uniform token physics:axis = "Y"\nfloat physics:lowerLimit = -3e38\nfloat physics:upperLimit = 90'
    found = reading(tmp_path, stage(body("a") + joint("j", "Revolute", "", "a", more)))
    assert found.joints["j"].limits == pytest.approx((-math.inf, math.pi / 2))


def test_what_is_left_out_is_named(tmp_path):
    hinge = joint("j", "Revolute", "", "a", 'uniform token physics:axis = "Y"\nfloat physxJoint:jointFriction = 0.3')
    off = HINGE.replace('"j"', '"off"').replace("rel", "bool physics:jointEnabled = 0\nrel")
    (tmp_path / "m.usda").write_text(stage(body("a") + hinge + off), encoding="utf-8")
    said = " ".join(import_model(tmp_path / "m.usda").left_out)
    assert "physxJoint:jointFriction of joint j" in said
    assert "joint off" in said
