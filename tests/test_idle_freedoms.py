import pickle
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import screwgauge
from screwgauge import Scene, ScrewgaugeError
from support.data import data
from support.errors import DescriptionError
from support.geometry import Array
from support.judging import judge
from support.scene import GivenMotion, sampled
from support.tolerances import IDLE_MOTION

SCENE = "3ups-upu-s"


def motion(idle: tuple[int, ...], *, off: float = 0.0) -> GivenMotion:
    whole = sampled(SCENE, slice(0, 40, 10)).motion
    return replace(whole, ydd=whole.ydd + np.array([0.0, off]), idle=idle, drive=None)


def test_parts_keep_idle_coordinates_and_order_moves_them():
    one = motion((1,))
    assert one.part(slice(0, 2)).idle == (1,)
    turned = one.reorder([1, 0])
    assert turned.idle == (0,)
    np.testing.assert_array_equal(turned.y[:, 0], one.y[:, 1])


def test_judge_does_not_ask_for_accelerations_of_idle_coordinates():
    scene = sampled(SCENE, slice(0, 40, 10))
    quantities = ["joint_position", "joint_velocity", "joint_acceleration"]
    solution = screwgauge.run(scene, engines=["screw"], quantities=quantities).solutions["screw"]

    def faults(idle: tuple[int, ...]) -> set[str]:
        table = judge(scene.mechanism, replace(scene.problem(quantities), task=motion(idle, off=1.0)), solution)
        return set(table["worst_component"][~table["ok"]])

    asked = f"{[*scene.mechanism.independent][1]} as prescribed"
    assert faults(()) == {asked}
    assert asked not in faults((1,))


MOVED = """
mechanism = "cart.toml"
motion.cart.harmonics = [[3, 0, 0.4]]
idle.angle = { rate = 0 }
time = { duration = 3, step = 0.05 }
"""


@pytest.fixture
def cart(tmp_path) -> Callable[..., Scene]:
    (tmp_path / "cart.toml").write_text(data("cart.toml"))

    def scene(*changes: tuple[str, str]) -> Scene:
        text = MOVED
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "scene.toml").write_text(text)
        return screwgauge.load_scene(tmp_path / "scene.toml")

    return scene


def pole(t: Array, start: tuple[float, float]) -> tuple[Array, Array, Array, Array]:
    m, l, g, inertia = 1.0, 0.7, 9.81, 2e-2 + 0.49
    push = lambda t: -3.6 * np.sin(3 * t)  # noqa: E731

    def bend(t: Array, q: Array) -> Array:
        return -(m * l * push(t) * np.cos(q) + m * g * l * np.sin(q)) / inertia

    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14, "t_eval": t}
    q, qd = solve_ivp(lambda t, z: [z[1], bend(t, z[0])], (t[0], t[-1]), start, **options).y
    qdd = bend(t, q)
    return q, qd, qdd, 3.0 * push(t) + m * l * (qdd * np.cos(q) - qd**2 * np.sin(q))


def test_pole_on_a_driven_cart_follows_the_closed_form(cart):
    scene = cart()
    q, qd, qdd, force = pole(scene.t, (0.5, 0.0))
    motion = scene.motion
    for ours, closed in ((motion.y, q), (motion.yd, qd), (motion.ydd, qdd)):
        assert np.abs(ours[:, 1] - closed).max() < IDLE_MOTION
    results = screwgauge.run(scene)
    assert results.ok
    for engine in results.solutions:
        assert np.abs(results.values("actuator_force", engine)[:, 0] - force).max() < IDLE_MOTION * np.abs(force).max()


def test_samples_are_followed_between(cart, tmp_path):
    exact = cart()
    t, y, yd, ydd = (
        x[:, 0] if x.ndim == 2 else x for x in (exact.t, exact.motion.y, exact.motion.yd, exact.motion.ydd)
    )
    rows = zip(t.tolist(), y.tolist(), yd.tolist(), ydd.tolist(), strict=True)
    lines = ["t,cart,cartd,cartdd", *(",".join(map(repr, row)) for row in rows)]
    (tmp_path / "cart.csv").write_text("\n".join(lines))
    sampled = cart(("motion.cart.harmonics = [[3, 0, 0.4]]", 'motion.csv = "cart.csv"'))
    np.testing.assert_array_equal(sampled.motion.y[:, 0], y)
    # splines of the fourth order over a twentieth of a second
    assert 0.0 < np.abs(sampled.motion.y - exact.motion.y).max() < 1e-5
    assert screwgauge.run(sampled).ok


def test_start_without_a_word_is_home_without_momentum(cart):
    scene = cart(("idle.angle = { rate = 0 }\n", ""))
    (freedom,) = scene.undriven
    # momentum along the pole: I q' + m l x' cos q
    assert freedom.start == 0.5
    assert freedom.rate == pytest.approx(-0.7 * 1.2 * np.cos(0.5) / 0.51, rel=1e-14, abs=0)


def test_motion_is_that_under_the_forces_that_act(cart):
    scene = cart()
    light = scene.under(gravity=[0, 0, -1.62])
    moved = replace(scene, applied=light.applied)
    assert np.abs(light.motion.y - scene.motion.y)[:, 1].max() > 0.1
    np.testing.assert_array_equal(moved.motion.y, light.motion.y)
    again = pickle.loads(pickle.dumps(light))
    np.testing.assert_array_equal(again.at([1.0, 2.0]).motion.y, light.motion.y[[20, 40]])


def test_other_times_leave_the_start_where_it_was(cart):
    scene = cart()
    np.testing.assert_allclose(scene.at([1.0, 1.5]).motion.y, scene.motion.y[[20, 30]], rtol=1e-14)
    with pytest.raises(DescriptionError, match="starts at t = 0 s"):
        scene.at([-0.5, 1.0])


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("idle.angle = { rate = 0 }", "idle.cart = { rate = 0 }", "'cart' also has a motion"),
        ("idle.angle = { rate = 0 }", "idle.pole = { rate = 0 }", "pole"),
        ("idle.angle = { rate = 0 }", "idle.angle = { speed = 0 }", "speed"),
        ("motion.cart", "motion.angle", "'cart' is missing"),
    ],
)
def test_what_does_not_fit_is_refused(cart, old, new, match):
    with pytest.raises(ScrewgaugeError, match=match):
        cart((old, new))


def test_forces_of_a_motion_that_nothing_drives_are_refused_with_a_way_out(cart):
    scene = cart(("idle.angle = { rate = 0 }", "motion.angle.offset = 0.5"))
    with pytest.raises(DescriptionError, match=r"remove 'angle' from \[motion\]"):
        screwgauge.run(scene, quantities=["actuator_force"])


def judged(scene: Scene, motion: GivenMotion, change: float = 0.0) -> set[str]:
    wanted = ["joint_position", "joint_velocity", "joint_acceleration"]
    solution = screwgauge.run(scene, engines=["screw"], quantities=wanted).solutions["screw"]
    accelerations = solution.values["joint_acceleration"]
    array = accelerations.array + np.array([0.0, change])
    values = {**solution.values, "joint_acceleration": replace(accelerations, array=array)}
    problem = replace(scene.problem(wanted), task=motion)
    table = judge(scene.mechanism, problem, replace(solution, values=values))
    return set(table["residual"][~table["ok"]])


def test_judge_sees_accelerations_that_forces_do_not_make(cart):
    scene = cart()
    assert not judged(scene, scene.motion)
    assert judged(scene, scene.motion, change=1e-8) == {"idle_balance"}


def test_judge_sees_a_motion_that_forces_do_not_make(cart):
    scene = cart()
    other = scene.under(gravity=[0, 0, -9.81 * (1 + 1e-8)])
    mixed = replace(scene.motion, drive=other.motion.drive, y=other.motion.y, yd=other.motion.yd)
    solution = screwgauge.run(other, engines=["screw"]).solutions["screw"]
    table = judge(scene.mechanism, replace(scene.problem([*solution.values]), task=mixed), solution)
    assert "idle_motion" in set(table["residual"][~table["ok"]])


@pytest.mark.parametrize("backend", ["numpy", "llvm"])
def test_programs_solve_idle_accelerations(cart, backend):
    scene = cart()
    motion = scene.motion
    solver = screwgauge.compile(scene, ("actuator_force", "joint_acceleration"), backend=backend)
    assert not solver.notes
    asked = motion.ydd.copy()
    asked[:, 1] = 7.0  # of no account
    answer = solver(motion.y.copy(), motion.yd.copy(), asked)
    assert not answer.by_array
    np.testing.assert_allclose(answer["joint_acceleration"], motion.ydd, rtol=0, atol=IDLE_MOTION)
    force = screwgauge.run(scene, engines=["screw"]).values("actuator_force", "screw")
    np.testing.assert_allclose(answer["actuator_force"], force, rtol=0, atol=IDLE_MOTION)


def test_pole_that_a_joint_damps_and_a_spring_turns_is_followed_however_stiff(cart):
    """It comes to rest within 1e-5 s."""
    damped = '\n[[springs]]\ncoordinate = "hinge"\nstiffness = 40.0\nrest = 0.3\ndamping = 5e4\n'
    scene = cart(
        ("idle.angle = { rate = 0 }\n", "idle.angle = { rate = 2 }\n"), ("step = 0.05 }", "step = 0.05 }" + damped)
    )
    assert np.abs(scene.motion.yd[1:, 1]).max() < 1e-2
    assert screwgauge.run(scene).ok


def test_exciting_motion_leaves_to_the_forces_what_the_scene_does(cart):
    scene = screwgauge.exciting(cart())
    assert scene.motion.idle == (1,)
    assert screwgauge.run(scene.at(scene.t[:5]), engines=["screw"], quantities=["actuator_force"]).ok
