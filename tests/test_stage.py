import json
import re
from dataclasses import replace
from functools import cache
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import screwgauge
from screwgauge.models.shapes import DOUBT, differences, face_on_view, shapes, view_axes, viewed_from
from screwgauge.report.stage.drawing import drawing, labels
from screwgauge.report.stage.motion import FRAMES
from screwgauge.report.stage.picture import remarks, stage
from support.data import data
from support.mechanism import Joint, Mechanism, load_mechanism, mechanism_names
from support.pages import Items, Picture
from support.solve import layout, length, pose, positions

SEEN = 2e-4  # of the mechanism's length: positions and quaternions have four decimals
MOST = 400_000  # of the default scene, bytes


@cache
def solved() -> tuple[screwgauge.Scene, Picture]:
    scene = screwgauge.load_scene("3ups-upu-s").at(np.linspace(0.0, 10.0, 300))
    return scene, stage(scene, screwgauge.run(scene, engines=["screw"]).solutions)


def data_of(picture: Picture) -> dict[str, Any]:
    return json.loads(picture.stage)


def placed(data: dict[str, Any], frame: int, body: int, point: Any) -> np.ndarray:
    px, py, pz, w, x, y, z = data["poses"][frame][7 * body : 7 * body + 7]
    v, axis = np.array(point), np.array([x, y, z])
    return np.array([px, py, pz]) + v + 2.0 * np.cross(axis, np.cross(axis, v) + w * v)


def words_of(svg: str) -> list[str]:
    return re.findall(r"<text[^>]*>([^<]*)</text>", svg)


@pytest.mark.slow
def test_bodies_are_where_the_motion_has_them() -> None:
    scene, picture = solved()
    data, mechanism = data_of(picture), scene.mechanism
    lay = layout(mechanism)
    unit, rows = length(lay), [int(np.argmin(np.abs(scene.t - t))) for t in data["t"]]
    at = pose(lay, positions(lay, scene.motion.y[rows], scene.t[rows]))
    com, i = mechanism.body("platform").com, mechanism.body_index["platform"]
    expected = (at.p[:, i] + at.R[:, i] @ com) / unit
    found = np.array([placed(data, k, i, com / unit) - placed(data, k, 0, np.zeros(3)) for k in range(len(rows))])
    assert len(rows) == FRAMES
    assert found == pytest.approx(expected, abs=SEEN)


def test_every_joint_and_body_has_its_shapes_and_those_that_are_driven_or_cut_have_more() -> None:
    scene, picture = solved()
    data, mechanism = data_of(picture), scene.mechanism
    named = {group: {s["n"] for s in data["shapes"] if s["g"] == group} for group in ("links", "joints", "masses")}
    assert named["links"] == named["masses"] == {body.name for body in mechanism.bodies}
    assert named["joints"] == {joint.name for joint in mechanism.joints}
    cages = {s["n"] for s in data["shapes"] if s["k"] == "cage"}
    assert cages == {cut.name for cut in layout(mechanism).cuts}
    arrows = {s["n"] for s in data["shapes"] if s["k"] == "arrow" and s["g"] == "joints"}
    assert arrows == {joint.name for joint in mechanism.actuators}


def test_the_block_of_a_guide_on_ground_moves_with_what_slides() -> None:
    scene = screwgauge.load_scene("slider-crank")
    data, piston = data_of(stage(scene)), scene.mechanism.body_index["piston"]
    (block,) = [one for one in data["shapes"] if one["n"] == "slide" and one["k"] == "box"]
    assert block["i"] == piston
    middle = (np.array(block["a"]) + block["b"]) / 2.0
    assert middle == pytest.approx(scene.mechanism.joint("slide").child_frame.p)
    assert np.ptp([placed(data, k, piston, middle)[0] for k in range(FRAMES)]) > 0.1


def test_springs_hang_between_their_points_and_are_named() -> None:
    scene = screwgauge.load_scene("a03-andrews-ivp")
    (spring,) = scene.applied.springs
    picture = stage(scene)
    data, scale = data_of(picture), 1.0 / length(layout(scene.mechanism))
    (coil,) = [one for one in data["shapes"] if one["g"] == "springs" and one["k"] == "slide"]
    assert coil["n"] == f"spring {spring.first} - {spring.second}"
    assert coil["a"] == pytest.approx(scale * spring.first_point, abs=SEEN)
    assert coil["b"] == pytest.approx(scale * spring.second_point, abs=SEEN)
    assert coil["n"] in picture.svg
    rings = [one["n"] for one in data_of(stage(screwgauge.load_scene("ruse")))["shapes"] if one["g"] == "springs"]
    assert "spring of cross.rod" in rings


def test_the_marks_of_legs_stay_half_way_along() -> None:
    data = data_of(stage(load_mechanism("3ups-upu-s")))
    slides = [one for one in data["shapes"] if one["n"] == "leg1.slide" and one["k"] == "box"]
    assert {one["i"] for one in slides} == {load_mechanism("3ups-upu-s").body_index["leg1.lower"]}


def test_a_joint_that_only_gives_a_pose_coordinates_is_no_hardware() -> None:
    plain = load_mechanism("3-rrr")
    names = ("pose.q1", "pose.q2", "pose.q3")
    free = np.tile([-np.inf, np.inf], (3, 1))
    pose_of = Joint("pose", "E", "ground", "platform", np.eye(3)[2:], names, np.zeros(3), free)
    described = replace(plain, joints=(*plain.joints, pose_of), independent=dict(zip("xyz", names, strict=True)))
    data, other = data_of(stage(described)), data_of(stage(plain))
    assert "pose" not in {one["n"] for one in data["shapes"]}
    assert data["words"][0] == other["words"][0]  # no leg more
    assert "six constraints are redundant" in data["words"][2] == other["words"][2]
    assert "table" in {one["n"] for one in data_of(stage(load_mechanism("ruse")))["shapes"]}  # which carries a plate


def test_arrows_are_the_forces_to_scale() -> None:
    scene, picture = solved()
    data = data_of(picture)
    load = next(one for one in data["arrows"] if one["g"] == "loads" and not one["m"])
    assert load["v"][:3] == pytest.approx([0, 0, 0.3])
    assert "1000 N" in data["scales"]["loads"]
    groups = {one["g"] for one in data["arrows"]}
    assert groups == {"loads", "actuators", "reactions"}
    longest = max(np.linalg.norm(np.reshape(a["v"], (-1, 3)), axis=1).max() for a in data["arrows"])
    assert longest == pytest.approx(0.3, abs=1e-3)
    assert scene.mechanism.actuator_names == tuple(
        one["n"].partition(",")[0] for one in data["arrows"] if one["g"] == "actuators"
    )


def test_the_default_scene_is_small() -> None:
    assert len(solved()[1].stage.encode()) < MOST


def test_words_say_what_the_paper_begins_with() -> None:
    """Section 2.2."""
    first, second, third, *_ = data_of(solved()[1])["words"]
    assert "leg1 (UPU): one force along y through (-0.4, 0, 0)" in first
    assert "leg4 (UPS): none; s (S): three forces" in first
    assert "two rotations through s, about x and y" in second
    assert third.startswith("4 actuators for two degrees")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("3-upu", "three translations along every axis"),
        ("3-rps", "(0.02, -0.01, 0.6) m, about x and y and one translation along z"),
        ("delta", "three translations along every axis"),
        ("stewart", "all six freedoms"),
        ("sarrus", "one translation along z"),
        ("a01-pendulum", "one rotation about z through pivot"),
        ("bennett", "of 114 mm/rad"),
        ("arm7", "all six freedoms"),
    ],
)
def test_what_a_platform_or_hand_is_left_is_said(name: str, said: str) -> None:
    (leaves,) = [
        text for text in data_of(stage(load_mechanism(name)))["words"] if text.startswith("Remaining freedoms")
    ]
    assert said in leaves


@pytest.mark.parametrize(
    ("name", "sentences"),
    [
        (
            "slider-crank",
            [
                "Constraint forces on rod in the plane normal to z, by chain of joints: crank to pin (RR): one force "
                "along x through (0.22, 0, 0) m; slide to wrist (PR): one force along y through wrist.",
                "Remaining freedoms of rod: one rotation about z through wrist.",
                "Each chain by itself keeps rod in the plane, so that three constraints are redundant.",
            ],
        ),
        ("arm7", ["Remaining freedoms of link7: all six freedoms."]),
        (
            "cart-pole",
            [
                "Constraint forces on pole in the plane normal to y: rail to hinge (PR): one force along z "
                "through hinge.",
            ],
        ),
    ],
)
def test_a_mechanism_without_legs_has_none_in_its_sentences(name: str, sentences: list[str]) -> None:
    words = data_of(stage(load_mechanism(name)))["words"]
    assert words[: len(sentences)] == sentences
    assert "leg" not in " ".join(words)


def test_a_tree_with_several_ends_is_called_one() -> None:
    assert data_of(stage(load_mechanism("a05-governor")))["words"][0].startswith("An open tree with 3 ends")


def test_what_is_suspicious_is_marked_and_listed() -> None:
    picture = stage(load_mechanism("screw-press"))
    (sentence,) = data_of(picture)["doubts"]
    assert any(isinstance(block, Items) and block.texts == (sentence,) for block in remarks(picture))
    assert any(s["g"] == "doubts" and s["n"] == sentence for s in data_of(picture)["shapes"])
    assert words_of(picture.svg).count("!") == 2  # of the mark, and of the legend that tells what it is
    assert "suspicious" in words_of(picture.svg)
    assert [what for colour, what in data_of(picture)["legend"] if colour == DOUBT] == ["cage: suspicious, see below"]
    plain = stage(load_mechanism("slider-crank"))
    assert "suspicious" not in f"{words_of(plain.svg)} {data_of(plain)['legend']}"


def test_a_simulation_moves_as_it_was_integrated() -> None:
    scene = screwgauge.load_scene("a03-andrews-ivp").at([0.0, 0.01, 0.02])
    data = data_of(stage(scene, screwgauge.run(scene, engines=["screw"]).solutions))
    assert data["t"] == [0.0, 0.01, 0.02]
    assert data["y"]["beta"][0] != data["y"]["beta"][2]


def test_a_simulation_without_an_answer_stands_still() -> None:
    assert data_of(stage(screwgauge.load_scene("a03-andrews-ivp")))["said"] == "home pose"


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in mechanism_names() if name != "a02-fourbar-40"])
def test_every_mechanism_can_be_drawn_with_all_its_names_and_none_upon_another(name: str) -> None:
    mechanism = load_mechanism(name)
    svg = drawing(mechanism)
    written = ", ".join(words_of(svg)).replace(":", ",").split(", ")
    assert {body.name for body in mechanism.bodies} <= set(written)
    assert {joint.name for joint in mechanism.joints if joint.kind != "F"} <= set(written)
    boxes = [
        (float(x), float(y) - 9.0, float(x) + 0.5 * 11.0 * len(text), float(y))
        for x, y, text in re.findall(r'<text x="([\d.-]+)" y="([\d.-]+)" fill="[^"]*">([^<]*)</text>', svg)
        if text != "!" and float(y) > 30.0
    ]
    for i, (a, b, c, d) in enumerate(boxes):
        assert a > 0.0
        assert c < 640.0
        for e, f, g, h in boxes[:i]:
            assert min(c, g) - max(a, e) <= 1.0 or min(d, h) - max(b, f) <= 1.0


def test_many_bodies_are_drawn_without_their_names() -> None:
    words = words_of(drawing(load_mechanism("a02-fourbar-40")))
    assert "a0: crank" in words
    assert len(words) < 12


def test_names_are_text_whatever_they_are() -> None:
    mechanism = load_mechanism("a01-pendulum")
    odd = replace(mechanism, title="<script>&", bodies=(replace(mechanism.bodies[0], name="bob"),))
    assert "<script>" not in drawing(odd)


def flipped(mechanism: Mechanism, name: str) -> Mechanism:
    joints = [replace(j, axes=-j.axes) if j.name == name else j for j in mechanism.joints]
    return replace(mechanism, joints=tuple(joints))


def test_a_forgotten_sign_of_an_axis_differs_in_its_arrow_alone() -> None:
    mechanism = load_mechanism("3-rps")
    found = differences(mechanism, flipped(mechanism, "leg2.base"))
    assert {(one.name, one.kind) for one in found} == {("leg2.base", "arrow")}
    assert drawing(mechanism) != drawing(flipped(mechanism, "leg2.base"))  # seen alone, too


def test_a_base_that_is_elsewhere_is_drawn_beside_the_right_one() -> None:
    mechanism = load_mechanism("3-rps")
    moved = [
        replace(j, parent_frame=replace(j.parent_frame, p=1.1 * j.parent_frame.p)) if j.name == "leg1.base" else j
        for j in mechanism.joints
    ]
    other = replace(mechanism, joints=tuple(moved))
    assert {one.name for one in differences(mechanism, other)} >= {"leg1.base", "leg1.lower"}
    assert differences(mechanism, mechanism) == []
    picture = stage(mechanism, other=other)
    assert "second mechanism" in words_of(picture.svg)
    assert any(s["g"] == "other" for s in data_of(picture)["shapes"])
    assert "leg1.base" in remarks(picture)[0].text


def test_an_ellipsoid_is_that_of_a_homogeneous_body(paper: Mechanism) -> None:
    """Moments m (b^2 + c^2) / 5."""
    unit = length(layout(paper))
    for one in shapes(paper):
        if one.kind == "ellipsoid":
            body = paper.body(one.name)
            half = np.linalg.norm(one.b, axis=0) * unit
            axes = one.b / np.linalg.norm(one.b, axis=0)
            moments = body.mass / 5.0 * (np.sum(half**2) - half**2)
            assert axes @ np.diag(moments) @ axes.T == pytest.approx(body.inertia, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "right"), [("slider-crank", "x"), ("five-bar", "x"), ("screw-press", "x"), ("3ups-upu-s", "x")]
)
def test_who_looks_has_x_to_the_right(name: str, right: str) -> None:
    view = view_axes(viewed_from(load_mechanism(name)))
    assert view[0]["xyz".index(right)] > (0.99 if name != "3ups-upu-s" else 0.5)
    assert view[1, 1 if name in ("slider-crank", "five-bar") else 2] > 0.9


def test_what_moves_in_x_z_is_seen_from_the_front_also_where_its_bodies_lie_side_by_side() -> None:
    points = np.array([[0.0, 0.1, 0.0], [0.4, -0.1, 0.2], [0.9, 0.05, 0.3]])
    axes = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.0]])
    assert view_axes(face_on_view(points, axes)) == pytest.approx(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert face_on_view(points, np.eye(3)) is None


def test_a_picture_has_world_axes_and_a_bar_of_a_round_length() -> None:
    mechanism = load_mechanism("3ups-upu-s")
    svg = drawing(mechanism)
    assert {"x", "y", "z", "0.2 m"} <= {*words_of(svg)}
    (bar,) = re.findall(r"v-6v6H([\d.]+)v-6v6", svg)
    lay = layout(mechanism)
    at, i = pose(lay, mechanism.home[None]), mechanism.body_index["leg1.lower"]
    left, right = (float(x) for x in re.findall(r'<path class="body"[^>]* d="M([\d.]+),[^L]*L([\d.]+),', svg)[0])
    line = next(one for one in shapes(mechanism) if one.name == "leg1.lower" and one.group == "links")
    seen = view_axes(viewed_from(mechanism))[0] @ at.R[0, i] @ (line.b - line.a) * length(lay)  # [m]
    assert (float(bar) - 90.0) / 0.2 == pytest.approx((right - left) / seen, rel=0.02)


def test_labels_without_room_are_left_out() -> None:
    place = np.array([300.0, 200.0])
    written = labels([(f"a name of the number {k}", "#222", place) for k in range(60)], place[None], 640.0, 400.0)
    boxes = [(float(x), float(y)) for x, y in re.findall(r'<text x="([\d.-]+)" y="([\d.-]+)"', "".join(written))]
    assert 5 < len(boxes) < 60
    for i, (x, y) in enumerate(boxes):
        assert all(abs(x - u) >= 130.0 or abs(y - v) >= 13.0 for u, v in boxes[:i])


def test_marks_of_the_legend_are_drawn_and_not_spelled() -> None:
    picture = ET.fromstring(drawing(load_mechanism("slider-crank")))
    groups = [
        element for element in picture.iter() if element.tag.endswith("}g") and "mark" in element.get("class", "")
    ]
    assert any("driven" in group.get("class", "") for group in groups)
    assert not [group.text for group in groups if (group.text or "").strip() or not len(group)]


#: A body at x that nothing holds: a drone.
FREE = data("free-body.toml")


@pytest.mark.parametrize("bodies", [{"a": 0.0}, {"a": 0.1}, {"a": 0.0, "b": 0.0}, {"a": 0.0, "b": 0.2}])
def test_bodies_that_nothing_holds_are_drawn(bodies: dict[str, float], write) -> None:
    names = {body: [f"{body}{i}" for i in range(6)] for body in bodies}
    text = 'name = "free"\n[independent]\n' + "".join(f'{q} = "{q}"\n' for each in names.values() for q in each)
    for body, x in bodies.items():
        text += FREE.format(body, x, ", ".join(f'"{q}"' for q in names[body]))
    mechanism = load_mechanism(write("free.toml", text))
    assert np.linalg.norm(viewed_from(mechanism)) == pytest.approx(1.0, rel=1e-12, abs=0)
    assert {*bodies} <= {*", ".join(words_of(drawing(mechanism))).split(", ")}
    assert data_of(stage(mechanism))["poses"]
