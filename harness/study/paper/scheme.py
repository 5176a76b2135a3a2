"""Erratum 8: the paper's scheme in time, eq. (27), run as printed and mended. Also the data of its plots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.paper.scheme import Trajectory, integrate
from screwgauge.reference.rotations import Array, rotation
from screwgauge.study.paper.errata import DURATION, Case, Erratum, erratum

STEP = 1e-3  # s, the paper's
LEGS = ("leg1", "leg2", "leg3", "leg4")
#: (label, twist, method, steps [s]) of the runs over which orders are measured.
LADDERS = (
    ("Euler, (60) as printed", "printed", "euler", (0.1, 0.05, 0.02, 0.01)),
    ("Euler, right twist", "right", "euler", (0.1, 0.05, 0.02, 0.01)),
    ("RK4, right twist", "right", "rk4", (0.2, 0.1, 0.05, 0.02, 0.01)),
)


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One run of the scheme: how far the legs' ends are from where the S chain has the platform.

    Attributes:
        t: Time [s]. Shape (n,).
        gap: Distance of each leg's C from its place on the platform [m]. Shape (n, 4).
        tilt: Error of the platform's attitude as the S chain has it [rad]. Shape (n,).
    """

    label: str
    step: float
    t: Array
    gap: Array
    tilt: Array


@dataclass(frozen=True, slots=True, eq=False)
class SchemeRuns:
    """All runs: three over time at the steps of the errata, and the ladders of steps.

    Attributes:
        over_time: Euler 1 ms with the right twist and with (60) as printed, RK4 10 ms with the right twist.
        ladders: Label -> steps [s] and the largest gap of any leg [m] at each. Shapes (k,), (k,).
    """

    over_time: tuple[Run, Run, Run]
    ladders: dict[str, tuple[Array, Array]]


def scheme_runs(case: Case, progress: Callable[[float], None] = lambda share: None) -> SchemeRuns:
    """Runs the scheme over the 10 s of the case."""
    plan = [
        ("Euler 1 ms, right twist", "right", "euler", STEP),
        ("Euler 1 ms, (60) as printed", "printed", "euler", STEP),
        ("RK4 10 ms, right twist", "right", "rk4", 10 * STEP),
    ]
    runs: list[Run] = []
    for label, twist, method, step in plan:
        runs.append(_run(case, label, twist, method, step))
        progress(0.25 * len(runs))
    ladders = {}
    for label, twist, method, steps in LADDERS:
        gaps = [_run(case, label, twist, method, step).gap.max() for step in steps]
        ladders[label] = np.array(steps), np.array(gaps)
    return SchemeRuns((runs[0], runs[1], runs[2]), ladders)


def _run(case: Case, label: str, twist: str, method: str, step: float) -> Run:
    found = integrate(case.lay, case.scene.drive, step, DURATION, twist=twist, method=method)
    return Run(label, step, found.t, _gaps(case, found), _tilt(case, found))


def _gaps(case: Case, found: Trajectory) -> Array:
    """Distance [m] of C as leg k has it from C as the S chain has it. Shape (n, 4)."""
    levers = np.stack([case.lay.mechanism.joint(f"{leg}.wrist").child_frame.p for leg in LEGS])
    own = found.p[:, :4] + (found.R[:, :4] @ levers[..., None])[..., 0]
    place = found.p[:, 4:] + (found.R[:, 4:] @ levers[..., None])[..., 0]
    return np.asarray(np.linalg.norm(own - place, axis=-1))


def _tilt(case: Case, found: Trajectory) -> Array:
    """Angle [rad] between ``Rx(a) Ry(b)`` and the platform of the S chain. Shape (n,)."""
    y = case.scene.drive(found.t).y
    x, yy, _ = np.eye(3)
    right = rotation(x, y[:, 0]) @ rotation(yy, y[:, 1])
    return np.asarray(2.0 * np.arcsin(np.linalg.norm(found.R[:, 4] - right, axis=(1, 2)) / np.sqrt(8.0)))


def order(steps: Array, errors: Array) -> float:
    """Slope of log error over log step."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def scheme_errata(runs: SchemeRuns) -> list[Erratum]:
    """The rows of erratum 8. The right form is the same scheme by RK4 with the right twist."""
    euler, literal, rk4 = runs.over_time
    forms = "Euler, 1 ms, right twist", "RK4, 10 ms, right twist"
    ups = euler.gap[-1, 1:].max(), rk4.gap[-1, 1:].max()
    tilt = euler.tilt[-1], rk4.tilt[-1]
    orders = order(*runs.ladders[LADDERS[1][0]]), order(*runs.ladders[LADDERS[2][0]])
    upu = literal.gap[-1, 0], rk4.gap[-1, 0]
    printed = "Euler, 1 ms, (60) as printed", forms[1]
    floor = "Euler, (60) as printed: a floor", "Euler, right twist"
    return [
        erratum(8, "(27)", "UPS legs, gap after 10 s", forms, ups, "m"),
        erratum(8, "(27)", "attitude off after 10 s", forms, tilt, "rad"),
        erratum(
            8,
            "(27)",
            "order of the gap in the step",
            ("Euler, right twist", "RK4, right twist"),
            orders,
            "order",
        ),
        erratum(8, "(27), (60)", "UPU leg, gap after 10 s", printed, upu, "m"),
        erratum(
            8,
            "(27), (60)",
            "gap at 10 ms by gap at 100 ms",
            floor,
            (_ratio(runs, 0), _ratio(runs, 1)),
            "factor",
        ),
    ]


def _ratio(runs: SchemeRuns, ladder: int) -> float:
    """Largest gap at the shortest step of a ladder over that at the longest."""
    gaps = runs.ladders[LADDERS[ladder][0]][1]
    return float(gaps[-1] / gaps[0])
