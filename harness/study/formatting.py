"""Formatting of numbers, units and names for people."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from screwgauge.quantities import digits

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]


def rows(frame: pd.DataFrame) -> list[Row]:
    """Return the rows of a table as dictionaries, column -> value."""
    columns = {str(name): frame[name].tolist() for name in frame}  # four times as fast as pandas' records
    return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]


def group_rows(table: Iterable[Row], *keys: str) -> dict[tuple[Any, ...], list[Row]]:
    """Group rows by the values of keys, in order of appearance."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in table:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return groups


def is_empty(value: Any) -> bool:
    """Return True for an empty cell of a table: None or NaN."""
    return value is None or (isinstance(value, (float, np.floating)) and bool(np.isnan(value)))


def number(value: Any, figures: int = 6) -> str:
    """Format a number with given significant figures and no trailing zeros: ``1.25``, ``1e-11``; empty for None."""
    if value is None:
        return ""
    if not np.isfinite(value):
        return "NaN" if np.isnan(value) else f"{float(value)}"
    scientific = value and not 1e-4 <= abs(value) < 1e6
    mantissa, e, exponent = (f"{value:.{figures - 1}e}" if scientific else f"{value:.{figures}g}").partition("e")
    if not e:
        return mantissa
    return f"{mantissa.rstrip('0').rstrip('.') if '.' in mantissa else mantissa}e{int(exponent)}"


def size(value: Any) -> str:
    """Format the size of an error with two figures: ``3.1e-13``, ``12``; ``0`` for zero."""
    if is_empty(value):
        return "NaN"
    if value == 0 or not np.isfinite(value):
        return "0" if value == 0 else "inf"
    mantissa, exponent = f"{value:.1e}".split("e")
    if not 0 <= int(exponent) < 3:
        return f"{mantissa}e{int(exponent)}"
    return f"{float(f'{value:.1e}'):.{1 if abs(value) < 9.95 else 0}f}"


def digits_text(scaled: float) -> str:
    """Format the number of correct digits for a scaled error, to one decimal place; ``NaN`` for NaN."""
    value = digits(scaled)
    return "NaN" if np.isnan(value) else f"{value:.1f}"


def error_ratio(error: float, tolerance: float) -> float:
    """Return an error as a multiple of its tolerance; infinite if the error is NaN or the tolerance zero."""
    return error / tolerance if tolerance > 0.0 and not is_empty(error) else float("inf")


def duration(seconds: float) -> str:
    """Format a duration: ``12.3 µs``; empty if not measured."""
    if is_empty(seconds):
        return ""
    scales = (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9))
    unit, scale = next((pair for pair in scales if seconds >= 0.9995 * pair[1]), scales[-1])
    return f"{seconds / scale:.3g} {unit}"


def moment(date: str) -> str:
    """Format an ISO 8601 date as ``2026-11-26 08:17:33 UTC``; return other strings unchanged."""
    return re.sub(r"^(\d{4}-\d\d-\d\d)T(\d\d:\d\d:\d\d).*(Z|[+]00:00)$", r"\1 \2 UTC", date)


def span(low: str, high: str) -> str:
    """Format a range: ``1 to 3``, or one value if both are equal."""
    return low if low == high else f"{low} to {high}"


def vector(values: Iterable[float]) -> str:
    """Format a vector: ``(0, 0, -9.81)``."""
    return "(" + ", ".join(map(number, values)) + ")"


def unit_text(unit: str) -> str:
    """Format a unit: ``m/s^2`` -> ``m/s²``, ``N m`` -> ``N·m``."""
    return unit.replace("^2", "²").replace("^3", "³").replace(" ", "·").replace(",·", ", ")


def words(name: str) -> str:
    """Replace underscores with spaces: ``loop_closure`` -> ``loop closure``."""
    return name.replace("_", " ")


def tick(ok: Any) -> str:
    """Return a mark and a word for a status, legible without colours or special fonts."""
    return "✓ ok" if bool(ok) else "✗ no"


def file_name(title: str) -> str:
    """Convert a title to a lower-case, hyphenated file name that is short enough for any file system."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower())[:60].strip("-") or "figure"


def free_name(name: str, taken: Collection[str]) -> str:
    """Append a number to a name if it is taken."""
    names = (name, *(f"{name}-{k}" for k in range(2, len(taken) + 3)))
    return next(one for one in names if one not in taken)


def join_all(names: Iterable[str]) -> str:
    """Join names: ``a, b and c``."""
    items = list(names)
    return f"{', '.join(items[:-1])} and {items[-1]}" if len(items) > 1 else "".join(items)


#: Column of a table -> formatter; other columns are shown unchanged.
FORMS: dict[str, Callable[[Any], str]] = {
    **dict.fromkeys(("max_abs", "rms", "max_scaled", "rms_scaled", "max_difference", "error", "size"), size),
    **dict.fromkeys(("time_s", "seconds_per_sample", "cpu", "wall"), duration),
    **dict.fromkeys(("min_s", "median_s", "cpu_s", "severity", "three"), partial(number, figures=3)),
    "as_digits": lambda scaled: digits_text(scaled).replace("NaN", "no number"),
    "names": lambda names: ", ".join(names) or "nothing",
    "percent": lambda share: f"{number(100.0 * share, 3)} %",
    "words": words,
    "tolerance": partial(number, figures=2),
    **dict.fromkeys(("expected", "number"), number),
    **dict.fromkeys(("fitted", "four"), partial(number, figures=4)),
    "unit": unit_text,
    "date": moment,
    "residual": words,
    "ok": tick,
}
