"""Two machines that share some joints by name are compared where they fit, and what does not fit is named."""

from __future__ import annotations

import numpy as np
import pytest

from screwgauge import diagnose

pytestmark = pytest.mark.slow

LEGS = [[f"{side}_leg_{joint}" for joint in ("hpz", "hpx", "kny", "akx")] for side in "lr"]
EQUAL = ["back_z", "back_y", "back_x", *LEGS[0], *LEGS[1]]
ONE, OTHER = ("0 0 1", "1 0 0", "0 1 0"), ("0 0 1", "0 1 0", "1 0 0")


class Robot:
    """A URDF grown limb by limb, masses and offsets at random."""

    def __init__(self, seed: int) -> None:
        self.random, self.parts = np.random.default_rng(seed), ['<link name="pelvis"/>']

    def limb(self, root: str, names: list[str], at: tuple[float, ...], axes=ONE, kind: str = "revolute") -> str:
        """Adds a chain; returns its last link."""
        for i, name in enumerate(names):
            xyz = np.array(at) if i == 0 else self.random.uniform(-0.05, 0.05, 3) + np.array([0, 0, -0.2])
            mass, com = self.random.uniform(1, 8), self.random.uniform(-0.05, 0.05, 3)
            x, c = (" ".join(f"{v:.3f}" for v in vector) for vector in (xyz, com))
            moments = " ".join(f'i{k}{k}="{mass * v:.4f}"' for k, v in zip("xyz", (0.01, 0.012, 0.008), strict=True))
            self.parts.append(
                f'<link name="{name}.link"><inertial><origin xyz="{c}"/><mass value="{mass:.3f}"/>'
                f'<inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial></link>'
                f'<joint name="{name}" type="{kind}"><origin xyz="{x}"/><parent link="{root}"/>'
                f'<child link="{name}.link"/><axis xyz="{axes[i % 3]}"/>'
                '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
            )
            root = f"{name}.link"
        return root

    @property
    def text(self) -> str:
        return f'<robot name="r">{"".join(self.parts)}</robot>'


def humanoid(seed: int, arm: str, joints: int, axes=ONE, hang: str = "") -> str:
    robot = Robot(seed)
    torso = robot.limb("pelvis", EQUAL[:3], (0, 0, 0.1), axes)
    for side, y in (("l", 0.2), ("r", -0.2)):
        hand = robot.limb(hang or torso, [f"{arm}_{side}{i}" for i in range(joints)], (0, y, 0.4))
        for k in range(2):
            robot.limb(hand, [f"{arm}_{side}_finger{k}{i}" for i in range(2)], (0.03 * k, 0, -0.1))
    for names, y in zip(LEGS, (0.1, -0.1), strict=True):
        robot.limb("pelvis", names, (0, y, -0.1), axes)
    return robot.text


@pytest.fixture
def found(write):
    a = write("a.urdf", humanoid(1, "arm", 6))
    return diagnose(a, write("b.urdf", humanoid(2, "manus", 7, OTHER, "pelvis")))


@pytest.mark.slow
def test_identical_names_pair_joints_of_machines_that_have_little_else_in_common(found):
    assert {*found.pairing.joints} >= {*EQUAL}
    assert all(found.pairing.joints[name] == name and found.pairing.how[name] == "name" for name in EQUAL)
    assert len(found.pairing.joints) < 0.5 * 31
    assert "different machines" not in found.verdict
    start = "Compared by their names are 11 of 31 joints of A and 33 of B (back_z = back_z, back_y = back_y, "
    assert start in found.explanation
    assert found.exit_status == 1


@pytest.mark.slow
def test_what_fits_is_compared_and_what_does_not_is_named(found):
    said = {(each.what, each.item_a or each.item_b): each.sentence for each in found.differences}
    missing = [sentence for (what, _), sentence in said.items() if what == "branch"]
    assert len(missing) == 4
    assert "arm_l0 and 9 joints behind it: missing in B, with all that they carry" in said["branch", "arm_l0"]
    assert "manus_r0 and 10 joints behind it: missing in A, with all that they carry" in said["branch", "manus_r0"]
    assert said["axis", "back_y"].startswith("back_y: its axis in B is tilted by ")
    assert ("mass", "l_leg_kny.link") in said
    assert found.rows
    assert found.proof is not None
    assert found.proof.agrees


def test_a_joint_of_the_same_name_and_another_kind_is_said_to_be_so(write):
    texts = []
    for kind in ("revolute", "prismatic"):
        robot = Robot(3)
        torso = robot.limb("pelvis", EQUAL, (0, 0, 0))
        robot.limb(torso, ["neck"], (0, 0, 0.3), kind=kind)
        texts.append(robot.text)
    found = diagnose(*(write(f"{i}.urdf", text) for i, text in enumerate(texts)))
    sentences = [each.sentence for each in found.differences]
    assert any(said.startswith("neck: a hinge in A, a slide in B; it and all that it carries") for said in sentences)
    assert not found.same


@pytest.mark.slow
def test_joints_between_those_of_one_name_are_held(write):
    """B's back has a joint more between two that both have."""
    one, other = Robot(4), Robot(4)
    one.limb("pelvis", EQUAL[:7], (0, 0, 0))
    other.limb("pelvis", [*EQUAL[:2], "extra", *EQUAL[2:7]], (0, 0, 0))
    found = diagnose(write("a.urdf", one.text), write("b.urdf", other.text))
    assert len(found.pairing.joints) == 7
    assert any(each.item_b == "extra" for each in found.differences)


def test_few_equal_names_are_chance(write):
    one, other = Robot(5), Robot(6)
    one.limb("pelvis", [f"a{i}" for i in range(9)] + EQUAL[:3], (0, 0, 0))
    other.limb("pelvis", EQUAL[:3] + [f"b{i}" for i in range(9)], (0.5, 0, 0), OTHER)
    found = diagnose(write("a.urdf", one.text), write("b.urdf", other.text))
    assert "models of different machines" in found.verdict
    assert not found.same


def test_joints_under_other_names_have_partners_though_a_limb_is_missing(write):
    one, other = Robot(7), Robot(7)
    one.limb("pelvis", [f"a{i}" for i in range(5)], (0, 0, 0.1))
    one.limb("pelvis", [f"tail{i}" for i in range(2)], (0, 0.3, 0))
    other.limb("pelvis", [f"b{i}" for i in range(5)], (0, 0, 0.1))
    found = diagnose(write("a.urdf", one.text), write("b.urdf", other.text))
    assert found.pairing.joints == {f"a{i}": f"b{i}" for i in range(5)}
    assert {*found.pairing.how.values()} == {"geometry"}
    assert [each.item_a for each in found.differences] == ["tail0"]


HAND = """<robot name="r"><link name="base"/>
<link name="hand"><inertial><origin xyz="0 0.02 0.3"/><mass value="{mass}"/>
<inertia ixx="0.02" iyy="0.03" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="finger"><inertial><origin xyz="0.01 0 0.05"/><mass value="0.3"/>
<inertia ixx="0.001" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="arm" type="continuous"><parent link="base"/><child link="hand"/><axis xyz="1 0 0"/></joint>
<joint name="grip" type="{kind}"><origin xyz="0 0 0.4"/><parent link="hand"/><child link="finger"/><axis xyz="0 1 0"/>
</joint></robot>"""


def test_what_a_joint_of_one_model_moves_is_no_part_of_what_is_put_right(write):
    a = write("a.urdf", HAND.format(mass=1.0, kind="fixed"))
    found = diagnose(a, write("b.urdf", HAND.format(mass=1.2, kind="continuous")))
    assert found.attribution.share == pytest.approx(1.0)
    assert found.proof.agrees
    assert found.proof.on == "file"
    changes = {each.what: each.change for each in found.differences if each.change}
    assert changes["mass"].value == pytest.approx(1.0)
    assert changes["com"].value == pytest.approx([0.0, 0.02, 0.3])
