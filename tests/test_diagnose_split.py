"""One freedom that two models make of other joints, a ball and three hinges, is one difference, with what to do."""

from __future__ import annotations

import pytest

from screwgauge import diagnose

INERTIAL = '<inertial pos="0.1 0 0" mass="1" diaginertia=".01 .02 .03"/>'
MODEL = f"""<mujoco model="m"><worldbody><body name="base"><joint name="turn" axis="0 0 1"/>{INERTIAL}
<body name="hand" pos=".3 0 0">@{INERTIAL}<body name="tip" pos=".3 0 0"><joint name="last" axis="1 0 0"/>{INERTIAL}
</body></body></body></worldbody></mujoco>"""
BALL = '<joint name="wrist" type="ball"/>'
HINGES = '<joint name="wx" axis="1 0 0"/><joint name="wrist" axis="0 1 0"/><joint name="wz" axis="1 0 1"/>'
#: The same through bodies that have no mass, as a URDF has it.
LINKS = """<robot name="m"><link name="world"/><link name="base">{0}</link><link name="c1"/><link name="c2"/>
<link name="hand">{0}</link><link name="tip">{0}</link>{1}</robot>"""
SOLID = """<inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial>"""
CHAIN = (
    *(("turn", "world", "base", "0 0 0", "0 0 1"), ("wx", "base", "c1", ".3 0 0", "1 0 0")),
    *(
        ("wy", "c1", "c2", "0 0 0", "0 1 0"),
        ("wz", "c2", "hand", "0 0 0", "0 0 1"),
        ("last", "hand", "tip", ".3 0 0", "1 0 0"),
    ),
)
URDF = LINKS.format(
    SOLID,
    "".join(
        f'<joint name="{name}" type="continuous"><parent link="{near}"/><child link="{far}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="{axis}"/></joint>'
        for name, near, far, xyz, axis in CHAIN
    ),
)
SLIDES = "".join(
    f'<joint name="t{x}" type="slide" axis="{axis}"/>'
    for x, axis in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True)
)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("other", "names"), [(MODEL.replace("@", HINGES), "wx, wrist, wz"), (URDF, "wx, wy, wz")])
def test_a_ball_joint_and_three_hinges_about_its_centre_are_one_difference(other, names, turned, write):
    files = [write("a.xml", MODEL.replace("@", BALL)), write("b.urdf" if other is URDF else "b.xml", other)]
    found = diagnose(*(reversed(files) if turned else files))
    (said,) = found.differences
    a, b = ("B", "A") if turned else ("A", "B")
    assert said.sentence == (
        f"wrist: a ball joint in {a}, in {b} the joints {names}, which move what they carry in the same ways; all are "
        f"held where torques are compared: make them one kind of joint to compare them"
    )
    assert (said.what, found.exit_status) == ("kind", 1)


@pytest.mark.parametrize("home", ["", ' pos="0 0 0.1"'])
def test_a_free_joint_and_six_of_one_freedom_are_one_difference(home, write):
    """Where the six count from says nothing of what they carry."""
    floating = MODEL.replace('<joint name="turn" axis="0 0 1"/>', "{}").replace("@", '<joint name="q" axis="0 1 0"/>')
    six = SLIDES + HINGES
    stands = floating.replace('name="base"', f'name="base"{home}')
    found = diagnose(write("a.xml", stands.format('<freejoint name="float"/>')), write("b.xml", floating.format(six)))
    (said,) = found.differences
    assert said.sentence.startswith("float: a free joint in A, in B the joints tx, ty, tz, wx, wrist, wz, which move")


def test_hinges_that_miss_the_centre_are_other_joints(write):
    off = HINGES.replace('axis="0 1 0"', 'axis="0 1 0" pos="0 0 .1"')
    found = diagnose(write("a.xml", MODEL.replace("@", BALL)), write("b.xml", MODEL.replace("@", off)))
    assert [each.what for each in found.differences] == ["branch", "branch"]
