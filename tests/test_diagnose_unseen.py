"""What no torque of the open tree can show is found all the same, named as what it is, and patched where it can be."""

from __future__ import annotations

from pathlib import Path

import pytest

import screwgauge
from support import robots
from support.command import main
from support.diagnosis import linkage
from support.errors import OutputError

INERTIAL = '<inertial pos="0.1 0 0.02" mass="1" diaginertia="0.01 0.02 0.02"/>'
FOUR_BAR = linkage(more='<actuator><motor name="m" joint="a" gear="2"/></actuator>')


@pytest.fixture
def diagnosed(diagnosed):
    """Diagnosis of the linkage against a copy with some texts replaced."""

    def of(*edits, a=FOUR_BAR, b=FOUR_BAR):
        for old, new in edits:
            assert b.count(old) == 1
            b = b.replace(old, new)
        return diagnosed(a, b)

    return of


def sentences(found):
    assert found.same == (not found.differences)
    assert found.exit_status == (1 if found.differences else 0)
    return [each.sentence for each in found.differences]


def test_the_same_is_the_same(diagnosed):
    assert sentences(diagnosed()) == []


def test_a_motor_on_another_joint(diagnosed):
    found = diagnosed(('<motor name="m" joint="a"', '<motor name="m" joint="c"'))
    assert sentences(found) == ["m: drives c in B, a in A"]
    assert "m: drives c in B, a in A" in found.verdict


def test_a_coupling_to_another_joint_names_both(diagnosed):
    found = diagnosed(('joint1="d" joint2="a"', 'joint1="d" joint2="b"'))
    assert sentences(found) == ["d: follows b in B, a in A"]
    assert [each.change for each in found.differences] == [None]


WEIGHT = (
    '<body name="weight" pos="0 0 0.1"><joint name="w" axis="0 0 1"/>'
    '<inertial pos="0 0 0" mass="0.3" diaginertia="1e-3 1e-3 1e-3"/></body><body name="rod"'
)


def test_a_branch_that_one_lacks_changes_nothing_before_it(diagnosed):
    """Nor does what carries it have its mass, in whichever model it is."""
    right, extra = FOUR_BAR, FOUR_BAR.replace('<body name="rod"', WEIGHT)
    found = diagnosed(('<body name="rod"', WEIGHT))
    assert sentences(found) == ["w: missing in A, with all that it carries (1 body, 0.3 kg)"]
    assert "explains 100.0000 % of the torque difference" in found.verdict
    found = diagnosed(a=extra, b=right)
    said = "w: missing in B, with all that it carries (1 body, 0.3 kg), without which torques are compared"
    assert sentences(found) == [said]
    found = diagnosed(a=extra, b=right.replace('mass="1"', 'mass="1.1"', 1))
    assert sentences(found) == [said, "crank: mass 1.100 kg in B, 1.000 kg in A (+10.00 %)"]
    assert found.headline == "crank: mass 1.100 kg in B, 1.000 kg in A (+10.00 %), and 1 more cause."
    assert found.explanation.startswith("It explains 100.0000 % of the torque difference")


def test_a_coupling_that_one_lacks(diagnosed):
    found = diagnosed(('<joint name="gear" joint1="d" joint2="a" polycoef="0 1 0 0 0"/>', ""))
    assert sentences(found) == ["d follows a in A only"]
    assert "Closures and couplings leave 1 degree of freedom in A, 2 in B." in found.verdict


def test_a_medium(diagnosed):
    found = diagnosed(("<worldbody>", '<option density="1.2" viscosity="0.001"/><worldbody>'))
    assert sentences(found) == ["medium (1.2, 0.001) kg/m^3, Pa s in B, (0, 0) kg/m^3, Pa s in A"]


OPEN = "Torques are compared of the open tree, which cannot show it."


def test_an_anchor_elsewhere_is_said_with_what_it_opens(diagnosed):
    found = diagnosed(('anchor="0.3 0 0"', 'anchor="0.301 0 0"'))
    assert len(found.differences) == 2
    assert all("is elsewhere in B, shifted by +1 mm along " in each for each in sentences(found))
    assert OPEN in found.verdict


def test_a_closure_that_is_missing_or_of_another_kind(diagnosed):
    loop = '<connect name="loop" body1="rod" body2="rocker" anchor="0.3 0 0"/>'
    found = diagnosed((loop, ""))
    (sentence,) = sentences(found)
    assert sentence.startswith("loop: a closure of rod and rocker in A only")
    assert OPEN in found.verdict
    found = diagnosed((loop, '<weld name="loop" body1="rod" body2="rocker" anchor="0.3 0 0"/>'))
    assert sentences(found)[0].startswith("loop: a weld in B, a point in A")
    assert OPEN in found.verdict


def test_beside_what_no_torque_shows_for_another_reason(diagnosed):
    found = diagnosed(('anchor="0.3 0 0"', 'anchor="0.301 0 0"'), ('gear="2"', 'gear="3"'))
    assert "the open tree, which cannot show what differs in closures and couplings, and no torque" in found.verdict


def test_beside_what_torques_show(diagnosed):
    found = diagnosed(
        ('polycoef="0 1 0 0 0"', 'polycoef="0 2 0 0 0"'), ("<worldbody>", '<option gravity="0 0 -9.8"/><worldbody>')
    )
    assert "1 further difference does not affect torques of the open tree." in found.verdict
    assert "The motions that loops leave differ by 0." in found.verdict


@pytest.mark.slow
def test_what_no_torque_shows_is_put_right_in_the_file(tmp_path):
    """Alone, and beside what torques show."""
    path = robots.write(tmp_path)[1]
    text = path.read_text(encoding="utf-8")
    start = text.index('name="link0"')
    mass = text[text.index('mass="', start) :].split('"')[1]
    both = text.replace(f'mass="{mass}"', f'mass="{float(mass) + 0.5}"', 1).replace("-1.5 1.2", "-1 1.2")
    limits = text.replace("-1.5 1.2", "-1 1.2")
    for name, other, shown in (("limits.xml", limits, 0), ("both.xml", both, 1)):
        b, out = tmp_path / name, tmp_path / f"fixed-{name}"
        b.write_text(other, encoding="utf-8")
        found = screwgauge.diagnose(path, b)
        assert len(found.differences) == 1 + shown
        found.write_fix(out)
        assert found.not_fixed == ()
        assert screwgauge.diagnose(path, out).same


@pytest.mark.slow
def test_what_cannot_be_put_right_is_said(diagnosed, tmp_path, capsys):
    moved = ('<motor name="m" joint="a"', '<motor name="m" joint="c"')
    with pytest.raises(OutputError, match=r"nothing to write: no change of B's file is known for this: m: drives c"):
        diagnosed(moved).write_fix(tmp_path / "fixed.xml")
    diagnosed(moved, ("<worldbody>", '<option gravity="0 0 -9.8"/><worldbody>'))
    files = [str(tmp_path / name) for name in ("a.xml", "b.xml")]
    assert main(["diagnose", *files, "--out", str(tmp_path / "out"), "--fix", str(tmp_path / "fixed.xml")]) == 1
    assert "not fixed: no change of B's file is known for this: m: drives c in B, a in A" in " ".join(
        capsys.readouterr().out.split()
    )


@pytest.mark.slow
def test_softness_of_a_closure_and_of_a_coupling(diagnosed):
    found = diagnosed(('name="loop"', 'name="loop" solref="0.5 1"'))
    assert sentences(found) == ["loop: softness, solref (0.5000, 1) in B, (0.02000, 1) in A"]
    assert OPEN in found.verdict
    found = diagnosed(('name="gear"', 'name="gear" solimp="0.8 0.95 0.001 0.5 2"'))
    (sentence,) = sentences(found)
    assert sentence.startswith("gear: softness, solimp (0.8000, 0.95, 0.001, 0.5, 2) in B, (0.9000, 0.95, ")
    assert found.differences[0].what == "softness"


#: Closures in all forms that MJCF has, closed at home; `rod` and `eye` are one body, of which the frames are not the
#: same.
TIED = (
    FOUR_BAR.replace('pos="0 0 0.1"><joint name="d"', 'pos="0 0 0.1" euler="0 20 0"><joint name="d"')
    .replace('<body name="tip"', '<site name="s" pos="0.1 0 0" euler="0 10 0"/><body name="tip"')
    .replace('<joint name="b" axis="0 1 0"/>', '<joint name="b" axis="0 1 0"/><body name="eye" pos="0 0.1 0"/>')
    .replace(
        '<body name="eye" pos="0 0.1 0"/>',
        '<body name="eye" pos="0.3 0.1 0"><site name="r" pos=".1 -.1 -.2" euler="0 10 0"/></body>',
    )
    .replace(
        "<equality>",
        '<equality><weld body1="eye" body2="tip" anchor="0 0 .1" '
        'relpose="0.03420201433256687 -.1 -0.006030737921409152 0.984807753012208 0 0.17364817766693033 0"/>'
        '<connect name="sites" site1="s" site2="r"/><weld name="fixed" site1="r" site2="s" torquescale="2"/>',
    )
    .replace('joint name="gear"', "joint")
)
TIES = {
    "anchor of a connect": [('anchor="0.3 0 0"', 'anchor="0.301 0.02 0"')],
    "anchor of a weld": [('anchor="0 0 .1"', 'anchor="0 0.2 .1"')],
    "pose of a weld": [('relpose="0.03420201433256687', 'relpose="0.13')],
    "site": [('pos=".1 -.1 -.2" euler="0 10 0"', 'pos=".1 -.05 -.2" axisangle="1 0 0 30"')],
    "softness": [('name="sites"', 'name="sites" solref="0.5 1"'), ("<joint joint1", '<joint solimp="0.8 .9" joint1')],
    "scale of torques": [(' torquescale="2"', "")],
    "all at once": [
        ('pos="0.1 0 0" euler="0 10 0"', 'pos="0.1 0.2 0" euler="0 20 0"'),
        ('relpose="0.03420201433256687', 'solref="-500 -1" relpose="0.13'),
        ('<body name="rocker" pos="0.3 0 0"', '<body name="rocker" pos="0.35 0 0"'),
    ],
}


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("case", TIES)
def test_closures_are_put_right_in_the_file(case, tmp_path):
    text = TIED
    for old, new in TIES[case]:
        assert text.count(old) == 1
        text = text.replace(old, new)
    paths = [tmp_path / name for name in ("a.xml", "b.xml", "fixed.xml")]
    for path, content in zip(paths, (TIED, text), strict=False):
        path.write_text(content, encoding="utf-8")
    found = screwgauge.diagnose(*paths[:2])
    assert found.differences
    found.write_fix(paths[2])
    assert found.not_fixed == ()
    assert screwgauge.diagnose(paths[0], paths[2]).same


@pytest.mark.slow
def test_what_a_file_cannot_say_of_closures_is_said(tmp_path):
    """A site that others use does not move alone."""
    both = TIED.replace("<worldbody>", '<sensor><framepos objtype="site" objname="s"/></sensor><worldbody>')
    (tmp_path / "a.xml").write_text(both, encoding="utf-8")
    (tmp_path / "b.xml").write_text(both.replace('"s" pos="0.1 0 0"', '"s" pos="0.2 0 0"'), encoding="utf-8")
    found = screwgauge.diagnose(tmp_path / "a.xml", tmp_path / "b.xml")
    assert found.not_fixed == ("site 's' is used elsewhere, too: give the closure one of its own",)
    with pytest.raises(OutputError, match="nothing to write: site 's' is used elsewhere"):
        found.write_fix(tmp_path / "fixed.xml")


def test_torquescale_of_a_weld_is_compared(tmp_path):
    (tmp_path / "a.xml").write_text(TIED, encoding="utf-8")
    (tmp_path / "b.xml").write_text(TIED.replace(' torquescale="2"', ""), encoding="utf-8")
    found = screwgauge.diagnose(tmp_path / "a.xml", tmp_path / "b.xml")
    assert sentences(found) == ["fixed: softness, torquescale (1.000) in B, (2.000) in A"]


def test_a_point_mass_on_its_axis_has_no_length_and_is_compared(tmp_path):
    text = (
        '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="{}"/>'
        '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    for name, mass in (("a.urdf", 1), ("b.urdf", 1.5)):
        (tmp_path / name).write_text(text.format(mass), encoding="utf-8")
    found = screwgauge.diagnose(tmp_path / "a.urdf", tmp_path / "b.urdf")
    assert "b: mass 1.500 kg in B, 1.000 kg in A (+50.00 %). It explains 100.0000 %" in found.verdict


def test_gravity_of_an_import_is_that_of_its_scene(inside):
    """A description cannot say it; its scene can, and the model files that are made of both."""
    text = (
        f'<mujoco model="m"><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 1 0"/>{INERTIAL}</body>'
    )
    Path("still.xml").write_text(f"{text}</worldbody></mujoco>", encoding="utf-8")
    assert main(["import", "still.xml"]) == 0
    for made in ("still.toml", "still.xml"):
        assert main(["models", made, "--out", "made", "--check"]) == 0
        assert screwgauge.diagnose("still.xml", "made/m.xml").same
    assert screwgauge.diagnose("still.xml", "still.toml").same
    Path("still.scene.toml").unlink()
    alone = screwgauge.diagnose("still.xml", "still.toml")
    assert "B says no gravity; 9.81 m/s^2 downwards is taken" in alone.notes


def test_mass_that_welded_bodies_share_otherwise_is_said_to_be_the_same_as_a_whole(diagnosed):
    arm_, twin = (f'<body name="{n}"><joint name="j{n}" axis="0 1 0"/>{INERTIAL}</body>' for n in "ab")
    model = f'<mujoco><worldbody>{arm_}{twin}</worldbody><equality><weld body1="a" body2="b"/></equality></mujoco>'
    said = "a and b are welded to each other and are the same as a whole, which A and B divide otherwise"

    def notes(one, two):
        text = model.replace(arm_, arm_.replace(INERTIAL, scaled(one)))
        return " ".join(diagnosed(a=model, b=text.replace(twin, twin.replace(INERTIAL, scaled(two)))).notes)

    def scaled(share):
        moments = " ".join(repr(share * moment) for moment in (0.01, 0.02, 0.02))
        return INERTIAL.replace('"1"', f'"{share}"').replace("0.01 0.02 0.02", moments)

    assert said in notes(0.5, 1.5)
    assert said not in notes(0.5, 1.0)
    assert said not in notes(1.0, 1.0)


def test_force_laws_of_actuators_are_compared(diagnosed):
    servo = FOUR_BAR.replace('<motor name="m" joint="a" gear="2"/>', '<position name="m" joint="a" kp="{}"/>')
    assert sentences(diagnosed(a=servo.format(1), b=servo.format(1))) == []
    (said,) = sentences(diagnosed(a=servo.format(1), b=servo.format(2)))
    assert said == "force law of actuator m: gainprm[0] 2 in B, 1 in A"


def test_a_weld_whose_closed_poses_are_nearly_singular_is_no_fault_of_the_engine(tmp_path):
    """Of six hinges that a weld of the last to the first leaves at poses where condition numbers reach 1e7."""
    axes = ("0 0 1", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
    opened, closed = "", ""
    for i, axis in enumerate(axes):
        opened += f'<body name="b{i}" pos="0.1 {0.05 * (i % 2)} 0.2"><joint name="q{i}" axis="{axis}"/>{INERTIAL}'
        closed += "</body>"
    weld = '<equality><weld name="w" body1="b5" body2="b1"/></equality>'
    a, b = tmp_path / "a.xml", tmp_path / "b.xml"
    a.write_text(f"<mujoco><worldbody>{opened}{closed}</worldbody></mujoco>")
    b.write_text(f"<mujoco><worldbody>{opened}{closed}</worldbody>{weld}</mujoco>")
    found = screwgauge.diagnose(a, b)
    assert "difference of the engine" not in found.verdict
    assert all(witness.agrees for witness in found.witnesses)
