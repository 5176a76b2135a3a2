"""The paper's own scheme: rates chain by chain, joint angles by steps in time; its twist, and the right one."""

from __future__ import annotations

from screwgauge.reference.paper.scheme import Trajectory, integrate
from screwgauge.reference.pose import layout
from screwgauge.solution import Values
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestant import QUANTITIES, Contestant, Outcome, Task

#: Steps as parts of the motion's duration: on a scene of 10 s, 1e-1 s to 1e-4 s and 2e-1 s to 1e-2 s.
EULER = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 1e-5)
RK4 = (2e-2, 1e-2, 5e-3, 2e-3, 1e-3)
_FOUND = QUANTITIES[:3]
_NAMES = {"euler": "Euler", "rk4": "RK4"}
_WORDS = {
    "right": "right twist",
    "printed": "eq. (60) as printed",
    "literal": "eqs. (22)-(23) and (60) as printed",
}
_SERIES = {"printed": "eq. 60", "literal": "eqs 22, 23, 60"}


def literal(quick: bool) -> list[Contestant]:
    """Eqs. (15)-(27) with the twist of eq. (60), without and with eqs. (22)-(23): each ends on a floor of its own."""
    return [*_steps("printed", "euler", EULER[:-1], quick), *_steps("literal", "euler", EULER[:-1], quick)]


def corrected(quick: bool) -> list[Contestant]:
    """The same with the right twist, by Euler's method and by Runge and Kutta's."""
    return [*_steps("right", "euler", EULER, quick), *_steps("right", "rk4", RK4, quick)]


def _steps(twist: str, method: str, parts: tuple[float, ...], quick: bool) -> list[Contestant]:
    return [_contestant(twist, method, part) for part in (parts[:5] if quick else parts)]


def _contestant(twist: str, method: str, part: float) -> Contestant:
    return Contestant(
        f"{_WORDS[twist]}, {_NAMES[method]}, step = {part:g} of the duration",
        _FOUND,
        "from the first pose and the twist of the platform: every step of the trajectory, then eq. (44)",
        lambda case: _task(case, twist, method, part),
        series=_NAMES[method] if twist == "right" else _SERIES[twist],
        parameter=("step / duration", part),
        label=f"{part:g} T",
    )


def _task(case: Case, twist: str, method: str, part: float) -> Task:
    t, lay = case.times, layout(case.scene.mechanism)
    start, duration = float(t[0]), float(t[-1] - t[0])

    def call() -> Trajectory:
        return integrate(lay, case.whole.drive, part * duration, duration, start=start, twist=twist, method=method)

    def read(found: Trajectory) -> dict[str, Outcome]:
        mine, theirs = found.rows(t)
        arrays = dict(zip(_FOUND, (found.q, found.w, found.beta), strict=True))
        outcomes = {}
        for quantity, array in arrays.items():
            like = case.reference.values[quantity]
            reference = Values(like.components, like.units, like.array[theirs])
            outcomes[quantity] = Outcome(Values(like.components, like.units, array[mine]), reference)
        return outcomes

    # delivered are the compared times, however many steps it takes to get from one to the next
    return Task(call, read, len(t))
