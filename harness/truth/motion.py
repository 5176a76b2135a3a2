"""The independent coordinates as power series in time, from the text of a scene or from doubles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flint import arb

from screwgauge.problem import GivenMotion
from screwgauge.truth.exact import number, vector
from screwgauge.truth.jets import Jet, sin_cos

Terms = Sequence[tuple[list[arb], list[list[arb]]]]
"""For each coordinate the polynomial, lowest coefficient first, and the harmonics [omega, cos, sin]."""


def read_terms(tables: Mapping[str, Any], labels: Sequence[str]) -> Terms:
    """Reads ``[motion.LABEL]`` tables, already checked, without rounding their numbers."""
    terms = []
    for label in labels:
        table = tables[label]
        polynomial = vector(table.get("polynomial", [0]))
        polynomial[0] += number(table.get("offset", 0))
        terms.append((polynomial, [vector(row) for row in table.get("harmonics", [])]))
    return terms


def drive(terms: Terms, t: float) -> list[Jet]:
    """Series ``[y, y', y''/2]`` of each coordinate at a time, a double taken exactly."""
    return [_one(polynomial, harmonics, arb(t)) for polynomial, harmonics in terms]


def _one(polynomial: list[arb], harmonics: list[list[arb]], t: arb) -> Jet:
    y = [arb(0), arb(0), arb(0)]
    for coefficient in reversed(polynomial):  # Horner on the series t + 1 dt
        y = [y[0] * t + coefficient, y[1] * t + y[0], y[2] * t + y[1]]
    for omega, c, s in harmonics:
        sin, cos = sin_cos([omega * t, omega, arb(0)])
        y = [y[k] + c * cos[k] + s * sin[k] for k in range(3)]
    return y


def samples(motion: GivenMotion, i: int) -> list[Jet]:
    """Series of each coordinate at one sample whose doubles are taken exactly."""
    columns = zip(motion.y[i].tolist(), motion.yd[i].tolist(), motion.ydd[i].tolist(), strict=True)
    return [[arb(y), arb(yd), arb(ydd) / 2] for y, yd, ydd in columns]
