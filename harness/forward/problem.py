"""What an engine is given to integrate a motion, and what it returns: `ForwardProblem` -> `ForwardSolution`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.reference.springs import Spring
from screwgauge.solution import Load, Progress


@dataclass(frozen=True, slots=True, eq=False)
class Motor:
    """A force along one joint coordinate, added to whatever else acts there.

    Attributes:
        coordinate: Name of the joint coordinate.
        polynomial: Coefficients over time, lowest first [N or N m, per s^k]. Shape (m,).
        harmonics: Rows [omega, cos, sin] [rad/s, N or N m]. Shape (k, 3).
    """

    coordinate: str
    polynomial: Array
    harmonics: Array

    def force(self, t: float) -> float:
        """[N or N m] at a time [s]."""
        omega, c, s = self.harmonics.T
        waves = c * np.cos(omega * t) + s * np.sin(omega * t)
        return float(np.polynomial.polynomial.polyval(t, self.polynomial) + waves.sum())


@dataclass(frozen=True, slots=True)
class Method:
    """How the motion is integrated.

    Attributes:
        name: ``DOP853`` for smooth motion, ``Radau`` or ``BDF`` for stiff ones.
        rtol, atol: Tolerances of a step, for rad, m and their rates alike.
        near: Condition number of the closed loops above which a pose is stepped over.
    """

    name: str = "DOP853"
    rtol: float = 1e-10
    atol: float = 1e-12
    near: float = 1e5


@dataclass(frozen=True, slots=True, eq=False)
class ForwardProblem:
    """All that an engine is given; it closes its own loops.

    Attributes:
        model: Its model file: mechanism TOML, URDF or MJCF.
        loops: The loops file beside it: what URDF and MJCF cannot say.
        gravity: World axes [m/s^2]. Shape (3,).
        loads: On bodies, constant, in world axes.
        springs: Springs and dampers, across joints or between points of bodies.
        motors: Forces along joint coordinates.
        start, rates: Independent coordinates and their rates at the first time. Shape (k,).
        times: Where the motion is wanted [s], increasing; it starts at the first. Shape (n,).
    """

    model: Path
    loops: Path | None
    gravity: Array
    loads: tuple[Load, ...]
    springs: tuple[Spring, ...]
    motors: tuple[Motor, ...]
    start: Array
    rates: Array
    times: Array
    method: Method = Method()
    progress: Progress = lambda share: None


@dataclass(frozen=True, slots=True, eq=False)
class ForwardSolution:
    """A motion as an engine integrated it, as far as it came; m of the n times were reached.

    Attributes:
        engine, version, setting: Who made it, and how.
        q, v, a: Joint coordinates of the description, in its order, unwrapped, with rates and accelerations
            [rad or m, per s, per s^2]. Shape (m, n_q).
        work: What motors, loads and dampers have put in since the start [J]; NaN where it is not known. Shape (m,).
        condition: Condition number of the closed loops. Shape (m,).
        steps, evaluations: How many steps were taken, and accelerations computed.
        seconds: Wall time of the integration alone [s].
        cpu: Processor time of the same [s]; NaN where it was not measured.
        stopped: Why it ended early, empty if it did not.
        notes: Sentences for the report.
    """

    engine: str
    version: str
    setting: str
    q: Array
    v: Array
    a: Array
    work: Array
    condition: Array
    steps: int
    evaluations: int
    seconds: float
    stopped: str = ""
    notes: tuple[str, ...] = ()
    cpu: float = float("nan")


Integrator = Callable[[ForwardProblem], ForwardSolution]
"""An engine, driven forward, is a function from a problem to a solution."""
