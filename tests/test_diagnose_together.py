"""The libraries' own torques of two models, as loaded, agree before the models are called the same."""

from __future__ import annotations

import numpy as np
import pytest

import screwgauge
from screwgauge.diagnosis import libraries as module
from support.mechanism import load_mechanism
from support.models import write_models
from support.trees import raw_queries

INERTIAL = '<inertial pos="0.2 0.05 0.1" mass="{}" fullinertia="0.02 0.03 0.04 0.001 0.002 -0.003"/>'
MATTER = (
    '<inertial><origin xyz="0.2 0.05 0.1"/><mass value="{}"/>'
    '<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0.002" iyz="-0.003"/></inertial>'
)
URDF = (
    f'<robot name="r"><link name="base">{MATTER.format(2)}</link><link name="arm">{MATTER.format(1)}</link>'
    '<joint name="j" type="continuous"><origin xyz="0.3 0 0.1" rpy="0.1 0.2 0.3"/>'
    '<parent link="base"/><child link="arm"/>'
    '<axis xyz="0 1 0"/><dynamics damping="0.3" friction="0.1"/></joint></robot>'
)
MJCF = (
    '<mujoco><compiler angle="radian" eulerseq="XYZ"/>{option}<worldbody>'
    '<body name="base" {at}><freejoint name="free"/>'
    + INERTIAL.format(2)
    + '<body name="arm" pos="0.3 0 0.1" euler="0.1 0.2 0.3">'
    '<joint name="j" axis="0 1 0" damping="0.3" frictionloss="0.1"/>'
    + INERTIAL.format(1)
    + '<body name="ball" pos="0.2 0 0" euler="0.3 0 0.4"><joint name="s" type="ball" damping="0.2"/>'
    + INERTIAL.format(0.5)
    + "</body></body></body></worldbody></mujoco>"
)


@pytest.fixture
def files(tmp_path, inside):

    def write(**texts):
        for name, text in texts.items():
            (tmp_path / f"{name}{'.urdf' if '<robot' in text else '.xml'}").write_text(text, encoding="utf-8")

    return write


def rpy(text):
    """MJCF's XYZ turns about moving axes, URDF's rpy about fixed ones."""
    return text.replace('rpy="0.1 0.2 0.3"', 'rpy="0.1 0 0"').replace('euler="0.1 0.2 0.3"', 'euler="0.1 0 0"')


def test_a_floating_base_that_stands_elsewhere_and_a_ball_joint_are_asked_the_same(files):
    still, elsewhere = (MJCF.format(option="", at=at) for at in ("", 'pos="1 2 3" euler="0.4 0.5 0.6"'))
    files(a=still, b=elsewhere)
    found = screwgauge.diagnose("a.xml", "b.xml")
    assert found.same, found.verdict
    assert found.found.together.largest > 1.0
    assert found.found.together.states == module.STATES


def test_a_urdf_that_floats_beside_an_mjcf(files):
    ball = MJCF[MJCF.index('<body name="ball"') : MJCF.index("</body></body></body>")] + "</body>"
    text = rpy(MJCF.replace(ball, "").format(option="", at='pos="0 0 1" euler="0 0.3 0"'))
    files(a=rpy(URDF), b=text)
    found = screwgauge.diagnose("a.urdf", "b.xml")
    assert found.found.together.agrees, found.verdict
    assert found.found.together.calls == ("rnea", "mj_inverse")


@pytest.mark.slow
def test_loops_in_either_cut_and_a_description_agree_at_closed_states(files, tmp_path):
    write_models(load_mechanism("a02-fourbar-2"), tmp_path)
    name = "a02-fourbar-2"
    for pair in ((name, f"{name}.xml"), (f"{name}-full.xml", f"{name}.xml"), (f"{name}.xml", f"{name}-full.xml")):
        found = screwgauge.diagnose(*pair)
        assert found.same, found.verdict
        assert found.found.together.row.scaled < 1e-12
        assert found.found.together.largest > 0.1


def test_torques_that_differ_for_no_reason_that_is_read_are_not_the_same(files, monkeypatch):
    """Whatever a library adds as it loads one of the two files."""
    text = MJCF.format(option="", at="")
    files(a=text, b=text.replace("<worldbody>", "<!-- b --><worldbody>"))
    ask = raw_queries.ask

    def faked(path, bodies, joints, floating=False, whole=False):
        said = ask(path, bodies, joints, floating, whole)
        more = 0.5 * np.ones_like(said.tau) if whole and path.name == "b.xml" else 0.0
        return type(said)(**{**{f: getattr(said, f) for f in said.__slots__}, "tau": said.tau + more})

    monkeypatch.setattr(raw_queries, "ask", faked)
    found = screwgauge.diagnose("a.xml", "b.xml")
    assert (found.same, found.undecided, found.exit_status) == (False, False, 1)
    assert found.differences == ()
    assert found.verdict.startswith(
        "The libraries' own forces as loaded (mj_inverse of A and mj_inverse of B, with passive "
    )
    assert "differ by 0.5 of " in found.verdict


def test_what_is_not_compared_is_named_as_what_could_be_the_cause(files):
    text = MJCF.format(option="", at="").replace("<freejoint", '<site name="s1"/><freejoint')
    site = text.replace('<joint name="j"', '<site name="s2" pos="0.1 0.1 0.5"/><joint name="j"')
    tendon = '<tendon><spatial name="rope" stiffness="50"><site site="s1"/><site site="s2"/></spatial></tendon>'
    files(a=site, b=site.replace("</mujoco>", f"{tendon}</mujoco>"))
    found = screwgauge.diagnose("a.xml", "b.xml")
    assert "The cause may be in what is not compared: spatial tendon rope in B." in found.verdict
    assert found.found.together.row.component == "j"
    assert not found.undecided


def test_a_planar_joint_is_no_fault_of_the_library(write):
    """Pinocchio counts its linear velocity along the axes of the body that it carries."""
    inertial = (
        '<inertial><origin xyz="0.1 0.2 0.05"/><mass value="1"/>'
        '<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    joint = '<joint name="j" type="planar"><parent link="base"/><child link="b"/><axis xyz="0 0 1"/></joint>'
    file = write("planar.urdf", f'<robot name="r"><link name="base"/><link name="b">{inertial}</link>{joint}</robot>')
    found = screwgauge.diagnose(file, file)
    assert found.same, found.verdict
