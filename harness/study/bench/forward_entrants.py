"""Who takes part in a forward bench: engines, methods and tolerances; steppers with their steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from screwgauge.engines.integrators import INTEGRATORS, load_integrator
from screwgauge.engines.tree.stepper import Stepper, integrate_steps
from screwgauge.problem import ForwardProblem, Method
from screwgauge.scene.setting import EXPLICIT, METHODS
from screwgauge.solution import ForwardSolution

#: Tolerances of a step, rtol = atol. An implicit method of low order needs too many steps for the tighter ones.
LADDER = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
LEAST_IMPLICIT = 1e-8
QUICK_LADDER = (1e-4, 1e-7)
#: Fixed steps over the whole motion, and how each stepper is set: family, integrator, whatever is not default, and its
#: order where steps can show it (RK4's reach rounding before they are fine, MuJoCo's softness has a floor).
STEPS = (250, 1_000, 4_000, 16_000, 64_000)
QUICK_STEPS = (100, 400, 1_600)
#: Impedance that leaves least softness, and refinements that remove the rest of it.
STIFF: dict[str, Any] = {"solimp": 0.9999, "passes": 20}
STEPPERS: tuple[tuple[str, str, str, dict[str, Any], float | None], ...] = (
    ("pinocchio-Euler", "pinocchio", "Euler", {}, 1.0),
    ("pinocchio-RK4", "pinocchio", "RK4", {}, None),
    ("mujoco-Euler", "mujoco", "Euler", {}, None),
    ("mujoco-implicitfast", "mujoco", "implicitfast", {}, None),
    ("mujoco-RK4", "mujoco", "RK4", {}, None),
    ("mujoco-Euler-refined", "mujoco", "Euler", STIFF, None),
)
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
        effort: Place on its ladder; what comes first is short.
        late: It is known to take very long, so that it has its turn when all others had theirs.
        label: Short name in the diagram.
        parameter: Name and value of what is varied, if that is a step.
        order: Power of the step that the energy that is lost should be, if it should be one.
    """

    family: str
    engine: str
    setting: str
    integrate: Callable[[ForwardProblem], ForwardSolution]
    effort: float
    label: str
    parameter: tuple[str, float] | None = None
    order: float | None = None
    late: bool = False

    @property
    def name(self) -> str:
        """As in the tables."""
        return self.family


def entrants(own: str, duration: float, *, stiff: bool, quick: bool) -> list[Entrant]:
    """All of them, each family from coarse to fine.

    Args:
        own: Method of the scene.
        duration: Of the motion [s].
        stiff: Whether an explicit method would have to take very many steps.
    """
    found = [*_screw(own, stiff=stiff, quick=quick)]
    for engine in INTEGRATORS:
        if engine != "screw":
            found += _ladder(engine, engine, own, _rungs(own, quick, LEAST_CONSTRAINED))
    found += _steppers(duration, quick=quick)
    return sorted(found, key=lambda entrant: entrant.effort)


def _steppers(duration: float, *, quick: bool) -> Iterator[Entrant]:
    """The engines' own steppers at fixed steps."""
    for family, engine, integrator, settings, order in STEPPERS:
        for effort, n in enumerate(QUICK_STEPS if quick else STEPS):
            stepper = Stepper(engine, integrator, duration / n, **settings)
            yield Entrant(
                family=family,
                engine=engine,
                setting=stepper.setting,
                integrate=_stepping(stepper),
                effort=effort,
                label=_label(stepper.dt),
                parameter=("dt [s]", stepper.dt),
                order=order,
            )


def _label(dt: float) -> str:
    """A step with its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if dt >= size:
            return f"{dt / size:.3g} {unit}"
    return f"{dt:.1e} s"


def _stepping(stepper: Stepper) -> Callable[[ForwardProblem], ForwardSolution]:
    return lambda problem: integrate_steps(problem, stepper)


def _rungs(method: str, quick: bool, least: float = 0.0) -> list[float]:
    least = max(least, 0.0 if method in EXPLICIT else LEAST_IMPLICIT)
    return [rtol for rtol in (QUICK_LADDER if quick else LADDER) if rtol >= least]


def _screw(own: str, *, stiff: bool, quick: bool) -> Iterator[Entrant]:
    for method in METHODS:
        rungs = _rungs(method, quick)
        if quick and method != own:
            rungs = rungs[:1]
        if stiff and method in EXPLICIT:  # it is stability that asks for steps: every rung takes very long
            yield from _ladder(f"screw-{method}", "screw", method, rungs[:1], late=True)
        else:
            yield from _ladder(f"screw-{method}", "screw", method, rungs)


def _ladder(family: str, engine: str, method: str, rungs: Sequence[float], late: bool = False) -> Iterator[Entrant]:
    for effort, rtol in enumerate(rungs):
        yield Entrant(
            family=family,
            engine=engine,
            setting=f"{method}, rtol = atol = {rtol:.0e}",
            integrate=_with(engine, method, rtol),
            effort=effort,
            label=f"{rtol:.0e}".replace("e-0", "e-"),
            late=late,
        )


def _with(engine: str, name: str, rtol: float) -> Callable[[ForwardProblem], ForwardSolution]:
    def integrate(problem: ForwardProblem) -> ForwardSolution:
        method = Method(name, rtol, rtol, problem.method.near)
        return load_integrator(engine)(replace(problem, method=method))

    return integrate
