"""Models in the forms that public ones use become descriptions that move as the library that read them says."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from screwgauge.models.importing import homes
from support import urdf
from support.command import main
from support.data import data
from support.errors import ClosureError, DescriptionError
from support.judging import agreed
from support.mechanism import Mechanism, load_mechanism
from support.models import Options, description, import_model
from support.scene import GivenMotion, check_home, sampled

SKEW = "0 0.6 0.8"
placed = partial(urdf.joint, xyz="0.3 0 0.1", rpy="0.4 0.1 -0.7")


def link(name: str, mass: float = 0.0, com: str = "0.1 0.02 -0.03") -> str:
    return urdf.link(name, mass, (0.02, 0.03, 0.025, 0.001, -0.002, 0.003), com, "0.3 -0.2 0.1")


def robot(folder: Path, *parts: str, name: str = "robot.urdf") -> Path:
    path = folder / name
    path.write_text(urdf.robot(*parts, name="my robot"), encoding="utf-8")
    return path


#: As public arms are: a base that is fixed to the world, a tool without a joint, a continuous joint, damping, a name
#: with a slash, home beyond a limit.
ARM = (
    *(link("world"), link("base", 3.0), link("upper/arm", 2.0), link("fore arm", 1.0), link("wrist", 0.5)),
    link("tool", 0.2),
    placed("mount", "fixed", "world", "base"),
    placed("shoulder", "revolute", "base", "upper/arm", '<dynamics damping="0.4"/>', axis=SKEW, limits=(-2.0, 2.0)),
    placed("elbow joint", "revolute", "upper/arm", "fore arm", axis=SKEW, limits=(0.5, 2.5)),
    placed("roll", "continuous", "fore arm", "wrist"),
    placed("flange", "fixed", "wrist", "tool"),
)


def rnea(path: Path, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    model = pinocchio.buildModelFromUrdf(str(path))
    found = np.zeros(model.nq)
    for angle, one in zip(q, list(model.joints)[1:], strict=True):
        found[one.idx_q : one.idx_q + one.nq] = [angle] if one.nq == 1 else [np.cos(angle), np.sin(angle)]
    return np.array(pinocchio.rnea(model, model.createData(), found, v, a))


def test_an_arm_moves_as_its_file_says(tmp_path):
    path = robot(tmp_path, *ARM)
    imported = import_model(path)
    mechanism = imported.mechanism
    assert [joint.name for joint in mechanism.joints] == ["shoulder", "elbow-joint", "roll"]
    assert [joint.name for joint in mechanism.actuators] == ["shoulder", "elbow-joint", "roll"]
    names = {"upper/arm": "upper-arm", "fore arm": "fore-arm", "elbow joint": "elbow-joint"}
    assert imported.names == {**names, "my robot": "my-robot"}
    elbow = mechanism.joint("elbow-joint")
    assert elbow.limits.tolist() == [[0.5, 2.5]]
    assert elbow.home[0] == pytest.approx(0.8)
    assert any("'elbow-joint' moves the most, by 0.8" in sentence for sentence in imported.remarks)
    scene = screwgauge.load_scene(path)
    assert scene.applied.springs == ()
    results = screwgauge.run(scene.at(scene.t[:3]))
    assert results.ok
    motion = scene.motion
    assert isinstance(motion, GivenMotion)
    for i in range(3):
        expected = rnea(path, motion.y[i], motion.yd[i], motion.ydd[i]) + [0.4, 0.0, 0.0] * motion.yd[i]
        got = results.values("actuator_force", engine="screw")[i]
        assert got == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_a_file_that_has_changed_is_imported_anew(tmp_path):
    before = screwgauge.load_scene(robot(tmp_path, *ARM)).mechanism.mass
    heavier = [part.replace('value="1.0"', 'value="2.0"') for part in ARM]
    assert screwgauge.load_scene(robot(tmp_path, *heavier)).mechanism.mass == pytest.approx(before + 1.0)


def test_what_is_written_is_what_was_imported(tmp_path, write):
    mechanism = import_model(robot(tmp_path, *ARM)).mechanism
    path = write("arm.toml", description(mechanism))
    check_same(load_mechanism(path), mechanism)


def check_same(one: Mechanism, other: Mechanism) -> None:
    assert one.independent == other.independent
    for body, twin in zip(one.bodies, other.bodies, strict=True):
        assert (body.name, body.mass) == (twin.name, twin.mass)
        assert np.array_equal(body.com, twin.com)
        assert np.array_equal(body.inertia, twin.inertia)
    for joint, twin in zip(one.joints, other.joints, strict=True):
        assert (joint.name, joint.kind, joint.actuated) == (twin.name, twin.kind, twin.actuated)
        for key in ("axes", "home", "limits"):
            assert getattr(joint, key) == pytest.approx(getattr(twin, key), rel=1e-15, abs=0), key
        for key in ("parent_frame", "child_frame"):
            assert np.array_equal(getattr(joint, key).p, getattr(twin, key).p)


# A planar four-bar as grippers have it: a connect between bodies, a driver whose twin is coupled to it by a joint
# equality, armature and springs, a home that is closed.
@pytest.fixture
def gripper(write) -> Path:
    return write("gripper.xml", data("gripper.xml"))


def test_a_gripper_runs(gripper):
    results = screwgauge.run(sampled(gripper, [3, 50]))
    assert {"actuator_force", "reaction"} <= {*results.pairs["quantity"]}
    assert results.pairs["ok"].all()
    assert results.judge["ok"].all()
    assert results.left_out.terms == ()


#: A four-bar whose loop is open at zero, in the form of public parallel robots; rods are spheres at both ends.
LOOP = (
    *(
        link("base", 1.0),
        link("crank", 1.0),
        link("rocker", 1.0),
        link("rod", 0.5, "0.2 0 0"),
        link("tip"),
        link("eye"),
    ),
    placed("motor", "revolute", "base", "crank", axis=SKEW, xyz="0 0 0"),
    placed("passive", "revolute", "base", "rocker", axis=SKEW, xyz="0.4 0.1 0"),
    *(link(f"cross{i}") for i in (1, 2)),
    placed("rod1", "revolute", "crank", "cross1"),
    urdf.joint("rod2", "revolute", "cross1", "cross2", axis="0 1 0"),
    urdf.joint("rod3", "revolute", "cross2", "rod", axis="0 0 1"),
    placed("fixed1", "fixed", "rod", "tip", xyz="0.45 0 0"),
    placed("fixed2", "fixed", "rocker", "eye", xyz="0.2 0.1 0.1"),
)
YAML = "closed_loop: [['tip', 'eye']]\ntype: ['3d']\nname_mot: ['motor']\n"


@pytest.mark.slow
def test_a_loop_that_is_open_at_zero_is_assembled(tmp_path):
    path = robot(tmp_path, *LOOP)
    (tmp_path / "robot.yaml").write_text(YAML, encoding="utf-8")
    imported = import_model(path)
    mechanism = imported.mechanism
    check_home(mechanism)
    assert sorted(joint.kind for joint in mechanism.joints) == ["R", "R", "S", "S"]
    assert len(mechanism.independent) == 2  # the rod spins about itself: independent, and driven by nothing
    assert "motor" in mechanism.independent
    assert any("loops are open: 'loop1' by" in sentence for sentence in imported.remarks)
    results = agreed(screwgauge.run(sampled(path, [3, 50])))
    assert "the actuated joints drive 1 of 2" in " ".join(results.warnings)
    assert "generalized_force" in {*results.pairs["quantity"]}


#: A crank that turns a foot by a rod. Where the file has it rod and crank cross, which is outside the limits however
#: they turn; the other assembly is within them.
FOOT = data("leg.xml")


@pytest.mark.slow
def test_home_is_well_conditioned_and_within_the_limits_if_a_closed_pose_is(write):
    path = write("leg.xml", FOOT.format(""))
    imported = import_model(path)
    mechanism = imported.mechanism
    check_home(mechanism)
    for name in ("crank", "foot"):
        joint = mechanism.joint(name)
        assert joint.limits.tolist() == [[-2.4, -0.5]]
        assert -2.4 < joint.home[0] < -0.5
    said = " ".join(imported.remarks)
    assert "middle of the joint ranges" in said
    assert re.search(r"own home .* 0\.\d+, .*foot outside limits", said)
    assert "left out" not in said
    assert import_model(path).mechanism.home.tolist() == mechanism.home.tolist()
    results = agreed(screwgauge.run(sampled(path, slice(None, None, 25))))
    assert max(error.largest for error in results.guard.values()) < 1e-11


def test_keyframes_of_any_name_lead_to_a_home(tmp_path):
    path = tmp_path / "leg.xml"
    frames = '<key name="stand" qpos="0.2 -1.4571 1.2361 -1.4688"/>'
    path.write_text(FOOT.format(f"<keyframe>{frames}</keyframe>"), encoding="utf-8")
    imported = import_model(path)
    assert "found from keyframe 'stand'" in " ".join(imported.remarks)
    assert imported.mechanism.joint("knee").home[0] == pytest.approx(0.2, abs=1e-3)
    assert imported.mechanism.joint("foot").home[0] == pytest.approx(-1.4688, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "origin", "kinds", "why"),
    [
        ("0 0 1", "0 0 0", ["U"], None),
        (
            "0.6 0 0.8",
            "0 0 0",
            ["R", "R"],
            "not at right angles",
        ),
        (
            "0 0 1",
            "0 3e-8 0",
            ["R", "R"],
            "1.5e-08 m",
        ),
    ],
    ids=["a cross", "oblique axes", "axes that do not quite meet"],
)
def test_a_composite_joint_that_a_description_cannot_hold_is_named(axis, origin, kinds, why, tmp_path):
    parts = (
        *(link("base", 3.0), link("cross"), link("arm", 2.0)),
        urdf.joint("pitch", "continuous", "base", "cross"),
        urdf.joint("yaw", "continuous", "cross", "arm", xyz=origin, axis=axis),
    )
    imported = import_model(robot(tmp_path, *parts), Options(floating=True, actuated=[]))
    assert [joint.kind for joint in imported.mechanism.joints] == ["F", *kinds]
    named = [sentence for sentence in imported.remarks if "universal joint" in sentence]
    assert len(named) == bool(why)
    assert all("'pitch', 'yaw'" in said and why in said for said in named)


def test_a_loop_that_cannot_close_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(homes, "STARTS", 8)
    far = [part.replace("0.45 0 0", "0.01 0 0") for part in LOOP]
    path = robot(tmp_path, *far)
    (tmp_path / "robot.yaml").write_text(YAML, encoding="utf-8")
    with pytest.raises(ClosureError, match=r"from any of \d+ starts; .*'loop1' by [\d.]+ m"):
        import_model(path)


def test_a_floating_base_is_independent(tmp_path):
    parts = [part for part in ARM if 'name="mount"' not in part and 'name="world"' not in part]
    mechanism = import_model(robot(tmp_path, *parts), Options(floating=True)).mechanism
    (free,) = (joint for joint in mechanism.joints if joint.kind == "F")
    assert {*free.coordinates} < {*mechanism.independent.values()}
    assert len(mechanism.independent) == 9
    assert len(mechanism.actuators) == 3


def test_choices_are_followed(gripper):
    wanted = Options(independent={"angle": "follower"}, actuated=["follower"])
    mechanism = import_model(gripper, wanted).mechanism
    assert dict(mechanism.independent) == {"angle": "follower"}
    assert [joint.name for joint in mechanism.actuators] == ["follower"]
    with pytest.raises(DescriptionError, match="rank 1, but the mechanism has 1"):
        import_model(gripper, Options(independent={"a": "follower", "b": "driver"}))
    with pytest.raises(ScrewgaugeError, match=r"--actuated: .*'nobody'"):
        import_model(gripper, Options(actuated=["nobody"]))


def test_import_writes_both_files_or_none(gripper, tmp_path, command):
    out = tmp_path / "made" / "grip.toml"
    said = command("import", gripper, "-o", out).out
    assert "gear other than 1 of actuator" in said
    assert "# Left out: gear other than 1" in out.read_text(encoding="utf-8")
    scene = screwgauge.load_scene(out)  # finds the scene beside it
    assert scene.file == out.with_name("grip.scene.toml")
    assert scene.name == "grip"
    assert main(["import", str(gripper), "-o", str(out)]) == 0  # what it wrote itself it writes again


@pytest.mark.slow
@pytest.mark.parametrize("name", ["grip.toml", "grip.scene.toml"])
@pytest.mark.parametrize(
    "edited", [lambda text: "# mine\n", lambda text: text.replace("mass = 0.2", "mass = 0.3"), str.upper]
)
def test_what_somebody_has_worked_on_is_not_written_over(name, edited, gripper, tmp_path, command):
    assert main(["import", str(gripper), "-o", str(tmp_path / "grip.toml")]) == 0
    (path := tmp_path / name).write_text(mine := edited(path.read_text(encoding="utf-8")) + "\n", encoding="utf-8")
    assert "nothing in it proves" in command("import", gripper, "-o", tmp_path / "grip.toml", status=2).err
    assert path.read_text(encoding="utf-8") == mine


def test_a_description_alone_runs(write):
    path = write("alone.toml", description(load_mechanism("slider-crank")))
    scene = screwgauge.load_scene(path)
    assert len(scene.motion) > 50
    assert np.abs(scene.motion.ydd).max() > 0


def test_a_refusal_leaves_no_file(refused, write, tmp_path):
    refused("import", write("bad.urdf", "hello"), out=tmp_path / "bad.toml")


def planar(folder: Path, right_angle: str) -> Path:
    parts = [
        link("base"),
        *(link(name, 1.0, com) for name, com in (("a", "0 0.1 0"), ("b", "0.1 0 0"), ("c", "0 0 0.1"))),
    ]
    hinges = (
        ("ja", "base", "a", "0 0 0", f"{right_angle} 0 0", "0 0 1"),
        ("jb", "a", "b", "0 0.2 0", f"-{right_angle} 0 0", "0 1 0"),
        ("jc", "base", "c", "0.3 0 0", "0 0 0", "0 1 0"),
    )
    for name, near, far, xyz, rpy, axis in hinges:
        parts.append(urdf.joint(name, "revolute", near, far, xyz=xyz, rpy=rpy, axis=axis))
    for name, near, xyz in (("eye1", "b", "0.35 0 0"), ("eye2", "c", "0 0 0.25")):
        parts += [link(name), urdf.joint(name, "fixed", near, name, xyz=xyz)]
    (folder / "planar.yaml").write_text("closed_loop: [[eye1, eye2]]\ntype: [3d]\nname_mot: [ja]\n", encoding="utf-8")
    return robot(folder, *parts, name="planar.urdf")


@pytest.mark.slow
def test_a_robot_whose_limits_leave_no_motion_is_refused_by_joint_limits_and_file(tmp_path, inside, command):
    path = planar(tmp_path, "1.5707963267948966")
    text = path.read_text(encoding="utf-8").replace("lower", "LOWER").replace("upper", "UPPER")
    text = text.replace('LOWER="-3" UPPER="3"', 'lower="-3" upper="3"', 2)  # of ja and jb
    text = text.replace('LOWER="-3" UPPER="3"', 'lower="-1e-5" upper="2e-5"')  # of jc
    path.write_text(text, encoding="utf-8")
    for typed in (["import", path.name, "-o", "out.toml"], ["run", path.name], ["bench", path.name]):
        said = command(*typed, status=2).err
        assert f"screwgauge: {path.name}: not even a motion of 0.01" in said
        assert "limits of 'jc' ([-1e-05, 2e-05] rad); widen" in said
        assert "tmp" not in said.rpartition("not even")[2]


def test_redundant_loops_move(tmp_path):
    mechanism = import_model(planar(tmp_path, "1.5707963267948966")).mechanism
    assert [joint.name for joint in mechanism.actuators] == [*mechanism.independent] == ["ja"]


def test_digits_that_lock_a_redundant_loop_are_blamed(tmp_path):
    with pytest.raises(DescriptionError, match=r"rounding errors of about \de-06, .* write angles"):
        import_model(planar(tmp_path, "1.5708"))


def test_loops_written_as_robot_yaml_come_back(inside):
    assert main(["models", "slider-crank", "--include", "yaml", "--out", "."]) == 0
    imported = import_model(Path("slider-crank.urdf"), Options(loops=Path("slider-crank.yaml")))
    mechanism = load_mechanism("slider-crank")
    assert len(imported.mechanism.independent) == len(mechanism.independent)
    assert imported.mechanism.mass == pytest.approx(mechanism.mass, rel=1e-15, abs=0)
    check_home(imported.mechanism)


SMALL = '<inertial pos="0 0.02 0.02" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>'
HAND = f"""<mujoco model="hand"><compiler angle="radian"/><worldbody><body name="arm">
<joint name="shoulder" axis="0 1 0"/><inertial pos="0 0 0.4" mass="1" diaginertia="0.1 0.1 0.1"/>
<body name="driver" pos="0 0.035 0.859"><joint name="driven" axis="1 0 0" range="0 0.85"/>{SMALL}
<body name="finger" pos="0 0.035 0.042"><joint name="tip" axis="-1 0 0" range="0 0.85"/>{SMALL}</body></body>
<body name="knuckle" pos="0 0.02 0.874"><joint name="link" axis="1 0 0" range="0 0.85"/>{SMALL}</body></body>
</worldbody><equality><connect body1="finger" body2="knuckle" anchor="0 -0.015 0.015"/></equality></mujoco>"""


def test_a_loop_at_its_limits_gets_room_though_it_is_conditioned_worse_there(tmp_path):
    (tmp_path / "hand.xml").write_text(HAND, encoding="utf-8")
    mechanism = import_model(tmp_path / "hand.xml").mechanism
    low, high = mechanism.limits.T
    assert (low < mechanism.home).all()
    assert (mechanism.home < high).all()


def test_meshes_of_what_is_fixed_to_the_world_are_not_asked_for(tmp_path):
    base = '<body name="base"><geom type="mesh" mesh="m"/><body name="arm"><joint name="hinge"/>'
    text = f'<asset><mesh name="m" file="../nowhere.stl"/></asset><worldbody>{base}{SMALL}</body></body></worldbody>'
    (tmp_path / "arm.xml").write_text(f'<mujoco model="arm">{text}</mujoco>', encoding="utf-8")
    imported = import_model(tmp_path / "arm.xml", Options(meshes=True))
    assert imported.mechanism.mass == 0.1
    assert any("body base" in each and "meshes" in each for each in imported.left_out)
