"""What a forward bench does with one entrant: integrate, time, score."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from screwgauge.engines.screw.forward import integrate
from screwgauge.judging.answer import answer_at
from screwgauge.judging.compare import reference_scale
from screwgauge.judging.energy import energy_balance
from screwgauge.problem import ForwardProblem
from screwgauge.quantities import natural_scales
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.pose import layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.observe import known_values, observe
from screwgauge.scene.scene import Scene
from screwgauge.scene.setting import Forward
from screwgauge.scene.start import make_problem
from screwgauge.solution import ForwardSolution, Values
from screwgauge.study.bench.forward_entrants import Entrant
from screwgauge.study.bench.rows import CUT, FAILED, OK
from screwgauge.study.forward import integrated, trimmed
from screwgauge.study.run import model_files

#: Below this [s] an entrant is measured again, `Plan.rounds` times in all, and the shortest time counts.
SHORT = 1.0


@dataclass(frozen=True, slots=True)
class Plan:
    """How much is measured.

    Attributes:
        samples: Times compared, at most.
        rounds: Measurements of what is short.
        budget: Seconds after which nothing further begins or goes on.
        each: Seconds after which an entrant is stopped.
        share: Share of the duration that is integrated.
    """

    samples: int
    rounds: int
    budget: float
    each: float
    share: float


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


class _TooLong(Exception):
    """An entrant that was stopped."""


class Work:
    """What all entrants share."""

    def __init__(self, scene: Scene, start: Forward, folder: Path, plan: Plan) -> None:
        self.scene, self.start, self.folder, self.plan = scene, start, folder, plan
        self.lay = layout(scene.mechanism)
        self.known, self.source = self._reference()
        floor = natural_scales(scene.mechanism)
        self.scale = np.array([reference_scale(self.known, unit, floor[unit]) for unit in self.known.units])

    def problem(self, engine: str, most: float = np.inf) -> ForwardProblem:
        """The problem of an engine; an integration that lasts longer than so many seconds is stopped."""
        begin = perf_counter()

        def progress(share: float) -> None:
            if perf_counter() - begin > most:
                raise _TooLong(f"stopped after {most:.3g} s, {share:.0%} of the way")

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

    def outcome(self, entrant: Entrant, left: float) -> Outcome:
        """Integrates, again if that was short, and scores. Whatever is raised becomes a row.

        Args:
            left: Of the budget [s].
        """
        most = min(self.plan.each, left)
        try:
            found = self._integrate(entrant, most)
            times = [(found.seconds, found.cpu)]
            for _ in range(self.plan.rounds - 1):
                if found.seconds < SHORT:
                    again = self._integrate(entrant, most)
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

    def _integrate(self, entrant: Entrant, most: float) -> ForwardSolution:
        problem = self.problem(entrant.engine, most)
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
        short = found.stopped or (f"only {m} of {len(self.scene.motion)} samples" if m < len(self.scene.motion) else "")
        solution = integrated(self.scene, found)
        answer = answer_at(self.scene.mechanism, self.scene.problem(()), solution, np.arange(m))
        balance = next(energy_balance(answer), None)
        return Outcome(
            entrant,
            FAILED if short or lost else OK,
            short or ("not a number" if lost else ""),
            scaled=float((error / self.scale).max(initial=0.0)),
            rms=float(np.sqrt(np.mean((error / self.scale) ** 2))) if error.size else float("nan"),
            largest=self._by_unit(error),
            energy=float("nan") if balance is None else balance["max_abs"],
            energy_scaled=float("nan") if balance is None else balance["max_scaled"],
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
