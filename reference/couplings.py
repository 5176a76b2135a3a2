"""Couplings: joint coordinates that are polynomials of others, as in gears, screws and mimic joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Coupling:
    """A joint coordinate that is a polynomial of another one, ``q = p(q')``.

    Attributes:
        coordinate: The joint coordinate that is coupled.
        of: The one that it is a polynomial of; empty where it is held at a constant.
        polynomial: Coefficients, lowest first [rad or m, over powers of rad or m]. Shape (m,), one without `of`.
    """

    name: str
    coordinate: str
    of: str
    polynomial: Array
    where: str = ""

    def __post_init__(self) -> None:
        where = self.where or self.name
        if not np.isfinite(self.polynomial).all():
            raise DescriptionError("the polynomial is not finite", where, "give finite numbers")
        if self.of and not self.polynomial[1:].any():
            what = f"'{self.coordinate}' does not depend on '{self.of}'"
            raise DescriptionError(what, where, "give coefficients of its powers, or leave 'of' out")
        if not self.of and len(self.polynomial) != 1:
            what = f"a polynomial of {len(self.polynomial)} coefficients, and no coordinate that it is one of"
            raise DescriptionError(what, where, "name that one: of = ..., or give one number")
        if self.of == self.coordinate:
            raise DescriptionError(f"couples '{self.of}' to itself", where, "name two coordinates")
        self.polynomial.setflags(write=False)

    def derivative(self, order: int) -> Array:
        """Coefficients of a derivative of the polynomial, lowest first; none where it is zero."""
        coefficients = self.polynomial.astype(float)
        for _ in range(order):  # numpy's polyder takes five times as long, in every evaluation of a motion
            coefficients = coefficients[1:] * np.arange(1, len(coefficients))
        return coefficients


@dataclass(frozen=True, slots=True, eq=False)
class Fixing(Coupling):
    """The coupling that holds the hinge of a fixed joint, by the name of the joint."""


@dataclass(frozen=True, slots=True, eq=False)
class CouplingRows:
    """Couplings as equations in some vector of n_q coordinates, one row each.

    Attributes:
        pairs: Column of each coupled coordinate, and of the one that it depends on, None where it is held.
    """

    couplings: tuple[Coupling, ...]
    pairs: tuple[tuple[int, int | None], ...]

    def __len__(self) -> int:
        return len(self.couplings)

    @property
    def columns(self) -> list[int]:
        """Columns of the coupled coordinates, one a row."""
        return [column for column, _ in self.pairs]

    def derivatives(self, q: NDArray[Any], order: int) -> list[tuple[int, int | None, Any]]:
        """Columns i and j of each coupling ``q_i = p(q_j)``, and a derivative of p at q_j.

        Args:
            q: Coordinates, any numbers. Shape (..., n_q).
        """
        entries = []
        for coupling, (i, j) in zip(self.couplings, self.pairs, strict=True):
            value: Any = 0.0
            for coefficient in coupling.derivative(order)[::-1].tolist():  # Horner
                value = coefficient if j is None else value * q[..., j] + coefficient
            entries.append((i, j, value))
        return entries

    def residuals(self, q: Array) -> Array:
        """``q_i - p(q_j)`` [rad or m]. Shape (n, n_q) -> (n, m)."""
        out = q[:, self.columns]
        for row, (_, _, value) in enumerate(self.derivatives(q, 0)):
            out[:, row] -= value
        return out

    def matrix(self, q: Array) -> Array:
        """Derivative of the residuals, 1 at i and -p' at j. Shape (n, n_q) -> (n, m, n_q)."""
        out = np.zeros((len(q), len(self), q.shape[1]), dtype=q.dtype)
        for row, (i, j, slope) in enumerate(self.derivatives(q, 1)):
            out[:, row, i] = 1.0
            if j is not None:
                out[:, row, j] = -slope
        return out

    def bias(self, q: Array, v: Array) -> Array:
        """Second derivative of the residuals where coordinates have none, ``-p'' v_j^2``. (n, n_q) twice -> (n, m)."""
        out = np.zeros((len(q), len(self)), dtype=q.dtype)
        for row, (_, j, curvature) in enumerate(self.derivatives(q, 2)):
            if j is not None:
                out[:, row] = -curvature * v[:, j] ** 2
        return out


def bind(couplings: Sequence[Coupling], coordinates: Sequence[str]) -> CouplingRows:
    """The equations of couplings in the vector of some coordinates, which has all that they name."""
    place = {name: i for i, name in enumerate(coordinates)}
    pairs = tuple((place[one.coordinate], place[one.of] if one.of else None) for one in couplings)
    return CouplingRows(tuple(couplings), pairs)


def component_name(coupling: Coupling) -> str:
    """Name of the component of ``reaction`` by which a coupling acts along its coordinate: of a fixed joint ``mz``."""
    return f"{coupling.name}.{'mz' if isinstance(coupling, Fixing) else 'coupling'}"


def check_couplings(couplings: Sequence[Coupling], coordinates: Sequence[str]) -> None:
    """Refuses couplings of coordinates that do not exist, two of one coordinate, and circles.

    Raises:
        UnknownNameError: There is no such coordinate.
        DescriptionError: One coordinate is coupled twice, or depends on itself.
    """
    above: dict[str, str] = {}
    for coupling in couplings:
        for name in filter(None, (coupling.coordinate, coupling.of)):
            if name not in coordinates:
                raise UnknownNameError("coordinate", name, coordinates, coupling.where)
        if coupling.coordinate in above:
            what = f"'{coupling.coordinate}' is coupled twice"
            raise DescriptionError(what, coupling.where, "couple it once")
        above[coupling.coordinate] = coupling.of
    for coupling in couplings:
        name, passed = coupling.of, {coupling.coordinate}
        while name in above and name not in passed:
            passed.add(name)
            name = above[name]
        if name in passed:
            what = f"'{name}' depends on itself, over the couplings of {', '.join(sorted(passed))}"
            raise DescriptionError(what, coupling.where, "leave one of them out")
