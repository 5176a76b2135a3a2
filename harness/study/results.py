"""What a comparison found. Made by `run`, written by `write`, told by `report`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.judging.conditioning import Guarded, guarded
from screwgauge.judging.refusals import Refusal
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution, Values


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """Solutions of one scene, compared pair by pair and judged one by one.

    Attributes:
        solutions: Engine -> what it computed, in the order asked for.
        failures: Engine -> why it did not.
        errors: One row per component pair: quantity, component, unit, a, b, max_abs, rms, max_scaled, scale,
            worst_t, rule, unique, tolerance, ok.
        pairs: One row per quantity, pair and unit: quantity, a, b, unit, max_abs, rms, max_scaled,
            worst_component, worst_t, rule, unique, tolerance, ok, reason.
        judge: One row per engine, residual and unit: engine, residual, unit, max_abs, max_scaled,
            worst_component, worst_t, tolerance, ok, reason.
        mobility: Facts of the mechanism (freedoms, rank, redundancy), name -> value.
        environment: Versions and machine, name -> value.
        warnings: Sentences about the scene itself.
        refusals: Samples at which an engine gives no number, with the reason.
    """

    scene: Scene
    solutions: Mapping[str, Solution]
    failures: Mapping[str, Failure]
    errors: pd.DataFrame
    pairs: pd.DataFrame
    judge: pd.DataFrame
    mobility: Mapping[str, Any]
    environment: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    refusals: Sequence[Refusal] = ()

    @property
    def ok(self) -> bool:
        """Every engine ran and gave every number; something was compared or judged, all within its tolerance."""
        if self.failures or self.refusals or not (len(self.pairs) or len(self.judge)):
            return False
        return bool(self.pairs["ok"].all()) and bool(self.judge["ok"].all())

    @property
    def exit_status(self) -> int:
        """0 agreement, 1 out of tolerance or nothing compared, 3 an engine failed or is missing."""
        if self.failures:
            return 3
        return 0 if self.ok else 1

    @property
    def guard(self) -> list[Guarded]:
        """How far each quantity of each engine can be trusted, by condition and estimated error."""
        return [row for solution in self.solutions.values() for row in guarded(solution, self.times)]

    @property
    def times(self) -> Array:
        """Sample times [s]. Shape (n_sample,)."""
        return self.scene.motion.t

    def quantity(self, quantity: str, engine: str | None = None) -> Values:
        """Values of one quantity with their names and units; the first engine that has it by default."""
        engines = [engine] if engine else list(self.solutions)
        for name in engines:
            if name not in self.solutions:
                raise UnknownNameError("engine", name, self.solutions)
            if quantity in self.solutions[name].values:
                return self.solutions[name].values[quantity]
        known = dict.fromkeys(q for name in engines for q in self.solutions[name].values)
        raise UnknownNameError("quantity", quantity, known)

    def values(self, quantity: str, engine: str | None = None) -> Array:
        """Shape (n_sample, n_component)."""
        return self.quantity(quantity, engine).array

    def radius(self, quantity: str, engine: str | None = None) -> Array:
        """Rigorous radius of the truth: no true value is farther from the exact midpoint than this.

        The values themselves are those midpoints rounded to doubles. NaN at samples that the truth did not solve.

        Returns:
            Shape (n_sample, n_component).

        Raises:
            UnknownNameError: No engine has radii for this quantity.
        """
        engines = [engine] if engine else list(self.solutions)
        for name in engines:
            if name in self.solutions and quantity in self.solutions[name].radius:
                return self.solutions[name].radius[quantity]
        known = dict.fromkeys(q for name in engines if name in self.solutions for q in self.solutions[name].radius)
        raise UnknownNameError("radius", quantity, known or ["none, as the engine truth was not run"])

    def components(self, quantity: str, engine: str | None = None) -> tuple[str, ...]:
        """Names in column order."""
        return self.quantity(quantity, engine).components

    def write(self, out: str | Path, *, samples: bool = False) -> Path:
        """Writes the report and its data into a folder; nothing is left there if it fails.

        Raises:
            OutputError: The folder cannot be written.
        """
        from screwgauge.report.paper.document import paper_section
        from screwgauge.report.write import write_results

        # measured here: a run that writes no report does not wait for it
        return write_results(self, Path(out), samples=samples, paper=paper_section(self.scene))
