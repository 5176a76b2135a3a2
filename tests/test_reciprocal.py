from dataclasses import replace

import numpy as np
import pytest

from screwgauge.reference.reciprocal import ScrewElement, body_twists, elements, end_body, idle_forces, legs, supports
from support.freedoms import reciprocal_screws
from support.geometry import couple, force, linear, prismatic, revolute
from support.mechanism import Frame, Mechanism, load_mechanism, mechanism_names
from support.solve import at_home, layout, motion_at, pose, posed

CLOSE = 1e-9  # of directions of unit length, and of points that lie within a few metres
X, Y, Z = np.eye(3)


def screw(one: ScrewElement) -> np.ndarray:
    """``[direction; moment about O]``."""
    if np.isinf(one.pitch):
        return np.concatenate([np.zeros(3), one.direction])
    moment = np.cross(one.point, one.direction) + one.pitch * one.direction
    return np.concatenate([one.direction, moment])


def of(name: str, body: str = ""):
    return supports(*at_home(load_mechanism(name)), body)[0]


def kinds(system) -> list[float]:
    """Pitch 0: force, rotation; infinite: couple, translation."""
    return [one.pitch for one in system]


@pytest.mark.parametrize("seed", range(40))
def test_elements_span_their_system(seed: int) -> None:
    random = np.random.default_rng(seed)
    e, r = random.normal(size=(2, 6, 3))
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    pool = [revolute(e[0], r[0]), revolute(e[1], r[0]), revolute(e[1], r[1]), prismatic(e[0]), prismatic(e[2])]
    pool += [revolute(e[2], r[2]), revolute(e[3], r[0]), revolute(e[0], r[3]) + 0.3 * prismatic(e[0])]
    chosen = np.array(pool).T[:, random.choice(len(pool), 1 + seed % 5, replace=False)]
    basis = np.linalg.svd(chosen, full_matrices=False)[0][:, : linear.rank(chosen)]
    found = elements(basis, random.normal(size=3))
    both = np.column_stack([basis, *map(screw, found)])
    assert len(found) == basis.shape[1] == linear.rank(np.array([screw(one) for one in found]))
    assert linear.rank(both, 1e-7) == basis.shape[1]


def test_a_system_of_no_screws_has_no_elements() -> None:
    assert elements(np.zeros((6, 0)), np.zeros(3)) == ()


def test_a_pencil_of_forces_is_told_by_its_point() -> None:
    point = np.array([0.3, -0.2, 0.5])
    pencil = np.array([force(X + Y, point), force(X - 2 * Y, point)]).T
    found = elements(np.linalg.qr(pencil)[0], np.zeros(3))
    assert kinds(found) == [0.0, 0.0]
    for one in found:
        assert one.point == pytest.approx(point, abs=CLOSE)


def test_two_skew_rotations_are_told_by_their_own_axes() -> None:
    """No other screw of their cylindroid has zero pitch."""
    axes = [(X, np.array([0.0, 0.0, -0.2])), ((X + 2 * Y) / np.sqrt(5.0), np.array([0.0, 0.0, 0.4]))]
    found = elements(np.linalg.qr(np.array([revolute(*one) for one in axes]).T)[0], np.zeros(3))
    assert kinds(found) == [0.0, 0.0]
    for e, r in axes:
        assert any(
            np.linalg.norm(np.cross(one.direction, e)) < CLOSE and np.linalg.norm(np.cross(one.point - r, e)) < CLOSE
            for one in found
        )


def test_a_screw_keeps_its_pitch_and_axis() -> None:
    point = np.array([0.1, 0.2, 0.3])
    (found,) = elements(((revolute(Z, point) + 0.25 * prismatic(Z)) / 2.0)[:, None], np.zeros(3))
    assert found.pitch == pytest.approx(0.25, rel=1e-12, abs=0)
    assert np.cross(found.point - point, Z) == pytest.approx(np.zeros(3), abs=CLOSE)


def test_a_couple_and_a_force_across_it_are_both_told() -> None:
    found = elements(np.linalg.qr(np.array([force(Z, X), couple(X)]).T)[0], np.zeros(3))
    assert kinds(found) == [0.0, np.inf]
    assert abs(found[1].direction) == pytest.approx(X, abs=CLOSE)


def test_the_paper_s_platform_hangs_on_upu_ups_and_s() -> None:
    """Section 2.2: S takes three forces through O, UPU one force, UPS none."""
    found = of("3ups-upu-s")
    does = {leg.name: (leg.kinds, system) for leg, system in zip(found.legs, found.wrenches, strict=True)}
    assert {name: kind for name, (kind, _) in does.items()} == {
        "leg1": "UPU",
        "s": "S",
        **dict.fromkeys(("leg2", "leg3", "leg4"), "UPS"),
    }
    assert [len(does[name][1]) for name in ("leg1", "leg2", "leg3", "leg4", "s")] == [1, 0, 0, 0, 3]
    (one,) = does["leg1"][1]
    assert (one.direction, one.point[[0, 2]], one.pitch) == (pytest.approx(Y, abs=CLOSE), pytest.approx([-0.4, 0]), 0)
    assert kinds(does["s"][1]) == [0.0] * 3
    for system in (does["s"][1], found.twists):
        assert np.array([one.point for one in system]) == pytest.approx(np.zeros((len(system), 3)), abs=CLOSE)
    assert np.array([one.direction for one in found.twists]) == pytest.approx(np.array([X, Y]), abs=CLOSE)


def test_an_upu_leg_whose_outer_and_inner_axes_are_parallel_takes_a_couple_across_both() -> None:
    """Tsai's 3-UPU: three couples, so the platform does not turn."""
    found = of("3-upu")
    assert [kinds(system) for system in found.wrenches] == [[np.inf]] * 3
    assert kinds(found.twists) == [np.inf] * 3
    first = load_mechanism("3-upu").joint("leg1.base")
    normal = np.cross(*first.axes)
    assert abs(found.wrenches[0][0].direction @ normal) == pytest.approx(1.0, rel=1e-12, abs=0)


def test_each_rps_leg_takes_a_force_through_its_ball_along_its_hinge() -> None:
    mechanism, found = load_mechanism("3-rps"), of("3-rps")
    for k, system in enumerate(found.wrenches, 1):
        (one,) = system
        ball, hinge = mechanism.joint(f"leg{k}.ball").child_frame.p, mechanism.joint(f"leg{k}.base").axes[0]
        assert one.pitch == 0.0
        assert np.cross(one.direction, hinge) == pytest.approx(np.zeros(3), abs=CLOSE)
        assert np.cross(one.point - ball, hinge) == pytest.approx(np.zeros(3), abs=CLOSE)
    assert kinds(found.twists) == [0.0, 0.0, np.inf]  # turns about lines in the plane of the balls, rises along z
    assert [one.point[2] for one in found.twists[:2]] == pytest.approx([0.6, 0.6])


def test_three_forces_that_do_not_meet_leave_turns_about_lines_that_meet_all_of_them() -> None:
    """A tilted 3-RPS: rotation axes meet or parallel every force."""
    lay = layout(load_mechanism("3-rps"))
    (found,) = supports(lay, posed(lay, 0.63, 0.7, 0.66))
    forces = [system[0] for system in found.wrenches]
    for turn in found.twists:
        for one in forces:
            assert screw(one)[:3] @ screw(turn)[3:] + screw(one)[3:] @ screw(turn)[:3] == pytest.approx(0.0, abs=CLOSE)


def test_a_planar_coupler_turns_about_the_pole_of_its_cranks() -> None:
    """Kennedy; redundant planar legs each repeat a force and two couples."""
    mechanism, found = load_mechanism("a03-andrews"), of("a03-andrews")
    at = pose(*at_home(mechanism))
    (turn,) = found.twists
    assert (found.body, abs(turn.direction), turn.pitch) == ("K2", pytest.approx(Z, abs=CLOSE), 0.0)
    assert found.overconstraints == 9
    for base, tip in (("o", "f"), ("b", "e2")):
        ends = [(mechanism.joint(name), mechanism.body_index[mechanism.joint(name).parent]) for name in (base, tip)]
        p, q = (at.p[0, i] + at.R[0, i] @ joint.parent_frame.p for joint, i in ends)
        assert np.cross(q - p, turn.point - p)[2] == pytest.approx(0.0, abs=CLOSE)


def test_a_bennett_s_coupler_screws_and_each_of_its_legs_takes_two_forces_through_both_hinges() -> None:
    """Two skew hinges: forces that meet both, and the couple across."""
    found = of("bennett")
    (turn,) = found.twists
    assert 0.0 < turn.pitch < np.inf
    assert found.overconstraints == 3
    for system in found.wrenches:
        assert kinds(system) == [0.0, 0.0, 0.0, np.inf]


def test_a_delta_s_arm_takes_a_couple_though_it_holds_a_loop() -> None:
    found = of("delta")
    assert [kinds(system) for system in found.wrenches] == [[np.inf]] * 3
    assert kinds(found.twists) == [np.inf] * 3
    assert {leg.kinds for leg in found.legs} == {""}


def test_what_dangles_is_no_part_of_a_leg_but_what_is_coupled_is() -> None:
    (leg,) = of("a05-governor").legs
    assert (leg.name, leg.kinds) == ("spin to slide", "RP")  # its arms hang on the slider
    (leg,) = of("planetary-gear").legs
    assert [joint.name for joint in leg.joints] == ["sun", "carrier", "planet1", "planet2", "planet3"]
    nut = next(leg for leg in of("screw-press").legs if leg.name == "screw to nut")
    assert nut.kinds == "RC, coupled"


def test_a_thread_leaves_one_freedom_of_a_cylindrical_joint_of_the_pitch_of_its_lead() -> None:
    mechanism = load_mechanism("screw-press")
    nut = replace(mechanism.joint("nut"), parent="ground")
    threaded = replace(mechanism, joints=tuple(nut if joint.name == "nut" else joint for joint in mechanism.joints))
    (twists,) = body_twists(threaded, [nut], "nut", threaded.home[None])
    (found,) = elements(twists, np.zeros(3))
    assert abs(found.pitch) == pytest.approx(0.01 / (2.0 * np.pi), rel=1e-9, abs=0)
    assert body_twists(replace(threaded, couplings=()), [nut], "nut", threaded.home[None])[0].shape == (6, 2)


def test_joints_that_constrain_nothing_are_no_legs() -> None:
    assert [leg.name for leg in of("stewart").legs] == [f"leg{k}" for k in range(1, 7)]
    assert len(of("stewart").twists) == 6
    mechanism = load_mechanism("stewart")
    pose = replace(mechanism.joint("pose"), child="leg1.upper")
    joints = tuple(pose if joint.name == "pose" else joint for joint in mechanism.joints)
    assert len(legs(replace(mechanism, joints=joints), "platform")) == 6  # one of them beside what leaves it free


def test_of_a_chain_the_hand_is_told() -> None:
    mechanism = load_mechanism("arm7")
    assert end_body(mechanism)[0] == mechanism.bodies[-1].name


@pytest.mark.parametrize("name", [name for name in mechanism_names() if name != "a02-fourbar-40"])
def test_what_is_left_is_what_the_legs_allow_and_no_wrench_works_on_it(name: str) -> None:
    """The legs together leave the platform at least the whole mechanism's motions, and exactly these if there is
    nothing else.
    """
    found = of(name)
    wrenches = np.array([screw(one) for system in found.wrenches for one in system]).reshape(-1, 6)
    twists = np.array([screw(one) for one in found.twists])
    powers = wrenches[:, :3] @ twists[:, 3:].T + wrenches[:, 3:] @ twists[:, :3].T
    assert powers == pytest.approx(np.zeros(powers.shape), abs=1e-7)
    both = reciprocal_screws(reciprocal_screws(wrenches.T)) if wrenches.size else wrenches.T
    assert len(twists) == 6 - both.shape[1]
    assert sum(map(len, found.wrenches)) - both.shape[1] == found.overconstraints


def test_size_and_place_make_no_difference() -> None:
    mechanism, moved = load_mechanism("bennett"), np.array([3.0, -2.0, 1.0])

    def elsewhere(body: str, frame: Frame) -> Frame:
        return replace(frame, p=frame.p + moved) if body == "ground" else frame

    joints = tuple(
        replace(
            joint,
            parent_frame=elsewhere(joint.parent, joint.parent_frame),
            child_frame=elsewhere(joint.child, joint.child_frame),
        )
        for joint in mechanism.joints
    )
    there = supports(*at_home(replace(mechanism, joints=joints)))[0]
    here = supports(*at_home(mechanism))[0]
    assert there.twists[0].pitch == pytest.approx(here.twists[0].pitch, rel=1e-9, abs=0)
    apart = there.twists[0].point - here.twists[0].point - moved
    assert np.cross(apart, here.twists[0].direction) == pytest.approx(np.zeros(3), abs=1e-8)


def test_idle_forces_of_actuators_do_no_work(paper: Mechanism) -> None:
    lay = layout(paper)
    q = posed(lay, 0.2, 0.1)
    idle = idle_forces(lay, q)
    assert idle.shape == (4, 2)
    for rates in np.eye(2):
        w = motion_at(lay, q, rates[None]).joint_velocity[0, paper.actuated_columns]
        assert w @ idle == pytest.approx([0, 0], abs=CLOSE)
    stewart = load_mechanism("stewart")
    assert idle_forces(*at_home(stewart)).shape == (6, 0)
