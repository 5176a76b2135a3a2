import json
import re

import numpy as np
import pytest
import tomli_w

import screwgauge
from screwgauge import exciting
from screwgauge.scene import default as motions
from support.command import main
from support.engines import solve
from support.errors import DescriptionError
from support.judging import coverage
from support.scene import check_scene, far_from_home, scene_names
from support.singular import four_bar

pytestmark = pytest.mark.slow

#: Share of inertia in the actuator forces: 0.4 to 1.1 is seen, from 0.0008 on in the scenes' own motions.
INERTIA = 0.3
#: Parameters and load points that are tested, of all; the rest lies across what is planar, or turns about one axis.
TESTED = {
    "3-rps": (60, 70),
    "3-rrr": (28, 70),
    "3-upu": (64, 70),
    "3ups-upu-s": (93, 93),
    "3ups-upu-s-offset": (93, 93),
    "arm7": (67, 70),
    "belt-leg": (48, 63),
    "bennett": (23, 30),
    "delta": (89, 100),
    "double-cardan": (20, 30),
    "five-bar": (16, 40),
    "geared-five-bar": (44, 75),
    "planetary-gear": (35, 50),
    "rccc": (27, 30),
    "ruse": (29, 33),
    "sarrus": (19, 50),
    "screw-press": (23, 43),
    "slider-crank": (11, 33),
    "stewart": (130, 130),
    "stewart-legs": (130, 130),
}


def test_every_scene_with_a_given_motion_is_looked_at():
    given = {name for name in scene_names() if not screwgauge.load_scene(name).simulated}
    assert given - {"3ups-upu-s-eq55", "3ups-upu-s-fast"} == set(TESTED)  # these two have the mechanism of another


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("name", TESTED)
def test_every_mechanism_moves_and_tests_all_that_it_can(name, monkeypatch):
    monkeypatch.setattr(motions, "SAMPLES", 13)  # and amplitudes that all of them can do: to find out takes long
    monkeypatch.setattr(motions, "AMPLITUDES", np.array([0.16, 0.08]))
    scene = exciting(screwgauge.load_scene(name), 1, 13)
    assert far_from_home(scene) == ()
    found, failures = solve(scene, ["screw"], scene.quantities)
    assert not failures
    covered = coverage(scene.mechanism, scene.problem(scene.quantities), found, check_scene(scene), scene.tolerance)
    assert covered.inertia[1] > INERTIA
    assert (len(covered.parameters) - len(covered.untested), len(covered.parameters)) == TESTED[name]
    assert max(row["smallest"] for row in covered.parameters if row["tested"]) < 1e-7


LIMITED = """
extends = "slider-crank"
name = "limited"
joints.crank.limits = [[{low}, 0.3]]
"""


def test_it_is_as_large_as_limits_let_it_be(write):
    scene = screwgauge.load_scene("slider-crank")
    free = np.abs(exciting(scene).motion.y).max()
    write("limited.toml", LIMITED.format(low=-0.2))
    text = 'mechanism = "limited.toml"\nmotion.crank = {}\ntime = { times = [0] }\n'
    near = exciting(screwgauge.load_scene(write("scene.toml", text))).motion.y
    assert free > 0.4
    assert 0.1 < near.max() < 0.3
    assert near.min() > -0.2
    write("limited.toml", LIMITED.format(low=0.0))
    with pytest.raises(
        DescriptionError, match=r"away from singular poses: it would exceed the limits of 'crank' \(\[0, "
    ):
        exciting(screwgauge.load_scene(write("scene.toml", text)))


def test_a_home_pose_next_to_a_change_point_is_near_a_singular_pose_though_the_loop_closes_beyond(write):
    bars = four_bar(0.3, 0.5, 0.3, 0.5, np.pi - 1e-3)
    write("m.toml", tomli_w.dumps({"name": "parallelogram", **bars}))
    scene = screwgauge.load_scene(write("s.toml", 'mechanism = "m.toml"\nmotion.a = {}\ntime = { times = [0] }\n'))
    with pytest.raises(DescriptionError, match="it would approach a singular"):
        exciting(scene)


def test_samples_of_a_file_are_replaced(write):
    write("motion.csv", "t,q1,q1d,q1dd\n0,1.0472,0,0\n")
    scene = screwgauge.load_scene(write("scene.toml", 'mechanism = "bennett"\nmotion.csv = "motion.csv"\n'))
    made, usual = exciting(scene), exciting(screwgauge.load_scene("bennett"))
    assert np.array_equal(made.motion.ydd, usual.motion.ydd)
    assert made.wording().motion == usual.wording().motion is not None


def test_a_simulation_and_a_seed_for_nothing_are_refused(refused):
    said = refused("run", "a01-pendulum", "--exciting")
    assert all(fact in said for fact in ("a01-pendulum: ", "integrated", "run the scene with its own motion"))
    assert "--seed applies only" in refused("run", "bennett", "--seed", "1")


@pytest.mark.slow
def test_a_seed_gives_the_same_motion_and_another_another():
    scene = screwgauge.load_scene("bennett")
    one, same, other = (exciting(scene, seed) for seed in (3, 3, 4))
    assert np.array_equal(one.motion.y, same.motion.y)
    assert not np.array_equal(one.motion.y[:5], other.motion.y[:5])
    assert (one.name, one.title) == ("bennett-exciting-3", "Bennett linkage, exciting motion with seed 3")


@pytest.mark.slow
def test_engines_agree_in_it_and_the_report_tells_it_as_toml(tmp_path, write, capsys, monkeypatch, no_progress):
    monkeypatch.setattr("screwgauge.report.figures.run.make_plots", lambda results: [])
    assert main(["run", "bennett", "--exciting", "--seed", "5", "--json", "--out", str(tmp_path / "out")]) == 0
    assert json.loads(capsys.readouterr().out)["scene"] == "bennett-exciting-5"
    page = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert "exciting motion with seed 5" in page
    (line,) = [re.sub(r"\\(.)", r"\1", line) for line in page.splitlines() if line.startswith("| motion |")]
    said = f'mechanism = "bennett"\nmotion.{line.removeprefix("| motion | ").removesuffix(" |")}\n'
    again = screwgauge.load_scene(write("again.toml", f"{said}time = {{ times = [0, 0.1, 0.2] }}\n"))
    made = exciting(screwgauge.load_scene("bennett"), 5)
    assert np.array_equal(again.motion.y, made.moved(again.t).y)
    assert made.wording().motion == again.wording().motion is not None  # the truth reads it exactly
