"""Who takes part in a forward bench: engines, methods and tolerances; steppers with their steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from screwgauge.forward.engines import INTEGRATORS, load_integrator
from screwgauge.forward.problem import ForwardProblem, ForwardSolution, Method
from screwgauge.forward.setting import EXPLICIT, METHODS

#: Tolerances of a step, rtol = atol. An implicit method of low order needs too many steps for the tighter ones.
LADDER = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
LEAST_IMPLICIT = 1e-8
QUICK_LADDER = (1e-4, 1e-7)
#: Engines that hold their loops by constraint forces gain nothing below this: rounding of those is larger.
LEAST_CONSTRAINED = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Entrant:
    """One engine with one method and setting.

    Attributes:
        family: Line in the diagram.
        engine: Whose model file it reads.
        setting: In words.
        integrate: Takes the problem of that engine.
        effort: The larger, the longer it takes; smaller ones come first.
        label: Short name in the diagram.
        parameter: Name and value of what is varied, if errors should be a power of it; `order` is that power.
    """

    family: str
    engine: str
    setting: str
    integrate: Callable[[ForwardProblem], ForwardSolution]
    effort: float
    label: str
    parameter: tuple[str, float] | None = None
    order: float | None = None

    @property
    def name(self) -> str:
        """As in the tables."""
        return self.family


def entrants(own: str, *, stiff: bool, quick: bool) -> list[Entrant]:
    """All of them, coarse ones first.

    Args:
        own: Method of the scene.
        stiff: Whether an explicit method would have to take very many steps.
    """
    found = [*_screw(own, stiff=stiff, quick=quick)]
    for engine in INTEGRATORS:
        if engine != "screw":
            found += _ladder(engine, engine, own, _rungs(own, quick, LEAST_CONSTRAINED))
    return sorted(found, key=lambda entrant: entrant.effort)


def _rungs(method: str, quick: bool, least: float = 0.0) -> list[float]:
    least = max(least, 0.0 if method in EXPLICIT else LEAST_IMPLICIT)
    return [rtol for rtol in (QUICK_LADDER if quick else LADDER) if rtol >= least]


def _screw(own: str, *, stiff: bool, quick: bool) -> Iterator[Entrant]:
    for method in METHODS:
        rungs = _rungs(method, quick)
        if stiff and method in EXPLICIT:
            rungs = rungs[:1]  # it is stability that asks for the steps: all rungs take as long
        if quick and method != own:
            rungs = rungs[:1]
        yield from _ladder(f"screw-{method}", "screw", method, rungs)


def _ladder(family: str, engine: str, method: str, rungs: Sequence[float]) -> Iterator[Entrant]:
    for rtol in rungs:
        yield Entrant(
            family=family,
            engine=engine,
            setting=f"{method}, rtol = atol = {rtol:.0e}",
            integrate=_with(engine, method, rtol),
            effort=-rtol,
            label=f"{rtol:.0e}".replace("e-0", "e-"),
        )


def _with(engine: str, name: str, rtol: float) -> Callable[[ForwardProblem], ForwardSolution]:
    def integrate(problem: ForwardProblem) -> ForwardSolution:
        method = Method(name, rtol, rtol, problem.method.near)
        return load_integrator(engine)(replace(problem, method=method))

    return integrate
