"""USD is read as UsdPhysics has it: units, matter, joints between frames, loops, drives, mimics, files beside."""

from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.geometry import quaternion, rotation_matrix
from support.graphs import usd_name, usd_of, wanted
from support.mechanism import load_mechanism
from support.models import Imported, Options, description, import_model, write_models
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
    mechanism, file = load_mechanism(name), tmp_path / "m.usda"
    file.write_text(usd_of(mechanism, last, unit), encoding="utf-8")
    own = wanted(mechanism)
    independent = {label: usd_name(c) for label, c in own.independent.items()}
    return import_model(file, Options(independent=independent, actuated=[usd_name(c) for c in own.actuated]))


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


def test_moments_stand_along_principal_axes(tmp_path):
    R = rotation_matrix([{"axis": [0, 0, 1], "angle": 0.3}, {"axis": [1, 0, 0], "angle": 0.7}], "test")
    axes = ", ".join(map(repr, quaternion(R).tolist()))
    found = reading(
        tmp_path, stage(body("a", more=f"{MASS.format(1)}\nquatf physics:principalAxes = ({axes})") + HINGE)
    )
    wished = R @ np.diag([0.1, 0.2, 0.25]) @ R.T
    assert found.bodies["a"].inertia == pytest.approx(wished, abs=1e-7)


def test_a_body_that_states_mass_and_centre_alone_has_the_moments_of_a_ball(tmp_path):
    more = "float physics:mass = 2\npoint3f physics:centerOfMass = (0, 0, 1)"
    found = reading(tmp_path, stage(body("a", more=more) + HINGE)).bodies["a"]
    assert found.mass == 2.0
    assert found.inertia == pytest.approx(0.4 * 2.0 * 0.1**2 * np.eye(3))


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


def test_gains_of_drives_are_compared_between_two_usds(tmp_path):
    for name, gain in (("a", 3), ("b", 4)):
        more = f'uniform token physics:axis = "Y"\nfloat drive:angular:physics:stiffness = {gain}'
        text = stage(body("a") + joint("j", "Revolute", "", "a", more, '"PhysicsDriveAPI:angular"'))
        (tmp_path / f"{name}.usda").write_text(text, encoding="utf-8")
    (fact,) = screwgauge.diagnose(tmp_path / "a.usda", tmp_path / "b.usda").differences
    assert (fact.what, fact.a, fact.b) == ("drives", {"stiffness": 3.0}, {"stiffness": 4.0})


@pytest.mark.parametrize(("name", "data"), [("m.usda", b"#usda 1.0\ndef"), ("m.usd", b"x"), ("m.usdz", b"PK\x03\x04")])
def test_broken_files_are_refused(name, data, tmp_path, capfd):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ScrewgaugeError, match="cannot be read as USD"):
        read(tmp_path / name, "screwgauge")
    assert capfd.readouterr().err == ""
