"""Numbers, units and tables as text for people."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

MAX_DIGITS = 17.0
Row = dict[str, Any]


def rows(frame: pd.DataFrame) -> list[Row]:
    """The rows of a table as dictionaries, column -> value."""
    return [{str(key): value for key, value in row.items()} for row in frame.to_dict("records")]


def digits(scaled: float) -> float:
    """Digits of agreement of a scaled error: 17 at most, 0 at least, NaN for NaN."""
    if not np.isfinite(scaled):
        return float("nan")
    if scaled <= 0.0:
        return MAX_DIGITS
    return float(np.clip(-np.log10(scaled), 0.0, MAX_DIGITS))


def missing(value: Any) -> bool:
    """Whether a table's cell is empty: None or not a number."""
    return value is None or (isinstance(value, (float, np.floating)) and bool(np.isnan(value)))


def number(value: Any, figures: int = 6) -> str:
    """A number with so many significant figures, without trailing zeros: ``1.25``, ``1e-11``."""
    if value is None:
        return ""
    if not np.isfinite(value):
        return "NaN" if np.isnan(value) else ("inf" if value > 0 else "-inf")
    if value and not 1e-4 <= abs(value) < 1e6:
        mantissa, exponent = f"{value:.{figures - 1}e}".split("e")
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        return f"{mantissa}e{int(exponent)}"
    mantissa, e, exponent = f"{value:.{figures}g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if e else mantissa


def size(value: Any) -> str:
    """The size of an error, two figures: ``3.1e-13``; ``0`` if there is none."""
    if missing(value):
        return "NaN"
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.1e}".split("e") if np.isfinite(value) else ("inf", "0")
    return f"{mantissa}e{int(exponent)}" if np.isfinite(value) else "inf"


def unit_text(unit: str) -> str:
    """``m/s^2`` -> ``m/s²``, ``N m`` -> ``N·m``."""
    return unit.replace("^2", "²").replace("^3", "³").replace(" ", "·")


def tick(ok: Any) -> str:
    """Words beside the sign, so that nothing rests on colour or font."""
    return "✓ ok" if bool(ok) else "✗ no"


def file_name(title: str) -> str:
    """A title as a file name: lower case, words joined by hyphens."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def listed(words: Iterable[str]) -> str:
    """``a, b and c``."""
    items = list(words)
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}" if items else ""


def cell(value: Any) -> str:
    """Text for one cell of a Markdown table."""
    text = " ".join(str(value).split())
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("|", "\\|")


def markdown_table(head: Sequence[str], body: Iterable[Sequence[Any]], right: Iterable[int] = ()) -> str:
    """A Markdown table; `right` are the columns of numbers."""
    ends = set(right)
    rule = ["---:" if i in ends else "---" for i in range(len(head))]
    lines = [head, rule, *([cell(value) for value in row] for row in body)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def text_table(head: Sequence[str], body: Sequence[Sequence[str]], right: Iterable[int] = ()) -> list[str]:
    """Aligned lines for a terminal."""
    ends = set(right)
    widths = [max(len(row[i]) for row in [head, *body]) for i in range(len(head))]

    def line(row: Sequence[str]) -> str:
        parts = [
            text.rjust(w) if i in ends else text.ljust(w) for i, (text, w) in enumerate(zip(row, widths, strict=True))
        ]
        return "  ".join(parts).rstrip()

    return [line(row) for row in [head, *body]]
