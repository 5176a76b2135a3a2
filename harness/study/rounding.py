"""Estimates of rounding errors in answers: from the number type of an engine, and along idle coordinates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial

from screwgauge.engines.rounding import idle_errors, rounding_errors
from screwgauge.problem import Problem
from screwgauge.quantities import FLOAT64, number_type
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.solution import Solution


def with_rounding(mechanism: Mechanism, problem: Problem, answers: Mapping[str, Solution]) -> dict[str, Solution]:
    """Replace the error estimates of engines whose number type is not float64 with estimates for that type."""
    rounding = cache(partial(rounding_errors, mechanism, problem))
    idle = cache(partial(idle_errors, mechanism, problem))

    def estimate(answer: Solution) -> Solution:
        if (kind := number_type(answer.engine)) is FLOAT64:
            return _with_idle(answer, idle) if answer.errors else answer
        try:
            errors = rounding(kind)
        except ScrewgaugeError as error:
            note = f"the rounding error of {kind.name} is unknown: {error}"
            return replace(answer, errors={}, notes=(*answer.notes, note))
        return replace(answer, errors={name: one for name, one in errors.items() if name in answer.values})

    return {name: estimate(answer) for name, answer in answers.items()}


def _with_idle(answer: Solution, idle: Callable[[], Mapping[str, Mapping[str, float]]]) -> Solution:
    """Increase error estimates to at least the rounding error in accelerations of idle coordinates."""
    errors = dict(answer.errors)
    for name in {*errors} & {*idle()}:
        own = errors[name].absolute
        most = {unit: max(size, own.get(unit, 0.0)) for unit, size in idle()[name].items()}
        errors[name] = replace(errors[name], absolute={**own, **most})
    return replace(answer, errors=errors)
