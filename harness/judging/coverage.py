"""Coverage: the share of each kind of term in the compared values, and parameters that do not affect these values.

Engines agree even on wrong terms if these vanish. Coverage examines the terms of the equations, and the parameters that
form the columns of the regressor of the compared forces: mass, centre of mass and inertia of each body, and the point
of each load.
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
    compared_forces,
    covered_motion,
    parameters,
    terms,
)
from screwgauge.problem import GivenMotion, Problem, Rows
from screwgauge.quantities import FLOOR, OF_BODIES, OF_JOINTS, QUANTITIES, natural_scales
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import Mobility
from screwgauge.reference.reciprocal import normal_of_plane
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution
from screwgauge.witness.kinematics import unit_twists

Row = dict[str, Any]
"""A row of a coverage table."""

MOST = 51  # number of samples examined
#: Largest number of entries in the regressor, which limits the samples, and the fewest samples worth examining.
NUMBERS, FEWEST = 3_000_000, 3
#: Columns below this fraction of the largest regressor column, and terms below this fraction of a quantity, are
#: rounding.
NOTHING = 1e-9
#: Share of inertia in the forces below which a motion tests only statics.
STATICS = 0.01
#: Number of poses at which random velocities are tried, and a tolerance that makes every effect visible.
ANY, TINY = 6, 1e-300
#: Term -> its name in messages.
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
    """Parameters and terms that the motion excites.

    Attributes:
        shares: Rows with quantity, unit, term and share: the largest magnitude of a kind of term divided by the largest
            magnitude of the quantity. For the Lie bracket, the term is the change caused by omitting the bracket.
        parameters: Rows with parameter, effect, smallest and tested. The effect is the largest scaled change in a
            compared force if the parameter is wrong by its full scale; `smallest` is the fraction of this scale above
            which an error is out of tolerance.
        hidden: Names of parameters and terms that no motion through these poses reveals.
        planar: Whether all joints move in one plane.
        missing: Why coverage is unknown; empty if it is known.
    """

    shares: tuple[Row, ...] = ()
    parameters: tuple[Row, ...] = ()
    missing: str = "Coverage was not examined."
    hidden: frozenset[str] = frozenset()
    planar: bool = False

    @property
    def untested(self) -> list[str]:
        """Names of the parameters that could be wrong by their full scale."""
        return [row["parameter"] for row in self.parameters if not row["tested"]]

    @property
    def absent(self) -> list[str]:
        """Kinds of terms of the scene that vanish in all compared values."""
        there = {row["term"] for row in self.shares if row["share"]}
        lost = dict.fromkeys(row["term"] for row in self.shares if row["term"] not in there)
        products = [term for term in BRACKET[1:] if term in lost and "bracket" not in lost]
        part = [f"{' and '.join(products)} of the Lie bracket"] if products else []
        return [name for term, name in _NAMES.items() if term in lost] + part

    @property
    def inertia(self) -> tuple[str, float] | None:
        """Name of the first compared force, and the share of inertia in this force; None without compared forces."""
        by: dict[str, list[float]] = {}
        for row in self.shares:
            if row["term"] in ("inertial", "gyroscopic"):
                by.setdefault(row["quantity"], []).append(row["share"])
        name = next((name for name in _FORCES if name in by), None)
        return None if name is None else (name, max(by[name]))

    @property
    def poor(self) -> str:
        """Description of what the motion leaves untested; empty if coverage is unknown."""
        sentences = list[str]()
        if self.inertia and self.inertia[1] < STATICS:
            name, share = self.inertia
            sentences.append(f"Inertia is {100.0 * share:.2g} % of {name}: this motion tests only statics.")
        names, terms = [[n for n in some if n not in self.hidden] for some in (self.untested, self.absent)]
        if names or terms:
            sentences.append(f"Not tested here: {_count(names, terms)}.")
        if self.hidden:
            names, terms = [[n for n in some if n in self.hidden] for some in (self.untested, self.absent)]
            why = " (mostly because the mechanism is planar)" * self.planar
            none = f"No compared quantity depends on {_count(names, terms)} in any motion through these poses"
            sentences.append(f"{none}{why}: nothing is wrong.")
        return " ".join(sentences)

    @property
    def sentence(self) -> str:
        """Summary of the coverage."""
        if self.missing:
            return self.missing
        n = len(self.parameters)
        if not n:
            return "No inertial parameter is tested: no force is compared."
        tested = f"{n - len(self.untested)} of {n} inertial parameters and load points are tested"
        return f"{tested}. {self.poor}".strip()


def _count(parameters: list[str], terms: list[str]) -> str:
    """Return a phrase that names the first parameter, counts the others, and lists all terms."""
    more = len(parameters) - 1
    first = [parameters[0] + f" and {more} other{'s' * (more > 1)}" * (more > 0)] if parameters else []
    return ", ".join([*first, *terms])


def coverage(
    mechanism: Mechanism,
    problem: Problem,
    solutions: Mapping[str, Solution],
    counted: Mobility,
    tolerance_of: Callable[[str], float],
) -> Coverage:
    """Measure which mistakes a given motion would reveal in the requested quantities.

    Args:
        solutions: Solutions; the first solution with joint coordinates provides the poses.
        counted: Uniqueness of forces; only determined reactions count.
        tolerance_of: Quantity -> scaled error up to which two engines agree.
    """
    motion = problem.task
    if not isinstance(motion, GivenMotion):
        return Coverage(missing="Coverage is computed for given motions, not for simulations.")
    if not problem.wanted & {*_FORCES, *_MOTIONS}:
        return Coverage(missing="The dynamics are not tested: no force and no acceleration is compared.")
    known = (q for solution in solutions.values() if (q := assembly_of(mechanism, solution)) is not None)
    q = next(known, np.zeros((0, len(mechanism.coordinates))))
    rows = np.flatnonzero(np.isfinite(q).all(axis=1))
    if not rows.size:
        return Coverage(missing="Coverage is unknown: no engine returned joint positions.")
    room = NUMBERS // (60 * len(mechanism.bodies) ** 2)
    if room < FEWEST:
        return Coverage(missing=f"Coverage is not computed: {len(mechanism.bodies)} bodies are too many.")
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(MOST, room)).astype(np.intp))]
    try:
        with np.errstate(all="ignore"):  # NaN at some samples may be finite at others
            return _Composition(mechanism, problem, counted, q[rows], motion.part(rows)).coverage(tolerance_of)
    except ScrewgaugeError as error:  # engines also raise and report this error
        return Coverage(missing=f"Coverage is unknown: {error}.")


_Forces = tuple[tuple[str, ...], list[tuple[str, str, Array]]]
"""Names of terms or parameters, and their effect on every compared force: quantity, unit, values (n, m, p)."""


class _Composition:
    """Terms of forces and accelerations along a motion, and along a random motion through some of its poses."""

    def __init__(
        self, mechanism: Mechanism, problem: Problem, counted: Mobility, q: Array, motion: GivenMotion
    ) -> None:
        self.wanted, self.n, self.scales = problem.wanted, len(q), natural_scales(mechanism)
        any_rows = _any_poses(q[:, mechanism.independent_columns])
        shaken = _randomise(mechanism, motion.part(any_rows))
        t, y, yd, ydd = (
            np.concatenate([getattr(motion, name), getattr(shaken, name)]) for name in ("t", "y", "yd", "ydd")
        )
        both = GivenMotion(t, y, yd, ydd)
        now = covered_motion(mechanism, problem, both, np.concatenate([q, q[any_rows]]))
        self.whole = _by_unit(now.accelerations, mechanism.units)
        self.lost = {term: _by_unit(lost, mechanism.units) for term, lost in now.lost.items()}
        names, needed = terms(now)
        self.terms: _Forces = names, [*compared_forces(now, needed, counted)]
        self.parameters: _Forces = (), []
        if self.terms[1]:
            names, needed = parameters(now)
            self.parameters = names, [*compared_forces(now, needed, counted)]
        twists = unit_twists(now.motion)[0, mechanism.columns(mechanism.moving)]
        self.planar = normal_of_plane(twists) is not None

    def coverage(self, tolerance_of: Callable[[str], float]) -> Coverage:
        """Return the coverage of the motion, including the parameters and terms that no motion can reveal."""
        motion, other = slice(self.n), slice(self.n, None)
        shares, sizes = self._shares(motion)
        parts = tuple(self._effects(motion, sizes, tolerance_of))
        hidden = frozenset[str]()
        if any(len(array) > self.n for array in self.whole.values()):
            shares_then, sizes_then = self._shares(other)
            then = Coverage(shares_then, tuple(self._effects(other, sizes_then, lambda quantity: TINY)), "")
            hidden = frozenset([*then.untested, *then.absent])
        return Coverage(shares, parts, "", hidden, self.planar)

    def _shares(self, rows: slice) -> tuple[tuple[Row, ...], dict[tuple[str, str], float]]:
        """Return the shares of all terms at the given samples, and the largest magnitude of each force and unit."""
        (names, forces), found, sizes = self.terms, [*self._accelerations(rows)], dict[tuple[str, str], float]()
        whole = [i for i, name in enumerate(names) if name not in BRACKET]  # the bracket is a part of inertia
        for quantity, unit, array in forces:
            each = array[rows]
            size = max(largest(each[..., whole].sum(axis=2)), FLOOR * self.scales[unit])
            sizes[quantity, unit] = size
            found += [_share(quantity, unit, name, largest(each[..., i]) / size) for i, name in enumerate(names)]
        return tuple(found), sizes

    def _accelerations(self, rows: slice) -> Iterator[Row]:
        """Yield the relative change in accelerations caused by omitting terms of the Lie bracket."""
        for (quantity, unit), array in self.whole.items():
            if quantity in self.wanted:
                size = max(largest(array[rows]), FLOOR * self.scales[unit])
                for term in BRACKET:
                    yield _share(quantity, unit, term, largest(self.lost[term][quantity, unit][rows]) / size)

    def _effects(
        self, rows: slice, sizes: Mapping[tuple[str, str], float], tolerance_of: Callable[[str], float]
    ) -> Iterator[Row]:
        """Yield the effect of each parameter on the compared forces."""
        names, forces = self.parameters
        effect, errors = np.zeros(len(names)), np.full(len(names), np.inf)
        for quantity, unit, array in forces:
            columns = np.nanmax(np.abs(array[rows]), axis=(0, 1), initial=0.0)
            columns[columns < NOTHING * columns.max()] = 0.0
            scaled = columns / sizes[quantity, unit]
            effect = np.maximum(effect, scaled)
            with np.errstate(divide="ignore"):
                errors = np.minimum(errors, tolerance_of(quantity) / scaled)
        for name, change, least in zip(names, effect, errors, strict=True):
            yield {"parameter": name, "effect": float(change), "smallest": float(least), "tested": bool(least < 1.0)}


def _any_poses(y: Array) -> Rows:
    """Return samples at which to try random velocities; empty if an independent coordinate is constant. Shape (k,)."""
    n = ANY if np.ptp(y, axis=0).all() else 0
    return np.unique(np.linspace(0, len(y) - 1, n).astype(np.intp))


def _randomise(mechanism: Mechanism, motion: GivenMotion) -> GivenMotion:
    """Return a motion through the same poses with random velocities and accelerations, scaled by gravity."""
    units, rng = [mechanism.units[i] for i in mechanism.independent_columns], np.random.default_rng(0)
    scales = natural_scales(mechanism)
    yd, ydd = (rng.normal(size=motion.y.shape) * [scales[unit + per] for unit in units] for per in ("/s", "/s^2"))
    return GivenMotion(motion.t, motion.y, yd, ydd)


def _by_unit(of: tuple[Array, Array, Array], units: Sequence[str]) -> dict[tuple[str, str], Array]:
    """Map (quantity, unit) to values."""
    has, (joints, angular, com) = np.array(units), of
    return {
        **{("joint_acceleration", f"{unit}/s^2"): joints[:, has == unit] for unit in dict.fromkeys(units)},
        ("body_angular_acceleration", "rad/s^2"): angular,
        ("com_acceleration", "m/s^2"): com,
    }


def _share(quantity: str, unit: str, term: str, share: float) -> Row:
    return {"quantity": quantity, "unit": unit, "term": term, "share": share if share >= NOTHING else 0.0}
