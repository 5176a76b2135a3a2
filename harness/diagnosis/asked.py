"""What the libraries themselves say, beside the dynamics of what they have read."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.dynamics import Dynamics, dynamics, passive_parts
from screwgauge.diagnosis.tree import States, Tree
from screwgauge.engines.plain import Answers, Ask, JointStates
from screwgauge.reference.rotations import Array

#: Libraries that have dynamics, and what asks them.
ASKED = {"pinocchio": "screwgauge.engines.pinocchio.plain", "mujoco": "screwgauge.engines.mujoco.plain"}


def answers(path: Path, library: str, tree: Tree, states: States, *, floating: bool = False) -> Answers:
    """Of one library on a file, at states of the tree that it reads from it."""
    ask: Ask = import_module(ASKED[library]).ask
    return ask(path, tuple(tree.reading.bodies), joint_states(tree, states), floating)


def joint_states(tree: Tree, states: States) -> Mapping[str, JointStates]:
    """States by joint."""
    numbers = {name: i for i, name in enumerate(tree.reading.joints)}
    return {
        name: JointStates(
            joint.kind,
            tree.frames.get(numbers[name], np.eye(4)),
            states.q[:, tree.places[name]],
            states.qd[:, tree.freedoms[name]],
            states.qdd[:, tree.freedoms[name]],
        )
        for name, joint in tree.reading.joints.items()
    }


def apart(said: Answers, tree: Tree, states: States, ours: Dynamics | None = None) -> dict[str, tuple[float, float]]:
    """How far a library is from the dynamics of what it has read.

    Returns:
        Quantity -> largest difference and largest magnitude.
    """
    ours = ours or dynamics(tree, states)
    parts = passive_parts(tree, states)
    pairs: dict[str, tuple[Array, Array]] = {
        "tau": (said.tau, ours.tau - sum(force for name, force in parts.items() if name not in said.covers)),
        "mass_matrix": (said.mass_matrix, ours.mass_matrix),
        "bias": (said.bias, ours.bias),
        "gravity": (said.gravity, ours.gravity),
        "velocity": (said.velocity, ours.velocity),
        "acceleration": (said.acceleration, ours.acceleration),
    }
    return {name: (float(np.abs(x - y).max()), float(np.abs(y).max())) for name, (x, y) in pairs.items()}
