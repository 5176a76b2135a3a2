"""What compiled programs cost beside bare calls of `rnea`: alike for all contestants, and named as what ran."""

from __future__ import annotations

import sys

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from campaigns import volume

import screwgauge
from screwgauge.models.catalog import mechanism_path


def test_every_contestant_answers_as_many_samples_in_turn():
    now, order = [0], []

    def contestant(name, nanoseconds, n):
        def call():
            order.append(name)
            now[0] += nanoseconds * n

        return call, n

    calls = {"f": contestant("f", 3, 256), "m": contestant("m", 7, 2048)}
    found = volume.measured(calls, rounds=3, clock=lambda: now[0])
    assert found == pytest.approx({"f": 3e-9, "m": 7e-9}, rel=1e-9, abs=0.0)
    share = "f" * (volume.SHARE // 256) + "m" * (volume.SHARE // 2048)
    assert "".join(order) == share + 3 * "".join(2 * part for part in (share.rstrip("m"), share.lstrip("f")))


@pytest.fixture
def small(monkeypatch):
    """A small scene in the place of the paper's, and few samples of it."""
    scene = screwgauge.load_scene("arm7")
    monkeypatch.setattr(volume, "load_scene", lambda name: scene)
    monkeypatch.setattr(volume, "bare", lambda n: {"rnea": lambda: None})
    monkeypatch.setattr(volume, "SAMPLES", {"numpy": (16, 32), "llvm": (16, 32)})


def test_all_quantities_and_forces_alone_are_called_with_buffers_and_with_estimates(small):
    calls = volume.contestants(["numpy"])
    assert {name: n for name, (_, n) in calls.items()} == {
        "rnea": 256,
        "numpy all": 16,
        "numpy all, estimates": 16,
        "numpy forces": 32,
        "numpy forces, estimates": 32,
    }
    first, again = (calls["numpy forces, estimates"][0]() for _ in range(2))
    assert first["actuator_force"] is again["actuator_force"]
    assert first.estimate["actuator_force"].shape == (32, 1)


def test_bare_calls_are_of_all_samples(monkeypatch):
    called = []
    for library, name in ((pin, "rnea"), (mujoco, "mj_inverse")):
        monkeypatch.setattr(library, name, lambda *_, name=name: called.append(name))
    calls = volume.bare(3)
    for call in calls.values():
        call()
    assert called == 3 * ["rnea"] + 3 * ["mj_inverse"]
    monkeypatch.undo()
    *_, q, v, a, tau = calls["rneaInParallel, 1 thread"].args
    assert q.shape[1] == 3
    model = pin.buildModelFromUrdf(str(mechanism_path("3ups-upu-s").with_suffix(".urdf")))
    tree = [pin.rnea(model, model.createData(), *row) for row in zip(q.T, v.T, a.T, strict=True)]
    np.testing.assert_allclose(tau.T, tree, rtol=1e-13)


def test_what_ran_in_the_place_of_another_is_named(small, monkeypatch):
    monkeypatch.setitem(sys.modules, "llvmlite.binding", None)
    if "screwgauge.reference.traced.native" in sys.modules:
        sys.modules["screwgauge.reference.traced.native"]._host.cache_clear()
    note = "llvmlite is not installed (extra 'fast'): the program runs with NumPy"
    assert f"llvm all, estimates, {note}" in volume.contestants(["llvm"])
