import pickle
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from support.data import data
from support.mechanism import GROUND
from support.readings import BodyReading, JointReading, Reading, collapse, libraries_for, read
from support.urdf import joint as urdf_joint
from support.urdf import link as urdf_link
from support.urdf import robot

#: Numbers of a file pass through roll-pitch-yaw or quaternions, and through the principal axes that MuJoCo keeps.
READ = 1e-13
URDF_LIBRARIES = ["pinocchio", "mujoco", "yourdfpy"]
INERTIAL = '<inertial pos="0.1 0.2 -0.3" mass="{}" fullinertia="1 1.2 1.3 0.1 -0.05 0.02"/>'


TENSOR = (1, 1.2, 1.3, 0.1, -0.05, 0.02)


def link(name: str, mass: float = 0.0) -> str:
    return urdf_link(name, mass, TENSOR, "0.1 0.2 -0.3", "0.3 -0.4 0.5")


joint = partial(urdf_joint, xyz="0.3 -0.1 0.2", rpy="0.2 0.3 -0.7", limits=(-1.5, 0.5))
URDF = data("arm-of-all-joints.urdf")
MJCF = data("arm-of-all-joints.xml")


@pytest.fixture
def urdf(write) -> Path:
    return write("arm.urdf", URDF)


@pytest.fixture
def mjcf(write) -> Path:
    return write("arm.xml", MJCF)


def same_bodies(one: Reading, other: Reading) -> None:
    assert list(one.bodies) != []
    assert {name: (body.near, body.joints, body.first) for name, body in one.bodies.items()} == {
        name: (body.near, body.joints, body.first) for name, body in other.bodies.items()
    }
    assert set(one.fixed) == set(other.fixed)
    for name, body in one.bodies.items():
        assert close(body, other.bodies[name], "mass", "com", "inertia", "pose", "gravcomp"), name
        assert set(body.fixed) == set(other.bodies[name].fixed)
        for fixed, T in body.fixed.items():
            np.testing.assert_allclose(T, other.bodies[name].fixed[fixed], rtol=0, atol=READ)


def same_joints(one: Reading, other: Reading) -> None:
    assert set(one.joints) == set(other.joints)
    for name, said in one.joints.items():
        assert said.kind == other.joints[name].kind
        assert close(said, other.joints[name], "screw", "home", "limits", "armature", "damping", "friction"), name


def close(one: BodyReading | JointReading, other: BodyReading | JointReading, *what: str) -> bool:
    for name in what:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=READ, atol=READ, err_msg=name)
    return True


@pytest.mark.parametrize("home", [{}, {"turn": 0.3, "push": -0.2, "spin": 2.5, "follow": 0.4}])
def test_a_urdf_is_the_same_to_all_libraries(urdf, home):
    first, *others = (read(urdf, library, home=home) for library in URDF_LIBRARIES)
    for other in others:
        same_bodies(first, other)
        same_joints(first, other)
        assert other.gravity is None
    assert first.joints["spin"].home == home.get("spin", 0.0)


@pytest.mark.parametrize("home", [{}, {"x": 0.3, "y": -0.8, "z": 0.25}])
def test_an_mjcf_is_the_same_to_both_engines(mjcf, home):
    one, other = (read(mjcf, library, home=home) for library in ("mujoco", "pinocchio"))
    same_bodies(one, other)
    same_joints(one, other)
    assert one.bodies["cross"].joints == ("x", "y", "z")
    assert [one.joints[name].kind for name in ("b", "x", "z")] == ["ball", "hinge", "slide"]
    np.testing.assert_allclose(one.joints["b"].centre, other.joints["b"].centre, rtol=0, atol=READ)
    assert one.bodies["cross"].mass > 10.0  # with what its geoms weigh


def test_what_a_urdf_says_of_a_joint_is_read(urdf):
    turn = read(urdf, "pinocchio").joints["turn"]
    assert (turn.limits, turn.damping, turn.friction) == ((-1.5, 0.5), 0.4, 0.2)
    assert read(urdf, "pinocchio").joints["spin"].limits == (-np.inf, np.inf)


@pytest.mark.parametrize("library", URDF_LIBRARIES)
def test_links_that_nothing_moves_are_one_body(urdf, library):
    """It is called after the first that has mass, and has the mass of all; those of the ground are in the world."""
    reading = read(urdf, library)
    tool = reading.bodies["tool"]
    assert (tool.near, tool.joints, tool.first, set(tool.fixed)) == ("upper", ("push",), "flange", {"flange", "camera"})
    assert tool.mass == pytest.approx(2.5, rel=1e-15, abs=0)
    assert set(reading.fixed) == {"base", "mount"}
    assert reading.bodies["upper"].near == GROUND
    frames = [np.linalg.inv(tool.fixed["flange"]), tool.fixed["camera"]]
    np.testing.assert_allclose(*frames, rtol=0, atol=READ)  # both joints have the same origin
    c = np.array([0.1, 0.2, -0.3])
    far = frames[1][:3, :3] @ c + frames[1][:3, 3]
    np.testing.assert_allclose(tool.com, (2 * c + 0.5 * far) / 2.5, rtol=0, atol=READ)


@pytest.mark.parametrize("library", URDF_LIBRARIES)
def test_a_link_may_have_inertia_alone(library, write):
    base, arm, turn = link("base"), link("arm", 1), joint("turn", "revolute", "base", "arm")
    rotor = urdf_link("rotor", 1, TENSOR).replace('mass value="1"', 'mass value="0"')
    fixed = joint("on", "fixed", "arm", "rotor")
    reading = read(write("rotor.urdf", robot(base, arm, rotor, turn, fixed)), library)
    (whole,) = reading.bodies.values()
    alone = read(write("arm.urdf", robot(base, arm, turn)), library).bodies["arm"]
    assert (whole.mass, set(whole.fixed)) == (1.0, {"rotor"})
    assert np.trace(whole.inertia - alone.inertia) == pytest.approx(1 + 1.2 + 1.3, rel=1e-14, abs=0)


@pytest.mark.parametrize("library", URDF_LIBRARIES)
def test_a_mimic_joint_is_a_coupling(urdf, library):
    (said,) = read(urdf, library).couplings.values()
    assert (said.joint, said.function.lead) == ("follow", "turn")
    assert [*np.trim_zeros(said.function.polynomial, "b")] == [0.1, -2.0]


def test_the_base_of_a_urdf_floats_if_asked(urdf):
    fixed = read(urdf, "pinocchio")
    for library in URDF_LIBRARIES:
        reading = read(urdf, library, floating=True)
        base = reading.bodies["base"]
        assert (base.near, base.joints, reading.joints["root_joint"].kind) == (GROUND, ("root_joint",), "free")
        assert base.mass == pytest.approx(3.0, rel=1e-15, abs=0)
        assert reading.freedoms["root_joint"].stop - reading.freedoms["root_joint"].start == 6
        np.testing.assert_allclose(reading.bodies["tool"].pose, fixed.bodies["tool"].pose, rtol=0, atol=READ)


def test_a_planar_joint_is_two_slides_and_a_hinge(write):
    path = write("planar.urdf", robot(link("a"), link("b", 1), joint("p", "planar", "a", "b", axis="0 0 1")))
    one, other = (read(path, library) for library in ("pinocchio", "mujoco"))
    assert one.bodies["b"].joints == other.bodies["b"].joints == ("p_TX", "p_TY", "p_RZ")
    assert [one.joints[name].kind for name in one.joints] == ["slide", "slide", "hinge"]
    np.testing.assert_allclose(one.joints["p_RZ"].screw, other.joints["p_RZ"].screw, rtol=0, atol=READ)


def test_a_free_body_is_where_the_file_has_it(write):
    body = f'<body name="a" pos="1 2 3" quat="0.6 0 0.8 0"><freejoint name="f"/>{INERTIAL.format(1)}</body>'
    path = write("free.xml", f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    one, other = (read(path, library) for library in ("mujoco", "pinocchio"))
    same_bodies(one, other)
    assert [*one.bodies["a"].pose[:3, 3]] == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(one.joints["f"].centre, [1.0, 2.0, 3.0], rtol=0, atol=READ)


def test_what_has_no_name_gets_one(write):
    inner = f'<body><joint/><joint axis="1 0 0"/>{INERTIAL.format(1)}</body>'
    body = f'<body name="a"><freejoint/>{INERTIAL.format(1)}{inner}</body>'
    path = write("bare.xml", f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    one, other = (read(path, library) for library in ("mujoco", "pinocchio"))
    assert {name: body.joints for name, body in one.bodies.items()} == {
        "a": ("a_joint",),
        "body_2": ("body_2_joint", "body_2_joint_2"),
    }
    same_bodies(one, other)


def test_a_massless_cross_stays_until_it_is_collapsed(write):
    parts = [link("base"), link("cross"), link("end", 1), joint("u", "revolute", "base", "cross")]
    parts.append(joint("v", "revolute", "cross", "end", axis="0 1 0"))
    reading = read(write("cross.urdf", robot(*parts)), "pinocchio")
    assert (reading.bodies["cross"].mass, reading.bodies["end"].near) == (0.0, "cross")
    whole = collapse(reading)
    assert {name: (body.near, body.joints) for name, body in whole.bodies.items()} == {"end": (GROUND, ("u", "v"))}
    assert whole.joints == reading.joints
    assert collapse(reading, keep=["cross"]).bodies.keys() == reading.bodies.keys()


def test_libraries_are_those_of_the_format_its_own_first(urdf, mjcf):
    assert libraries_for(urdf) == ("pinocchio", "yourdfpy", "mujoco")
    assert libraries_for(mjcf) == ("mujoco", "pinocchio")


def test_readings_pickle(mjcf):
    reading = read(mjcf, "mujoco")
    same_bodies(pickle.loads(pickle.dumps(reading)), reading)
