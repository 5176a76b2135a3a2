"""The paper's scheme in time, eqs. (25) to (27), run as printed and mended: errata 7 and 8."""

from typing import NamedTuple

import numpy as np
from paper.case import UPU_CHAIN, Case, every, largest, longest
from paper.erratum import Erratum, Form

from screwgauge.reference.rotations import Array, rotation
from screwgauge.study.bench.scheme import PARTS, fixed_axes, integrate

MILLIMETRES = 1e3
#: Label -> twist, method, step [s] of the runs over time; the paper's step is 1 ms.
OVER_TIME = {
    "Euler 1 ms, right twist": ("right", "euler", 1e-3),
    "Euler 1 ms, (60) as printed": ("printed", "euler", 1e-3),
    "RK4 10 ms, right twist": ("right", "rk4", 1e-2),
}
#: Label -> twist, method, steps [s] of the runs over which orders are measured.
LADDERS = {
    "Euler, (60) as printed": ("printed", "euler", (0.1, 0.05, 0.02, 0.01)),
    "Euler, right twist": ("right", "euler", (0.1, 0.05, 0.02, 0.01)),
    "RK4, right twist": ("right", "rk4", (0.2, 0.1, 0.05, 0.02, 0.01)),
}


class Run(NamedTuple):
    """One run of the scheme: how far the legs' ends are from where the S chain has the platform.

    Attributes:
        t: Time [s]. Shape (n,).
        gap: Distance of each leg's C from its place on the platform [m]. Shape (n, 4).
        tilt: Error of the platform's attitude as the S chain has it [rad]. Shape (n,).
    """

    t: Array
    gap: Array
    tilt: Array


class Runs(NamedTuple):
    """All runs of erratum 8, by their labels.

    Attributes:
        over_time: Those of `OVER_TIME`.
        ladders: Steps [s] and the largest gap of any leg [m] at each, of those of `LADDERS`. Shapes (k,), (k,).
    """

    over_time: dict[str, Run]
    ladders: dict[str, tuple[Array, Array]]


def runs(case: Case) -> Runs:
    """Runs the scheme over the 10 s of the case: seconds, most of them for the paper's 10 000 steps."""
    ladders = {
        label: (np.array(steps), np.array([run(case, twist, method, step).gap.max() for step in steps]))
        for label, (twist, method, steps) in LADDERS.items()
    }
    return Runs({label: run(case, *settings) for label, settings in OVER_TIME.items()}, ladders)


def run(case: Case, twist: str, method: str, step: float) -> Run:
    motion = case.scene.moved(every(step / PARTS[method]))
    q = integrate(case.lay, motion, twist=twist, method=method)[0]
    _, R, p = case.side.walk(case.side.gather(q))
    legs, chain = case.leg_ends(R[:, :4], p[:, :4]), case.leg_ends(R[:, 4:], p[:, 4:])
    a, b = motion.y[:: PARTS[method]].T
    attitude = rotation(np.eye(3)[0], a) @ rotation(np.eye(3)[1], b)
    tilt = 2.0 * np.arcsin(np.linalg.norm(R[:, 4] - attitude, axis=(1, 2)) / np.sqrt(8.0))
    return Run(motion.t[:: PARTS[method]], np.linalg.norm(legs - chain, axis=-1), tilt)


def units(case: Case) -> list[Erratum]:
    """7: the UPU chain cannot make V of eq. (60). Eq. (26) hides what is left over, and depends on units of length."""
    side, V, right = case.side, fixed_axes(case.motion)[0], case.twist[0]
    along = case.scene.moved(every(0.01 / PARTS["rk4"]))
    q, w, _ = integrate(case.lay, along, twist="printed", method="rk4")
    S = side.walk(side.gather(q))[0][:, UPU_CHAIN]
    made = (S.swapaxes(1, 2) @ side.gather(w)[:, UPU_CHAIN, :, None])[..., 0]
    left_over = longest(made - fixed_axes(along)[0][:: PARTS["rk4"]])

    def first(V: Array, unit: float) -> Array:
        scale = np.repeat([1.0, unit], 3)
        S = np.where(side.turns > 0, case.screws * scale, case.screws)
        return side.solve(S, (V * scale)[:, None])[:, UPU_CHAIN, 0]

    metres, millimetres = first(V, 1.0), first(V, MILLIMETRES)
    change, none = largest(metres - millimetres), largest(first(right, 1.0) - first(right, MILLIMETRES))
    i = int(np.argmin(np.abs(case.t - 2.0)))
    path = Form("V of (60), along the scheme's own path", left_over), Form("right V", case.left_over(right, UPU_CHAIN))
    at_2_s = Form("lengths in metres", metres[i]), Form("lengths in millimetres", millimetres[i])
    most = Form("V of (60), m against mm", change), Form("right V, m against mm", none)
    return [
        Erratum(7, "E", "(25)-(26), (60)", "UPU chain: |S w - V|", *path, "rad/s, m/s"),
        Erratum(7, "E", "(25)-(26), (60)", "UPU w_1, t = 2 s, in m and in mm", *at_2_s, "rad/s"),
        Erratum(7, "E", "(25)-(26), (60)", "UPU w_1, largest change by units", *most, "rad/s"),
    ]


def steps_in_time(runs: Runs) -> list[Erratum]:
    """8: eq. (27) is of order one and corrects no closure; as printed a shorter step mends nothing."""
    euler, literal, rk4 = runs.over_time.values()
    printed, right, fourth = runs.ladders.values()
    best, mended = "RK4, 10 ms, right twist", "Euler, 1 ms, right twist"
    ups = Form(mended, euler.gap[-1, 1:].max()), Form(best, rk4.gap[-1, 1:].max())
    tilt = Form(mended, euler.tilt[-1]), Form(best, rk4.tilt[-1])
    orders = Form("Euler, right twist", order(*right)), Form("RK4, right twist", order(*fourth))
    upu = Form("Euler, 1 ms, (60) as printed", literal.gap[-1, UPU_CHAIN]), Form(best, rk4.gap[-1, UPU_CHAIN])
    floor = Form("Euler, (60) as printed: a floor", _last_by_first(printed[1]))
    falls = Form("Euler, right twist", _last_by_first(right[1]))
    return [
        Erratum(8, "E", "(27)", "UPS legs, gap after 10 s", *ups, "m"),
        Erratum(8, "E", "(27)", "attitude off after 10 s", *tilt, "rad"),
        Erratum(8, "E", "(27)", "order of the gap in the step", *orders, "order"),
        Erratum(8, "E", "(27), (60)", "UPU leg, gap after 10 s", *upu, "m"),
        Erratum(8, "E", "(27), (60)", "gap at 10 ms by gap at 100 ms", floor, falls, "factor"),
    ]


def order(steps: Array, errors: Array) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def _last_by_first(gaps: Array) -> float:
    return float(gaps[-1] / gaps[0])
