"""Model check: do the libraries read from the model files what the description says?

Before any motion is compared, so that a difference of engines is never one of models.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

from screwgauge.models.comparison import CheckRow, Comparison, compare_loops, compare_readings
from screwgauge.models.expected import expected_reading
from screwgauge.models.generate import stem
from screwgauge.models.layout import CUTS
from screwgauge.models.loops import loops_of, read_loops
from screwgauge.models.readings.read import read
from screwgauge.reference.applied import GRAVITY
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array

#: Reader -> suffix of the model file that it reads. The loops file is read by our own reader.
SUFFIXES = {"loops": ".loops.toml", "yourdfpy": ".urdf", "pinocchio": ".urdf", "mujoco": ".xml"}


def installed_readers() -> tuple[str, ...]:
    """Readers whose library is installed."""
    return tuple(name for name in SUFFIXES if name == "loops" or find_spec(name))


def check_models(
    mechanism: Mechanism,
    folder: Path,
    *,
    readers: Iterable[str] | None = None,
    gravity: Sequence[float] | Array = GRAVITY,
) -> list[CheckRow]:
    """Compares all model files of a mechanism with its description.

    Args:
        folder: Where the files of `write_models` lie.
        readers: Some of `SUFFIXES`; by default those whose library is installed.
        gravity: What the MJCF should say [m/s^2]. Shape (3,).

    Raises:
        UnknownNameError: There is no such reader.
    """
    rows = []
    for cut in CUTS:
        for reader in installed_readers() if readers is None else readers:
            if reader not in SUFFIXES:
                raise UnknownNameError("reader", reader, SUFFIXES)
            path = folder / f"{stem(mechanism.name, cut)}{SUFFIXES[reader]}"
            rows += check_file(mechanism, cut, path, reader, gravity=gravity)
    return rows


def check_file(
    mechanism: Mechanism, cut: str, path: Path, reader: str, *, gravity: Sequence[float] | Array = GRAVITY
) -> list[CheckRow]:
    """Compares one model file, as one library reads it, with the description.

    A file that cannot be read, or a library that is missing, is a row with the reason.
    """
    out = Comparison(path.name, reader)
    home = dict(zip(mechanism.coordinates, map(float, mechanism.home), strict=True))
    try:
        if reader == "loops":
            compare_loops(out, loops_of(mechanism, cut), read_loops(path), mechanism)
        else:
            compare_readings(out, expected_reading(mechanism, cut, gravity), read(path, reader, home=home), mechanism)
    except Exception as error:  # libraries raise what they like about a file
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return [CheckRow(path.name, reader, "", "file", "can be read", reason, math.nan, 0.0, False)]
    return out.rows


def check_table(rows: Sequence[CheckRow]) -> str:
    """One line for each file, reading and property, the worst item named; then every row that is not ok."""
    groups: dict[tuple[str, str, str], list[CheckRow]] = {}
    for row in rows:
        groups.setdefault((row.file, row.reading, row.what), []).append(row)
    lines = [("file", "reading", "property", "items", "worst", "at", "tolerance", "")]
    for (file, reading, what), group in groups.items():
        numbers = [row for row in group if not math.isnan(row.difference)]
        worst = max(numbers, key=lambda row: row.difference, default=None)
        figures = (f"{worst.difference:.1e}", worst.item, f"{worst.tolerance:.0e}") if worst else ("", "", "")
        verdict = "ok" if all(row.ok for row in group) else "DIFFERS"
        lines.append((file, reading, what, str(len(group)), *figures, verdict))
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    text = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines]
    text += [
        f"{row.file} as read by {row.reading}: {row.what} of {row.item or 'the model'}: "
        f"expected {row.expected}, found {row.found}"
        for row in rows
        if not row.ok
    ]
    return "\n".join(text) + "\n"
