"""MuJoCo's loops are soft: a floor in gap, force and energy that no time step removes, and what removes it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.quantities import natural_scales
from screwgauge.reference import linear
from screwgauge.reference.rotations import Array
from screwgauge.study.stress.case import GOOD, Case, Finding, Rung

if TYPE_CHECKING:
    from screwgauge.study.stress.driven.held import Held
    from screwgauge.study.stress.driven.mujoco_steps import Setting, Stepped

SOFT = "MuJoCo's soft loop gives way under load, and nothing says so; a finer step changes nothing"
STIFF = "first-order error of a fixed step that nothing estimates"
OWN = 1e-11  # tolerance at which `screw` takes part; the reference has a tenth of it
CASE_DURATION, QUICK_DURATION = 1.0, 0.3  # [s]


def settings() -> dict[str, Setting]:
    """Label -> setting of MuJoCo, as far as this version has it."""
    from screwgauge.study.stress.driven.mujoco_steps import Setting, has_integrator

    found = {
        "mujoco Euler": Setting(),
        "mujoco implicit": Setting("IMPLICIT"),
        "mujoco implicitfast": Setting("IMPLICITFAST"),
        "mujoco RK4": Setting("RK4"),
        "mujoco discrete": Setting("DISCRETE"),
        "mujoco solref 0.05 s": Setting(constant=0.05),
        "mujoco solref 0.005 s": Setting(constant=0.005),
        "mujoco d = 0.99": Setting(impedance=0.99),
        "mujoco d = 0.9999": Setting(impedance=0.9999),
        "mujoco refined": Setting(impedance=0.9999, passes=4),
    }
    return {label: setting for label, setting in found.items() if has_integrator(setting.integrator)}


def softness() -> Case:
    """The loaded default scene under constant actuator forces, stepped for a second."""
    return Case(
        name="softness",
        title="Soft loops of MuJoCo over the time step",
        axis="time step [s]",
        about=(
            "The loaded default scene from t = 1 s on under the actuator forces of that instant, for 1 s. Loop gap, "
            "constraint forces, energy and joint positions against a motion that `screw` integrated at 1e-12. "
            "The softness of solref and solimp is a floor that the time step does not remove; applying the last "
            "constraint force from outside and solving again (refined: four such passes a step) removes it, and "
            "what is left falls with the step."
        ),
        drawn="loop_gap",
        low=1e-6,
        high=4e-3,
        full=(2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5),
        quick=(2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5),
        rung=lambda dt, quick: Rung(dt, lambda: climb(dt, QUICK_DURATION if quick else CASE_DURATION)),
    )


def climb(dt: float, duration: float) -> Iterator[Finding]:
    """All engines at one time step."""
    from screwgauge.study.stress.driven.held import default_scene_held
    from screwgauge.study.stress.driven.mujoco_steps import step

    held = default_scene_held(duration, 11)
    yield from _screw(held, default_scene_held(duration, 11, OWN))
    for label, setting in settings().items():
        yield from _findings(label, held, step(held, setting, dt), STIFF if setting.passes else SOFT)


def _screw(held: Held, own: Held) -> Iterator[Finding]:
    """Our own motion at another tolerance, on its own joint coordinates."""
    gap = np.linalg.norm(own.path.rates.pose.residual[..., 3:], axis=-1).max(axis=1)
    here = [own.names.index(name) for name in held.names]
    errors = {
        "loop_gap": gap.max() / natural_scales(held.lay.mechanism)["m"],
        "constraint_force": _largest(own.reactions[:, here], held.reactions),
        "energy": _largest(own.path.energy, held.path.energy, held.path.energy[0]),
        "joint_position": _positions(held, own.path.rates.pose.q, range(held.path.rates.pose.q.shape[1])),
    }
    condition = _condition(held)
    for quantity, error in errors.items():
        yield Finding("screw", quantity, float(error), condition=condition, time_s=own.seconds)


def _findings(label: str, held: Held, found: Stepped, cause: str) -> Iterator[Finding]:
    columns = [held.names.index(name) for name in found.names]
    errors = {
        "loop_gap": found.gap.max() / natural_scales(held.lay.mechanism)["m"],
        "constraint_force": _largest(found.force, held.reactions[:, columns]),
        "energy": _largest(found.energy, held.path.energy, held.path.energy[0]),
        "joint_position": _positions(held, found.q, held.columns(found.coordinates)),
    }
    condition = _condition(held)
    for quantity, error in errors.items():
        if found.warning:
            yield Finding(label, quantity, reason=f"MuJoCo warns: {found.warning}")
            continue
        reason = cause if error > GOOD else ""
        yield Finding(label, quantity, float(error), condition=condition, time_s=found.seconds, reason=reason)


def _condition(held: Held) -> float:
    """Of the closed loops, at its worst."""
    return float(linear.condition(held.path.rates.A).max())


def _largest(mine: Array, right: Array, zero: float = 0.0) -> float:
    """Largest error against the largest magnitude of what is right, counted from `zero`."""
    return float(np.abs(mine - right).max() / np.abs(right - zero).max())


def _positions(held: Held, q: Array, columns: range | list[int]) -> float:
    """Scaled error of joint positions, angles and lengths each by their own size."""
    mechanism, right = held.lay.mechanism, held.path.rates.pose.q[:, columns]
    turns = np.array([turn for joint in mechanism.joints for turn, _ in joint.freedoms])[list(columns)]
    return max(_largest(q[:, kind], right[:, kind]) for kind in (turns, ~turns))
