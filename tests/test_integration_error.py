from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

import screwgauge
from screwgauge import Scene
from screwgauge.judging.allowance import MOST, WITHIN, Granted
from screwgauge.judging.trust import integration_errors
from screwgauge.study.simulations import add_observables, loosen
from support.data import DATA, data
from support.engines import REFERENCE, Solution, Values, ask, model_files
from support.geometry import within_half_turn
from support.judging import compared
from support.models import write_models
from support.report import verdict
from support.solve import Pace, layout

pytestmark = pytest.mark.slow

FALL = """
mechanism = "{mechanism}"
time = {{ duration = {duration}, step = {step} }}
[forward]
rtol = 1e-12
atol = 1e-12
"""
#: How far built-in scenes are followed here [s].
UNTIL = {"cart-pole": 6.0, "spatial-slider-crank": 1.0}
CARTS = {"cart-pole": (1e-6, 1.0, 1.0), "sibling": (2e-6, 1.5, 0.8)}
MOTION = frozenset(("joint_position", "joint_velocity", "joint_acceleration"))


@pytest.fixture
def fall(write):
    def make(name: str, duration: float = 10.0, step: float = 0.05) -> Scene:
        write("sibling.toml", data("light-cart.toml"))
        mechanism = name if name == "cart-pole" else f"{name}.toml"
        return screwgauge.load_scene(write("fall.toml", FALL.format(mechanism=mechanism, duration=duration, step=step)))

    return make


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
@pytest.mark.parametrize("name", CARTS)
def test_a_light_cart_that_darts_aside_does_not_stop_an_engine(fall, name, engine, tmp_path):
    scene = fall(name, step=5.0)
    write_models(scene.mechanism, tmp_path, gravity=scene.applied.g)
    found = ask(engine, model_files(name, engine, tmp_path), scene.problem(MOTION))
    assert (found.stopped, found.n_solved) == ("", 3)


def test_steps_that_would_never_reach_the_end_are_told_from_a_fast_phase():
    def told(sizes):
        pace, t = Pace("DOP853", 1e-12, 1.0), 0.0
        return [pace.endless(t := t + size) for size in sizes]

    window = Pace("DOP853", 1e-12, 1.0).window
    assert not any(told([1e-3] * 10 + [1e-12] * (window // 2) + [1e-3] * 10))
    creeping = told([1e-3] + [1e-9] * (2 * window))
    assert creeping.index(True) == window - 1
    assert Pace("Radau", 1e-12, 1.0).window > 10 * window


@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("name", ["cart-pole", "spatial-slider-crank"])
def test_engines_agree_by_the_default_tolerance(name):
    scene = screwgauge.load_scene(name)
    results = screwgauge.run(scene.at(scene.t[scene.t <= UNTIL[name]]))
    assert results.ok, str(results)
    assert not results.scene.tolerances
    within = results.pairs["reason"].str.startswith(WITHIN)
    assert (results.pairs["max_scaled"][within] > results.scene.tolerance("observable")).all()
    assert results.pairs["tolerance"].max() < MOST
    assert "estimated error of integration" in verdict(results).text
    assert any("integration error" in note for note in results.solutions["screw"].notes)


@pytest.mark.slow
def test_the_sibling_agrees_by_the_estimate(fall):
    # at 5.25 s the cart darts aside with 4e5 m/s^2, of which one rounding is more than the judge admits
    results = screwgauge.run(fall("sibling", 6.0, step=0.04))
    assert results.ok, str(results)
    assert results.pairs["max_scaled"].max() > results.scene.tolerance("joint_position")


def test_where_engines_agree_nobody_integrates_again(monkeypatch):
    def unwanted(scene):
        raise AssertionError(scene.name)

    monkeypatch.setattr("screwgauge.study.run.loosen", unwanted)
    assert screwgauge.run(screwgauge.load_scene("cart-pole").at([0.0, 0.2]), engines=["screw", "mujoco"]).ok


@pytest.mark.slow
def test_a_tolerance_of_the_scene_is_binding(fall):
    scene = replace(fall("cart-pole", 4.0), tolerances={"joint_velocity": 1e-10})
    results = screwgauge.run(scene, engines=["screw", "mujoco"], quantities=["joint_velocity"])
    assert not results.ok
    assert set(results.pairs["tolerance"]) == {1e-10}
    assert results.pairs["reason"].str.contains("from screw and .* from mujoco").all()
    assert "scene sets the tolerance" in verdict(results).text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "right", "wrong"),
    [
        ("spatial-slider-crank", 'mass="0.02"', 'mass="0.02002"'),
        ("cart-pole", 'pos="0 0 -1"', 'pos="0 0 -1.001"'),
    ],
)
def test_a_model_that_is_a_thousandth_off_still_differs(name, right, wrong, tmp_path):
    scene = screwgauge.load_scene(name).at([0.0, 0.5, 1.0])
    write_models(scene.mechanism, tmp_path, gravity=scene.applied.g)
    own = tmp_path / f"{name}.xml"
    text = own.read_text(encoding="utf-8")
    assert text.count(right) == 1
    own.write_text(text.replace(right, wrong), encoding="utf-8")
    results = screwgauge.run(replace(scene, models={"mujoco": own}), engines=["screw", "mujoco"])
    assert results.exit_status == 1
    assert not results.pairs["ok"].any()
    assert results.pairs["reason"].str.contains("integration.* at most .*; at least ").all()


def several(scene: Scene, engine: str) -> tuple[Solution, list[Solution]]:
    files = model_files(scene.mechanism.name, engine)
    wanted = ("joint_position", "joint_velocity", "observable") if scene.observables else ("joint_position",)
    found = {str(k): ask(engine, files, x.problem(MOTION)) for k, x in enumerate([scene, *loosen(scene)])}
    first, *looser = add_observables(replace(scene, known=None), layout(scene.mechanism), found, wanted).values()
    return first, looser


def honest(estimate: np.ndarray, error: np.ndarray) -> None:
    error = np.maximum.accumulate(np.abs(error).max(axis=1))
    assert (estimate >= error - 1e-13).all(), (estimate / error).min()
    assert estimate[-1] < 1000.0 * error[-1] + 1e-11


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "engine", "until"),
    [
        ("a01-pendulum", "screw", 10.0),
        ("a01-pendulum", "pinocchio", 10.0),
        ("a02-fourbar-2", "screw", 1.0),
        ("a02-fourbar-2", "screw", 10.0),  # ten singular poses
        ("a03-andrews-ivp", "screw", 0.03),
        ("a03-andrews-ivp", "mujoco", 0.03),
        ("a04-bricard-box", "screw", 10.0),
        ("a05-governor", "screw", 2.0),
        ("a05-governor", "pinocchio", 0.5),
    ],
)
def test_the_estimate_holds_the_true_error_of_established_problems(name, engine, until):
    scene = screwgauge.load_scene(name)
    rows = np.flatnonzero(scene.known.t <= until)[::10]
    right, looser = several(scene.at(scene.known.t[rows]), engine)
    has = right.values["observable"]
    for unit, estimate in integration_errors(right, looser)["observable"].items():
        honest(estimate, (has.array - scene.known.array[rows])[:, [i for i, u in enumerate(has.units) if u == unit]])


@cache
def exact(name: str, times: tuple[float, ...]) -> np.ndarray:
    """Angle of the pole from the integral of energy; its motion repeats itself. Shape (n, 1). With u^2 the angle below
    the horizontal, theta'^2 = 2 m g l cos(theta) / I(theta).
    """
    cart, pole, l = CARTS[name]
    nodes, weights = np.polynomial.legendre.leggauss(40)

    def slowness(u: np.ndarray) -> np.ndarray:
        theta = 0.5 * np.pi - u * u
        moment = pole * l * l * (np.sin(theta) ** 2 + np.cos(theta) ** 2 * cart / (cart + pole)) + 1e-12
        return 2.0 * np.sqrt(moment * (1.0 / np.sinc(u * u / np.pi)) / (2.0 * pole * 9.81 * l))

    down = np.sqrt(0.5 * np.pi)
    marks = [0.0, *(np.sqrt(0.5 * np.pi - e) for e in (1.0, 0.1, 0.02, 0.005, 0.002, 1e-3, 5e-4, 2e-4, 5e-5)), down]

    def since(u: float) -> float:
        ends = [*(mark for mark in marks if mark < u), u]
        return sum(0.5 * (b - a) * (weights @ slowness(a + 0.5 * (b - a) * (nodes + 1.0))) for a, b in pairwise(ends))

    quarter, found = since(down), []
    for t in times:
        k, rest = divmod(t, quarter)
        way = rest if k % 2 == 0 else quarter - rest
        u = brentq(lambda x, way=way: since(x) - way, 0.0, down, xtol=1e-15, rtol=1e-15) if way else 0.0
        found.append((0.5 * np.pi - u * u) * (1.0 if k % 4 in (0, 3) else -1.0))
    return np.array(found)[:, None]


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("engine", ["screw", "pinocchio", "mujoco"])
def test_the_estimate_holds_the_true_error_of_the_cart_pole(engine):
    """At speeds of 4 km/s rounding decides: the pole's own motion is a small difference."""
    scene = screwgauge.load_scene("cart-pole").at(np.linspace(0.0, 10.0, 21))
    right, looser = several(scene, engine)
    column = right.values["joint_position"].components.index("hinge")
    error = right.values["joint_position"].array[:, [column]] - exact("cart-pole", tuple(scene.t.tolist()))
    error = np.maximum.accumulate(np.abs(error).max(axis=1))
    assert (integration_errors(right, looser)["joint_position"]["rad"] >= error).all()
    assert error[-1] < 1e-7


@pytest.mark.slow
def test_the_estimate_grows_with_a_chaotic_motion(write):
    """Errors of a double pendulum grow by 1e8 in twenty seconds."""
    text = FALL.format(mechanism=DATA / "pendulum.toml", duration=20, step=0.25).replace("1e-12", "1e-9")
    scene = screwgauge.load_scene(write("chaos.toml", f"{text}start = {{ a = 2.5, b = 1 }}\n"))
    steps = replace(scene.start.integration, rtol=1e-13, atol=1e-13)
    best = replace(scene, task=replace(scene.start, integration=steps))
    files = model_files(str(DATA / "pendulum.toml"), "screw")
    right, true, *looser = [ask("screw", files, x.problem(MOTION)) for x in (scene, best, *loosen(scene))]
    estimate = integration_errors(right, looser)["joint_position"]["rad"]
    q = right.values["joint_position"].array - true.values["joint_position"].array
    error = np.maximum.accumulate(np.abs(within_half_turn(q)).max(axis=1))
    assert (estimate >= error).all()
    assert estimate[4] < 1e-6 < 1e-5 < estimate[-1]


LATER = np.array([0.0, 1e-10, 5e-5])


def motions(late: float, early: float = 0.0, error=LATER):
    scene = screwgauge.load_scene("a01-pendulum").at([0.0, 1.0, 2.0])
    scene = replace(scene, tolerances={})
    angles = np.array([[-1.5], [0.5], [1.0]])
    found, left = {}, {"joint_position": {"rad": error}}
    for name, more in (("screw", [[0.0], [0.0], [0.0]]), ("pinocchio", [[0.0], [early], [late]])):
        values = {"joint_position": Values(("pivot",), ("rad",), angles + np.array(more))}
        found[name] = Solution(name, "", values, np.ones(3))
    return compared(scene, found, dict.fromkeys(found, left))[1].iloc[0]


def test_what_integration_leaves_at_the_end_is_not_admitted_at_the_beginning():
    assert motions(late=6e-5)["ok"]
    row = motions(late=6e-5, early=1e-6)
    assert not row["ok"]
    assert (row["worst_t"], row["max_abs"]) == (1.0, pytest.approx(1e-6))
    assert "at least" in row["reason"]


def test_more_than_ten_thousandths_is_not_put_down_to_integration():
    row = motions(late=2e-3, error=np.full(3, 1.0))
    assert not row["ok"]
    assert "at most 0.0001" in row["reason"]


def test_an_unknown_error_of_integration_is_none():
    limits = np.zeros(2)
    grown = Granted(0.0, limits, limits, "", 1.0, {"screw": np.array([0.0, np.nan])}, False)
    assert grown.admitted.tolist() == [0.0, 0.0]
    assert grown.reason(1e-3, 1, ok=False, usual=1e-9) == ""


def test_a_reference_has_no_error_of_integration(monkeypatch):
    scene = screwgauge.load_scene("a01-pendulum").at([0.0, 5.0, 10.0])
    steps = replace(scene.start.integration, rtol=1e-8, atol=1e-8)
    scene = replace(scene, tolerances={}, task=replace(scene.start, integration=steps))
    monkeypatch.setattr("screwgauge.quantities.GROWTH", 1.0)
    results = screwgauge.run(scene, engines=["screw"])
    assert results.ok, str(results)
    assert results.pairs["max_abs"].max() > 1e-8
    assert all(f"{WITHIN}: at most" in reason and REFERENCE not in reason for reason in results.pairs["reason"])
