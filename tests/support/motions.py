"""Forces of two mechanisms in one motion about their homes."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from support.acting import Applied
from support.engines import ModelFiles, Problem, ask
from support.models import description
from support.scene import GivenMotion


def forces(mechanism: Mechanism, home: Array, folder: Path) -> dict[str, np.ndarray]:
    """Forces along the independent coordinates and of the actuators, and joint coordinates, in one motion by name.

    Args:
        home: Independent coordinates that it moves about. Shape (k,).
    """
    path = folder / "described.toml"
    path.write_text(description(mechanism), encoding="utf-8")
    rng, k = np.random.default_rng(3), len(mechanism.independent)
    y = home + 0.02 * rng.uniform(-1.0, 1.0, (3, k))
    motion = GivenMotion(np.arange(3.0), y, rng.normal(size=(3, k)), rng.normal(size=(3, k)))
    wanted = {"joint_position", "generalized_force"} | ({"actuator_force"} if mechanism.actuators else set())
    solution = ask("screw", ModelFiles(path), Problem(Applied(), motion, frozenset(wanted)))
    return {
        f"{quantity} {component}": column
        for quantity, values in solution.values.items()
        for component, column in zip(values.components, values.array.T, strict=True)
    }


def worst(one: Mapping[str, np.ndarray], other: Mapping[str, np.ndarray]) -> float:
    keys = {key for key in one if not key.startswith("joint_position")}
    assert keys == {key for key in other if not key.startswith("joint_position")}
    sizes = {q: max(np.abs(one[key]).max() for key in keys if key.startswith(q)) for q in {k.split()[0] for k in keys}}
    return max(float(np.abs(one[key] - other[key]).max()) / sizes[key.split()[0]] for key in keys)
