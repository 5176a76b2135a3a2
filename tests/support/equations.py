"""The equations of motion, to be evaluated, and to be broken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from screwgauge.reference.equations import closure, dynamics, joint_types, kinematics
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.forward import preload_space
from screwgauge.reference.equations.joint_types import (
    JointPose,
    closure_residual,
    components,
    constraint_wrenches,
    reaction_names,
    triad,
)
from screwgauge.reference.equations.ops import Ops
from screwgauge.reference.equations.rounding import gain
from screwgauge.reference.equations.screws import rotation
from screwgauge.reference.rotations import across_direction


def exchange(monkeypatch: pytest.MonkeyPatch, name: str, wrong: Callable[..., object]) -> None:
    """Puts another function in the place of one wherever the equations use it."""
    for module in (joint_types, kinematics, closure, dynamics):
        if hasattr(module, name):
            monkeypatch.setattr(module, name, wrong)


def without_brackets(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leaves out all Lie brackets, those of the screws of one joint among them."""
    exchange(monkeypatch, "lie_bracket", lambda X, Y: np.zeros_like(Y))
    for kind, entry in joint_types.TYPES.items():
        monkeypatch.setitem(joint_types.TYPES, kind, replace(entry, own=None))
