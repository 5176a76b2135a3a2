import re
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support import questions
from support.engines import solve
from support.errors import ClosureError, SingularPoseError
from support.geometry import within_half_turn
from support.mechanism import load_mechanism
from support.models import write_models
from support.planar import Bar, four_bar, moving
from support.questions import BASE_LOCK, SCENE, SINGULAR_B, findings
from support.scene import check_scene
from support.solve import (
    Anchors,
    AssemblyMode,
    Curve,
    bent_paths,
    closed_form_positions,
    continuation,
    layout,
    straight_path,
)
from support.stress import CASES, OK, SILENT
from support.tolerances import ROUNDING

pytestmark = pytest.mark.slow

FAR = 1.2
#: Angles of joints near the lock of a leg at 1e-5 rad, from closed loops.
ALIKE = 1e-7


def scene_at(y):
    return questions.scene_at(screwgauge.load_scene(SCENE), np.asarray(y, dtype=float))


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1201, 1, 5], ids=["steps of 1 ms", "one far pose", "coarse"])
def test_no_engine_jumps_over_the_lock_of_a_leg(steps):
    a = np.linspace(0.0, FAR, steps) if steps > 1 else np.array([FAR])
    scene = scene_at(np.stack([a, np.full_like(a, 0.01)], axis=1))
    right = closed_form_positions(layout(scene.mechanism), scene.motion.y)
    for engine, solution in solve(scene, ("pinocchio", "mujoco"), ("generalized_force",))[0].items():
        assert np.abs(within_half_turn(solution.assembly - right))[:, :12].max() < ALIKE, engine
    column = scene.mechanism.coordinates.index("leg4.q1")
    assert right[-1, column : column + 2] == pytest.approx([-3.123, -0.451], abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("distance", [1e-2, 1e-5])
def test_a_coarse_motion_past_a_lock_is_not_refused(distance):
    check_scene(scene_at([[BASE_LOCK + 0.2, distance], [BASE_LOCK - 0.2, distance], [-1.0, 0.3]]))


@pytest.mark.slow
def test_a_motion_through_a_lock_is_refused_by_name():
    with pytest.raises(SingularPoseError, match=r"a = -0.804634.*leg2.base locks"):
        check_scene(scene_at([[BASE_LOCK + 0.2, 0.0], [BASE_LOCK - 0.2, 0.0]]))


@pytest.mark.slow
@pytest.mark.parametrize("to", [[0.1, 0.9], [0.0, 0.5], [-0.3, 0.36], [0.2, SINGULAR_B + 1e-7]])
def test_a_motion_over_the_lost_constraint_is_refused_there_and_follows_no_branch_that_turns_off(to):
    with pytest.raises(SingularPoseError, match=r"(?s)b = 0.356801: .*leg1.wrist is lost"):
        check_scene(scene_at([[0.0, 0.0], to]))


@pytest.mark.slow
def test_random_steps_stay_on_the_branch_of_the_closed_form():
    rng, lay = np.random.default_rng(4), layout(load_mechanism(SCENE))
    around = 10.0 ** rng.uniform(-5.0, -0.5, 12)
    turn = rng.uniform(0.0, 2.0 * np.pi, 12)
    y = np.stack([BASE_LOCK + around * np.cos(turn), around * np.sin(turn)], axis=1)
    y[::3] = np.stack([rng.uniform(-0.6, 0.6, 4), SINGULAR_B - around[::3]], axis=1)
    q = AssemblyMode(lay, strict=True).motion(y, np.arange(12.0))
    assert np.abs(within_half_turn(q - closed_form_positions(lay, y)))[:, :12].max() < ALIKE


OTHER = """
extends = "3ups-upu-s"
[joints."leg4.base"]
home = ["pi", "7*pi/6"]
[joints."leg4.wrist"]
home = [0, "-pi/6", "pi"]
"""


def test_another_assembly_is_one_sentence(tmp_path, write):
    turned = load_mechanism(write("turned.toml", f'name = "{SCENE}"\n{OTHER}'))
    scene = scene_at([[0.1, 0.05], [0.2, 0.1]])
    write_models(turned, tmp_path / "models", gravity=scene.applied.g)
    scene = replace(scene, models={"mujoco": tmp_path / "models" / f"{SCENE}.xml"})
    results = screwgauge.run(scene, ("screw", "mujoco"), ("actuator_force", "reaction"))
    named = re.compile("mujoco.*assembly mode.*screw.*t = 0 s.*leg4.base")
    assert all(map(named.search, results.pairs["reason"])), results.pairs.to_string()
    assert not results.pairs["ok"].any()
    assert repr(results).replace("\n", " ").count("assembly mode from") == 1


def test_engines_that_are_both_in_another_assembly_than_home_do_not_agree(tmp_path, write):
    turned = load_mechanism(write("turned.toml", f'name = "{SCENE}"\n{OTHER}'))
    scene = scene_at([[0.1, 0.05], [0.2, 0.1]])
    write_models(turned, tmp_path / "models", gravity=scene.applied.g)
    files = {name: tmp_path / "models" / f"{SCENE}.{end}" for name, end in (("mujoco", "xml"), ("pinocchio", "urdf"))}
    results = screwgauge.run(replace(scene, models=files), tuple(files), ("actuator_force",))
    assert all("not in the home assembly mode" in reason for reason in results.pairs["reason"])
    assert not results.pairs["ok"].any()


@pytest.mark.slow
@pytest.mark.parametrize(("bounded", "verdict"), [(True, OK), (False, SILENT)])
def test_the_stress_case_tells_an_engine_that_jumps(bounded, verdict, tmp_path, monkeypatch):
    if not bounded:  # as if every ball were large
        monkeypatch.setattr(
            Anchors, "distance", lambda self, y, a: np.zeros(np.broadcast_shapes(y.shape[:-1], np.shape(a)))
        )
        monkeypatch.setattr(Anchors, "distances", lambda self, y, a: np.zeros(y.shape[:-1]))
        monkeypatch.setattr(continuation, "NEAR", np.inf)
    found = [one for question in CASES["assembly"].ask(1e-2, True, tmp_path) for one in findings(question)]
    assert {one.verdict for one in found if one.engine.endswith("1.2 rad") and not one.own} == {verdict}
    assert {one.verdict for one in found if one.own} == {OK}


@pytest.mark.slow
def test_a_motion_beyond_where_the_loops_close_is_refused_there(write):
    """Coupler and rocker are in line at cos a = (1 + 1 - 1.3^2) / 2."""
    text, last = four_bar([Bar(1.0), Bar(0.5), Bar(0.8)], 1.0, 0.9), np.arccos(0.155)
    with pytest.raises(ClosureError, match=rf"t = 2 s: the loops cannot close beyond y = \[{last:.6f}"):
        check_scene(moving(write, text, [0.9, 1.2, 2.0], 0.0))
    check_scene(moving(write, text, [0.9, 1.2, last - 1e-3, 1.0], 0.0))


def test_besides_the_straight_way_two_lead_round_either_side():
    a, b = np.array([0.1, 0.2, 0.3]), np.array([1.0, 0.4, -0.5])
    way, left, right = (Curve(points) for points in (straight_path(a, b), *bent_paths(a, b)))
    for curve in (way, left, right):
        assert np.abs(curve.points[[0, -1]] - [a, b]).max() < ROUNDING
    middle, *sides = (curve.halves()[0].points[-1] for curve in (way, left, right))
    assert np.abs(middle - (a + b) / 2).max() < ROUNDING
    bend = sides[0] - middle
    assert abs(bend @ (b - a)) < ROUNDING
    assert np.linalg.norm(bend) == pytest.approx(0.3 * np.linalg.norm(b - a), rel=0.5)
    assert np.abs(sides[0] + sides[1] - 2 * middle).max() < ROUNDING
    assert bent_paths(a[:1], b[:1]) == []
