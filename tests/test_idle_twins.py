from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import screwgauge
from support.data import data
from support.errors import DescriptionError
from support.geometry import Array
from support.scene import assumptions
from support.tolerances import LINEAR

ENGINES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full", "lagrange")
QUANTITIES = (
    "joint_position",
    "joint_velocity",
    "body_angular_velocity",
    "body_angular_acceleration",
    "actuator_force",
)
#: Motors drive cranks, from whose ends rods hang down to a foot that turns about two axes.
FOOT = data("ankle-foot.toml")
LEG = data("ankle-leg.toml")
SIDES = {1: 0.05, 2: -0.05}
AXES = {"S": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "U": [[1, 0, 0], [0, 1, 0]]}
MATTERS = "do not depend on it"
HELD = "motion.roll.offset = 0.1\nmotion.pitch.offset = -0.2\n"
MOVED = "motion.roll.harmonics = [[10, 0, 0.15]]\nmotion.pitch.harmonics = [[8, 0, 0.25]]\n"


@pytest.fixture
def ankle(tmp_path) -> Callable[..., Any]:
    def results(kind: str, axial: float, motion: str = MOVED, engines: tuple[str, ...] = ENGINES) -> Any:
        spins = "".join(f'spin{k} = "rod{k}.top.q3"\n' for k in SIDES) if kind == "S" else ""
        legs = (LEG.format(k=k, y=y, kind=kind, axial=axial, axes=AXES[kind]) for k, y in SIDES.items())
        (tmp_path / "ankle.toml").write_text("".join([FOOT.format(spins=spins), *legs]))
        scene = f'mechanism = "ankle.toml"\ntime = {{ duration = 0.6, step = 0.05 }}\n{motion}'
        (tmp_path / "scene.toml").write_text(scene)
        found = screwgauge.run(screwgauge.load_scene(tmp_path / "scene.toml"), engines, QUANTITIES)
        assert found.ok, found.pairs
        return found

    return results


def apart(one: Any, other: Any, engine: str) -> float:
    a, b = (each.values("actuator_force", engine) for each in (one, other))
    return float(np.abs(a - b).max() / np.abs(b).max())


@pytest.mark.parametrize("axial", [1e-4, 1e-6, 1e-9, 0.0])
def test_held_ankles_have_the_same_torques(ankle, axial):
    balls, universal = (ankle(kind, axial, HELD) for kind in "SU")
    assert all(apart(balls, universal, engine) < LINEAR for engine in ENGINES)


@pytest.mark.parametrize("axial", [1e-4, 1e-6, 0.0])
def test_rods_that_do_not_spin_are_thin(ankle, axial):
    """Zero momentum about a rod's line makes its inertia there irrelevant."""
    balls, thin = ankle("S", axial), ankle("U", 0.0)
    assert all(apart(balls, thin, engine) < LINEAR for engine in ENGINES)


def test_rods_on_universal_joints_take_the_power_of_their_spin(ankle):
    axial = 1e-5
    balls, universal = (ankle(kind, axial, engines=("screw", "mujoco")) for kind in "SU")
    rates = universal.values("joint_velocity", "screw")
    names = [*universal.components("joint_velocity")]
    driven = rates[:, [names.index(f"motor{k}") for k in SIDES]]
    more = universal.values("actuator_force", "screw") - balls.values("actuator_force", "screw")
    taken = sum(axial * w * wd for w, wd in (spin(universal, k) for k in SIDES))
    assert np.abs(taken).max() > 1e-7
    np.testing.assert_allclose((more * driven).sum(axis=1), taken, rtol=0, atol=1e-9 * np.abs(taken).max())


def spin(results: Any, k: int) -> tuple[Array, Array]:
    names = [*results.components("joint_position")]
    q = results.values("joint_position", "screw")
    roll, pitch, crank = (q[:, names.index(name)] for name in ("foot.q1", "foot.q2", f"motor{k}"))
    zero, y = 0.0 * roll, SIDES[k]
    end = np.stack([-0.02 - 0.05 * np.cos(crank), y + zero, 0.2 + 0.05 * np.sin(crank)], axis=1)
    x, z = -0.07 * np.cos(pitch), 0.07 * np.sin(pitch)  # turned about y, then about x
    foot = np.stack([x, y * np.cos(roll) - z * np.sin(roll), y * np.sin(roll) + z * np.cos(roll)], axis=1)
    line = (foot - end) / 0.2
    w, b = (
        results.values(name, "screw")[:, [[*results.components(name)].index(f"rod{k}.{axis}") for axis in "xyz"]]
        for name in ("body_angular_velocity", "body_angular_acceleration")
    )
    return (w * line).sum(axis=1), (b * line).sum(axis=1) + (w * np.cross(w, line)).sum(axis=1)


def test_report_says_what_is_assumed_and_whether_it_matters(ankle, tmp_path):
    def said(axial: float, motion: str = MOVED) -> tuple[str, ...]:
        return assumptions(ankle("S", axial, motion, ("screw",)).scene)

    assert all(MATTERS not in one and "without momentum" in one for one in said(1e-5))
    assert all(MATTERS in one and "without momentum" in one for one in said(1e-5, HELD))
    assert all(MATTERS in one and "assumed to rest" in one for one in said(0.0))
    results = ankle("S", 1e-5, engines=("screw",))
    results.write(tmp_path / "out")
    assert said(1e-5)[0] in (tmp_path / "out" / "report.md").read_text()
    assert "spin1 (idle)" in (tmp_path / "out" / "report.html").read_text()


def test_what_has_no_inertia_cannot_rest_under_a_force(ankle):
    pushed = HELD + '[[loads]]\non = "rod1"\nby = "environment"\ntorque = [0, 0, 0.1]\n'
    with pytest.raises(DescriptionError, match="'spin1' has no inertia"):
        ankle("S", 0.0, pushed)


def test_rod_that_spins_bends_the_torques(ankle):
    still = ankle("S", 1e-5)
    turning = ankle("S", 1e-5, MOVED + "idle.spin1.rate = 30\n")
    assert np.abs(turning.values("actuator_force", "screw") - still.values("actuator_force", "screw")).max() > 1e-7
