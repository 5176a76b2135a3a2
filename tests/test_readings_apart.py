"""A library that crashes or takes all memory costs its reading only; the matrix of readers says why."""

from __future__ import annotations

import os

import numpy as np
import pytest

from screwgauge.solution import Failure
from screwgauge.study import apart, loading
from screwgauge.study.loading import Request, readings
from screwgauge.study.readers import COLUMNS, reader_matrix

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

    def crashing(request, progress):  # goes to its process by value, being of no module
        return os.abort() if request.library == "pinocchio" else work(request, progress)

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


def test_the_matrix_says_what_is_dropped_and_what_does_not_load(roots, write):
    thin, none = write("thin.urdf", ARM.replace("@", "5")), write("none.xml", "<html/>")
    table = reader_matrix([roots, thin, none])
    assert list(table.columns) == list(COLUMNS)
    rows = {(row.model, row.library): row for row in table.itertuples()}
    assert list(rows) == [
        ("roots", "mujoco"),
        ("roots", "pinocchio"),
        *(("thin", library) for library in ("pinocchio", "yourdfpy", "mujoco")),
        ("none", ""),
    ]
    full, part = rows["roots", "mujoco"], rows["roots", "pinocchio"]
    assert (full.loads, full.freedoms, full.mass, full.cause) == (True, 3, 3.0, "")
    assert (part.loads, part.freedoms, part.mass) == (True, 1, 1.0)
    assert part.cause.startswith("body b, c, which pinocchio drops; joint bj, cj, which pinocchio drops")
    refused = rows["thin", "mujoco"]
    assert not refused.loads
    assert np.isnan(refused.mass)
    assert refused.cause.startswith("MuJoCo refuses it (inertia must satisfy A + B >= C")
    assert rows["none", ""].cause.startswith("is no model")


def test_the_matrix_compares_torques_where_it_is_told_how(write):
    path = write("arm.urdf", ARM.replace("@", "1"))
    seen = []

    def torques(one, other):
        seen.append((one.library, other.library))
        return 0.25

    table = reader_matrix([path], torques)
    assert seen == [("pinocchio", "yourdfpy"), ("pinocchio", "mujoco")]
    assert list(table["torque"]) == [0.0, 0.25, 0.25]
    assert reader_matrix([path])["torque"].isna().tolist() == [False, True, True]


def test_masses_and_kinds_that_differ_are_causes(write):
    """Pinocchio takes the mass of every geom, MuJoCo that of some groups."""
    shapes = '<geom size="0.1" mass="1"/><geom size="0.1" mass="2" group="4"/>'
    body = f'<body name="a"><joint name="j"/>{shapes}</body>'
    compiler = '<compiler inertiagrouprange="0 1"/>'
    path = write("groups.xml", f"<mujoco>{compiler}<worldbody>{body}</worldbody></mujoco>")
    (_, row) = reader_matrix([path]).itertuples()
    assert "mass of a 3 kg, not 1 kg" in row.cause
