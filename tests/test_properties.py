import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from screwgauge import Scene, load_scene
from support.engines import Solution, solve
from support.geometry import rotation
from support.strategies import FEW, scenes
from support.tolerances import ROUNDING

pytestmark = pytest.mark.slow

ENGINES = ("screw", "pinocchio", "mujoco")
JOINTS = ("joint_velocity", "joint_acceleration")
FORCES = ("generalized_force", "actuator_force")
drawn = scenes("planar-4", "rsur", "serial", "3-rrr", "rccc")

Tables = dict[str, Any]


def asked(scene: Scene) -> dict[str, Solution]:
    answers, failures = solve(scene, ENGINES, (*JOINTS, *FORCES))
    assert not failures, failures
    return answers


def pair(scene: Scene, change: Callable[[Tables, Tables], None]) -> tuple[dict[str, Solution], ...]:
    files = [file for file in (scene.mechanism_file, scene.file) if file]
    tables = [tomllib.loads(file.read_text(encoding="utf-8")) for file in files]
    change(*tables)
    with tempfile.TemporaryDirectory() as name:
        copies = [Path(name) / file.name for file in files]
        for copy, table in zip(copies, tables, strict=True):
            copy.write_text(tomli_w.dumps(table), encoding="utf-8")
        return asked(scene), asked(load_scene(copies[1]))


def check(pairs: tuple[dict[str, Solution], ...], factors: dict[str, float]) -> None:
    for engine, quantity in ((engine, quantity) for engine in ENGINES for quantity in (*JOINTS, *FORCES)):
        one, other = (answers[engine] for answers in pairs)
        values = one.values[quantity]
        for unit in set(values.units):
            columns = [i for i, has in enumerate(values.units) if has == unit]
            a, b = (each.values[quantity].array[:, columns] for each in (one, other))
            factor = factors.get(quantity, 1.0)
            error = one.errors[quantity]
            admitted = max(ROUNDING, error.scaled.max()) * np.abs(a).max() + error.absolute[unit]
            assert np.abs(factor * a - b).max(initial=0.0) <= max(1.0, abs(factor)) * admitted, (engine, quantity, unit)


@pytest.mark.slow
@FEW
@given(scene=drawn, angle=st.floats(-3.0, 3.0), axis=st.integers(0, 2))
def test_forces_turn_with_the_world(scene: Scene, angle: float, axis: int) -> None:
    about = np.eye(3)[axis]
    R = rotation(about, np.array(angle))

    def turn(mechanism: Tables, tables: Tables) -> None:
        for joint in mechanism["joints"].values():
            for side in ("parent", "child"):
                if joint[side] == "ground":
                    frame = joint.setdefault(f"{side}_frame", {})
                    frame["position"] = (R @ frame.get("position", [0.0] * 3)).tolist()
                    old = frame.get("rotation", [])
                    frame["rotation"] = [{"matrix": R.tolist()}, *(old if isinstance(old, list) else [old])]
        tables["gravity"] = (R @ tables["gravity"]).tolist()
        for load in tables.get("loads", []):
            for vector in ("force", "torque"):
                load[vector] = (R @ load[vector]).tolist()

    check(pair(scene, turn), {})


@pytest.mark.slow
@FEW
@given(scene=drawn, factor=st.floats(1e-3, 1e3))
def test_forces_grow_with_masses_and_loads(scene: Scene, factor: float) -> None:
    def grow(mechanism: Tables, tables: Tables) -> None:
        for body in mechanism["bodies"].values():
            body["mass"] *= factor
            body["inertia"] = {key: factor * value for key, value in body["inertia"].items()}
        for load in tables.get("loads", []):
            load |= {vector: [factor * x for x in load[vector]] for vector in ("force", "torque")}

    check(pair(scene, grow), dict.fromkeys(FORCES, factor))


@pytest.mark.slow
@FEW
@given(drawn)
def test_forces_do_not_know_which_way_time_runs(scene: Scene) -> None:
    back = replace(scene, task=replace(scene.motion, yd=-scene.motion.yd))
    check((asked(scene), asked(back)), {"joint_velocity": -1.0})
