"""Error estimates: the trustworthy accuracy of each quantity of an engine at each sample.

Poses close to rounding, eps in each closing equation. That moves the unknowns by up to g eps, g being the norm of the
inverse of the closing system, without dimension; the rates, which are solved with a matrix at that pose, by g^2 eps;
the accelerations, in which those rates stand, by g^3 eps. Measured along b -> 0.3568 rad of the 3-UPS-UPU-S, distance
1e-1 to 1e-12: projected engines lose exactly that, and their forces what of the accelerations is inertia. As powers
of g overstate what a mechanism with heavy loads and slow motion loses, badly conditioned samples are not
extrapolated but solved again: the pose is moved as rounding may have moved it, once in the worst direction, once in
a general one, and what comes out is compared. Well-conditioned samples cost nothing; for them the powers are used.
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

#: Norms of the inverse above which a sample is solved again instead of extrapolated; force systems, being larger,
#: have condition numbers of a thousand where nothing is wrong.
CLEAR, CLEAR_FORCES = 30.0, 1e4
#: Worst case over the two poses that are tried.
SAFETY = 4.0
#: Share of the tolerance from which powers of the gain say too much of what is zero.
SHARE = 0.01

Units = Mapping[str, Sequence[str]]
"""Quantity -> unit of each component."""

_POWER = {"q": 1, "v": 2, "a": 3, "f": 3}  # of g, by what a quantity needs
#: Quantities that rest on accelerations.
ACCELERATED = tuple(name for name, quantity in QUANTITIES.items() if quantity.needs in "af")


@dataclass(frozen=True, slots=True, eq=False)
class Trust:
    """Condition numbers and sizes from which the errors of some samples are estimated.

    Attributes:
        condition: Condition number of the closing system. Shape (n,).
        gain: Norm of its inverse, without dimension: of the worst loop in its own length, or of all of them at once in
            that of the mechanism, see `stretch`. Shape (n,).
        charts: Condition number of the charts of cut joints, 1 at best; only joint coordinates suffer. (n,).
        forces: Quantity -> condition number of the system that its forces were solved from. Shape (n,).
        speed, rush: Largest rate, in rad/s or lengths of the mechanism per s, and largest acceleration, or square of
            that rate. Shape (n,).
        load: Largest force [N], whose parts may cancel. Shape (n,).
        open: Openings of the loops beyond rounding, without dimension. Shape (n,).
        rushes: Quantity -> what stands in the place of `rush` for it, where its accelerations are sums of more. (n,).
        stretch: What rounding of one closing equation is to the shortest loop over what it is to the mechanism, where
            gains are those of loops. (n,).
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
        """Build a `Trust` for n samples without any information."""
        return cls(*np.full((3, n), np.nan))

    def doubtful(self, slack: float = 1.0) -> Rows:
        """Find samples whose errors powers of the gain would overestimate; `slack` scales these numbers."""
        worst = np.maximum(self.gain, self.charts) / CLEAR
        for condition in self.forces.values():
            worst = np.maximum(worst, condition / CLEAR_FORCES)
        rows: Rows = np.flatnonzero(~(worst <= slack))
        return rows

    def with_rows(self, rows: Rows, other: Trust) -> Trust:
        """Replace some samples by those of another solution."""

        def merged(mine: Array | float, others: Array | float) -> Array:
            both = mine + np.zeros(len(self.condition))
            both[rows] = others
            return both

        numbers = {
            one.name: merged(getattr(self, one.name), getattr(other, one.name))
            for one in fields(self)
            if one.name not in ("forces", "rushes")
        }
        forces, rushes = (
            {**mine, **others} for mine, others in ((self.forces, other.forces), (self.rushes, other.rushes))
        )
        return Trust(
            **numbers,
            forces={name: merged(self.forces.get(name, 1.0), other.forces.get(name, 1.0)) for name in forces},
            rushes={name: merged(self.rush_of(name), other.rush_of(name)) for name in rushes},
        )

    def rush_of(self, quantity: str) -> Array | float:
        """Largest summand of the accelerations of a quantity."""
        return self.rushes.get(quantity, self.rush)

    def of(self, quantity: str) -> Array:
        """Condition number of the systems that a quantity was solved from."""
        condition = np.maximum(self.condition, self.forces.get(quantity, 0.0))
        return np.maximum(condition, self.charts) if quantity in OF_JOINTS else condition


def worst_of(some: Mapping[str, Array], others: Mapping[str, Array]) -> dict[str, Array]:
    """Merge condition numbers of quantities by their maximum. Shape (n,) each."""
    return {**some, **{name: np.maximum(number, some.get(name, 1.0)) for name, number in others.items()}}


@dataclass(frozen=True, slots=True, eq=False)
class SolvedPart:
    """Some samples of a solution with their error data: quantity -> (n, m).

    Attributes:
        doubtful: Samples that were solved again.
        moved: Quantity -> how far their components moved. Shape (n_doubtful, m).
    """

    values: dict[str, Array]
    trust: Trust
    doubtful: Rows
    moved: Mapping[str, Array]


def shakes(A: Array, k: int) -> list[Array]:
    """Perturbations of the unknowns by rounding: in the most sensitive direction and in a general one.

    Args:
        A: Closing system without dimension, its last k rows picking y, which is exact. Shape (n, m + k, n_unknown).

    Returns:
        Two arrays of shape (n, n_unknown).
    """
    inverse = np.linalg.pinv(A, rcond=1e-16)
    worst = np.argmax(np.linalg.norm(inverse, axis=2), axis=1)
    first = np.sign(np.take_along_axis(inverse, worst[:, None, None], axis=1)[:, 0])
    second = np.broadcast_to(np.cos(1.0 + 2.4 * np.arange(A.shape[1])), first.shape)
    noises = [pattern * (ROUNDED * linear.EPS) for pattern in (first, second)]
    for noise in noises:
        noise[:, A.shape[1] - k :] = 0.0
    return [(inverse @ noise[..., None])[..., 0] for noise in noises]


def examined(
    values: dict[str, Array],
    trust: Trust,
    A: Array,
    k: int,
    again: Callable[[Rows, Array], dict[str, Array]],
    clock: Clock,
    units: Units,
    length: float,
) -> SolvedPart:
    """Complete a part of a solution: solve doubtful samples again, and refuse singular ones.

    Args:
        A, k: As for `shakes`.
        units, length: As for `vanishing`.
        again: Solves samples with unknowns moved by a shake: rows, (n_row, n_unknown) -> quantity -> (n_row, m).
        clock: All that is done counts as the stage "error estimate".
    """
    with clock.stage("error estimate"):
        spent = dict(clock.spent)
        doubtful: Rows = np.union1d(trust.doubtful(), vanishing(values, trust, units, length))
        moved = {name: np.zeros((len(doubtful), array.shape[1])) for name, array in values.items()}
        with np.errstate(all="ignore"):  # next to a singular pose anything may come out, and is then refused
            for shake in shakes(A[doubtful], k) if doubtful.size else ():
                for name, array in again(doubtful, shake).items():
                    away = np.abs(array - values[name][doubtful])
                    moved[name] = np.fmax(moved[name], np.where(np.isfinite(away), away, np.inf))
        clock.spent = spent
        for name, array in values.items():
            # at a chart lock angles are arbitrary, but they close the loops; rates of that joint alone are none
            condition = trust.condition if name in OF_JOINTS else trust.of(name)
            bad = ~(condition <= linear.SINGULAR)
            if bad.any():
                values[name] = np.where(bad[:, None], np.nan, array)
    return SolvedPart(values, trust, doubtful, moved)


def vanishing(values: Mapping[str, Array], trust: Trust, units: Units, length: float) -> Rows:
    """Choose samples to solve again for all those at which a unit of a quantity vanishes beside its summands.

    What cancels is measured by its summands, which may be a million times the measure of the comparison; powers of the
    gain, which know nothing of what cancels, would then admit far too much. One sample stands for all that have smaller
    powers, see `absolute`.

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
    """Yield each unit of a quantity with its columns and the size of its numbers at each sample.

    First alone, then with their summands, then with those that are numbers of another unit, of which they are made.
    """
    whole = np.abs(array / [arm(unit, length) for unit in units]).max(axis=1, initial=0.0)
    for unit in dict.fromkeys(units):
        columns = [i for i, has in enumerate(units) if has == unit]
        size, summands = np.abs(array[:, columns]).max(axis=1, initial=0.0), summand(name, unit, trust)
        most = (whole + summands) * arm(unit, length)
        # masses do not cancel: what couples two coordinates is as large as the roots of their own inertia at the most
        yield unit, columns, size, most if unit in INERTIA else size + summands * arm(unit, length), most


def error_of(name: str, parts: Sequence[SolvedPart], has: Values, length: float, mass: float) -> Error:
    """Estimate the rounding error of a quantity.

    What is less than `FLOOR` of its largest summand, or has not one digit, is no measure: if the error is within the
    tolerance of that summand, the quantity is zero within rounding, and the summand measures it.

    Args:
        length, mass: Length and mass of the mechanism [m, kg].

    Returns:
        The magnitude that scales it is at least `FLOOR` of the natural one, as in a scaled error. By unit the absolute
        error is the largest at any sample, at most the tolerance of the largest summand.
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
                [absolute(name, part, one[k], columns, zero=zero) for part, one in zip(parts, each, strict=True)]
            )
            for k in (3, 4)
        )
        largest, bound = float(most[~lost].max(initial=0.0)), QUANTITIES[name].tolerance * most_of_all
        rounding[unit] = min(bound, largest)
        meant = error < DIGIT * size  # other numbers say nothing about the size of the quantity
        scale = float(size[meant].max(initial=0.0))
        if scale <= FLOOR * most_of_all and largest <= bound:
            error, scale = most, most_of_all
        scale = max(scale or float(size.max(initial=0.0)), FLOOR * natural[unit])
        worst = np.maximum(worst, error / scale)
    scaled = np.where(lost | ~(worst < DIGIT), np.inf, worst)
    return Error(scaled, rounding, np.concatenate([part.trust.of(name) for part in parts]))


def absolute(name: str, part: SolvedPart, local: Array, columns: Sequence[int], *, zero: bool = False) -> Array:
    """Estimated error of the worst of some components, in their unit.

    Args:
        local: Size of their summands. Shape (n,).
        zero: Whether they are zero against these: samples with smaller powers than those that were solved again are
            then off by no more than these.

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
        if name != "joint_position":  # what stands on partial rates without a digit has none either
            error[~(ROUNDED * linear.EPS * trust.stretch * trust.gain**2 < DIGIT)] = np.inf
    return np.asarray(error)


def by_powers(name: str, trust: Trust) -> Scalar:
    """Error of a well-conditioned sample relative to its largest summand."""
    return (ROUNDED * linear.EPS + trust.open) * amplification(name, trust)


def amplification(name: str, trust: Trust) -> Scalar:
    """Amplification of rounding in a well-conditioned sample."""
    g = apply("max", trust.gain, 1.0)
    if name in OF_JOINTS:
        g = apply("max", g, trust.charts)
    power = g
    for _ in range(_POWER[QUANTITIES[name].needs] - 1):
        power = power * g
    return apply("max", trust.stretch * power, trust.forces.get(name, 1.0))


def summand(name: str, unit: str, trust: Trust) -> Scalar:
    """Size of a component's summands: in rad, N or lengths of the mechanism."""
    if unit in ("rad", "m") or unit in RATIOS:
        return 1.0
    if unit in INERTIA:
        return 0.0
    if unit in ("rad/s", "m/s"):
        return trust.speed
    return trust.rush_of(name) if unit.endswith("s^2") else trust.load
