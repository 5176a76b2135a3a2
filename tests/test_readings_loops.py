"""Loops that stand beside a URDF, in a file of our own or in the `robot.yaml` of parallel robots, close its reading."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.data import data
from support.mechanism import PolynomialSum, load_mechanism
from support.models import write_models
from support.readings import (
    CouplingReading,
    Reading,
    TreeStates,
    collapse,
    draw,
    move,
    read,
    read_yaml,
    tree_of,
    with_loops,
)


# Two legs, the left one of two links; a massless frame at each end, and one in the ground.
@pytest.fixture
def legs(write) -> Reading:
    return read(write("robot.urdf", data("two-legs.urdf")), "pinocchio")


#: A turned arm of three links, each of which is more than one.
TURNED = data("turned-arm.urdf")
LOOP = "closed_loop: [[nail, base]]\ntype: [3d]\njoint_name: [{}]\njoint_type: [{}]\n"


@pytest.fixture
def turned(write) -> Reading:
    return read(write("robot.urdf", TURNED), "pinocchio")


def test_a_universal_joint_turns_about_two_axes_of_the_frame_of_its_link(turned, write):
    """As Pinocchio does with a joint about z and one about y in its place."""
    reading = with_loops(turned, write("robot.yaml", LOOP.format("elbow", "UJOINT_ZY")))
    assert list(reading.joints) == ["shoulder", "elbow_Z", "elbow_Y", "grip"]
    assert reading.bodies["fore"].joints == ("elbow_Z", "elbow_Y")
    old = pinocchio.buildModelFromXML(TURNED)
    model, at = pinocchio.Model(), old.jointPlacements
    one = model.addJoint(0, pinocchio.JointModelRY(), at[1], "shoulder")
    two = model.addJoint(one, pinocchio.JointModelRZ(), at[2], "z")
    three = model.addJoint(two, pinocchio.JointModelRY(), pinocchio.SE3.Identity(), "y")
    last = model.addJoint(three, pinocchio.JointModelRY(), at[3], "grip")
    data, q = model.createData(), np.array([0.3, -0.5, 0.9, 0.4])
    pinocchio.forwardKinematics(model, data, q)
    still, rest = model.createData(), np.zeros((1, 4))
    pinocchio.forwardKinematics(model, still, rest[0])
    tree = tree_of(reading)
    motion = move(tree, TreeStates(q[None], rest, rest))
    i = list(reading.bodies).index("palm")
    expected = (data.oMi[last] * still.oMi[last].inverse()).homogeneous @ reading.bodies["palm"].pose
    np.testing.assert_allclose(motion.bodies.R[0, i], expected[:3, :3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(motion.bodies.p[0, i], expected[:3, 3], rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", ["shoulder", "elbow", "grip"])
def test_a_fixed_joint_makes_one_body_as_if_the_urdf_had_it(name, turned, write):
    reading = with_loops(turned, write("robot.yaml", LOOP.format(name, "fixed")))
    at = TURNED.index(f'<joint name="{name}"')
    expected = read(write("fixed.urdf", TURNED[:at] + TURNED[at:].replace("revolute", "fixed", 1)), "pinocchio")
    assert list(reading.joints) == list(expected.joints)
    assert list(reading.bodies) == list(expected.bodies)
    assert {*reading.fixed} == {*expected.fixed}
    for body, want in expected.bodies.items():
        said = reading.bodies[body]
        assert (said.near, said.joints, said.first, {*said.fixed}) == (
            want.near, want.joints, want.first, {*want.fixed},
        )  # fmt: skip
        for key in ("mass", "com", "inertia", "pose"):
            np.testing.assert_allclose(getattr(said, key), getattr(want, key), rtol=0, atol=2e-15)
    (closure,) = reading.closures.values()
    place = expected.place("thumb")
    assert place is not None
    assert closure.first == place[0]
    np.testing.assert_allclose(closure.first_frame, place[1], rtol=0, atol=2e-15)


def test_what_depends_on_a_joint_of_another_type_is_told(write):
    mimic = TURNED.replace("</robot>", "").replace(
        '<parent link="fore"/>', '<parent link="fore"/><mimic joint="elbow" multiplier="2" offset="0.3"/>'
    )
    reading = read(write("robot.urdf", f"{mimic}</robot>"), "pinocchio")
    held = with_loops(reading, write("robot.yaml", LOOP.format("elbow", "FIXED"))).couplings["grip"]
    assert (held.joint, held.function.lead, held.function.polynomial.tolist()) == ("grip", "", [0.3])
    for name, kind in (("grip", "FIXED"), ("elbow", "UJOINT_XY"), ("grip", "SPHERICAL")):
        with pytest.raises(ScrewgaugeError, match=rf"'{name}' is coupled.* cannot become {kind}"):
            with_loops(reading, write("robot.yaml", LOOP.format(name, kind)))


def test_of_several_joints_that_one_follows_those_that_are_fixed_are_constants(turned, write):
    belt = PolynomialSum(0.1, {"elbow": np.array([2.0, 1.0]), "shoulder": np.array([-1.0])})
    reading = replace(turned, couplings={"belt": CouplingReading("grip", belt)})
    held = with_loops(reading, write("robot.yaml", LOOP.format("elbow", "FIXED"))).couplings["belt"]
    assert held.named == ("grip", "shoulder")
    at = reading.joints["elbow"].home
    assert held.function.constant == pytest.approx(0.1 + 2.0 * at + at**2)


def test_names_of_fixed_joints_are_frames(turned, write):
    by_joint = with_loops(turned, write("one.yaml", "closed_loop: [[nail, cuff]]\ntype: [6d]")).closures["loop1"]
    by_link = with_loops(turned, write("two.yaml", "closed_loop: [[thumb, fore]]\ntype: [6d]")).closures["loop1"]
    assert (by_joint.first, by_joint.second) == (by_link.first, by_link.second) == ("palm", "fore")
    assert np.array_equal(by_joint.first_frame, by_link.first_frame)
    assert np.array_equal(by_joint.second_frame, by_link.second_frame)
    twice = read(write("twice.urdf", TURNED.replace('joint name="nail"', 'joint name="upper"')), "pinocchio")
    with pytest.raises(ScrewgaugeError, match=r"'upper' is a link.* joint .* link 'thumb'"):
        with_loops(twice, write("robot.yaml", "closed_loop: [[upper, base]]\ntype: [3d]"))


@pytest.mark.parametrize("library", ["pinocchio", "yourdfpy", "mujoco"])
def test_a_joint_stands_for_the_link_that_it_carries_whatever_the_body_is_called_after(library, write):
    reading = read(write("robot.urdf", data("foot-and-sole.urdf")), library)
    assert reading.bodies["sole"].first == "foot"
    (closure,) = with_loops(reading, write("l.yaml", "closed_loop: [[turn, base]]\ntype: [3d]")).closures.values()
    assert closure.first == "sole"
    np.testing.assert_allclose(closure.first_frame[:3, 3], [-0.1, 0.0, -0.2], rtol=0, atol=1e-15)


def test_aliases_of_a_yaml_are_no_bomb(legs, write):
    letters = "abcdefghijklmnopqrstuvwxyz"
    text = "a: &a [x, x]\n" + "".join(f"{n}: &{n} [*{m}, *{m}]\n" for m, n in pairwise(letters))
    assert len(read_yaml(write("robot.yaml", text), ())) == 26
    with pytest.raises(ScrewgaugeError, match="list of names"):
        with_loops(legs, write("robot.yaml", f"{text}name_mot: *z"))


def test_merges_of_a_yaml_are_no_bomb_either(write):
    """Each of ten lines once stood for ten times as many entries: 365 bytes took 42 s and 1.7 GB."""
    text = "a: &a {x: y}\n"
    for m, n in pairwise("abcdefgh"):
        text += f"{n}: &{n} {{<<: [{', '.join(f'*{m}' for _ in range(10))}]}}\n"
    with pytest.raises(ScrewgaugeError, match="the merge <<"):
        read_yaml(write("robot.yaml", text), ())


@pytest.mark.parametrize("name", ["3ups-upu-s", "five-bar"])
def test_a_loops_file_of_our_own_says_what_the_mjcf_says(name, tmp_path: Path):
    mechanism = load_mechanism(name)
    write_models(mechanism, tmp_path)
    for stem in (name, f"{name}-full"):
        expected = read(tmp_path / f"{stem}.xml", "mujoco")
        reading = with_loops(read(tmp_path / f"{stem}.urdf", "pinocchio"), tmp_path / f"{stem}.loops.toml")
        assert set(collapse(reading).bodies) == set(expected.bodies)
        assert set(reading.closures) == set(expected.closures)
        assert len(reading.actuators) == len(expected.actuators)
        for key, want in expected.closures.items():
            said = reading.closures[key]
            frames = {said.first: said.first_frame, said.second: said.second_frame}
            assert said.kind == want.kind
            np.testing.assert_allclose(frames[want.first], want.first_frame, rtol=0, atol=1e-14)
            np.testing.assert_allclose(frames[want.second], want.second_frame, rtol=0, atol=1e-14)


@pytest.mark.parametrize("kind", ["SPHERICAL", "UJOINT_ZY", "FIXED"])
def test_a_diagnosis_asks_the_library_about_the_joints_that_it_knows(kind, write):
    """Its own inverse dynamics know nothing of the types in a file beside the URDF."""
    types = LOOP.format("elbow", kind).partition("joint_name")
    urdf, loops = write("robot.urdf", TURNED), write("robot.yaml", "".join(types[1:]))
    found = screwgauge.diagnose(urdf, urdf, loops=loops)
    assert [(each.failed, each.agrees) for each in found.found.witnesses] == [("", True)] * 2
    assert found.exit_status == 0
    assert len(found.a.reading.joints) == {"SPHERICAL": 3, "UJOINT_ZY": 4, "FIXED": 2}[kind]


def test_a_tree_moves_alike_in_whatever_order_its_joints_stand(legs):
    one, two = tree_of(legs), tree_of(replace(legs, joints=dict(reversed(legs.joints.items()))))
    states = draw(legs, 3, 0)
    other = TreeStates(*(x[:, ::-1] for x in (states.q, states.qd, states.qdd)))
    assert (one.moves == two.moves[:, ::-1]).all()
    for name in "pwva":
        ours, theirs = (getattr(move(tree, some).com, name) for tree, some in ((one, states), (two, other)))
        assert np.allclose(ours, theirs, rtol=1e-14, atol=1e-14)
