"""Erratum 8: the paper's scheme in time, eq. (27), run as printed and mended. Also the data of its plots."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from screwgauge.engines.screw.scheme import integrate
from screwgauge.reference.rotations import Array, rotation
from screwgauge.study.paper.case import DURATION, Case
from screwgauge.study.paper.errata import Values

#: (label, twist, method, step [s]) of the runs over time; the paper's step is 1 ms.
OVER_TIME = (
    ("Euler 1 ms, right twist", "right", "euler", 1e-3),
    ("Euler 1 ms, (60) as printed", "printed", "euler", 1e-3),
    ("RK4 10 ms, right twist", "right", "rk4", 1e-2),
)
#: (label, twist, method, steps [s]) of the runs over which orders are measured.
LADDERS = (
    ("Euler, (60) as printed", "printed", "euler", (0.1, 0.05, 0.02, 0.01)),
    ("Euler, right twist", "right", "euler", (0.1, 0.05, 0.02, 0.01)),
    ("RK4, right twist", "right", "rk4", (0.2, 0.1, 0.05, 0.02, 0.01)),
)


class Run(NamedTuple):
    """One run of the scheme: how far the legs' ends are from where the S chain has the platform.

    Attributes:
        t: Time [s]. Shape (n,).
        gap: Distance of each leg's C from its place on the platform [m]. Shape (n, 4).
        tilt: Error of the platform's attitude as the S chain has it [rad]. Shape (n,).
    """

    label: str
    t: Array
    gap: Array
    tilt: Array


class SchemeRuns(NamedTuple):
    """All runs: three over time at the steps of the errata, and the ladders of steps.

    Attributes:
        over_time: Those of `OVER_TIME`.
        ladders: Label -> steps [s] and the largest gap of any leg [m] at each. Shapes (k,), (k,).
    """

    over_time: tuple[Run, ...]
    ladders: dict[str, tuple[Array, Array]]


def scheme_runs(case: Case, progress: Callable[[float], None]) -> SchemeRuns:
    """Runs the scheme over the 10 s of the case."""
    runs: list[Run] = []
    for settings in OVER_TIME:
        runs.append(_run(case, *settings))
        progress(0.25 * len(runs))
    ladders = {}
    for label, twist, method, steps in LADDERS:
        gaps = [_run(case, label, twist, method, step).gap.max() for step in steps]
        ladders[label] = np.array(steps), np.array(gaps)
    return SchemeRuns(tuple(runs), ladders)


def _run(case: Case, label: str, twist: str, method: str, step: float) -> Run:
    found = integrate(case.lay, case.scene.moved, step, DURATION, twist=twist, method=method)
    legs, chain = case.leg_ends(found.R[:, :4], found.p[:, :4]), case.leg_ends(found.R[:, 4:], found.p[:, 4:])
    a, b = case.scene.moved(found.t).y.T
    attitude = rotation(np.eye(3)[0], a) @ rotation(np.eye(3)[1], b)
    tilt = 2.0 * np.arcsin(np.linalg.norm(found.R[:, 4] - attitude, axis=(1, 2)) / np.sqrt(8.0))
    return Run(label, found.t, np.asarray(np.linalg.norm(legs - chain, axis=-1)), np.asarray(tilt))


def scheme_values(runs: SchemeRuns) -> list[Values]:
    """The rows of erratum 8. The right form is the same scheme by RK4 with the right twist."""
    euler, literal, rk4 = runs.over_time
    printed, right, fourth = (runs.ladders[label] for label, *_ in LADDERS)
    orders = (np.polyfit(np.log(steps), np.log(gaps), 1)[0] for steps, gaps in (right, fourth))
    return [
        Values(euler.gap[-1, 1:].max(), rk4.gap[-1, 1:].max()),
        Values(euler.tilt[-1], rk4.tilt[-1]),
        Values(*orders),
        Values(literal.gap[-1, 0], rk4.gap[-1, 0]),
        Values(*(gaps[-1] / gaps[0] for _, gaps in (printed, right))),  # shortest step over longest
    ]
