import numpy as np
import pytest

from screwgauge import diagnose
from support.urdf import joint, link, robot

pytestmark = pytest.mark.slow

LEGS = [[f"{side}_leg_{joint}" for joint in ("hpz", "hpx", "kny", "akx")] for side in "lr"]
EQUAL = ["back_z", "back_y", "back_x", *LEGS[0], *LEGS[1]]
ONE, OTHER = ("0 0 1", "1 0 0", "0 1 0"), ("0 0 1", "0 1 0", "1 0 0")


class Robot:
    def __init__(self, seed: int) -> None:
        self.random, self.parts = np.random.default_rng(seed), [link("pelvis")]

    def limb(self, root: str, names: list[str], at: tuple[float, ...], axes=ONE, kind: str = "revolute") -> str:
        for i, name in enumerate(names):
            xyz = np.array(at) if i == 0 else self.random.uniform(-0.05, 0.05, 3) + np.array([0, 0, -0.2])
            mass, com = self.random.uniform(1, 8), self.random.uniform(-0.05, 0.05, 3)
            x, c = (" ".join(f"{v:.3f}" for v in vector) for vector in (xyz, com))
            moments = [round(mass * share, 4) for share in (0.01, 0.012, 0.008)]
            self.parts.append(link(f"{name}.link", round(mass, 3), moments, c))
            self.parts.append(joint(name, kind, root, f"{name}.link", xyz=x, axis=axes[i % 3], limits=(-2, 2)))
            root = f"{name}.link"
        return root

    @property
    def text(self) -> str:
        return robot(*self.parts)


def humanoid(seed: int, arm: str, joints: int, axes=ONE, hang: str = "") -> str:
    machine = Robot(seed)
    torso = machine.limb("pelvis", EQUAL[:3], (0, 0, 0.1), axes)
    for side, y in (("l", 0.2), ("r", -0.2)):
        hand = machine.limb(hang or torso, [f"{arm}_{side}{i}" for i in range(joints)], (0, y, 0.4))
        for k in range(2):
            machine.limb(hand, [f"{arm}_{side}_finger{k}{i}" for i in range(2)], (0.03 * k, 0, -0.1))
    for names, y in zip(LEGS, (0.1, -0.1), strict=True):
        machine.limb("pelvis", names, (0, y, -0.1), axes)
    return machine.text


@pytest.fixture
def found(write):
    a = write("a.urdf", humanoid(1, "arm", 6))
    return diagnose(a, write("b.urdf", humanoid(2, "manus", 7, OTHER, "pelvis")))


def partners(found):
    return {name: partner.name for name, partner in found.found.pair.joints.items()}


def test_identical_names_pair_joints_of_machines_that_have_little_else_in_common(found):
    assert partners(found).items() >= {name: name for name in EQUAL}.items()
    assert all(found.found.how[name] == "name" for name in EQUAL)
    assert len(partners(found)) < 0.5 * 31
    assert found.found.alike
    assert found.exit_status == 1


def test_what_fits_is_compared_and_what_does_not_is_named(found):
    facts = {(fact.what, fact.part): fact for fact in found.found.facts}
    lost = {part: fact.side for (what, part), fact in facts.items() if what == "branch"}
    assert lost.items() >= {"arm_l0": "A", "arm_r0": "A", "manus_l0": "B", "manus_r0": "B"}.items()
    assert len(facts["branch", "arm_l0"].more) == 10
    assert np.linalg.norm(facts["placement", "back_y"].b[0]) == pytest.approx(np.pi / 2)
    assert ("mass", "l_leg_kny.link") in facts


def test_a_joint_of_the_same_name_and_another_kind_is_said_to_be_so(write):
    texts = []
    for kind in ("revolute", "prismatic"):
        machine = Robot(3)
        torso = machine.limb("pelvis", EQUAL, (0, 0, 0))
        machine.limb(torso, ["neck"], (0, 0, 0.3), kind=kind)
        texts.append(machine.text)
    found = diagnose(*(write(f"{i}.urdf", text) for i, text in enumerate(texts)))
    (fact,) = (fact for fact in found.found.facts if fact.what == "kind")
    assert (fact.part, fact.a, fact.b) == ("neck", "R", "P")


def test_few_equal_names_are_chance(write):
    one, other = Robot(5), Robot(6)
    one.limb("pelvis", [f"a{i}" for i in range(9)] + EQUAL[:3], (0, 0, 0))
    other.limb("pelvis", EQUAL[:3] + [f"b{i}" for i in range(9)], (0.5, 0, 0), OTHER)
    found = diagnose(write("a.urdf", one.text), write("b.urdf", other.text))
    assert not found.found.alike
    assert not found.same


def test_joints_under_other_names_have_partners_though_a_limb_is_missing(write):
    one, other = Robot(7), Robot(7)
    one.limb("pelvis", [f"a{i}" for i in range(5)], (0, 0, 0.1))
    one.limb("pelvis", [f"tail{i}" for i in range(2)], (0, 0.3, 0))
    other.limb("pelvis", [f"b{i}" for i in range(5)], (0, 0, 0.1))
    found = diagnose(write("a.urdf", one.text), write("b.urdf", other.text))
    assert partners(found) == {f"a{i}": f"b{i}" for i in range(5)}
    assert {*found.found.how.values()} == {"geometry"}
    assert [fact.part for fact in found.found.facts] == ["tail0"]
