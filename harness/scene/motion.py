"""Motions of the independent coordinates: sums of harmonics, polynomials, or samples from a CSV file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.problem import GivenMotion
from screwgauge.reference.description import check_keys, required
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.expressions import number, vector
from screwgauge.reference.files import beside, check_count
from screwgauge.reference.rotations import Array
from screwgauge.scene.columns import read_columns

_STILL = 1e-9  # what does not move as far as this rests [rad, m, or per s]


@dataclass(frozen=True, slots=True, eq=False)
class Analytic:
    """A motion of polynomials and harmonics.

    Attributes:
        terms: For each coordinate: coefficients, lowest first, shape (m,), and rows [omega, cos, sin], shape (k, 3).
        where: What to blame.
    """

    terms: tuple[tuple[Array, Array], ...]
    where: str

    def __call__(self, t: Array) -> GivenMotion:
        """The motion at times [s]. Shape (n,)."""
        y, yd, ydd = (np.empty((len(t), len(self.terms))) for _ in range(3))
        with np.errstate(over="ignore", invalid="ignore"):
            for k, (coefficients, harmonics) in enumerate(self.terms):
                for x in (y, yd, ydd):
                    x[:, k] = _polynomial(coefficients, t)
                    coefficients = coefficients[1:] * np.arange(1.0, len(coefficients))
                for omega, c, s in harmonics:
                    cos, sin = np.cos(omega * t), np.sin(omega * t)
                    y[:, k] += c * cos + s * sin
                    yd[:, k] += omega * (s * cos - c * sin)
                    ydd[:, k] -= omega**2 * (c * cos + s * sin)
        finite = np.isfinite(np.concatenate([y, yd, ydd], axis=1)).all(axis=1)
        if not finite.all():
            late = t[np.argmin(finite)]
            raise DescriptionError(
                f"grows beyond all numbers at t = {late:g} s", self.where, "shorten or slow the motion"
            )
        return GivenMotion(t, y, yd, ydd, self)


def _polynomial(coefficients: Array, t: Array) -> Array | float:
    """A polynomial by Horner's scheme, lowest coefficient first. Shapes (m,), (n,) -> (n,)."""
    value: Array | float = 0.0
    for c in coefficients[::-1].tolist():
        value = value * t + c
    return value


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """The motion of a CSV file, at its own times only."""

    file: Path
    samples: GivenMotion

    def __call__(self, t: Array) -> GivenMotion:
        """The motion at times of the file [s]. Shape (n,)."""
        rows = np.searchsorted(self.samples.t, t).clip(max=len(self.samples) - 1)
        wrong = np.flatnonzero(self.samples.t[rows] != t)
        if wrong.size:
            raise DescriptionError(
                f"has no sample at t = {t[wrong[0]]:g} s",
                str(self.file),
                "ask for times of the file; none are interpolated",
            )
        return self.samples.part(rows)

    def doubts(self, labels: Sequence[str]) -> tuple[str, ...]:
        """A sentence on every column that is half of what it or its integral (trapezoidal rule) moves away from being
        the derivative of another one, as in other units, with another sign, or sampled too coarsely to tell.
        """
        y, yd, ydd = (x.T for x in (self.samples.y, self.samples.yd, self.samples.ydd))
        said, h = [], np.diff(self.samples.t)
        for label, x, xd, order in [*zip(labels, y, yd, repeat("")), *zip(labels, yd, ydd, repeat("d"))]:
            with np.errstate(all="ignore"):
                integral = np.append(0.0, np.cumsum(h * (xd[1:] + xd[:-1]) / 2.0))
                moved, apart = np.abs(x - x[0]).max(), np.abs(x - x[0] - integral).max()
            if not apart <= max(moved / 2.0, np.abs(integral).max() / 2.0, _STILL):
                said.append(
                    f"{self.file.name}: {label}d{order} is no derivative of {label}{order} (its integral is up to "
                    f"{apart:.3g} off, {label}{order} moves by {moved:.3g}; check units, signs and step)"
                )
        return tuple(said)


Drive = Analytic | Sampled
"""A given motion as a function of time."""


def read_drive(table: Any, labels: list[str], folder: Path, where: str) -> tuple[Drive, Array | None]:
    """Reads ``[motion]``.

    Args:
        labels: Labels of the independent coordinates, in order.
        folder: Where a CSV file is looked for.

    Returns:
        The motion as a function of time, and the times of a CSV file, if it is one.

    Raises:
        DescriptionError: It cannot be read.
    """
    if isinstance(table, dict) and "csv" in table:
        check_keys(table, {"csv"}, where)
        if not isinstance(table["csv"], str):
            raise DescriptionError(f"{table['csv']!r} is not a file name", f"{where}.csv", "write it in quotes")
        return _sampled(beside(folder, table["csv"]), labels)
    check_keys(table, labels, where)
    terms = (read_terms(required(table, label, where), f"{where}.{label}") for label in labels)
    return Analytic(tuple(terms), where), None


def read_terms(table: Any, where: str) -> tuple[Array, Array]:
    """Polynomial coefficients, lowest first, shape (m,), and harmonics [omega, cos, sin], shape (k, 3)."""
    check_keys(table, {"offset", "harmonics", "polynomial"}, where)
    raw = table.get("polynomial", [0])
    if not isinstance(raw, list) or not raw:
        raise DescriptionError("is not a list of coefficients", f"{where}.polynomial", "write [c0, c1, ...]")
    check_count(len(raw), "coefficients", f"{where}.polynomial")
    polynomial = vector(raw, f"{where}.polynomial", len(raw))
    polynomial[0] += number(table.get("offset", 0), f"{where}.offset")
    harmonics = table.get("harmonics", [])
    if not isinstance(harmonics, list):
        raise DescriptionError("is not a list", f"{where}.harmonics", "write [[omega, cos, sin], ...]")
    check_count(len(harmonics), "harmonics", f"{where}.harmonics")
    rows = [vector(row, f"{where}.harmonics") for row in harmonics]
    return polynomial, np.array(rows).reshape(-1, 3)


def _sampled(path: Path, labels: list[str]) -> tuple[Drive, Array]:
    """A CSV file with the columns t, and for each coordinate a its value a, rate ad and second derivative add."""
    wanted = ["t", *(f"{label}{order}" for label in labels for order in ("", "d", "dd"))]
    if len(set(wanted)) < len(wanted):
        what = f"columns {', '.join(wanted)} share a name"
        raise DescriptionError(what, str(path), "label the independent coordinates otherwise")
    columns = read_columns(path, wanted, "derivatives are required")
    t = columns["t"]
    if not len(t):
        raise DescriptionError("has no samples", str(path), "write at least one row below the header")
    if (np.diff(t) <= 0).any():
        raise DescriptionError("the times do not increase", str(path), "sort the rows by t")
    arrays = [np.stack([columns[f"{label}{order}"] for label in labels], axis=1) for order in ("", "d", "dd")]
    return Sampled(path, GivenMotion(t, arrays[0], arrays[1], arrays[2])), t
