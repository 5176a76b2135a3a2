"""Reduction of engines' answers to plain data, which consist only of numbers and strings.

Engines of other packages may return anything. `plain_answer` returns plain data that can be compared, judged and shown
without further checks, so that a bad answer affects only its own row.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple
from typing import Any

import numpy as np

from screwgauge.engines.registry import Engine, EngineModel
from screwgauge.reference.rotations import Array
from screwgauge.solution import Cost, Error, Failure, Solution, Timing, Values

TRACE = 20_000  # largest number of characters of a traceback
LONG, SHORT, MOST = 2000, 200, 100  # largest length of a note and of a name; largest number of notes and of timings


def plain_answer(answer: object, n: int) -> Solution:
    """Check an answer with n samples and reduce it to plain data; truncate long strings, and mark them as truncated.

    Raises:
        TypeError, ValueError: The answer is malformed; the message names the fault.
    """
    if not isinstance(answer, Solution):
        raise TypeError(f"the answer is of type {type(answer).__name__}, not Solution")
    values = {name: _values(name, one, n) for name, one in _items("values", answer.values)}
    shapes = {name: one.array.shape for name, one in values.items()}
    return Solution(
        engine=truncate(answer.engine, SHORT),
        version=truncate(answer.version, SHORT),
        values=values,
        condition=_sizes("condition", answer.condition, n),
        timings=tuple(map(_timing, _limited_list("timings", answer.timings))),
        notes=_texts("notes", answer.notes),
        errors={name: _error(name, one, n, shapes.get(name, ())) for name, one in _items("errors", answer.errors)},
        assembly=None if answer.assembly is None else _numbers("assembly", answer.assembly, (n, None)),
        rows=None if answer.rows is None else _rows(answer.rows, n),
        setting=truncate(answer.setting, LONG),
        work=None if answer.work is None else _numbers("work", answer.work, (n,)),
        stopped=truncate(answer.stopped, LONG),
        cost=None if answer.cost is None else _cost(answer.cost),
        warnings=_texts("warnings", answer.warnings),
        lacks={name: truncate(why, LONG) for name, why in _items("lacks", answer.lacks)},
    )


def plain_failure(failed: Failure) -> Failure:
    """Truncate the strings of a failure to the lengths that this package allows."""
    limits = {"engine": SHORT, "reason": 2 * LONG, "traceback": TRACE}
    return Failure(**{name: truncate(getattr(failed, name), most) for name, most in limits.items()})


def truncate(text: object, most: int) -> str:
    """Truncate a string to `most` characters, and append the number of removed characters.

    Raises:
        TypeError: The value is not a string.
    """
    if not isinstance(text, str):
        raise TypeError(f"a string is expected, not {type(text).__name__}")
    return str(text) if len(text) <= most else f"{text[:most]}... ({len(text) - most} more characters)"


def _texts(what: str, texts: object) -> tuple[str, ...]:
    some = _limited_list(what, texts)
    return tuple(truncate(text, LONG) for text in some)


def _limited_list(what: str, items: object) -> list[Any]:
    """Return the items of a tuple or list; reject more than `MOST` items."""
    if not isinstance(items, (tuple, list)):
        raise TypeError(f"the {what} are of type {type(items).__name__}, not tuple")
    if len(items) > MOST:
        raise ValueError(f"{len(items)} {what}, more than {MOST}")
    return list(items)


def _items(what: str, table: object) -> Iterator[tuple[str, Any]]:
    """Yield the entries of a mapping; reject keys that cannot be names of quantities."""
    if not isinstance(table, Mapping):
        raise TypeError(f"the {what} are of type {type(table).__name__}, not a mapping")
    for name, value in table.items():
        if not isinstance(name, str) or len(name) > SHORT:
            raise ValueError(f"the {what} contain '{name!s:.100}', which is not a quantity")
        yield name, value


def _values(name: str, values: object, n: int) -> Values:
    if not isinstance(values, Values):
        raise TypeError(f"{name} is of type {type(values).__name__}, not Values")
    array = _numbers(name, values.array, (None, None))
    if len(array) != n:
        raise ValueError(f"{name} has {len(array)} samples, not one for each of {n} times")
    components, units = (_names(name, texts) for texts in (values.components, values.units))
    if len({*components}) < len(components):
        raise ValueError(f"two components of {name} have the same name")
    return Values(components, units, array)


def _names(what: str, texts: Iterable[object]) -> tuple[str, ...]:
    return tuple(truncate(text, SHORT) for text in texts)


def _numbers(what: str, array: object, shape: tuple[int | None, ...]) -> Array:
    """Check that an array contains real numbers and has a given shape, in which None stands for any length."""
    if type(array) is not np.ndarray:  # e.g. a masked array, in which some numbers are invalid
        raise TypeError(f"{what} is of type {type(array).__name__}, not an array of numbers")
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{what} is an array of {array.dtype.name}, not of real numbers")
    if array.ndim != len(shape) or any(m not in (None, k) for m, k in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("any" if m is None else str(m) for m in shape)
        raise ValueError(f"{what} has shape {array.shape}, not ({wanted})")
    return array if array.dtype == np.float64 else array.astype(float)


def _sizes(what: str, array: object, n: int) -> Array:
    """Check that an array contains a non-negative number or NaN for each sample."""
    sizes = _numbers(what, array, (n,))
    if (sizes < 0.0).any():
        raise ValueError(f"{what} has negative numbers")
    return sizes


def _size(what: str, number: Any) -> float:
    """Convert a number to float; reject NaN and negative numbers."""
    if not (size := float(number)) >= 0.0:
        raise ValueError(f"{what} must be a non-negative number, not {size}")
    return size


def _error(name: str, error: object, n: int, shape: tuple[int, ...]) -> Error:
    """Check the error estimate of a quantity. `shape`: shape of the quantity's values."""
    if not isinstance(error, Error):
        raise TypeError(f"the error of {name} is of type {type(error).__name__}, not Error")
    radius, condition, what = error.radius, error.condition, f"of {name}"
    return Error(
        scaled=_sizes(f"error {what}", error.scaled, n),
        absolute={unit: _size(f"error {what}", size) for unit, size in _items(f"error {what}", error.absolute)},
        condition=None if condition is None else _sizes(f"condition {what}", condition, n),
        source=truncate(error.source, SHORT),
        radius=None if radius is None else _numbers(f"radius {what}", radius, shape),
    )


def _rows(rows: object, n: int) -> Any:
    """Check that an array contains ascending indices of samples."""
    if type(rows) is not np.ndarray or rows.dtype.kind not in "iu" or rows.ndim != 1:
        raise TypeError("rows is not an array of indices")
    if len(rows) and not (rows[0] >= 0 and rows[-1] < n and (np.diff(rows.astype(np.int64)) > 0).all()):
        raise ValueError(f"rows are not ascending indices of {n} samples")
    return rows.astype(np.intp)


def _timing(timing: object) -> Timing:
    if not isinstance(timing, Timing):
        raise TypeError(f"a timing is of type {type(timing).__name__}, not Timing")
    engine, setting, stage, n, least, median, covers = astuple(timing)
    engine, setting, stage, covers = (truncate(text, LONG) for text in (engine, setting, stage, covers))
    return Timing(engine, setting, stage, int(n), float(least), float(median), covers)


def _cost(cost: object) -> Cost:
    if not isinstance(cost, Cost):
        raise TypeError(f"the cost is of type {type(cost).__name__}, not Cost")
    return Cost(float(cost.wall_s), float(cost.cpu_s), int(cost.steps), int(cost.evaluations))


def declared_lacks(model: EngineModel, engine: Engine | None) -> dict[str, str]:
    """Return quantity -> reason, for quantities that an engine or its loaded model declares it does not compute."""
    lacks = {**(engine.lacks if engine else {}), **dict(_items("lacks", getattr(model, "lacks", {})))}
    return {name: truncate(why, LONG) for name, why in lacks.items()}
