import numpy as np
import pytest

from support.freedoms import check_independent, mobility
from support.mechanism import four_bars, load_mechanism, mechanism_path
from support.solve import at_home, gaps, layout, pose
from support.tolerances import FORMULA, PLACED, TWENTY_DIGITS

#: bodies, joint freedoms, Kutzbach's count, mobility, redundant constraints
COUNTS = {
    "a01-pendulum": (1, 1, 1, 1, 0),
    "a02-fourbar-2": (5, 7, -5, 1, 6),
    "a03-andrews": (7, 10, -8, 1, 9),
    "a04-bricard-thin": (5, 6, 0, 1, 1),
    "a04-bricard-box": (5, 6, 0, 1, 1),
    "a05-governor": (4, 4, 4, 4, 0),
}


def pose_at_home(name):
    lay, home = at_home(load_mechanism(name))
    return lay, pose(lay, home)


def points(name):
    lay, at = pose_at_home(name)
    return {joint.name: at.joint(joint).p_child[0] for joint in lay.mechanism.joints}


@pytest.mark.parametrize("name", COUNTS)
def test_counts_are_the_known_ones(name):
    lay, home = at_home(load_mechanism(name))
    check_independent(lay, home)
    found = mobility(lay, home)
    counts = (found.bodies, found.joint_freedoms, found.kutzbach, found.mobility, found.overconstraints)
    assert counts == COUNTS[name]


@pytest.mark.parametrize("n", [2, 40])
def test_kept_four_bars_are_those_written_now(n):
    text = mechanism_path(f"a02-fourbar-{n}").read_text(encoding="utf-8")
    assert text == four_bars(n)


def test_four_bars_are_singular_where_all_links_are_horizontal():
    lay = layout(load_mechanism("a02-fourbar-2"))
    q = np.array([[-np.pi / 2] * 3 + [np.pi / 2] * 4])
    assert np.abs(gaps(lay, q)).max() < PLACED
    assert mobility(lay, q).mobility == 3


def test_pendulum_starts_to_the_left():
    lay, at = pose_at_home("a01-pendulum")
    bob = at.R[0, 1] @ lay.mechanism.bodies[0].com
    assert np.abs(bob - [-1.0, 0.0, 0.0]).max() < PLACED


def test_bricard_starts_at_the_corners_of_a_cube():
    corners = [[0, 0, 0], [1, 0, 0], [1, -1, 0], [1, -1, 1], [0, -1, 1], [0, 0, 1]]
    assert np.array_equal([*points("a04-bricard-thin").values()], corners)


def test_andrews_starts_where_the_test_set_puts_it():
    """E, F, G, H at the consistent start, to 20 digits by closed-form loop kinematics."""
    at = points("a03-andrews")
    known = {
        "f": (0.0069866741154514457087, -0.00043172306456889546258),
        "e2": (-0.020960022346354337126, 0.0012951691937066863877),
        "g": (-0.033997203885839981455, 0.016461971674997682778),
        "h": (-0.031633134507408900034, -0.015618868668304537040),
    }
    for name, (x, y) in known.items():
        assert np.abs(at[name] - [x, y, 0.0]).max() < TWENTY_DIGITS, name
    for name in ("e4", "e6"):
        assert np.abs(at[name] - at["e2"]).max() < TWENTY_DIGITS


def test_andrews_spring_starts_compressed():
    lay, at = pose_at_home("a03-andrews")
    i = lay.mechanism.body_index["K3"]
    end = at.p[0, i] + at.R[0, i] @ [0.02, -0.018, 0.0]
    assert np.linalg.norm(end - [0.014, 0.072, 0.0]) == pytest.approx(0.052672516110736675951, rel=FORMULA, abs=0)


def test_governor_starts_with_unstretched_springs():
    lay, at = pose_at_home("a05-governor")
    index = lay.mechanism.body_index
    for rod, side in (("right", 1.0), ("left", -1.0)):
        pin = at.p[0, index["slider"]] + [0.05 * side, 0.0, 0.0]
        middle = at.p[0, index[rod]] + at.R[0, index[rod]] @ [0.5 * side, 0.0, 0.0]
        assert np.linalg.norm(middle - pin) == pytest.approx(0.5, rel=FORMULA, abs=0)


def test_governor_rods_carry_their_balls():
    body = load_mechanism("a05-governor").body("right")
    about_pin = body.inertia + body.mass * (body.com @ body.com * np.eye(3) - np.outer(body.com, body.com))
    rod = 0.3 * 1.0001 / 12 + 0.3 * 0.25
    assert np.diag(about_pin) == pytest.approx([0.3 * 0.0002 / 12, rod + 5.0, rod + 5.0], rel=FORMULA, abs=0)
