"""Couplings: joint coordinates that are sums of polynomials of other coordinates (gears, screws, differentials)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial, polynomial
from numpy.typing import NDArray

from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class PolynomialSum:
    """A function of coordinates, ``p0 + sum_k p_k(q_k)``.

    Attributes:
        constant: p0 [rad or m].
        terms: Coordinate -> coefficients of its powers, starting with the first [rad or m per power of rad or m].
    """

    constant: float
    terms: Mapping[str, Array]

    def __post_init__(self) -> None:
        for coefficients in self.terms.values():
            coefficients.setflags(write=False)

    @staticmethod
    def of(polynomials: Mapping[str, Array]) -> PolynomialSum:
        """Build the sum of polynomials, lowest coefficient first; the key "" stands for a constant."""
        constants = [float(p[0]) for p in polynomials.values()]
        terms = {name: np.array(p[1:], dtype=float) for name, p in polynomials.items() if name}
        return PolynomialSum(sum(constants[1:], constants[0]), terms)

    @property
    def polynomials(self) -> dict[str, Array]:
        """Polynomials whose sum is the function, lowest coefficient first; the first one includes the constant."""
        if not self.terms:
            return {"": np.array([self.constant])}
        constants = [self.constant, *[0.0] * (len(self.terms) - 1)]
        return {name: np.array([c, *p]) for c, (name, p) in zip(constants, self.terms.items(), strict=True)}

    @property
    def lead(self) -> str:
        """Name of the first coordinate of the function; empty if the function is constant."""
        return next(iter(self.terms), "")

    @property
    def polynomial(self) -> Array:
        """Coefficients of a function of at most one coordinate, lowest first."""
        (polynomial,) = self.polynomials.values()
        return polynomial

    @property
    def linear(self) -> bool:
        return not any(p[1:].any() for p in self.terms.values())

    @property
    def slopes(self) -> dict[str, float]:
        """Coordinate -> coefficient of its first power."""
        return {name: float(p[0]) for name, p in self.terms.items()}

    @property
    def trimmed(self) -> PolynomialSum:
        """The function without trailing zero coefficients and without coordinates whose coefficients are all zero."""
        powers = {name: np.trim_zeros(p, "b") for name, p in self.terms.items()}
        return PolynomialSum(self.constant, {name: p for name, p in powers.items() if len(p)})

    def __call__(self, q: Mapping[str, float]) -> float:
        """Evaluate the function at coordinates [rad or m]."""
        return self.constant + sum(float(Polynomial([0.0, *p])(q[name])) for name, p in self.terms.items())

    def times(self, factor: float) -> PolynomialSum:
        return PolynomialSum(factor * self.constant, {name: factor * p for name, p in self.terms.items()})

    def plus(self, constant: float) -> PolynomialSum:
        return PolynomialSum(self.constant + constant, self.terms)

    def minus(self, other: PolynomialSum) -> PolynomialSum:
        terms = {name: -p for name, p in other.terms.items()}
        for name, p in self.terms.items():
            terms[name] = np.asarray(polynomial.polysub(p, other.terms.get(name, np.zeros(1))), dtype=float)
        return PolynomialSum(self.constant - other.constant, terms)

    def rename(self, names: Mapping[str, str]) -> PolynomialSum:
        """Rename the coordinates; names missing from `names` are kept."""
        return PolynomialSum(self.constant, {names.get(name, name): p for name, p in self.terms.items()})

    def at(self, values: Mapping[str, float]) -> PolynomialSum:
        """Substitute values [rad or m] for the given coordinates."""
        held = PolynomialSum(self.constant, {name: p for name, p in self.terms.items() if name in values})
        return PolynomialSum(held(values), {name: p for name, p in self.terms.items() if name not in values})

    def change_variables(self, zeros: Mapping[str, float], factors: Mapping[str, float]) -> PolynomialSum:
        """Substitute ``q = zero + factor x``; zero and factor default to 0 and 1."""
        terms = dict[str, Array]()
        constant = self.constant
        for name, p in self.terms.items():
            inner = Polynomial([zeros.get(name, 0.0), factors.get(name, 1.0)])
            counted = Polynomial([0.0, *p])(inner).coef if name in zeros or name in factors else np.array([0.0, *p])
            constant, terms[name] = constant + float(counted[0]), np.array(counted[1:], dtype=float)
        return PolynomialSum(constant, terms)

    def is_linear_in(self, name: str) -> bool:
        """Return True if the function can be solved for a coordinate."""
        p = self.terms.get(name, np.zeros(1))
        return bool(p[0]) and not p[1:].any()

    def solve(self, coordinate: str, lead: str) -> PolynomialSum:
        """Solve for `lead`, in which the function is linear; `coordinate` names the value of the function."""
        rest = {name: -p for name, p in self.terms.items() if name != lead}
        return PolynomialSum(-self.constant, {coordinate: np.ones(1), **rest}).times(1.0 / float(self.terms[lead][0]))

    def paired_coefficients(self, other: PolynomialSum) -> tuple[Array, Array]:
        """Return the coefficients of two functions of the same coordinates, padded to equal length, see `fill`."""
        names, both = list(self.terms), (self, other)
        size = max((len(p) for function in both for p in function.terms.values()), default=0)
        rows = ([np.pad(each.terms[name], (0, size - len(each.terms[name]))) for name in names] for each in both)
        first, second = (np.concatenate([[each.constant], *row]) for each, row in zip(both, rows, strict=True))
        return first, second

    def fill(self, coefficients: Array) -> PolynomialSum:
        """Replace the coefficients: `coefficients` has the constant, then equally many powers of each coordinate."""
        powers = np.split(coefficients[1:], len(self.terms)) if self.terms else []
        return PolynomialSum(float(coefficients[0]), dict(zip(self.terms, powers, strict=True)))

    def equals(self, other: PolynomialSum) -> bool:
        return {*self.terms} == {*other.terms} and np.array_equal(*self.paired_coefficients(other))


@dataclass(frozen=True, slots=True, eq=False)
class Coupling:
    """A joint coordinate that is a sum of polynomials of other coordinates, ``q = p0 + sum_k p_k(q_k)``.

    Attributes:
        coordinate: Name of the dependent joint coordinate.
        function: Right-hand side; constant for a fixed coordinate.
        fixing: True for the coupling that locks the hinge of the fixed joint with the same name.
    """

    name: str
    coordinate: str
    function: PolynomialSum
    where: str = ""
    fixing: bool = False

    def __post_init__(self) -> None:
        where, function = self.where or self.name, self.function
        if not np.isfinite([function.constant, *(x for p in function.terms.values() for x in p)]).all():
            raise DescriptionError("a coefficient is not finite", where, "use finite numbers")
        for name, coefficients in function.terms.items():
            if not coefficients.any():
                what = f"'{self.coordinate}' does not depend on '{name}'"
                raise DescriptionError(what, where, "use a nonzero coefficient, or remove the term")
        if self.coordinate in function.terms:
            raise DescriptionError(f"couples '{self.coordinate}' to itself", where, "choose other coordinates")

    def solve_for(self, coordinate: str) -> Coupling:
        """Solve the coupling for a given coordinate; return it unchanged if it is not linear in that coordinate."""
        if not self.function.is_linear_in(coordinate):
            return self
        return Coupling(self.name, coordinate, self.function.solve(self.coordinate, coordinate), self.where)

    @property
    def named(self) -> tuple[str, ...]:
        """Names of all coupled coordinates; the dependent coordinate comes first."""
        return self.coordinate, *self.function.terms


@dataclass(frozen=True, slots=True, eq=False)
class CouplingRows:
    """Couplings as equations in a vector of n_q coordinates, one row per coupling.

    Attributes:
        columns: Columns of the dependent coordinates, one per row.
        leads: Columns of the coordinates on which each row depends, with their polynomials, lowest coefficient first.
            The first polynomial includes the constant; for a fixed coordinate, the constant has column None.
    """

    columns: list[int]
    leads: tuple[tuple[tuple[int | None, Array], ...], ...]

    def __len__(self) -> int:
        return len(self.columns)

    def derivatives(self, q: NDArray[Any], order: int) -> list[tuple[int, list[tuple[int | None, Any]]]]:
        """Return column i of each coupling ``q_i = sum_k p_k(q_k)``, and each column k with a derivative of p_k at q.

        Args:
            q: Coordinates of any scalar type. Shape (..., n_q).
            order: Order of the derivative.
        """
        return [
            (i, [(k, _derivative(p, order, None if k is None else q[..., k])) for k, p in terms])
            for i, terms in zip(self.columns, self.leads, strict=True)
        ]

    def residuals(self, q: Array) -> Array:
        """Return ``q_i - sum_k p_k(q_k)`` [rad or m]. Shape (n, n_q) -> (n, m)."""
        out = q[:, self.columns]
        for row, (_, terms) in enumerate(self.derivatives(q, 0)):
            for _, value in terms:
                out[:, row] -= value
        return out

    def matrix(self, q: Array) -> Array:
        """Return the derivative of the residuals: 1 at i and -p_k' at each k. Shape (n, n_q) -> (n, m, n_q)."""
        out = np.zeros((len(q), len(self), q.shape[1]), dtype=q.dtype)
        for row, (i, terms) in enumerate(self.derivatives(q, 1)):
            out[:, row, i] = 1.0
            for k, slope in terms:
                if k is not None:
                    out[:, row, k] = -slope
        return out

    def bias(self, q: Array, v: Array) -> Array:
        """Return the second derivative of the residuals at zero coordinate accelerations, ``-sum_k p_k'' v_k^2``.

        Shapes (n, n_q), (n, n_q) -> (n, m).
        """
        out = np.zeros((len(q), len(self)), dtype=q.dtype)
        for row, (_, terms) in enumerate(self.derivatives(q, 2)):
            for k, curvature in terms:
                if k is not None:
                    out[:, row] -= curvature * v[:, k] ** 2
        return out


def _derivative(polynomial: Array, order: int, x: Any) -> Any:
    """Evaluate a derivative of a polynomial, lowest coefficient first, at x; x is None for a constant."""
    coefficients, value = polynomial, 0.0
    for _ in range(order):  # numpy's polyder is five times slower, and this runs at every evaluation of a motion
        coefficients = coefficients[1:] * np.arange(1, len(coefficients))
    for coefficient in coefficients[::-1].tolist():  # Horner's scheme
        value = coefficient if x is None else value * x + coefficient
    return value


def bind(couplings: Sequence[Coupling], coordinates: Sequence[str]) -> CouplingRows:
    """Build the equations of couplings for a vector of coordinates, which must include all coupled coordinates."""
    place = {name: i for i, name in enumerate(coordinates)}
    leads = [[(place.get(name), p) for name, p in one.function.polynomials.items()] for one in couplings]
    return CouplingRows([place[one.coordinate] for one in couplings], tuple(map(tuple, leads)))


def component_name(coupling: Coupling) -> str:
    """Return the name of a coupling's ``reaction`` component; it ends in ``mz`` for a fixed joint."""
    return f"{coupling.name}.{'mz' if coupling.fixing else 'coupling'}"


def check_couplings(couplings: Sequence[Coupling], coordinates: Sequence[str]) -> None:
    """Reject couplings of unknown coordinates, repeated couplings of a coordinate, and cycles.

    Raises:
        UnknownNameError: A coordinate does not exist.
        DescriptionError: A coordinate is coupled twice or depends on itself.
    """
    above: dict[str, Collection[str]] = {}
    for coupling in couplings:
        for name in coupling.named:
            if name not in coordinates:
                raise UnknownNameError("coordinate", name, coordinates, coupling.where)
        if coupling.coordinate in above:
            what = f"'{coupling.coordinate}' is coupled twice"
            raise DescriptionError(what, coupling.where, "couple it once")
        above[coupling.coordinate] = coupling.function.terms
    for coupling in couplings:
        if around := find_cycle(coupling.coordinate, above):
            what = f"'{coupling.coordinate}' depends on itself through the couplings of {', '.join(sorted(around))}"
            raise DescriptionError(what, coupling.where, "remove one of these couplings")


def find_cycle(coordinate: str, above: Mapping[str, Collection[str]]) -> tuple[str, ...]:
    """Find the cycle of coupled coordinates through which a coordinate depends on itself; return () if it does not.

    Args:
        above: Coupled coordinate -> coordinates on which it depends.
    """
    ways, passed = list[tuple[str, ...]]([(coordinate,)]), set[str]()
    while ways:
        way = ways.pop()
        for name in above[way[-1]]:
            if name == coordinate:
                return way
            if name in above and name not in passed:
                passed.add(name)
                ways.append((*way, name))
    return ()
