"""An engine's answer as plain data: arrays of real numbers of the right shapes, short texts. All else is refused.

Engines of other packages return what they like. What gets past here can be compared, judged and told without another
look, so that a bad answer costs its own row only.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple
from typing import Any

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.solution import Cost, Solution, Timing, Values, empty

LONG, SHORT, MOST = 2000, 200, 100  # characters of a note, of a name; notes, timings


def sound(answer: object, n: int) -> Solution:
    """An answer for n samples, made of nothing but numbers and texts; long texts are cut, which is said there.

    Raises:
        TypeError, ValueError: It is no such answer; the message says what of it is wrong.
    """
    if not isinstance(answer, Solution):
        raise TypeError(f"its answer is of type {type(answer).__name__}, not a Solution")
    values = {name: _values(name, found, n) for name, found in _items("values", answer.values)}
    shapes = {name: found.array.shape for name, found in values.items()}
    estimate, conditions = (_over_time(what, getattr(answer, what), n) for what in ("estimate", "conditions"))
    return Solution(
        engine=shortened(answer.engine, SHORT),
        version=shortened(answer.version, SHORT),
        values=values,
        condition=_sizes("condition", answer.condition, n),
        timings=tuple(map(_timing, _some("timings", answer.timings))),
        notes=_texts("notes", answer.notes),
        tolerances={name: _floats("tolerances", by_unit) for name, by_unit in _items("tolerances", answer.tolerances)},
        stated=_floats("stated", answer.stated),
        radius={x: _numbers(f"radius of {x}", r, shapes.get(x, ())) for x, r in _items("radius", answer.radius)},
        estimate=estimate,
        conditions={name: empty(n) for name in estimate} | conditions,  # not known of those without
        assembly=None if answer.assembly is None else _numbers("assembly", answer.assembly, (n, None)),
        rows=None if answer.rows is None else _rows(answer.rows, n),
        setting=shortened(answer.setting, LONG),
        work=None if answer.work is None else _numbers("work", answer.work, (n,)),
        stopped=shortened(answer.stopped, LONG),
        cost=None if answer.cost is None else _cost(answer.cost),
        warnings=_texts("warnings", answer.warnings),
        otherwise=_texts("otherwise", answer.otherwise),
    )


def shortened(text: object, most: int) -> str:
    """A text of at most so many characters, and what was cut off.

    Raises:
        TypeError: It is no text.
    """
    if not isinstance(text, str):
        raise TypeError(f"a text is of type {type(text).__name__}")
    return str(text) if len(text) <= most else f"{text[:most]}... ({len(text) - most} more characters)"


def _texts(what: str, texts: object) -> tuple[str, ...]:
    some = _some(what, texts)
    return tuple(shortened(text, LONG) for text in some)


def _some(what: str, items: object) -> list[Any]:
    """A tuple or list, not more of it than anybody reads."""
    if not isinstance(items, (tuple, list)):
        raise TypeError(f"its {what} are of type {type(items).__name__}, not a tuple")
    if len(items) > MOST:
        raise ValueError(f"{len(items)} {what}, more than {MOST}")
    return list(items)


def _items(what: str, found: object) -> Iterator[tuple[str, Any]]:
    """What an answer says of each quantity."""
    if not isinstance(found, Mapping):
        raise TypeError(f"its {what} are of type {type(found).__name__}, not a mapping")
    for name, value in found.items():
        if not isinstance(name, str) or len(name) > SHORT:
            raise ValueError(f"its {what} have '{name!s:.100}', which is no quantity")
        yield name, value


def _values(name: str, found: object, n: int) -> Values:
    if not isinstance(found, Values):
        raise TypeError(f"its {name} is of type {type(found).__name__}, not Values")
    array = _numbers(name, found.array, (None, None))
    if len(array) != n:
        raise ValueError(f"{len(array)} samples of {name} for {n} times")
    components, units = (_names(name, texts) for texts in (found.components, found.units))
    if len({*components}) < len(components):
        raise ValueError(f"two components of its {name} have one name")
    return Values(components, units, array)


def _names(what: str, texts: Iterable[object]) -> tuple[str, ...]:
    return tuple(shortened(text, SHORT) for text in texts)


def _numbers(what: str, array: object, shape: tuple[int | None, ...]) -> Array:
    """An array of doubles; of a shape, as far as that says something."""
    if type(array) is not np.ndarray:  # of a masked one, say, some numbers do not count
        raise TypeError(f"its {what} is of type {type(array).__name__}, not an array of numbers")
    if array.dtype.kind not in "fiu":
        raise TypeError(f"its {what} is an array of {array.dtype.name}, not of real numbers")
    if array.ndim != len(shape) or any(m not in (None, k) for m, k in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("any" if m is None else str(m) for m in shape)
        raise ValueError(f"its {what} has shape {array.shape}, not ({wanted})")
    return array if array.dtype == np.float64 else array.astype(float)


def _sizes(what: str, array: object, n: int) -> Array:
    """A number for each sample that is not negative, or none."""
    found = _numbers(what, array, (n,))
    if (found < 0.0).any():
        raise ValueError(f"its {what} has negative numbers")
    return found


def _over_time(what: str, found: object, n: int) -> dict[str, Array]:
    return {name: _sizes(f"{what} of {name}", array, n) for name, array in _items(what, found)}


def _floats(what: str, found: object) -> dict[str, float]:
    if not isinstance(found, Mapping):
        raise TypeError(f"its {what} are of type {type(found).__name__}, not a mapping")
    return {shortened(name, SHORT): float(value) for name, value in found.items()}


def _rows(rows: object, n: int) -> Any:
    """Indices of samples, ascending."""
    if type(rows) is not np.ndarray or rows.dtype.kind not in "iu" or rows.ndim != 1:
        raise TypeError("its rows are not an array of indices")
    if len(rows) and not (rows[0] >= 0 and rows[-1] < n and (np.diff(rows.astype(np.int64)) > 0).all()):
        raise ValueError(f"its rows are not ascending indices of {n} samples")
    return rows.astype(np.intp)


def _timing(timing: object) -> Timing:
    if not isinstance(timing, Timing):
        raise TypeError(f"a timing is of type {type(timing).__name__}")
    engine, setting, stage, n, least, median, covers = astuple(timing)
    engine, setting, stage, covers = (shortened(text, LONG) for text in (engine, setting, stage, covers))
    return Timing(engine, setting, stage, int(n), float(least), float(median), covers)


def _cost(cost: object) -> Cost:
    if not isinstance(cost, Cost):
        raise TypeError(f"its cost is of type {type(cost).__name__}")
    return Cost(float(cost.wall_s), float(cost.cpu_s), int(cost.steps), int(cost.evaluations))
