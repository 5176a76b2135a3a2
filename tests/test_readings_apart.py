"""A library that crashes or takes all memory costs its reading only."""

from __future__ import annotations

import os

import pytest

from screwgauge.solution import Failure
from screwgauge.study import apart, loading
from screwgauge.study.loading import Request, readings

REAL = apart.apart
INERTIAL = '<inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/>'
ROOTS = "".join(f'<body name="{name}"><joint name="{name}j"/>{INERTIAL}</body>' for name in "abc")
MATTER = '<inertial><mass value="1"/><inertia ixx="@" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
HINGE = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>'
ARM = f'<robot name="r"><link name="a"/><link name="b">{MATTER}</link>{HINGE}</robot>'


@pytest.fixture
def roots(write):
    return write("roots.xml", f"<mujoco><worldbody>{ROOTS}</worldbody></mujoco>")


def test_a_crash_costs_one_reading(roots, monkeypatch):
    work = loading._work

    def crashing(request):  # goes to its process by value, being of no module
        return os.abort() if request.library == "pinocchio" else work(request)

    monkeypatch.setattr(apart, "apart", REAL)
    monkeypatch.setattr(loading, "_work", crashing)
    found = readings({"one": Request(roots, "mujoco"), "other": Request(roots, "pinocchio")})
    assert list(found) == ["one", "other"]
    assert list(found["one"].bodies) == ["a", "b", "c"]
    assert isinstance(found["other"], Failure)
    assert found["other"].reason == "crashed: its process got SIGABRT"


def test_a_refusal_is_a_failure_with_its_reason(write):
    path = write("arm.urdf", ARM.replace("@", "5"))
    found = readings({"A": Request(path, "pinocchio"), "B": Request(path, "mujoco"), "C": Request(path, "pinocchio")})
    assert found["B"].engine == "mujoco"
    assert "MuJoCo refuses it (" in found["B"].reason
    assert list(found["A"].bodies) == list(found["C"].bodies) == ["b"]
