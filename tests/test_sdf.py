"""SDF is read as its specification has it: frames, nested and included models, shapes, couplings, the world."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from support.mechanism import DATA, GROUND
from support.models import import_model
from support.readings import Reading, read

LINK = '<link name="{}"><pose>{}</pose><inertial><mass>{}</mass></inertial></link>'


def model(parts: str, version: str = "1.9", gravity: str = "0 0 -9.8") -> str:
    world = f'<world name="w"><gravity>{gravity}</gravity><model name="m">{parts}</model></world>'
    return f'<?xml version="1.0"?><sdf version="{version}">{world}</sdf>'


def joint(name: str, kind: str, parent: str, child: str, more: str = "") -> str:
    return f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>{more}</joint>'


def axis(xyz: str, more: str = "", tag: str = "axis") -> str:
    return f"<{tag}><xyz>{xyz}</xyz>{more}</{tag}>"


def arm(more: str = "", axes: str = axis("0 1 0")) -> str:
    """Two links in a row: one on the world, one on the first, with a hinge each."""
    links = LINK.format("a", "0 0 0.5 0 0 0", 1) + LINK.format("b", "0 0 1.5 0 0 0", 2)
    return links + joint("j", "revolute", "world", "a", axes) + joint("k", "revolute", "a", "b", axis("0 1 0")) + more


def reading(tmp_path: Path, text: str) -> Reading:
    (tmp_path / "m.sdf").write_text(text, encoding="utf-8")
    return read(tmp_path / "m.sdf", "screwgauge")


def test_frames_are_placed_in_frames_and_attached_to_them(tmp_path):
    frames = (
        '<frame name="f" attached_to="b"><pose>0 0 0.25 0 0 0</pose></frame>'
        '<frame name="g" attached_to="f"><pose relative_to="a" degrees="true">0.1 0 0 90 0 0</pose></frame>'
        '<link name="c"><pose relative_to="g">0 0.2 0 0 0 0</pose></link>'
    )
    found = reading(tmp_path, model(arm(frames + joint("l", "prismatic", "g", "c", axis("0 0 1")))))
    assert found.bodies["c"].near == "b"
    assert found.bodies["c"].pose[:3, 3] == pytest.approx([0.1, 0.0, 0.7])
    assert found.joints["l"].direction == pytest.approx([0.0, -1.0, 0.0])


def test_a_turn_may_be_a_quaternion(tmp_path):
    pose = '<pose rotation_format="quat_xyzw">1 2 3 0 0 1 1</pose>'
    found = reading(tmp_path, model(arm().replace("<pose>0 0 1.5 0 0 0</pose>", pose)))
    assert found.bodies["b"].pose[:3, 0] == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("version", "axes"),
    [
        ("1.9", '<axis><xyz expressed_in="__model__">0 1 0</xyz></axis>'),
        ("1.6", "<axis><xyz>0 1 0</xyz><use_parent_model_frame>1</use_parent_model_frame></axis>"),
        ("1.5", axis("1 0 0")),
    ],
)
def test_axes_are_expressed_in_the_frame_that_they_name(version, axes, tmp_path):
    turned = arm(axes=axes).replace("0 0 0.5 0 0 0", "0 0 0.5 0 0 1.5707963267948966")
    assert reading(tmp_path, model(turned, version)).joints["j"].direction == pytest.approx([0.0, 1.0, 0.0])


def test_nested_models_are_placed_by_the_frame_that_they_name(tmp_path):
    nested = '<model name="hand" placement_frame="palm"><pose relative_to="b">0 0 1 0 0 0</pose>{}{}</model>'.format(
        LINK.format("palm", "0 0 0.3 0 0 0", 0.5), LINK.format("thumb", "0 0 0.4 0 0 0", 0.1)
    )
    hinges = joint("w", "revolute", "b", "hand::palm", axis("1 0 0")) + joint("t", "fixed", "hand::palm", "hand::thumb")
    found = reading(tmp_path, model(arm(nested + hinges)))
    assert found.bodies["hand::palm"].pose[:3, 3] == pytest.approx([0.0, 0.0, 2.5])
    assert found.bodies["hand::palm"].mass == pytest.approx(0.6)
    assert set(found.bodies["hand::palm"].fixed) == {"hand::thumb"}


INCLUDED = {
    "<include><uri>{}</uri><name>tool</name><pose relative_to='b'>0 0 1 0 0 0</pose></include>": "tool::t",
    "<include merge='true'><uri>{}</uri><pose relative_to='b'>0 0 1 0 0 0</pose></include>": "t",
}


@pytest.mark.parametrize("include", INCLUDED)
@pytest.mark.parametrize("uri", ["model://tool", "tool", "tool/model.sdf"])
def test_included_models_are_put_in_their_place(uri, include, tmp_path):
    (tmp_path / "tool").mkdir()
    link = LINK.format("t", "0 0 0.1 0 0 0", 3)
    text = f'<sdf version="1.8"><model name="x"><pose>9 9 9 0 0 0</pose>{link}</model></sdf>'
    (tmp_path / "tool" / "model.sdf").write_text(text, encoding="utf-8")
    name = INCLUDED[include]
    weld = joint("w", "revolute", "b", name, axis("1 0 0"))
    found = reading(tmp_path, model(arm(include.format(uri) + weld)))
    assert found.bodies[name].pose[:3, 3] == pytest.approx([0.0, 0.0, 2.6])
    assert found.bodies[name].mass == 3.0


def test_what_an_include_adds_belongs_to_the_model(tmp_path):
    (tmp_path / "t.sdf").write_text(f'<sdf version="1.8"><model name="x">{LINK.format("t", "", 3)}</model></sdf>')
    include = "<include><uri>t.sdf</uri><static>true</static><plugin name='grip' filename='g'/></include>"
    (tmp_path / "m.sdf").write_text(model(arm(include)), encoding="utf-8")
    assert "x::t" in read(tmp_path / "m.sdf", "screwgauge").fixed
    assert any("plugin grip" in phrase for phrase in import_model(tmp_path / "m.sdf").left_out)


def test_a_merged_model_is_placed_by_its_placement_frame(tmp_path):
    link = LINK.format("t", "0 0 0.25 0 0 0", 3)
    (tmp_path / "t.sdf").write_text(f'<sdf version="1.8"><model name="x">{link}</model></sdf>', encoding="utf-8")
    include = "<include merge='1'><uri>t.sdf</uri><placement_frame>t</placement_frame></include>"
    found = reading(tmp_path, model(arm(include + joint("w", "ball", "b", "t"))))
    assert found.bodies["t"].pose[:3, 3] == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize("version", ["1.5", "1.6"])
def test_a_joint_with_the_name_of_a_link_gets_another_one_in_old_versions(version, tmp_path):
    named = model(arm().replace('<joint name="k"', '<joint name="b"'), version)
    (tmp_path / "m.sdf").write_text(named, encoding="utf-8")
    imported = import_model(tmp_path / "m.sdf")
    assert "b_joint" in imported.mechanism.coordinates
    assert any("'b'" in said and "'b_joint'" in said for said in imported.remarks)


def test_frames_may_be_placed_in_each_other_without_end(tmp_path):
    n = 3000
    frames = (
        f'<frame name="f{i}"><pose relative_to="f{i - 1}">0 0 0.001 0 0 0</pose></frame>' for i in range(1, n + 1)
    )
    chain = "".join(
        ['<frame name="f0"/>', *frames, LINK.format("c", "", 1).replace("<pose>", f'<pose relative_to="f{n}">')]
    )
    found = reading(tmp_path, model(arm(chain + joint("l", "ball", "b", "c"))))
    assert found.bodies["c"].pose[2, 3] == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("inertial", "said"),
    [
        ("", "1 kg and 1 kg m.2 to what states no mass: c"),
        ("<inertial><mass>2</mass><inertia><ixx>1</ixx></inertia></inertial>", "1 kg m.2 .* moments of inertia: c"),
        ("<inertial auto='1'/>", "Mass and inertia of c are those of their shapes"),
    ],
)
def test_what_links_do_not_state_is_said(inertial, said, tmp_path):
    shape = "<collision name='s'><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>"
    moments = LINK.replace("</mass>", "</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>")
    links = moments.format("a", "", 1) + f'<link name="c">{inertial}{shape}</link>'
    parts = links + joint("j", "ball", "world", "a") + joint("l", "ball", "a", "c")
    still = '<model name="floor"><static>1</static><link name="floor"/></model>'
    (remark,) = reading(tmp_path, model(parts).replace("</world>", f"{still}</world>")).remarks
    assert re.search(said, remark)


R, L = 0.2, 0.7
#: Shape -> volume and moments over mass about its middle, by the formulas of a handbook; of a capsule apart.
SHAPES = {
    "<box><size>0.1 0.2 0.3</size></box>": (0.006, np.array([0.13, 0.1, 0.05]) / 12),
    "<sphere><radius>0.2</radius></sphere>": (4 / 3 * math.pi * R**3, np.full(3, 0.4 * R * R)),
    "<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>": (
        4 / 3 * math.pi * 0.006,
        np.array([0.13, 0.1, 0.05]) / 5,
    ),
    "<cylinder><radius>0.2</radius><length>0.7</length></cylinder>": (
        math.pi * R * R * L,
        np.array([(3 * R * R + L * L) / 12, (3 * R * R + L * L) / 12, R * R / 2]),
    ),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_give_mass_and_inertia_where_the_file_asks_for_it(shape, tmp_path):
    volume, moments = SHAPES[shape]
    link = (
        '<link name="c"><inertial auto="true"><density>500</density></inertial>'
        '<collision name="s"><pose relative_to="a">0 0 0.1 0 1.5707963267948966 0</pose>'
        f"<density>700</density><geometry>{shape}</geometry></collision></link>"
    )
    body = reading(tmp_path, model(arm(link + joint("l", "ball", "b", "c")))).bodies["c"]
    assert body.mass == pytest.approx(700 * volume)
    assert body.com == pytest.approx([0.0, 0.0, 0.6])
    assert np.diag(body.inertia) == pytest.approx(body.mass * moments[[2, 1, 0]])


def test_a_capsule_is_a_cylinder_between_two_hemispheres(tmp_path):
    """Against a sum over thin discs."""
    shape = "<capsule><radius>0.2</radius><length>0.7</length></capsule>"
    link = f'<link name="c"><inertial auto="1"/><collision name="s"><geometry>{shape}</geometry></collision></link>'
    body = reading(tmp_path, model(arm(link + joint("l", "ball", "b", "c")))).bodies["c"]
    z, step = np.linspace(-L / 2 - R, L / 2 + R, 200001, retstep=True)
    square = R * R - np.maximum(np.abs(z) - L / 2, 0.0) ** 2  # of the radius of each disc
    disc = 1000 * math.pi * square * step
    across, along = (disc * (square / 4 + z * z)).sum(), (disc * square / 2).sum()
    assert body.mass == pytest.approx(disc.sum(), rel=1e-9, abs=0)
    assert np.diag(body.inertia) == pytest.approx([across, across, along], rel=1e-8, abs=0)


def test_mass_beside_inertial_auto_scales_the_shapes(tmp_path):
    shape = "<geometry><sphere><radius>0.1</radius></sphere></geometry>"
    link = f'<link name="c"><inertial auto="1"><mass>2</mass></inertial><collision name="s">{shape}</collision></link>'
    body = reading(tmp_path, model(arm(link + joint("l", "ball", "b", "c")))).bodies["c"]
    assert body.mass == 2.0
    assert body.inertia[0, 0] == pytest.approx(0.008)


def test_a_mimic_follows_from_its_reference(tmp_path):
    mimic = '<mimic joint="j"><multiplier>3</multiplier><reference>0.5</reference><offset>0.2</offset></mimic>'
    k = joint("k", "revolute", "a", "b", axis("0 1 0"))
    found = reading(tmp_path, model(arm().replace(k, joint("k", "revolute", "a", "b", axis("0 1 0", mimic)))))
    assert found.couplings["k"].function.polynomials["j"] == pytest.approx([0.2 - 1.5, 3.0])


def test_the_axes_of_a_universal_joint_are_followed_one_by_one(tmp_path):
    parts = LINK.format("a", "0 0 1 0 0 0", 1) + LINK.format("b", "0 0 2 0 0 0", 1)
    mimic = '<mimic joint="u" axis="axis2"><multiplier>2</multiplier></mimic>'
    u = joint("u", "universal", "world", "a", axis("1 0 0") + axis("0 1 0", tag="axis2"))
    found = reading(tmp_path, model(parts + u + joint("k", "revolute", "a", "b", axis("0 0 1", mimic))))
    assert found.couplings["k"].function.polynomials["u.2"] == pytest.approx([0.0, 2.0])


@pytest.mark.parametrize(
    ("pitch", "way"),
    [
        ("<screw_thread_pitch>0.5</screw_thread_pitch>", 0.5),
        ("<thread_pitch>-12.566370614359172</thread_pitch>", 0.5),
        ("<screw_thread_pitch>0.2</screw_thread_pitch><thread_pitch>7</thread_pitch>", 0.2),
        ("", 1.0),
    ],
)
def test_a_screw_advances_by_its_pitch_in_a_turn(pitch, way, tmp_path):
    parts = LINK.format("a", "0 0 1 0 0 0", 1) + joint("s", "screw", "world", "a", axis("0 0 1") + pitch)
    coupling = reading(tmp_path, model(parts)).couplings["s.2"]
    assert coupling.function.polynomials["s.1"] == pytest.approx([0.0, way / math.tau])


def test_a_gearbox_couples_the_hinges_on_its_reference_body(tmp_path):
    parts = "".join(LINK.format(name, f"{x} 0 0 0 0 0", 1) for name, x in (("r", 0), ("p", 1), ("c", 2)))
    hinges = joint("j", "revolute", "world", "r", axis("1 0 0")) + joint("p1", "revolute", "r", "p", axis("0 1 0"))
    hinges += joint("c1", "revolute", "c", "r", axis("0 0 1"))  # leads from the link to the reference body
    ratio = "<gearbox_ratio>4</gearbox_ratio><gearbox_reference_body>r</gearbox_reference_body>"
    gears = joint("g", "gearbox", "p", "c", axis("0 1 0") + axis("0 0 1", tag="axis2") + ratio)
    found = reading(tmp_path, model(parts + hinges + gears))
    assert found.couplings["c1"].function.polynomials["p1"] == pytest.approx([0.0, 4.0])


def test_a_joint_has_what_its_axis_says(tmp_path):
    numbers = (
        "<limit><lower>-1</lower><upper>inf</upper><effort>7</effort></limit><dynamics><damping>0.1</damping>"
        "<friction>0.2</friction><spring_stiffness>3</spring_stiffness><spring_reference>0.4</spring_reference></dynamics>"
    )
    found = reading(tmp_path, model(arm(axes=axis("0 1 0", numbers))))
    hinge = found.joints["j"]
    assert hinge.limits == (-1.0, math.inf)
    assert [hinge.damping, hinge.friction, hinge.stiffness, hinge.rest] == [0.1, 0.2, 3.0, 0.4]
    assert [dict(each.values)["actfrcrange[1]"] for each in found.content if each.kind == "force limits"] == [7.0]


def test_a_model_is_static_or_hangs_on_the_world_or_floats(tmp_path):
    base = f'<model name="base"><static>true</static>{LINK.format("plate", "0 0 0.2 0 0 0", 5)}</model>'
    text = model(arm()).replace("</world>", f"{base}</world>")
    found = reading(tmp_path, text)
    assert "base::plate" in found.fixed
    assert set(found.bodies) == {"a", "b"}
    loose = reading(
        tmp_path, model(arm().replace("<parent>world</parent>", "<parent>b</parent>").replace('"k"', '"l"'))
    )
    assert [joint.kind for joint in loose.joints.values()].count("free") == 1


def test_gravity_is_that_of_the_world(tmp_path):
    assert reading(tmp_path, model(arm(), gravity="1 0 -3")).gravity == pytest.approx([1.0, 0.0, -3.0])
    assert reading(tmp_path, f'<sdf version="1.7"><model name="m">{arm()}</model></sdf>').gravity is None


def test_a_link_without_weight_is_measured_as_left_out(tmp_path):
    text = model(arm()).replace('<link name="b">', '<link name="b"><gravity>false</gravity>')
    (tmp_path / "m.sdf").write_text(text, encoding="utf-8")
    (borne,) = import_model(tmp_path / "m.sdf").mechanism.left_out
    assert (borne.body, borne.mass) == ("b", 2.0)


def test_a_child_named_twice_closes_a_loop():
    found = read(DATA / "four-bar.sdf", "screwgauge")
    assert {name for body in found.bodies.values() if body.copy_of for name in body.joints} == {"d"}
    assert found.joints["d"].damping == 0.3
    results = screwgauge.run(
        screwgauge.load_scene(str(DATA / "four-bar.sdf")), engines=("screw", "pinocchio", "mujoco")
    )
    assert results.ok, results
    assert not results.failures


def test_names_that_are_made_here_are_not_those_of_the_file(tmp_path):
    links = LINK.format("a", "0 0 1 0 0 0", 1) + LINK.format("b.q", "0 0 1 0 0 0", 1) + LINK.format("b", "", 1)
    loop = joint("q", "prismatic", "b.q", "b") + joint("r", "revolute", "a", "b.q") + joint("a_free", "ball", "a", "b")
    found = reading(tmp_path, model(links + loop))
    assert len(found.bodies) == 4
    assert sorted(one.kind for one in found.joints.values()) == ["ball", "free", "hinge", "slide"]


def test_what_stands_beside_the_world_is_left_out_by_name(tmp_path):
    text = model(arm()).replace("</sdf>", f'<world name="v"/><model name="n">{arm()}</model></sdf>')
    said = " ".join(each.sentence for each in reading(tmp_path, text).content)
    assert "world v" in said
    assert "model n" in said


def test_the_axis_of_a_ball_is_left_out_by_name(tmp_path):
    ball = LINK.format("c", "", 1) + joint(
        "l", "ball", "b", "c", axis("1 0 0", "<dynamics><damping>2</damping></dynamics>")
    )
    assert any("ball joint l" in each.sentence for each in reading(tmp_path, model(arm(ball))).content)


def test_next_to_no_mass_is_taken_as_it_is(tmp_path):
    (tmp_path / "m.sdf").write_text(model(arm()).replace("<mass>2</mass>", "<mass>1e-200</mass>"), encoding="utf-8")
    assert import_model(tmp_path / "m.sdf").mechanism.body("b").mass == 1e-200


def test_what_is_left_out_is_named(tmp_path):
    kinematic = model(arm()).replace('<link name="b">', '<link name="b"><kinematic>true</kinematic>')
    text = kinematic.replace("</model>", '<plugin name="p" filename="f"/><thing>3</thing></model>')
    (tmp_path / "m.sdf").write_text(text, encoding="utf-8")
    said = import_model(tmp_path / "m.sdf").left_out
    assert {phrase.split(" of ")[0] for phrase in said} == {"link kinematic", "plugin p", "model thing"}
    assert GROUND not in str(said)
