"""What a scene can see: the share of each kind of term in what is compared, and which parameters change none of it.

Engines agree on a term that is not there, too. Looked at are the terms of the equations, and the mass, centre of mass
and inertia of each body and the point of each load: the columns of the regressor of the compared forces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwgauge.judging.answer import largest
from screwgauge.judging.assembly_modes import assembly_of
from screwgauge.judging.identifiability import (
    BRACKET,
    CoveredAccelerations,
    CoveredMotion,
    compared_forces,
    covered_motion,
    parameters,
    terms,
)
from screwgauge.problem import GivenMotion, Problem
from screwgauge.quantities import FLOOR, OF_BODIES, OF_JOINTS, QUANTITIES, natural_scales
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import Mobility
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution

Row = dict[str, Any]
"""A row of what a scene can see."""

MOST = 51  # samples that are looked at
#: Numbers in the regressor; fewer samples where it had more, none where that leaves fewer than `FEWEST`.
NUMBERS, FEWEST = 3_000_000, 3
#: Share of the largest column of the regressor, or of a quantity, below which a column, or a term, is rounding.
NOTHING = 1e-9
#: Share of inertia in the forces below which a motion tests statics.
STATICS = 0.01
#: How terms are called that vanish.
_NAMES = {
    "gravity": "gravity",
    "inertial": "inertial forces",
    "gyroscopic": "gyroscopic moments",
    "bracket": "the Lie bracket",
}
_FORCES = ("actuator_force", "generalized_force", "reaction", "tree_force", "tree_force_soft")
_MOTIONS = tuple(name for name in (*OF_JOINTS, *OF_BODIES) if QUANTITIES[name].needs == "a")


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """What a scene can see.

    Attributes:
        shares: Rows quantity, unit, term, share: the largest magnitude of a kind of term over that of the quantity.
            The terms of the Lie bracket are what is lost where these are left out.
        parameters: Rows parameter, effect, smallest, tested: largest scaled change of a compared force by a parameter
            that is wrong by its whole size, and the share of that size from which an error is out of tolerance.
        missing: Why there is nothing to say, empty if there is.
    """

    shares: tuple[Row, ...] = ()
    parameters: tuple[Row, ...] = ()
    missing: str = "Coverage was not looked at."

    @property
    def untested(self) -> list[str]:
        """Names of the parameters that could be wrong by their whole size."""
        return [row["parameter"] for row in self.parameters if not row["tested"]]

    @property
    def absent(self) -> list[str]:
        """Kinds of terms that vanish in all that is compared; those that the scene has not are left out."""
        there = {row["term"] for row in self.shares if row["share"]}
        lost = dict.fromkeys(row["term"] for row in self.shares if row["term"] not in there)
        products = [term for term in BRACKET[1:] if term in lost and "bracket" not in lost]
        part = [f"{' and '.join(products)} of the Lie bracket"] if products else []
        return [name for term, name in _NAMES.items() if term in lost] + part

    @property
    def inertia(self) -> tuple[str, float] | None:
        """The first compared force and the share of inertia in it; None if no force is compared."""
        by: dict[str, list[float]] = {}
        for row in self.shares:
            if row["term"] in ("inertial", "gyroscopic"):
                by.setdefault(row["quantity"], []).append(row["share"])
        name = next((name for name in _FORCES if name in by), None)
        return None if name is None else (name, max(by[name]))

    @property
    def poor(self) -> str:
        """What the motion does not test, in a sentence or two; empty if nothing is known to be left out."""
        sentences = list[str]()
        if self.inertia and self.inertia[1] < STATICS:
            name, share = self.inertia
            sentences.append(f"Inertia is {100.0 * share:.2g} % of {name}: this motion tests statics.")
        if names := self.untested:
            rest = "" if len(names) == 1 else f" and {len(names) - 1} other{'s' * (len(names) > 2)}"
            names = [f"{names[0]}{rest}"]
        if names or self.absent:
            sentences.append(f"Not tested here: {', '.join([*names, *self.absent])}.")
        return " ".join(sentences)

    @property
    def sentence(self) -> str:
        """All that it comes to."""
        if self.missing:
            return self.missing
        n = len(self.parameters)
        if not n:
            return "No inertial parameter is tested: no force is compared."
        tested = f"{n - len(self.untested)} of {n} inertial parameters and points of loads are tested"
        return f"{tested}. {self.poor}".strip()


def coverage(
    mechanism: Mechanism,
    problem: Problem,
    solutions: Mapping[str, Solution],
    counted: Mobility,
    tolerance_of: Callable[[str], float],
) -> Coverage:
    """What a given motion can see of mistakes, in the quantities that it asks for.

    Args:
        solutions: Of which the first that has its joint coordinates gives the poses.
        counted: Which reactions are determined.
        tolerance_of: Quantity -> scaled error up to which two engines agree.
    """
    motion = problem.task
    if not isinstance(motion, GivenMotion):
        return Coverage(missing="Coverage is stated of given motions, not of simulations.")
    if not problem.wanted & {*_FORCES, *_MOTIONS}:
        return Coverage(missing="Nothing of the dynamics is tested: no force and no acceleration is compared.")
    known = (q for solution in solutions.values() if (q := assembly_of(mechanism, solution)) is not None)
    q = next(known, np.zeros((0, len(mechanism.coordinates))))
    rows = np.flatnonzero(np.isfinite(q).all(axis=1))
    if not rows.size:
        return Coverage(missing="Coverage is not known: no engine gave joint positions.")
    room = NUMBERS // (60 * len(mechanism.bodies) ** 2)
    if room < FEWEST:
        return Coverage(missing=f"Coverage is not stated of as many as {len(mechanism.bodies)} bodies.")
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(MOST, room)).astype(np.intp))]
    try:
        with np.errstate(all="ignore"):  # what is not a number at some sample is one at others
            now = covered_motion(mechanism, problem, motion.part(rows), q[rows])
            forces, sizes = _forces(now, counted)
            parts = _parameters(now, counted, sizes, tolerance_of) if sizes else ()
            return Coverage((*_motions(now), *forces), tuple(parts), "")
    except ScrewgaugeError as error:  # engines met it, too, and say so
        return Coverage(missing=f"Coverage is not known: {error}.")


def _motions(now: CoveredMotion) -> Iterator[Row]:
    """What accelerations lose with the Lie bracket."""
    scales, units = natural_scales(now.mechanism), now.mechanism.units
    whole, lost = _by_unit(now.accelerations, units), {term: _by_unit(of, units) for term, of in now.lost.items()}
    for (quantity, unit), array in whole.items():
        if quantity in now.problem.wanted:
            size = max(largest(array), FLOOR * scales[unit])
            for term in BRACKET:
                yield _share(quantity, unit, term, largest(lost[term][quantity, unit]) / size)


def _by_unit(of: CoveredAccelerations, units: Sequence[str]) -> dict[tuple[str, str], Array]:
    """(quantity, unit) -> values."""
    has = np.array(units)
    return {
        **{("joint_acceleration", f"{unit}/s^2"): of.joints[:, has == unit] for unit in dict.fromkeys(units)},
        ("body_angular_acceleration", "rad/s^2"): of.angular,
        ("com_acceleration", "m/s^2"): of.com,
    }


def _forces(now: CoveredMotion, counted: Mobility) -> tuple[list[Row], dict[tuple[str, str], float]]:
    """Shares of the terms of forces, and the largest magnitude of each quantity and unit."""
    names, needed = terms(now)
    scales, rows, sizes = natural_scales(now.mechanism), list[Row](), dict[tuple[str, str], float]()
    whole = [i for i, name in enumerate(names) if name not in BRACKET]  # which is a part of inertia
    for quantity, unit, array in compared_forces(now, needed, counted):
        size = max(largest(array[..., whole].sum(axis=2)), FLOOR * scales[unit])
        sizes[quantity, unit] = size
        rows += [_share(quantity, unit, name, largest(array[..., i]) / size) for i, name in enumerate(names)]
    return rows, sizes


def _parameters(
    now: CoveredMotion,
    counted: Mobility,
    sizes: Mapping[tuple[str, str], float],
    tolerance_of: Callable[[str], float],
) -> Iterator[Row]:
    """What each parameter does to the compared forces."""
    names, needed = parameters(now)
    effect, errors = np.zeros(len(names)), np.full(len(names), np.inf)
    for quantity, unit, array in compared_forces(now, needed, counted):
        columns = np.nanmax(np.abs(array), axis=(0, 1), initial=0.0)
        columns[columns < NOTHING * columns.max()] = 0.0
        scaled = columns / sizes[quantity, unit]
        effect = np.maximum(effect, scaled)
        with np.errstate(divide="ignore"):
            errors = np.minimum(errors, tolerance_of(quantity) / scaled)
    for name, change, least in zip(names, effect, errors, strict=True):
        yield {"parameter": name, "effect": float(change), "smallest": float(least), "tested": bool(least < 1.0)}


def _share(quantity: str, unit: str, term: str, share: float) -> Row:
    return {"quantity": quantity, "unit": unit, "term": term, "share": share if share >= NOTHING else 0.0}
