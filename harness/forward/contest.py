"""A forward bench: every entrant integrates the scene; its errors, energy and time become a row."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from screwgauge.bench.rows import CUT, FAILED, OK
from screwgauge.bench.slopes import Fit, Rule, fit
from screwgauge.bench.threads import one_thread
from screwgauge.compare import reference_scale
from screwgauge.driver import Report, model_files
from screwgauge.environment import environment
from screwgauge.forward.entrants import Entrant, entrants
from screwgauge.forward.judge import energy_balance
from screwgauge.forward.observe import known_values, observe
from screwgauge.forward.problem import ForwardProblem, ForwardSolution
from screwgauge.forward.run import started, trimmed
from screwgauge.forward.screw import forces_over_time, integrate
from screwgauge.forward.setting import EXPLICIT, Forward
from screwgauge.forward.start import check_start, make_problem
from screwgauge.forward.stiffness import stiff_warning, stiffness
from screwgauge.judging.kinetics import walk
from screwgauge.models.generate import write_models
from screwgauge.quantities import natural_scales
from screwgauge.reference.errors import DescriptionError, check_choice
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.pose import Layout, layout
from screwgauge.reference.rotations import Array
from screwgauge.scene import Scene
from screwgauge.solution import REFERENCE, Values

#: Below this [s] an entrant is measured again, `Plan.rounds` times in all, and the shortest time counts.
SHORT = 1.0


@dataclass(frozen=True, slots=True)
class Plan:
    """How much is measured.

    Attributes:
        samples: Times compared, at most.
        rounds: Measurements of what is short.
        budget: Seconds after which nothing further begins.
        each: Seconds after which an entrant is stopped.
        share: Share of the duration that is integrated.
    """

    samples: int
    rounds: int
    budget: float
    each: float
    share: float


FULL = Plan(samples=41, rounds=3, budget=90.0, each=45.0, share=1.0)
QUICK = Plan(samples=9, rounds=1, budget=25.0, each=8.0, share=0.2)
#: From one rung of a ladder to the next, at least so many times longer: what would take too long is not begun.
LONGER = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What became of one entrant.

    Attributes:
        scaled, rms: Largest and RMS scaled error of the observables.
        largest: Largest error by unit [rad, m].
        energy, energy_scaled: Largest energy that is not accounted for [J], and over the largest of its parts.
        wall, cpu: Shortest time of the integration [s].
        n_sample: Samples that it delivered.
    """

    entrant: Entrant
    status: str
    reason: str
    scaled: float = float("nan")
    rms: float = float("nan")
    largest: Mapping[str, float] | None = None
    energy: float = float("nan")
    energy_scaled: float = float("nan")
    wall: float = float("nan")
    cpu: float = float("nan")
    n_sample: int = 0
    steps: int = 0
    evaluations: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Contest:
    """What a forward bench found.

    Attributes:
        reference: What errors are measured against, in words.
    """

    scene: Scene
    plan: Plan
    outcomes: tuple[Outcome, ...]
    fits: tuple[Fit, ...]
    reference: str
    notes: tuple[str, ...]
    environment: Mapping[str, Any]

    @property
    def complete(self) -> bool:
        """Nothing was cut short."""
        return all(outcome.status != CUT for outcome in self.outcomes)


class _TooLong(Exception):
    """An entrant that was stopped."""


def contest(
    scene: Scene,
    *,
    plan: Plan = FULL,
    contestants: Iterable[str] | None = None,
    progress: Report = lambda step, share: None,
) -> Contest:
    """Measures errors, energy and run times of entrants on a forward scene.

    Args:
        contestants: Families or engines; all by default.

    Raises:
        ScrewgaugeError: Bad input. An entrant that fails is a row.
    """
    begin = perf_counter()
    start = started(scene)
    if not scene.observables:
        raise DescriptionError(
            "there is no observable to measure errors of", scene.name, "add [[observables]]"
        )
    here = _shortened(scene, plan)
    lay, notes = check_start(here, start)
    if plan.share < 1.0:
        part = f"Only the first {plan.share:.0%} of the motion were integrated; published results are of all of it."
        notes = (*notes, part)
    chosen = _chosen(here, start, lay, contestants, quick=plan.share < 1.0)
    outcomes = []
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        write_models(scene.mechanism, Path(folder), gravity=scene.gravity)
        progress(REFERENCE, 0.0)
        work = _Work(here, start, Path(folder), plan)
        for i, entrant in enumerate(chosen):
            progress(entrant.family, i / len(chosen))
            if perf_counter() - begin > plan.budget:
                outcomes.append(Outcome(entrant, CUT, "the budget was spent before its turn"))
            elif _hopeless(entrant, outcomes, plan):
                reason = f"the setting before took so long that this one would take more than {plan.each:g} s"
                outcomes.append(Outcome(entrant, CUT, reason))
            else:
                outcomes.append(work.outcome(entrant))
    return Contest(
        scene=here,
        plan=plan,
        outcomes=tuple(outcomes),
        fits=tuple(_fits(outcomes)),
        reference=work.source,
        notes=notes,
        environment={**environment(), "one_thread": one_thread()},
    )


def _hopeless(entrant: Entrant, before: Sequence[Outcome], plan: Plan) -> bool:
    """Whether the setting before, of the same family, lasted so long that this one cannot end in time."""
    same = [o for o in before if o.entrant.family == entrant.family]
    if not same:
        return False
    last = same[-1]
    longer = LONGER
    if entrant.parameter and last.entrant.parameter:
        longer = last.entrant.parameter[1] / entrant.parameter[1]
    return last.status == CUT or last.wall * longer > plan.each


def _shortened(scene: Scene, plan: Plan) -> Scene:
    """The scene on a few of its times, up to a share of its duration."""
    t = scene.motion.t
    t = t[t <= t[0] + plan.share * (t[-1] - t[0])] if plan.share < 1.0 else t
    rows = np.unique(np.linspace(0, len(t) - 1, min(len(t), plan.samples)).round().astype(int))
    return scene.at(t[rows])


def _chosen(
    scene: Scene, start: Forward, lay: Layout, names: Iterable[str] | None, *, quick: bool
) -> list[Entrant]:
    problem = make_problem(scene, start, scene.mechanism_file, None)
    fast = stiffness(lay, forces_over_time(problem, lay), start)
    explicit = replace(start, method=replace(start.method, name=EXPLICIT[0]))
    stiff = bool(stiff_warning(fast, explicit, float(scene.motion.t[-1])))
    t = scene.motion.t
    everyone = entrants(start.method.name, float(t[-1]) - start.since, stiff=stiff, quick=quick)
    if names is None:
        return everyone
    known = dict.fromkeys(name for entrant in everyone for name in (entrant.family, entrant.engine))
    wanted = check_choice("contestant", names, known, "--contestants")
    return [entrant for entrant in everyone if {entrant.family, entrant.engine} & set(wanted)]


class _Work:
    """What all entrants share."""

    def __init__(self, scene: Scene, start: Forward, folder: Path, plan: Plan) -> None:
        self.scene, self.start, self.folder, self.plan = scene, start, folder, plan
        self.lay = layout(scene.mechanism)
        self.known, self.source = self._reference()
        floor = natural_scales(scene.mechanism)
        self.scale = np.array([reference_scale(self.known, unit, floor[unit]) for unit in self.known.units])

    def problem(self, engine: str, until: float = np.inf) -> ForwardProblem:
        """The problem of an engine; an integration that lasts until a reading of the clock is stopped."""

        def progress(share: float) -> None:
            if perf_counter() > until:
                raise _TooLong(f"stopped after {self.plan.each:g} s, {share:.0%} of the way")

        return make_problem(self.scene, self.start, *model_files(self.scene, engine, self.folder), progress)

    def _reference(self) -> tuple[Values, str]:
        if self.scene.known is not None:
            return known_values(self.scene)[0], f"the known solution ({self.scene.known.source})"
        method = replace(self.start.method, rtol=1e-12, atol=1e-12)
        problem = replace(self.problem("screw"), method=method)
        found = integrate(problem)
        if found.stopped:
            raise DescriptionError(
                f"the motion stops early ({found.stopped})",
                self.scene.name,
                "shorten it or give a [reference]",
            )
        q = found.q[len(problem.times) - len(self.scene.motion) :]
        return observe(self.lay, self.scene.observables, q), f"screw with {method.name}, rtol = atol = 1e-12"

    def outcome(self, entrant: Entrant) -> Outcome:
        """Integrates, again if that was short, and scores. Whatever is raised becomes a row."""
        try:
            found = self._integrate(entrant)
            times = [(found.seconds, found.cpu)]
            for _ in range(self.plan.rounds - 1):
                if found.seconds < SHORT:
                    again = self._integrate(entrant)
                    times.append((again.seconds, again.cpu))
        except _TooLong as error:
            return Outcome(entrant, CUT, str(error))
        except ImportError as error:
            return Outcome(entrant, FAILED, f"not installed ({error})")
        except Exception as error:
            text = " ".join(str(error).split()).replace(f"{self.folder}/", "")
            return Outcome(entrant, FAILED, f"{type(error).__name__}: {text}")
        wall, cpu = np.min(np.array(times), axis=0).tolist()
        return self._scored(entrant, found, wall, cpu)

    def _integrate(self, entrant: Entrant) -> ForwardSolution:
        problem = self.problem(entrant.engine, perf_counter() + self.plan.each)
        with np.errstate(all="ignore"):
            found = entrant.integrate(problem)
        return trimmed(found, len(problem.times) - len(self.scene.motion))

    def _scored(self, entrant: Entrant, found: ForwardSolution, wall: float, cpu: float) -> Outcome:
        m = len(found.q)
        if m < 2:
            return Outcome(entrant, FAILED, f"stopped before the first sample: {found.stopped}")
        has = observe(self.lay, self.scene.observables, found.q)
        error = np.abs(has.array - self.known.array[:m])
        error = error[np.isfinite(self.known.array[:m]).all(axis=1)]
        lost = not np.isfinite(error).all()
        short = found.stopped or (
            f"only {m} of {len(self.scene.motion)} samples" if m < len(self.scene.motion) else ""
        )
        tree = spanning_tree(self.scene.mechanism)
        bodies, _ = walk(self.scene.mechanism, tree, found.q, found.v, found.a)
        balance = energy_balance(self.scene, found, bodies)
        drift = float("nan") if balance is None else float(np.abs(balance.values).max())
        return Outcome(
            entrant,
            FAILED if short or lost else OK,
            short or ("not a number" if lost else ""),
            scaled=float((error / self.scale).max(initial=0.0)),
            rms=float(np.sqrt(np.mean((error / self.scale) ** 2))) if error.size else float("nan"),
            largest=self._by_unit(error),
            energy=drift,
            energy_scaled=float("nan") if balance is None else drift / float(balance.scale),
            wall=wall,
            cpu=cpu,
            n_sample=m,
            steps=found.steps,
            evaluations=found.evaluations,
        )

    def _by_unit(self, error: Array) -> dict[str, float]:
        units = self.known.units
        return {
            unit: float(error[:, [i for i, u in enumerate(units) if u == unit]].max(initial=0.0))
            for unit in dict.fromkeys(units)
        }


def _fits(outcomes: Sequence[Outcome]) -> list[Fit]:
    """Slopes of the families whose error should be a power of their parameter."""
    found = []
    for family in dict.fromkeys(o.entrant.family for o in outcomes if o.entrant.order is not None):
        here = [o for o in outcomes if o.entrant.family == family and o.entrant.parameter and o.scaled > 0.0]
        points = [(o.entrant.parameter[1], o.scaled) for o in here if o.entrant.parameter]
        order = next((o.entrant.order for o in here), None)
        if points and order is not None and here[0].entrant.parameter is not None:
            found.append(fit(Rule(family, "observable", order), here[0].entrant.parameter[0], points))
    return found
