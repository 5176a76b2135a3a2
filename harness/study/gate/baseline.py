"""Baselines: JSON files with the errors, versions and hashes of a check; later checks must be at least as accurate."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

from screwgauge.environment import environment, json_text
from screwgauge.judging.residual import Residual
from screwgauge.quantities import SOLVED, digits
from screwgauge.reference.errors import DescriptionError, OutputError, quote
from screwgauge.reference.files import read_json
from screwgauge.reference.outputs import check_place, force_hint, replace_file
from screwgauge.study.gate.items import GateRow
from screwgauge.study.store import is_record

#: Version of the format of a baseline.
SCHEMA = 1
#: Type of tables of versions, hashes and packages.
TEXTS = Mapping[str, str]
#: Remedy for a missing baseline.
UPDATE = "create one with --update"
#: Factor by which an error must exceed its known value to be reported: one digit. Known values below NOISE, a hundredth
#: of the tolerance of solved quantities, are raised to it, because rounding differs between machines.
GROWN, NOISE = 10.0, 0.01 * SOLVED


@dataclass(frozen=True, slots=True)
class Against:
    """Comparison of a check with a baseline.

    Attributes:
        changed: Sentences on changed engines, models and versions.
        worse, improved: Sentences on errors that grew or shrank, with the digits lost or gained.
        notes: Sentences on rows that are only in the check or only in the baseline.
    """

    file: str
    changed: Sequence[str] = ()
    worse: Sequence[str] = ()
    improved: Sequence[str] = ()
    notes: Sequence[str] = ()


def state(rows: Iterable[GateRow], smoke: bool) -> dict[str, Any]:
    """Return the content of a baseline for the given rows, without run times."""
    record = environment()
    return {
        "schema": SCHEMA,
        "smoke": smoke,
        "environment": {"platform": record["platform"], "cpu": record["cpu"], **record["packages"]},
        "scenes": {
            row.scene: {
                "versions": dict(row.versions),
                "files": dict(row.files),
                "errors": {one.key: one.error for one in row.errors},
            }
            for row in rows
        },
    }


def write_baseline(file: Path, rows: Sequence[GateRow], smoke: bool, *, force: bool = False) -> None:
    """Write the given rows as the new baseline.

    Raises:
        OutputError: A row has no numbers, or the file cannot be written or is not a baseline; it stays unchanged.
    """
    check_baseline(file, force=force)
    if broken := [row.scene for row in rows if row.status in ("failed", "refused")]:
        what = f"cannot be written, because {', '.join(broken)} cannot be checked"
        raise OutputError(what, str(file), "fix that first, or omit --update")
    replace_file(file, json_text(state(rows, smoke)))


def compare_baseline(file: Path, rows: Sequence[GateRow], smoke: bool) -> Against:
    """Compare rows with a baseline.

    Raises:
        DescriptionError: The file is missing, is not a baseline, or was made with a different schema, different scenes
            or options.
    """
    known = read_baseline(file, smoke, [row.scene for row in rows])
    before, now = known["scenes"], state(rows, smoke)
    changed = [*_changes("", known["environment"], now["environment"])]
    worse, improved, notes = list[str](), list[str](), list[str]()
    for row in rows:
        if row.scene not in before:
            notes.append(f"{row.scene} is not in the baseline (--update adds it)")
            continue
        then = before[row.scene]
        for key in ("versions", "files"):
            changed += _changes(f"{row.scene}: ", then[key], now["scenes"][row.scene][key])
        for one in row.errors:
            if one.key not in then["errors"]:
                notes.append(f"{row.scene}: {one.key} is not in the baseline")
            elif sentence := _compare_error(row.scene, one, then["errors"][one.key]):
                (worse if sentence[0] else improved).append(sentence[1])
        lost = then["errors"].keys() - {one.key for one in row.errors}
        worse += [f"{row.scene}: {key} is no longer compared" for key in sorted(lost)]
    notes += [f"{name} is in the baseline but was not checked" for name in before if name not in now["scenes"]]
    return Against(str(file), list(dict.fromkeys(changed)), worse, improved, notes)


def check_baseline(file: Path, *, force: bool = False) -> None:
    """Refuse to overwrite a file that is not a baseline.

    Raises:
        OutputError: The file is not a baseline.
    """
    check_place(file)
    if not os.path.lexists(file) or force:
        return
    try:
        sound = _is_baseline(read_json(file, "baseline", UPDATE))
    except DescriptionError:
        sound = False
    if not sound:
        raise OutputError("already exists and is not a baseline", str(file), f"choose another file, or {force_hint()}")


def read_baseline(file: Path, smoke: bool, scenes: Sequence[str]) -> dict[str, Any]:
    """Read the entries of a baseline.

    Raises:
        DescriptionError: The file is not a baseline, or was made with a different schema, different scenes or options.
    """
    known = read_json(file, "baseline", UPDATE)
    if known.keys() >= {"schema", "scenes", "environment"} and known["schema"] != SCHEMA:
        raise DescriptionError(f"has schema {quote(known['schema'])}, not {SCHEMA}", str(file), UPDATE)
    if not _is_baseline(known):
        raise DescriptionError("is not a baseline", str(file), UPDATE)
    before = known["scenes"]
    if known.get("smoke") is not smoke:
        made = "with" if known.get("smoke") else "without"
        raise DescriptionError(
            f"was made {made} --smoke", str(file), "check in the same way, or replace it with --update"
        )
    if not before.keys() & {*scenes}:
        what = f"is a baseline for {', '.join(before) or 'nothing'}, not for {', '.join(scenes)}"
        raise DescriptionError(what, str(file), "choose another file, or create one with --update")
    return known


def _is_baseline(known: Mapping[str, Any]) -> bool:
    """Return True if all entries have the format that `state` produces."""
    scenes = known.get("scenes")
    if not is_record(known.get("environment"), TEXTS) or not isinstance(scenes, dict):
        return False
    return all(map(_is_scene_entry, scenes.values()))


def _is_scene_entry(entry: object) -> bool:
    if not isinstance(entry, dict) or not all(is_record(entry.get(key), TEXTS) for key in ("versions", "files")):
        return False
    errors = entry.get("errors")
    return isinstance(errors, dict) and all(map(_is_size, errors.values()))


def _is_size(value: object) -> bool:
    """Return True for a non-negative error, or null, which stands for NaN."""
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value < inf)


def _changes(whose: str, then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    """Yield sentences on entries that differ; the values of changed hashes are not shown."""
    for name in dict.fromkeys([*then, *now]):
        a, b = str(then.get(name, "")), str(now.get(name, ""))
        if a != b:
            hashed = len(a) == 64 or len(b) == 64
            yield (
                f"{whose}{name} has changed" if hashed and a and b else f"{whose}{name}: {a or 'none'} -> {b or 'none'}"
            )


def _compare_error(scene: str, one: Residual, before: float | None) -> tuple[bool, str] | None:
    """Return True and a sentence if an error grew, False and a sentence if it shrank, None if the change is noise."""
    then = float("nan") if before is None else float(before)
    a, b = digits(then), digits(one.error)
    sentence = f"{scene}: {one.key}: {then:.1e} -> {one.error:.1e}"
    if a != a or b != b:
        return (
            None
            if a != a and b != b
            else (b != b, f"{sentence} ({'no longer a number' if b != b else 'now a number'})")
        )
    if one.error > GROWN * max(then, NOISE):
        return True, f"{sentence}, {a - b:.1f} digits lost"
    if then > GROWN * max(one.error, NOISE):
        return False, f"{sentence}, {b - a:.1f} digits gained"
    return None
