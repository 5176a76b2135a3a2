"""Result of a run, created by `run`: solutions, comparisons, judgements, and the files that they are based on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from screwgauge.casebook.book import installed_versions, suspects
from screwgauge.engines.registry import ENGINES
from screwgauge.environment import environment
from screwgauge.judging.coverage import Coverage
from screwgauge.judging.trust import Refusal
from screwgauge.models import catalog
from screwgauge.models.importing.model import is_scratch
from screwgauge.quantities import GIVEN, QUANTITIES
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.files import digest
from screwgauge.reference.mobility import Mobility
from screwgauge.reference.rotations import Array
from screwgauge.scene import read as scenes
from screwgauge.scene.scene import Scene
from screwgauge.solution import REFERENCE, Error, Failure, Solution, Values
from screwgauge.study.leave import UNREAD
from screwgauge.study.left_out import LeftOutForces
from screwgauge.study.outcome import EXIT, Outcome, weakest
from screwgauge.study.review import TableReview

T = TypeVar("T")

DOUBT = "doubt"  #: Kind of a remark about values that no machine has.


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Solutions of one scene, compared in pairs and judged individually.

    Attributes:
        solutions: Engine -> its solution, in the order in which the engines were requested.
        failures: Engine -> its failure, with the reason.
        errors: One row per component pair: quantity, component, unit, a, b, max_abs, rms, max_scaled, scale, worst_t,
            rule, unique, tolerance, ok. For components without a unique value, tolerance and ok are empty.
        pairs: One row per quantity, pair and unit: quantity, a, b, unit, max_abs, rms, max_scaled, worst_component,
            worst_t, rule, unique, tolerance, ok, reason.
        judge: One row per engine, residual and unit: engine, residual, unit, max_abs, max_scaled, worst_component,
            worst_t, tolerance, ok, reason.
        remarks: Sentence about the scene -> `DOUBT`, `UNREAD` or an empty string.
        freedoms: Counts of the degrees of freedom.
        provenance: Judged files with their digests, date and schema, as in ``summary.json``.
        refusals: Samples at which an engine returns no value, with the reason.
        left_out: Forces that files contain but no engine includes.
        review: Function that computes `reviews` on demand.
        cover: Function that computes `coverage` on demand.
    """

    scene: Scene
    solutions: Mapping[str, Solution]
    failures: Mapping[str, Failure]
    errors: pd.DataFrame
    pairs: pd.DataFrame
    judge: pd.DataFrame
    remarks: Mapping[str, str]
    freedoms: Mobility
    provenance: Mapping[str, Any]
    refusals: Sequence[Refusal]
    left_out: LeftOutForces
    review: Callable[[], Mapping[str, TableReview]]
    cover: Callable[[], Coverage]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the scene itself."""
        return tuple(self.remarks)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Warnings about implausible values: engines may agree on input that nobody meant."""
        return tuple(sentence for sentence, kind in self.remarks.items() if kind == DOUBT)

    @property
    def unread(self) -> tuple[str, ...]:
        """Warnings about files that the scene names but that were not read."""
        return tuple(sentence for sentence, kind in self.remarks.items() if kind == UNREAD)

    @property
    def environment(self) -> dict[str, Any]:
        """Name -> value, for software versions and the machine."""
        return environment()

    @property
    def mobility(self) -> dict[str, Any]:
        """Name -> value: mobility, rank and redundancy of the mechanism, and which of its forces are unique."""
        counts = self.freedoms
        return {
            "moving bodies": counts.bodies,
            "joint freedoms": counts.joint_freedoms,
            "kutzbach": counts.kutzbach,
            "mobility": counts.mobility,
            "constraint components": counts.constraints,
            "their rank": counts.constraint_rank,
            "overconstraints": counts.overconstraints,
            "actuation redundancy": counts.actuation_redundancy,
            "unique forces": dict(zip(counts.names, counts.unique, strict=True)),
        }

    @property
    def undetermined(self) -> Sequence[str]:
        """Reaction components without a unique value, because redundant constraints leave them undetermined."""
        return self.freedoms.undetermined

    @cached_property
    def known(self) -> list[str]:
        """Sentences about known discrepancies of the engines that may explain results out of tolerance."""
        bad = self.pairs[~self.pairs["ok"].astype(bool)]
        wrong, packages = {*bad["quantity"]}, {ENGINES[name].package for name in {*self.solutions} & {*ENGINES}}
        sentences = []
        for case in suspects(wrong, {*self.pairs["quantity"]} - wrong, packages) if wrong else ():
            symptom, engines = case.sentence.rstrip("."), case.engines_text(installed_versions(case) or ())
            sentences.append(f"Known issue of {engines}: {symptom[0].lower()}{symptom[1:]} (casebook: {case.id}).")
        return sentences

    @cached_property
    def outcomes(self) -> tuple[Outcome, ...]:
        """All outcomes, weakest first."""
        alone = len(self.solutions) == 1
        holds: dict[Outcome, bool] = {
            "failed": bool(self.failures),
            "differ": bool(len(self.differences)),
            "faulted": bool(len(self.faults)),
            "nothing": not len(self.compared) and not (alone and len(self.judge)),
            "unjudged": bool(self.unjudged),
            "partly": bool(self.refusals or self.apart),
            "undecided": bool(self.undecided),
            "rigid": not {*self.left_out.inertia} <= {*self.scene.allow},
            "unlike": bool(self.mismatches),
        }
        return tuple(outcome for outcome, here in holds.items() if here) or ("judged" if alone else "agree",)

    @property
    def outcome(self) -> Outcome:
        """The weakest outcome, with which the verdict begins."""
        return weakest(self.outcomes)

    @property
    def ok(self) -> bool:
        """True if every engine ran, and everything requested was compared, judged and found within tolerance.

        A single engine only needs to be judged.
        """
        return not EXIT[self.outcome]

    def __bool__(self) -> bool:
        """Return `ok`, so that ``assert results`` passes only if the results are ok."""
        return self.ok

    @property
    def exit_status(self) -> int:
        """Exit status: 0 agreement, 1 out of tolerance or not everything compared, 3 an engine failed or is missing."""
        return EXIT[self.outcome]

    @property
    def compared(self) -> pd.DataFrame:
        """Rows of pairs whose engines both ran."""
        lost = [*self.failures]
        return self.pairs[~self.pairs["a"].isin(lost) & ~self.pairs["b"].isin(lost)]

    @property
    def differences(self) -> pd.DataFrame:
        """Rows of pairs out of tolerance by more than the engines' error estimates; missing values are ignored."""
        rows = self.compared
        lost = np.array([self._is_refused(row) for row in rows.to_dict("records")], dtype=bool)
        return rows[~rows["ok"].astype(bool) & ~(rows["undecided"] > 0) & ~lost]

    @property
    def faults(self) -> pd.DataFrame:
        """Rows of equations whose residuals exceed the tolerance by more than the engine's error estimate."""
        rows = self.judge[~self.judge["engine"].isin([*self.failures])]
        return rows[~rows["ok"].astype(bool) & ~(rows["undecided"] > 0)]

    @property
    def undecided(self) -> int:
        """Number of samples out of tolerance, but not by more than the engines' error estimates."""
        return max((int(rows["undecided"].max()) for rows in (self.compared, self.judge) if len(rows)), default=0)

    @property
    def reservations(self) -> list[str]:
        """Qualifications of an agreement: doubts about the scene, warnings by engines and about their model files."""
        warned = (text for solution in self.solutions.values() for text in solution.warnings)
        return [*dict.fromkeys(f"{text.rstrip('.')}." for text in (*self.doubts, *warned))]

    @property
    def mismatches(self) -> dict[str, str]:
        """Key -> sentence, for differences between model files and description, unless the scene allows them."""
        found = (each for solution in self.solutions.values() for each in solution.otherwise if each.physical)
        return {each.key: each.sentence for each in found if each.key not in self.scene.allow}

    @property
    def unjudged(self) -> tuple[str, ...]:
        """Engines for which no equation of mechanics was checked."""
        known = {*self.judge["engine"], *self.scene.tables, REFERENCE}
        return tuple(name for name in self.solutions if name not in known)

    @property
    def alone(self) -> Iterator[tuple[str, list[str]]]:
        """Engines, each with the names of its quantities that were not compared with a different engine."""
        seen = {(row[side], row["quantity"]) for row in self.pairs.to_dict("records") for side in "ab"}
        unique = {name: {*components} for name, components in self.not_unique.items()}
        for engine, solution in self.solutions.items() if len(self.solutions) > 1 else ():
            sized = {name: {*one.components} - unique.get(name, set()) for name, one in solution.values.items()}
            names = [name for name, components in sized.items() if components and (engine, name) not in seen]
            if names and engine not in self.scene.tables:  # separate remarks describe tables
                yield engine, names

    @property
    def apart(self) -> tuple[str, ...]:
        """Quantities that several engines compute, but that were not compared for all of them, e.g. tree forces.

        Empty if the user chose no quantities, so that all available quantities were requested.
        """
        if {*GIVEN} <= {name for one in self.solutions.values() for name in one.values}:
            return ()
        names = dict.fromkeys(name for _, quantities in self.alone for name in quantities)
        return tuple(name for name in names if len(self._solutions_with(name)) > 1)

    def _is_refused(self, row: Mapping[Any, Any]) -> bool:
        """Return True if a row lacks values because of samples for which an engine states a reason."""
        engines = (row["a"], row["b"])
        known = (one.engine in engines and row["quantity"] in one.quantities for one in self.refusals)
        return not np.isfinite(row["max_scaled"]) and any(known)

    @property
    def guard(self) -> dict[tuple[str, str], Error]:
        """Engine and quantity -> error estimated from conditioning; engines that prove bounds are omitted."""
        return {
            (name, quantity): error
            for name, solution in self.solutions.items()
            for quantity, error in solution.errors.items()
            if error.radius is None
        }

    @property
    def not_unique(self) -> dict[str, tuple[str, ...]]:
        """Quantity -> its components without a unique value, for quantities that have such components."""
        ruled = [name for name in QUANTITIES if QUANTITIES[name].ruled]
        firsts = {name: solution.values[name] for name in ruled for solution in self._solutions_with(name)[:1]}
        shown = {name: tuple(x for x in values.components if x in self.undetermined) for name, values in firsts.items()}
        return {name: components for name, components in shown.items() if components}

    def _solutions_with(self, quantity: str) -> list[Solution]:
        return [solution for solution in self.solutions.values() if quantity in solution.values]

    @cached_property
    def reviews(self) -> Mapping[str, TableReview]:
        """Table -> review of the faults in its columns."""
        return self.review()

    @cached_property
    def coverage(self) -> Coverage:
        """Coverage: which mistakes in parameters the scene could have revealed."""
        return self.cover()

    @property
    def times(self) -> Array:
        """Sample times [s]. Shape (n_sample,)."""
        return self.scene.t

    def quantity(self, quantity: str, engine: str | None = None) -> Values:
        """Return the values of a quantity with names and units, by default from the first engine that has it.

        Raises:
            UnknownNameError: The engine is unknown, or did not compute the quantity.
        """
        return self._pick("quantity", quantity, {name: s.values for name, s in self.solutions.items()}, engine)

    def values(self, quantity: str, engine: str | None = None) -> Array:
        """Return the values of a quantity as an array. Shape (n_sample, n_component)."""
        return self.quantity(quantity, engine).array

    def radius(self, quantity: str, engine: str | None = None) -> Array:
        """Return the rigorous radius of the truth: the largest possible distance of a true value from the midpoint.

        The values themselves are the midpoints rounded to doubles. The radius is NaN at samples that the engine `truth`
        did not solve.

        Returns:
            Shape (n_sample, n_component).

        Raises:
            UnknownNameError: No engine computed radii for this quantity.
        """
        return self._pick("radius", quantity, {name: _radii(one) for name, one in self.solutions.items()}, engine)

    def components(self, quantity: str, engine: str | None = None) -> tuple[str, ...]:
        """Return the component names in column order."""
        return self.quantity(quantity, engine).components

    def _pick(self, kind: str, quantity: str, by_engine: Mapping[str, Mapping[str, T]], engine: str | None) -> T:
        """Return the entry of a quantity for the named engine, or for the first engine that has it."""
        if engine and engine not in by_engine:
            raise UnknownNameError("engine", engine, by_engine)
        tables = [by_engine[engine]] if engine else list(by_engine.values())
        for table in tables:
            if quantity in table:
                return table[quantity]
        known = dict.fromkeys(name for table in tables for name in table)
        raise UnknownNameError(kind, quantity, known or ["none, because the engine truth was not run"])


def _radii(solution: Solution) -> dict[str, Array]:
    return {name: error.radius for name, error in solution.errors.items() if error.radius is not None}


SCHEMA = 1  #: Version of ``summary.json``: increased when a key is removed or changes its meaning.
_BUILT_IN = (scenes.FOLDER, catalog.FOLDER)


def provenance(
    scene: Scene | None, models: Mapping[str, Path], *, description: Path | None = None, date: datetime | None = None
) -> dict[str, Any]:
    """Return names and digests of the judged files.

    Args:
        scene: The scene; None if there is not exactly one scene.
        models: Engine -> path of the model file that the engine read; generated files must still exist.
        description: Generated description of the mechanism, if it is not the file of the scene.
        date: Date of the judgement; now by default.

    Returns:
        ``models`` (engine -> ``file`` and ``sha256``), ``scene_file`` and ``scene_sha256``, ``description`` (``file``,
        ``sha256``), ``date`` (ISO 8601, UTC) and ``schema``. File names are as given.
    """
    record: dict[str, Any] = {"date": (date or datetime.now(UTC)).astimezone(UTC).isoformat(timespec="seconds")}
    if scene is not None:
        given = {*scene.models.values(), scene.mechanism_file, *(table.file for table in scene.tables.values())}
        record["models"] = {name: _file(path, generated=path not in given) for name, path in models.items()}
        described = description or scene.mechanism_file
        record["description"] = _file(described, generated=described not in given)
        if scene.file is not None:
            record["scene_file"], record["scene_sha256"] = _file(scene.file).values()
    return {**record, "schema": SCHEMA}


def built_in(path: Path) -> bool:
    """Return True if a file comes with this package."""
    return any(path.is_relative_to(folder) for folder in _BUILT_IN)


def _file(path: Path, *, generated: bool = False) -> dict[str, str | None]:
    """Return the name and SHA-256 of a file; None instead of the hash if the file no longer exists."""
    if is_scratch(path):
        path = catalog.description_source(path)
        generated = is_scratch(path)
    name = f"generated {path.name}" if generated else f"built-in {path.name}" if built_in(path) else str(path)
    try:
        return {"file": name, "sha256": digest(path)}
    except DescriptionError:
        return {"file": name, "sha256": None}
