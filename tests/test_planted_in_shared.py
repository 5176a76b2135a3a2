from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge.engines.kit import acting
from screwgauge.engines.tree import applied_forces, closed_forces
from screwgauge.reference.equations import kinematics
from screwgauge.reference.equations.recursion import MOVING, BodyAccelerations
from support.engines import ENGINES, get_engine

#: Engines that share neither trees nor the solver's equations.
WITNESSES = ("lagrange", "exudyn")
TREES = ("pinocchio", "mujoco")


@pytest.fixture(scope="module")
def scene():
    return screwgauge.load_scene("3ups-upu-s-fast").at([0.1, 0.3])


@pytest.fixture(params=WITNESSES)
def witness(request, monkeypatch):
    engine = get_engine(request.param)
    if not engine.installed:
        pytest.skip(f"{engine.package} is not installed")
    monkeypatch.setitem(ENGINES, engine.name, replace(engine, apart=False))
    return engine.name


def differences(scene, one, other):
    results = screwgauge.run(scene, engines=(one, other))
    assert not results.failures
    pairs = results.pairs[~results.pairs["ok"].astype(bool)]
    return pairs.groupby("quantity")["max_scaled"].max().to_dict()


def test_nothing_differs_without_a_mistake(scene, witness):
    for other in ("screw", *TREES):
        assert differences(scene, other, witness) == {}


def test_a_reversed_reaction_of_trees_is_seen(scene, witness, monkeypatch):
    right = closed_forces.components
    monkeypatch.setattr(closed_forces, "components", lambda *at: -right(*at))
    assert differences(scene, *TREES) == {}
    assert differences(scene, TREES[0], witness) == {"reaction": pytest.approx(2.0)}


def test_loads_of_trees_that_are_larger_by_a_hundredth_are_seen(scene, witness, monkeypatch):
    right = acting.wrenches_on_bodies

    def larger(applied, *more):
        loads = tuple(replace(load, force=1.01 * load.force, torque=1.01 * load.torque) for load in applied.loads)
        return right(replace(applied, loads=loads), *more)

    for module in (acting, applied_forces):
        monkeypatch.setattr(module, "wrenches_on_bodies", larger)
    assert differences(scene, *TREES) == {}
    seen = differences(scene, TREES[0], witness)
    assert seen.keys() == {"generalized_force", "actuator_force", "reaction"}
    assert all(1e-4 < size < 0.1 for size in seen.values())


def test_gyroscopic_moments_of_the_other_sign_are_seen(scene, witness, monkeypatch):
    right = BodyAccelerations.needs

    def reversed_moments(self, g):
        needs, w = right(self, g).copy(), self.bodies.turning.w
        needs[..., MOVING, 3:] -= 2.0 * np.cross(w, (self.pose.lay.mechanism.inertias @ w[..., None])[..., 0])
        return needs

    monkeypatch.setattr(BodyAccelerations, "needs", reversed_moments)
    assert differences(scene, "screw", witness).keys() == {"generalized_force", "actuator_force", "reaction"}


def test_halved_brackets_are_seen(scene, witness, monkeypatch):
    right = kinematics.lie_bracket
    monkeypatch.setattr(kinematics, "lie_bracket", lambda *at: 0.5 * right(*at))
    assert "joint_acceleration" in differences(scene, "screw", witness)
