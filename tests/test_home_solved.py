"""Home is solved for: rough or missing in a description, it is the nearest pose in which all loops close."""

import re
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.command import main
from support.data import data
from support.errors import ClosureError
from support.mechanism import at_closed_home, families, load_mechanism, mechanism_names, same_content
from support.scene import check_home
from support.solve import gaps, layout
from support.tolerances import CLOSED, LINEAR

#: A planar four-bar by its lengths alone [m]: all links lie along x where its angles are zero.
CRANK, COUPLER, ROCKER, BASE = 0.2, 0.5, 0.45, 0.4
LENGTHS = data("four-bar-by-lengths.toml")
TURN = """mechanism = "four-bar.toml"
motion.crank.polynomial = [0, "2*pi"]
time = { duration = 1, step = 0.05 }
"""
SLIDER = data("slider-by-lengths.toml")
#: Built-in mechanisms with loops: planar and spatial ones, redundant loops, legs, gears and screws.
LOOPED = ["slider-crank", "five-bar", "3-rrr", "a03-andrews", "bennett", "rccc", "sarrus", "ruse", "screw-press"]
LOOPED += ["planetary-gear", "delta", "stewart", "3ups-upu-s", "3ups-upu-s-offset"]


@pytest.fixture
def four_bar(write):
    def make(a: str = "", c: str = "", **lengths: float):
        usual = {"crank": CRANK, "coupler": COUPLER, "rocker": ROCKER, "base": BASE}
        return write("four-bar.toml", LENGTHS.format(a=a, c=c, **{**usual, **lengths}))

    return make


def gap(mechanism) -> float:
    return float(np.abs(gaps(layout(mechanism), mechanism.home[None])).max(initial=0.0))


def rough(mechanism, by: float | None):
    off, chosen = np.random.default_rng(1).uniform(-1.0, 1.0, len(mechanism.home)), mechanism.independent_columns
    q = np.zeros(len(off)) if by is None else mechanism.home + by * off
    q[chosen] = mechanism.home[chosen]
    joints = (replace(joint, home=q[mechanism.columns(joint.coordinates)]) for joint in mechanism.joints)
    return replace(mechanism, joints=tuple(joints))


def apex(side: float) -> tuple[float, float]:
    base = BASE - CRANK
    coupler = np.arccos((base**2 + COUPLER**2 - ROCKER**2) / (2 * base * COUPLER))
    rocker = np.pi - np.arccos((base**2 + ROCKER**2 - COUPLER**2) / (2 * base * ROCKER))
    return side * coupler, side * rocker


def test_lengths_are_enough(four_bar):
    mechanism = load_mechanism(four_bar())
    coupler, rocker = apex(1.0)
    assert mechanism.home == pytest.approx([0.0, coupler, rocker, rocker - coupler], abs=CLOSED)
    assert gap(mechanism) < CLOSED
    check_home(mechanism)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_nearest_pose_is_taken_and_the_other_one_named(side, four_bar):
    rocker = apex(side)[1]
    mechanism = load_mechanism(four_bar(c=f"home = [{0.9 * rocker}]"))
    assert mechanism.home[2] == pytest.approx(rocker, abs=CLOSED)
    (said,) = mechanism.remarks
    assert "nearest of 2 poses" in said
    assert f"'c' = {-rocker:.3g} rad" in said
    (remedy,) = re.findall(r"write (home = \[.*?\]) in joint 'c'", said)
    assert load_mechanism(four_bar(c=remedy)).home[2] == pytest.approx(-rocker, abs=CLOSED)


def test_a_run_says_once_that_home_was_solved_for(four_bar, inside, command):
    said = command(
        "run", four_bar(c=f"home = [{0.9 * apex(1.0)[1]}]"), "--engines", "screw", "--quantities", "joint_position"
    )
    assert " ".join((said.out + said.err).split()).count("the home pose was solved for") == 1


def test_a_pose_within_limits_comes_before_a_nearer_one(four_bar):
    mechanism = load_mechanism(four_bar(c="home = [1.4]\nlimits = [[-3, 1]]"))
    assert mechanism.home[2] == pytest.approx(apex(-1.0)[1], abs=CLOSED)


def test_a_driven_coordinate_moves_where_no_pose_within_limits_closes_at_it(four_bar):
    mechanism = load_mechanism(four_bar(c="limits = [[1.8, 2]]"))
    assert 1.8 < mechanism.home[2] < 2.0
    assert abs(mechanism.home[0]) > 0.1
    assert gap(mechanism) < CLOSED


def test_what_is_written_stays_where_loops_close(four_bar):
    path = four_bar(a='home = ["30*deg"], ')
    mechanism = load_mechanism(path)
    assert mechanism.home[0] == np.pi / 6
    assert gap(mechanism) < CLOSED
    assert "crank" not in mechanism.remarks[0]


@pytest.mark.parametrize("name", mechanism_names())
def test_a_home_that_closes_is_not_touched(name):
    mechanism = load_mechanism(name)
    assert at_closed_home(mechanism) is mechanism


@pytest.mark.parametrize("by", [0.1, None], ids=["rough", "left out"])
@pytest.mark.parametrize("name", LOOPED)
def test_built_in_homes_are_found_again(name, by):
    mechanism = load_mechanism(name)
    solved = at_closed_home(rough(mechanism, by))
    assert solved.home == pytest.approx(mechanism.home, abs=LINEAR)
    assert gap(solved) < CLOSED
    columns = mechanism.independent_columns
    assert np.array_equal(solved.home[columns], mechanism.home[columns])
    assert same_content(solved, at_closed_home(rough(mechanism, by)))


@pytest.mark.sampled(7)
@pytest.mark.parametrize("by", [0.05, None], ids=["rough", "left out"])
@pytest.mark.parametrize("family", families())
def test_homes_of_random_mechanisms_are_found_again(family, by, tmp_path):
    mechanism = screwgauge.random(0, family, tmp_path).mechanism
    assert not mechanism.remarks
    solved = at_closed_home(rough(mechanism, by))
    assert solved.home == pytest.approx(mechanism.home, abs=LINEAR)
    assert gap(solved) < CLOSED


def test_a_driven_coordinate_moves_only_where_no_pose_closes_at_it(write):
    kept, moved = (load_mechanism(write("slider.toml", SLIDER.format(label=label))) for label in "as")
    assert kept.home == pytest.approx([0.0, 0.0, 0.0, 0.7], abs=CLOSED)
    assert 0.3 < moved.home[3] < 0.7  # s = 0 is beyond its dead points
    assert gap(moved) < CLOSED
    assert "closes the loops at s = 0" in moved.remarks[0]
    check_home(moved)


def test_links_that_all_lie_on_a_line_are_no_home_that_anybody_chose(four_bar):
    mechanism = load_mechanism(four_bar(crank=0.2, coupler=0.4, rocker=0.2, base=0.4))
    assert gap(mechanism) < CLOSED
    assert abs(mechanism.home[0]) > 0.01
    check_home(mechanism)


def test_a_coupled_coordinate_follows(write):
    geared = 'extends = "planetary-gear"\nname = "geared"\njoints.sun.home = [0.3]\n'
    mechanism, given = load_mechanism(write("geared.toml", geared)), load_mechanism("planetary-gear")
    assert mechanism.independent == given.independent
    assert np.abs(mechanism.coupling_rows.residuals(mechanism.home[None])).max() < CLOSED
    assert gap(mechanism) < CLOSED


def test_links_that_are_too_short_are_refused_with_the_smallest_gap(four_bar):
    with pytest.raises(ClosureError, match=r"four-bar\.toml: .* 'd' by (\S+) m;") as error:
        load_mechanism(four_bar(rocker=1.45))
    least = 1.45 - (BASE + CRANK + COUPLER)
    assert float(re.search(r"by (\S+) m;", str(error.value))[1]) == pytest.approx(least, rel=0.02)


def test_a_linkage_that_moves_by_its_proportions_alone_is_refused_with_others(write):
    other = 'extends = "bennett"\nname = "other"\njoints.j4.child_frame.position = [-0.3, 0, 0]\n'
    with pytest.raises(ClosureError, match=r"other\.toml: .* 'j4' by"):
        load_mechanism(write("other.toml", other))


def test_every_engine_begins_at_the_home_that_was_solved_for(four_bar, write, command):
    four_bar()
    rough_scene = screwgauge.load_scene(write("turn.toml", TURN))
    command("import", rough_scene.mechanism_file, "--out", rough_scene.mechanism_file.with_name("closed.toml"))
    scene = screwgauge.load_scene(write("closed-turn.toml", TURN.replace("four-bar", "closed")))
    engines = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full", "truth")
    solved, written = (screwgauge.run(one, engines, ("joint_position", "reaction")) for one in (rough_scene, scene))
    assert solved.ok
    assert any("home pose was solved for" in sentence for sentence in solved.warnings)
    assert not any("home pose was solved for" in sentence for sentence in written.warnings)
    for engine in engines:
        for quantity in ("joint_position", "reaction"):
            pair = (results.values(quantity, engine=engine) for results in (solved, written))
            np.testing.assert_array_equal(*pair)


def test_a_gate_passes_and_lists_it(four_bar, write, command):
    four_bar()
    outcome = screwgauge.check(write("turn.toml", TURN))
    assert outcome.ok
    assert "OK: 1 of 1 pass" in repr(outcome)
    assert "turn: the home pose was solved for" in " ".join(repr(outcome).split())


def test_import_writes_home_into_the_text_of_the_user(four_bar, command, inside):
    path = four_bar(c="home = [ # a guess\n 1.2 ] # above")
    command("import", path, "--out", "closed.toml")
    text, written = path.read_text(), (inside / "closed.toml").read_text()
    assert same_content(load_mechanism(inside / "closed.toml"), load_mechanism(path))
    assert not load_mechanism(inside / "closed.toml").remarks
    bare = re.sub(r"(?m)^# (The home pose|As screw).*\n|^#.*(that close the loops|first of these).*\n", "", written)
    for place in (r"home = \[[^\[\]]*\],? ?", r"(?m)^\n"):
        text, bare = re.sub(place, "", text), re.sub(place, "", bare)
    assert bare == text
    assert screwgauge.load_scene(inside / "closed.scene.toml").mechanism.name == "four-bar"


def test_import_writes_anew_what_it_cannot_keep(four_bar, command, write, inside):
    four_bar()
    more = write("more.toml", 'extends = "four-bar.toml"\nname = "more"\n')
    (inside / "there").mkdir()
    assert "description is rewritten" in command("import", more, "--out", "there/more.toml").out
    assert same_content(load_mechanism(inside / "there/more.toml"), load_mechanism(more))


@pytest.mark.parametrize("more", [[], ["--out", "four-bar.toml"]])
def test_import_does_not_overwrite_the_description(more, four_bar, inside, capfd):
    path = four_bar()
    text = path.read_text()
    assert main(["import", "four-bar.toml", *more]) == 2
    assert "overwrite it with --force" in capfd.readouterr().err
    assert path.read_text() == text
    assert [*inside.iterdir()] == [path]


@pytest.mark.parametrize("option", [["--floating"], ["--actuated", "a"], ["--loops", "robot.yaml"]])
def test_options_for_model_files_are_refused(option, four_bar, refused, inside):
    assert f"{option[0]} applies only to model files" in refused(
        "import", four_bar(), *option, out=inside / "closed.toml"
    )
