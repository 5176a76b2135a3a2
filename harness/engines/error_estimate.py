"""Estimate the error of each quantity that an engine computes, at each sample.

Loops close only up to rounding, eps in each closing equation. This moves the unknowns by up to g eps, where g is the
norm of the inverse of the dimensionless closing system. The error of the pose changes the rates by up to g^2 eps,
because their matrix depends on the pose, and the accelerations, which depend on the rates, by up to g^3 eps.
Measurements on the 3-UPS-UPU-S, at distances of 1e-1 to 1e-12 from b = 0.3568 rad, show that engines with projection
lose exactly these digits, and that their forces lose as many digits as the inertial terms. Powers of g overstate the
loss if loads are heavy and the motion is slow. Ill-conditioned samples are therefore solved again rather than
extrapolated: the pose is perturbed by about the rounding error, once in the worst direction and once in a generic one,
and the results are compared. For well-conditioned samples the powers are used, which take no extra time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from screwgauge.problem import Rows
from screwgauge.quantities import FLOOR, INERTIA, OF_JOINTS, QUANTITIES, RATIOS, arm, scales_of
from screwgauge.reference import linear
from screwgauge.reference.linear import DIGIT, ROUNDED
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.trace import Scalar, apply
from screwgauge.solution import Clock, Error, Values

#: Norms of the inverse above which a sample is solved again instead of extrapolated. The limit for force systems is
#: larger because their condition numbers reach a thousand in regular poses.
CLEAR, CLEAR_FORCES = 30.0, 1e4
#: Assumed ratio of the worst error to the larger of the changes at the two perturbed poses.
SAFETY = 4.0
#: Values that vanish are solved again if powers of the gain exceed this fraction of the tolerance.
SHARE = 0.01

Units = Mapping[str, Sequence[str]]
"""Quantity -> unit of each component."""

_POWER = {"q": 1, "v": 2, "a": 3, "f": 3}  # powers of g by the prerequisite of a quantity
#: Quantities that depend on accelerations.
ACCELERATED = tuple(name for name, quantity in QUANTITIES.items() if quantity.needs in "af")


@dataclass(frozen=True, slots=True, eq=False)
class Trust:
    """Condition numbers and scales used to estimate the errors of samples.

    Attributes:
        condition: Condition number of the closing system. Shape (n,).
        gain: Norm of the inverse of the dimensionless closing system, either of the worst loop, scaled by the length of
            that loop, or of all loops together, scaled by the length of the mechanism; see `stretch`. Shape (n,).
        charts: Condition number of the cut joints' angle charts, at least 1; affects only joint coordinates. (n,).
        forces: Quantity -> condition number of the system that was solved for its forces. Shape (n,).
        speed: Largest rate, in rad/s or mechanism lengths per s. Shape (n,).
        rush: Acceleration scale: the largest acceleration or the square of `speed`, whichever is larger. Shape (n,).
        load: Largest force term [N]; terms may cancel. Shape (n,).
        open: Loop residuals beyond rounding, dimensionless. Shape (n,).
        rushes: Quantity -> acceleration scale that replaces `rush` for a quantity whose accelerations have larger
            terms. (n,).
        stretch: Length of the mechanism divided by the length of the shortest loop, if gains are those of single
            loops; otherwise 1. (n,).
    """

    condition: Array
    gain: Array
    charts: Array
    forces: Mapping[str, Array] = field(default_factory=dict)
    speed: Array | float = 0.0
    rush: Array | float = 0.0
    load: Array | float = 0.0
    open: Array | float = 0.0
    stretch: Array | float = 1.0
    rushes: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def unknown(cls, n: int) -> Trust:
        """Build a `Trust` for n samples of unknown accuracy."""
        return cls(*np.full((3, n), np.nan))

    def doubtful(self, slack: float = 1.0) -> Rows:
        """Find samples for which powers of the gain would overestimate the errors; `slack` scales the thresholds."""
        worst = np.maximum(self.gain, self.charts) / CLEAR
        for condition in self.forces.values():
            worst = np.maximum(worst, condition / CLEAR_FORCES)
        rows: Rows = np.flatnonzero(~(worst <= slack))
        return rows

    def with_rows(self, rows: Rows, other: Trust) -> Trust:
        """Return a copy that takes the data of some samples from a different solution."""

        def merge(mine: Array | float, others: Array | float) -> Array:
            both = mine + np.zeros(len(self.condition))
            both[rows] = others
            return both

        numbers = {
            one.name: merge(getattr(self, one.name), getattr(other, one.name))
            for one in fields(self)
            if one.name not in ("forces", "rushes")
        }
        forces, rushes = (
            {**mine, **others} for mine, others in ((self.forces, other.forces), (self.rushes, other.rushes))
        )
        return Trust(
            **numbers,
            forces={name: merge(self.forces.get(name, 1.0), other.forces.get(name, 1.0)) for name in forces},
            rushes={name: merge(self.rush_of(name), other.rush_of(name)) for name in rushes},
        )

    def rush_of(self, quantity: str) -> Array | float:
        """Return the largest acceleration term of a quantity."""
        return self.rushes.get(quantity, self.rush)

    def of(self, quantity: str) -> Array:
        """Return the largest condition number of the systems solved for a quantity."""
        condition = np.maximum(self.condition, self.forces.get(quantity, 0.0))
        return np.maximum(condition, self.charts) if quantity in OF_JOINTS else condition


def worst_of(some: Mapping[str, Array], others: Mapping[str, Array]) -> dict[str, Array]:
    """Merge tables, quantity -> condition number (n,); take the larger number if both have the quantity."""
    return {**some, **{name: np.maximum(number, some.get(name, 1.0)) for name, number in others.items()}}


@dataclass(frozen=True, slots=True, eq=False)
class SolvedPart:
    """Some samples of a solution with their error data.

    Attributes:
        values: Quantity -> values. Shape (n, m).
        trust: Condition numbers; errors are not estimated if its `gain` is NaN at all samples, as in `Trust.unknown`.
        doubtful: Samples that were solved again.
        moved: Quantity -> largest change in the components when solved again. Shape (n_doubtful, m).
        q: All joint coordinates [rad or m], shape (n, n_q); None if unknown.
    """

    values: dict[str, Array]
    trust: Trust
    doubtful: Rows
    moved: Mapping[str, Array]
    q: Array | None = None


def perturbations(A: Array, k: int) -> list[Array]:
    """Return two perturbations as large as rounding errors, in the most sensitive and in a generic direction.

    Args:
        A: Dimensionless closing system. Its last k rows select y and are exact. Shape (n, m + k, n_unknown).

    Returns:
        Two arrays of changes in the unknowns, each of shape (n, n_unknown).
    """
    inverse = np.linalg.pinv(A, rcond=1e-16)
    worst = np.argmax(np.linalg.norm(inverse, axis=2), axis=1)
    first = np.sign(np.take_along_axis(inverse, worst[:, None, None], axis=1)[:, 0])
    second = np.broadcast_to(np.cos(1.0 + 2.4 * np.arange(A.shape[1])), first.shape)
    noises = [pattern * (ROUNDED * linear.EPS) for pattern in (first, second)]
    for noise in noises:
        noise[:, A.shape[1] - k :] = 0.0
    return [(inverse @ noise[..., None])[..., 0] for noise in noises]


def examine_part(
    values: dict[str, Array],
    trust: Trust,
    A: Array,
    k: int,
    solve_perturbed: Callable[[Rows, Array], dict[str, Array]],
    clock: Clock,
    units: Units,
    length: float,
) -> SolvedPart:
    """Complete a part of a solution: solve doubtful samples again, and reject singular samples.

    Args:
        A, k: As for `perturbations`.
        units, length: As for `vanishing_samples`.
        solve_perturbed: Solves samples with perturbed unknowns: rows, (n_row, n_unknown) -> quantity -> (n_row, m).
        clock: Attributes all time spent here to the stage "error estimate".
    """
    with clock.stage("error estimate"):
        spent = dict(clock.spent)
        doubtful: Rows = np.union1d(trust.doubtful(), vanishing_samples(values, trust, units, length))
        moved = {name: np.zeros((len(doubtful), array.shape[1])) for name, array in values.items()}
        with np.errstate(all="ignore"):  # near a singular pose results may be arbitrary, and are then rejected
            for shake in perturbations(A[doubtful], k) if doubtful.size else ():
                for name, array in solve_perturbed(doubtful, shake).items():
                    away = np.abs(array - values[name][doubtful])
                    moved[name] = np.fmax(moved[name], np.where(np.isfinite(away), away, np.inf))
        clock.spent = spent
        for name, array in values.items():
            # at a chart lock angles are arbitrary but close the loops; only that joint's rates are undefined
            condition = trust.condition if name in OF_JOINTS else trust.of(name)
            bad = ~(condition <= linear.SINGULAR)
            if bad.any():
                values[name] = np.where(bad[:, None], np.nan, array)
    return SolvedPart(values, trust, doubtful, moved)


def vanishing_samples(values: Mapping[str, Array], trust: Trust, units: Units, length: float) -> Rows:
    """Choose samples to solve again for quantities that vanish, in one of their units, relative to their terms.

    If the terms of a value cancel, its error is estimated from these terms, which may be a million times the comparison
    scale. Powers of the gain ignore cancellation and then give estimates that are far too large. One sample represents
    all samples with smaller powers, see `absolute_error`.

    Args:
        values: Quantity -> shape (n, m).
        units: Quantity -> unit of each component.
        length: Length of the mechanism [m].
    """
    again = set[int]()
    for name, array in values.items():
        powers = ROUNDED * linear.EPS * amplification(name, trust) + np.zeros(len(array))
        if not array.size or not (powers > SHARE * QUANTITIES[name].tolerance).any():
            continue
        for _, _, size, _, most in by_unit(name, array, units[name], trust, length):
            if (size <= FLOOR * most).all() and most.max() > 0.0:
                again.add(int(np.argmax(powers * most)))
    return np.array(sorted(again), dtype=np.intp)


def by_unit(
    name: str, array: Array, units: Sequence[str], trust: Trust, length: float
) -> Iterator[tuple[str, list[int], Array, Array, Array]]:
    """Yield each unit of a quantity, the columns that have it, and three magnitudes per sample, in this unit.

    The first is the largest value in this unit. The second adds the magnitude of the terms that sum to these values.
    The third adds these terms to the largest value in any unit. For inertias, the second equals the third.
    """
    whole = np.abs(array / [arm(unit, length) for unit in units]).max(axis=1, initial=0.0)
    for unit in dict.fromkeys(units):
        columns = [i for i, has in enumerate(units) if has == unit]
        size, summands = np.abs(array[:, columns]).max(axis=1, initial=0.0), summand(name, unit, trust)
        most = (whole + summands) * arm(unit, length)
        # masses do not cancel: a coupling inertia is at most the geometric mean of the two coordinates' own inertias
        yield unit, columns, size, most if unit in INERTIA else size + summands * arm(unit, length), most


def error_of(name: str, parts: Sequence[SolvedPart], has: Values, length: float, mass: float) -> Error:
    """Estimate the rounding error of a quantity.

    A value smaller than `FLOOR` times its largest term, or without a correct digit, cannot serve as a scale. If the
    error is within the tolerance of that term, the quantity is zero within rounding, and the term is its scale.

    Args:
        length, mass: Length and mass of the mechanism [m, kg].

    Returns:
        The scaled error of each sample; the scale is at least `FLOOR` times the natural magnitude. The absolute error
        in each unit is the maximum over the samples, limited to the tolerance times the largest term.
    """
    lost, worst, rounding = np.isnan(has.array).any(axis=1), np.zeros(len(has.array)), dict[str, float]()
    natural, numbers = scales_of(length, mass), [np.nan_to_num(x.values[name], posinf=np.inf) for x in parts]
    by_part = [[*by_unit(name, x, has.units, part.trust, length)] for x, part in zip(numbers, parts, strict=True)]
    for each in zip(*by_part, strict=True):
        unit, columns = each[0][:2]
        size, whole = (np.concatenate([one[k] for one in each]) for k in (2, 4))
        most_of_all = float(whole[~lost].max(initial=0.0))
        zero = float(size.max(initial=0.0)) <= FLOOR * most_of_all
        error, most = (
            np.concatenate(
                [absolute_error(name, part, one[k], columns, zero=zero) for part, one in zip(parts, each, strict=True)]
            )
            for k in (3, 4)
        )
        largest, bound = float(most[~lost].max(initial=0.0)), QUANTITIES[name].tolerance * most_of_all
        rounding[unit] = min(bound, largest)
        meant = error < DIGIT * size  # non-finite values do not show the size of the quantity
        scale = float(size[meant].max(initial=0.0))
        if scale <= FLOOR * most_of_all and largest <= bound:
            error, scale = most, most_of_all
        scale = max(scale or float(size.max(initial=0.0)), FLOOR * natural[unit])
        worst = np.maximum(worst, error / scale)
    scaled = np.where(lost | ~(worst < DIGIT), np.inf, worst)
    return Error(scaled, rounding, np.concatenate([part.trust.of(name) for part in parts]))


def absolute_error(name: str, part: SolvedPart, local: Array, columns: Sequence[int], *, zero: bool = False) -> Array:
    """Return the largest estimated error of the given components, in their unit.

    Args:
        local: Magnitude of the components' terms. Shape (n,).
        zero: True if the components vanish relative to these terms. The largest error of the samples solved again then
            limits the errors of samples with smaller powers.

    Returns:
        Shape (n,).
    """
    trust, again = part.trust, part.doubtful
    with np.errstate(over="ignore", invalid="ignore"):
        powers = by_powers(name, trust) * local
        error = np.array(powers)
        error[again] = ROUNDED * linear.EPS * trust.of(name)[again] * local[again]
        error[again] += SAFETY * part.moved[name][:, columns].max(axis=1)
        if zero and len(again):
            smaller = powers <= powers[again].max()
            error[smaller] = np.minimum(error[smaller], error[again].max())
        if name != "joint_position":  # without a correct digit in the partial rates, the value has no correct digit
            error[~(ROUNDED * linear.EPS * trust.stretch * trust.gain**2 < DIGIT)] = np.inf
    return np.asarray(error)


def by_powers(name: str, trust: Trust) -> Scalar:
    """Return the error of a well-conditioned sample relative to its largest term."""
    return (ROUNDED * linear.EPS + trust.open) * amplification(name, trust)


def amplification(name: str, trust: Trust) -> Scalar:
    """Return the factor by which rounding errors grow in a well-conditioned sample."""
    g = apply("max", trust.gain, 1.0)
    if name in OF_JOINTS:
        g = apply("max", g, trust.charts)
    power = g
    for _ in range(_POWER[QUANTITIES[name].needs] - 1):
        power = power * g
    return apply("max", trust.stretch * power, trust.forces.get(name, 1.0))


def summand(name: str, unit: str, trust: Trust) -> Scalar:
    """Return the magnitude of a component's terms in rad, N or mechanism lengths."""
    if unit in ("rad", "m") or unit in RATIOS:
        return 1.0
    if unit in INERTIA:
        return 0.0
    if unit in ("rad/s", "m/s"):
        return trust.speed
    return trust.rush_of(name) if unit.endswith("s^2") else trust.load
