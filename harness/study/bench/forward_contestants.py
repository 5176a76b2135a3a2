"""Who takes part in the bench of a simulation: methods and tolerances, and the engines' own steppers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import zip_longest

from screwgauge.engines.methods import METHODS
from screwgauge.engines.registry import engines
from screwgauge.problem import InitialValue, Integration
from screwgauge.scene.simulation import EXPLICIT
from screwgauge.study.bench.contestant import TABLE, Contestant
from screwgauge.study.bench.questions import Asked
from screwgauge.study.method import Method
from screwgauge.study.posed import Posed

_COVERS = "integration from start to end, closing of the loops and output at the samples; loading outside"
_MEMBER = partial(Contestant, quantities=("observable",), covers=_COVERS)
#: Tolerances of a step, rtol = atol. An implicit method of low order needs too many steps for the tighter ones.
LADDER = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
LEAST_IMPLICIT = 1e-8
QUICK_LADDER = (1e-4, 1e-7)
#: Engines that hold their loops by constraint forces gain nothing below this: rounding of those is larger.
LEAST_CONSTRAINED = 1e-10
#: Fixed steps over the whole motion.
STEPS = (250, 1_000, 4_000, 16_000, 64_000)
QUICK_STEPS = (100, 400, 1_600)


def simulation(posed: Posed, engine: str, wanted: Sequence[str], *, method: str = "", rtol: float = 0.0) -> Asked:
    """The motion from its start on; the wanted observables follow from the joint coordinates.

    Args:
        method, rtol: Of scipy, and its tolerances rtol = atol; those of the scene if there is none.
    """
    task = posed.scene.start
    if method:
        task = replace(task, integration=Integration(method, rtol, rtol, task.integration.near))
    problem = posed.problem("joint_position", "joint_velocity", "joint_acceleration", task=task, engine=engine)
    return Asked(posed.files(engine), (problem,), len(task), posed.reference)


def contestants(method: str, duration: float, *, stiff: bool, quick: bool) -> list[Contestant]:
    """All of them, the coarse settings of all families first.

    Args:
        method: That of the scene.
        duration: Of the motion [s].
        stiff: Whether an explicit method would have to take very many steps.
    """
    families = *_climbing(method, stiff, quick), *_stepping(duration, quick)
    return [contestant for turn in zip_longest(*families) for contestant in turn if contestant]


def _climbing(own: str, stiff: bool, quick: bool) -> Iterator[list[Contestant]]:
    """Engines by scipy's methods, each a ladder of tolerances."""
    for engine in (name for name, engine in engines().items() if InitialValue in engine.tasks):
        screw = engine == "screw"
        for method in METHODS if screw else (own,):
            least = max(0.0 if screw else LEAST_CONSTRAINED, 0.0 if method in EXPLICIT else LEAST_IMPLICIT)
            rungs = [rtol for rtol in (QUICK_LADDER if quick else LADDER) if rtol >= least]
            # in a quick bench only the scene's own method climbs; a stiff scene asks for steps to be stable on any rung
            if screw and ((quick and method != own) or (stiff and method in EXPLICIT)):
                rungs = rungs[:1]
            family, found = f"screw-{method}" if screw else engine, list[Contestant]()
            for rtol in rungs:
                question, setting = partial(simulation, method=method, rtol=rtol), f"{method}, rtol = atol = {rtol:.0e}"
                label = f"{rtol:.0e}".replace("e-0", "e-")
                found.append(_MEMBER(family, family, setting, Method(engine), question, label=label))
            yield found


def _stepping(duration: float, quick: bool) -> Iterator[list[Contestant]]:
    """The engines' own steppers, each over fixed steps."""
    for stepper in TABLE["steppers"]:
        family, engine, found = stepper["family"], stepper["engine"], list[Contestant]()
        for dt in (duration / n for n in (QUICK_STEPS if quick else STEPS)):
            method, setting = Method(engine, {"dt": dt, **stepper["settings"]}), stepper["setting"].format(dt=dt)
            parameter = "dt [s]", dt
            found.append(_MEMBER(family, family, setting, method, simulation, parameter=parameter, label=_label(dt)))
        yield found


def _label(dt: float) -> str:
    """A step with its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if dt >= size:
            return f"{dt / size:.3g} {unit}"
    return f"{dt:.1e} s"
