"""MuJoCo as a user calls it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from screwgauge.reference.rotations import Array


def load(text: str, **options: Any) -> mujoco.MjModel:
    """Loads an MJCF or a URDF, with options set."""
    model = mujoco.MjModel.from_xml_string(text)
    for name, value in options.items():
        setattr(model.opt, name, value)
    return model


def state(model: mujoco.MjModel, q: Any = None, v: Any = 0.0) -> mujoco.MjData:
    """Data with coordinates, at home by default, and velocities."""
    data = mujoco.MjData(model)
    data.qvel[:] = v
    if q is not None:
        data.qpos[:] = q
    return data


def inverted(model: mujoco.MjModel, q: Any = None, v: Any = 0.0, a: Any = 0.0) -> mujoco.MjData:
    """Data after `mj_inverse`."""
    data = state(model, q, v)
    data.qacc[:] = a
    mujoco.mj_inverse(model, data)
    return data


def inverse(model: mujoco.MjModel, q: Any = None, v: Any = 0.0, a: Any = 0.0) -> Array:
    """Forces of `mj_inverse`. Shape (n_v,)."""
    return np.array(inverted(model, q, v, a).qfrc_inverse)


def measured(text: str, measure: Callable[[mujoco.MjModel], float]) -> tuple[float, str]:
    """A number of a model; or, where MuJoCo does not load it, NaN and the first line of its message."""
    try:
        model = load(text)
    except ValueError as error:
        return math.nan, str(error).splitlines()[0].removeprefix("Error: ")
    return measure(model), ""


def moment(model: mujoco.MjModel) -> float:
    """Moment of inertia that the first coordinate moves [kg m^2]."""
    a = np.eye(model.nv)[0]
    return float(inverse(model, a=a)[0] - inverse(model)[0])


def mass(model: mujoco.MjModel) -> float:
    """Of all that moves [kg]."""
    return float(model.body_mass[1:].sum())
