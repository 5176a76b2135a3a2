"""Whether an answer is whole: every quantity that was asked for, at every sample, for every component."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

from screwgauge.engines.registry import engine_names, get_engine
from screwgauge.problem import Problem
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.errors import ModelFileError
from screwgauge.solution import Solution

Expected = Mapping[str, tuple[str, ...]]
"""Quantity -> component names that an answer must have."""


class LeftOutError(Exception):
    """An answer without all that was asked for."""


def left_out(engine: str, wanted: Collection[str], answer: Solution) -> tuple[str, ...]:
    """Quantities that an engine was asked for and does not give, other than those that its entry excepts."""
    return tuple(q for q in QUANTITIES if q in wanted and q not in answer.values and q not in _lacks(engine))


def without(quantities: Iterable[str]) -> str:
    """What is said of an answer that has no such quantities."""
    return f"gives no {', '.join(quantities)}, though asked for"


def excepted(engine: str, wanted: Collection[str]) -> Iterator[str]:
    """What the entry of an engine says of quantities that were asked for and that it cannot give."""
    return (f"gives no {name}: {why}" for name, why in _lacks(engine).items() if name in wanted)


def _lacks(engine: str) -> Mapping[str, str]:
    """What an entry excepts; nothing of a method that has no entry, such as the paper's scheme."""
    return get_engine(engine).lacks if engine in engine_names() else {}


def check_whole(engine: str, problem: Problem, answer: Solution) -> Solution:
    """The answer, if it has all that was asked for.

    Raises:
        LeftOutError: It has not.
    """
    if lost := left_out(engine, problem.wanted, answer):
        raise LeftOutError(without(lost))
    return answer


def check_components(answer: Solution, n: int, expected: Expected) -> None:
    """Refuses an answer with other samples or components than the description has."""
    for quantity, values in answer.values.items():
        if len(values.array) != n:
            raise ValueError(f"{len(values.array)} samples of {quantity} for {n} times")
        odd = [name for name in {*values.components} ^ {*expected.get(quantity, values.components)} if name]
        if odd:
            raise ModelFileError(
                f"its {quantity} and that of the description differ in '{min(odd)}'",
                f"model of {answer.engine}",
                "describe the same joints, bodies and actuators in the model, its loops file and the description",
            )


def check_units(answer: Solution, units: Mapping[str, Mapping[str, str]], coordinates: int) -> None:
    """Refuses an answer in other units than those of the description, or with an assembly of another mechanism.

    Args:
        units: Quantity -> component -> unit.
        coordinates: Of all joints.
    """
    for quantity in {*answer.values} & {*units}:
        found = answer.values[quantity]
        for name, unit in zip(found.components, found.units, strict=True):
            if unit != (wanted := units[quantity].get(name, unit)):
                raise ValueError(f"its {quantity} has {name} in '{unit}', not '{wanted}'")
    if answer.assembly is not None and answer.assembly.shape[1] != coordinates:
        raise ValueError(f"its assembly has {answer.assembly.shape[1]} coordinates, not {coordinates}")
