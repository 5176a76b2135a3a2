"""States of a gate on disk: the history, a Parquet file for each check, and the baseline, a JSON file.

Files of a history never change, so that nothing is locked; DuckDB reads them. A baseline has the errors of a known
state with its versions and hashes; later states must not lose digits.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from importlib.util import find_spec
from io import BytesIO
from math import inf, nan
from numbers import Real
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import pandas as pd

from screwgauge.environment import environment, json_text
from screwgauge.judging.residual import Residual
from screwgauge.quantities import SOLVED, digits
from screwgauge.reference.errors import DescriptionError, OutputError, UnknownNameError, shown
from screwgauge.reference.files import parse_json, read_json, replace_file, why
from screwgauge.scene.motion import read_parquet
from screwgauge.study.gate.items import GateRow
from screwgauge.study.outcome import EXIT
from screwgauge.study.store import is_record

#: Of the columns.
SCHEMA = 1
#: Of tables that are kept.
TEXTS = Mapping[str, str]
#: What to do where there is none.
FIRST = "run screwgauge check --store with this folder first"


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_number(value: object) -> bool:
    """Whether it is a size; NaN stands for none."""
    return isinstance(value, Real) and not isinstance(value, bool) and not float(value) < 0.0


def _is_date(value: object) -> bool:
    try:
        return isinstance(value, str) and datetime.fromisoformat(value).tzinfo is not None
    except ValueError:
        return False


def _is_table(value: object) -> bool:
    return isinstance(value, str) and _is_table_of_texts(value)


@lru_cache(maxsize=1000)
def _is_table_of_texts(text: str) -> bool:
    """Whether it is JSON of texts by name."""
    try:
        return is_record(parse_json(text, "table", "", ""), TEXTS)
    except DescriptionError:
        return False


#: Columns -> whether a value belongs in them.
_COLUMNS: Mapping[str, Callable[[object], bool]] = {
    "schema": lambda value: value == SCHEMA,
    "smoke": lambda value: isinstance(value, bool | np.bool_),
    "date": _is_date,
    "status": lambda value: _is_text(value) and value in EXIT,
    **dict.fromkeys(("run", "scene", "key", "cpu", "platform"), _is_text),
    **dict.fromkeys(("versions", "files", "packages"), _is_table),
    **dict.fromkeys(("seconds", "error", "tolerance"), _is_number),
}


def check_store(store: Path) -> None:
    """Checks before long work that a history can be kept.

    Raises:
        OutputError: What it needs is not installed, or the folder is no folder.
    """
    if missing := [name for name in ("duckdb", "pyarrow") if find_spec(name) is None]:
        what = f"a history needs {' and '.join(missing)}, which is not installed"
        raise OutputError(what, "", "run pip install '.[history]' in the checkout")
    if os.path.lexists(store) and not os.path.isdir(store):
        raise OutputError("is no folder", str(store), "name another folder by --store")


def keep(store: Path, rows: Sequence[GateRow], smoke: bool, date: datetime | None = None) -> Path:
    """Adds the rows of a check, as a file of its own that is there in whole or not at all.

    Raises:
        OutputError: It cannot be written.
    """
    record, when = environment(), (date or datetime.now(UTC)).isoformat(timespec="seconds")
    run = uuid4().hex[:12]
    common = {"schema": SCHEMA, "run": run, "date": when, "smoke": smoke, "cpu": record["cpu"]}
    common |= {"platform": record["platform"], "packages": json.dumps(record["packages"])}
    entries = [
        {
            **common,
            "scene": row.scene,
            "status": row.status,
            "seconds": row.seconds,
            "versions": json.dumps(dict(row.versions)),
            "files": json.dumps(dict(row.files)),
            "key": key,
            "error": error,
            "tolerance": tolerance,
        }
        for row in rows
        for key, error, tolerance in (
            [(one.key, one.error, one.tolerance) for one in row.errors] or [(row.sentence, nan, nan)]
        )
    ]
    text = BytesIO()
    pd.DataFrame(entries).to_parquet(text, index=False)
    store.mkdir(parents=True, exist_ok=True)
    path = store / f"{when.replace(':', '')}-{run}.parquet"
    replace_file(path, text.getvalue())
    return path


def queried(store: Path, query: str, **values: Any) -> pd.DataFrame:
    """The result of a query of a store; ``ERRORS`` in it stands for the table of all errors.

    Raises:
        DescriptionError: There is no history, or a file of it is of something else.
    """
    import duckdb

    try:
        files = sorted(path for path in store.iterdir() if path.name.endswith(".parquet"))
    except OSError as error:
        what, remedy = f"has no history ({why(error)})", FIRST
        raise DescriptionError(what, str(store), remedy) from None
    if not files:
        raise DescriptionError("has no history", str(store), FIRST)
    errors = pd.concat(map(_kept, files), ignore_index=True)
    with duckdb.connect(config={"enable_external_access": False}) as database:
        database.register("errors", errors)
        return database.execute(query.replace("ERRORS", "errors"), values or None).df()


def _kept(file: Path) -> pd.DataFrame:
    """The rows that one check has left.

    Raises:
        DescriptionError: The file is of something else.
    """
    frame, remedy = read_parquet(file), "remove the file, which does not belong there"
    for name, holds in _COLUMNS.items():
        if name not in frame:
            raise DescriptionError(f"is no history of checks (column '{name}' is missing)", str(file), remedy)
        for value in frame[name]:
            if not holds(value):
                raise DescriptionError(f"is no history of checks ({name} is {shown(value)})", str(file), remedy)
    return frame[[*_COLUMNS]].astype({"error": float, "tolerance": float, "seconds": float})


def history(store: Path, scene: str | None = None) -> pd.DataFrame:
    """A row for each check of a scene, the oldest first: when, with what, the error nearest to its tolerance, time.

    Raises:
        ScrewgaugeError: There is no such history.
    """
    known = queried(store, "select distinct scene from ERRORS order by scene")["scene"].tolist()
    if scene is not None and scene not in known:
        raise UnknownNameError("scene", scene, known, str(store))
    frame = queried(
        store,
        """select scene, date, run, any_value(status) as status, any_value(versions) as versions,
            any_value(files) as files, any_value(cpu) as cpu, bool_or(smoke) as smoke, any_value(seconds) as seconds,
            arg_max(key, share) as worst, arg_max(coalesce(error, 'inf'), share) as error
        from (select *, coalesce(error / tolerance, 'inf') as share from ERRORS)
        where $scene is null or scene = $scene group by scene, date, run order by scene, date, run""",
        scene=scene,
    )
    frame["digits"] = frame["error"].map(digits)
    return frame


def latest(store: Path, smoke: bool) -> Mapping[str, Any]:
    """The entries of a baseline: of each scene the last check that passed, see `write_latest`."""
    frame = queried(
        store,
        """select scene, versions, files, packages, platform, cpu, key, error from ERRORS
        where status in ('agree', 'judged') and smoke = $smoke
        qualify dense_rank() over (partition by scene order by date desc, run) = 1 order by date, scene, key""",
        smoke=smoke,
    )
    scenes: dict[str, Any] = {}
    rows = [dict[Any, Any](row) for row in frame.to_dict("records")]
    for row in rows:
        entry = {"versions": json.loads(row["versions"]), "files": json.loads(row["files"]), "errors": {}}
        scenes.setdefault(row["scene"], entry)["errors"][row["key"]] = row["error"]
    last = rows[-1] if rows else {"platform": "", "cpu": "", "packages": "{}"}
    machine = {"platform": last["platform"], "cpu": last["cpu"], **json.loads(last["packages"])}
    return {"smoke": smoke, "environment": machine, "scenes": scenes}


BASELINE_SCHEMA = 1
#: What to do where there is none.
UPDATE = "make one by --update"
#: An error has grown when it is so many times what it was, or what rounding makes of it on another machine, whichever
#: is more: one digit, and a hundredth of the tolerance of what is solved.
GROWN, NOISE = 10.0, 0.01 * SOLVED


@dataclass(frozen=True, slots=True)
class Against:
    """Comparison with a known state.

    Attributes:
        changed: Which engines, models, versions are others, in sentences.
        worse: Errors that have grown, in sentences with the digits that are lost; `improved`: likewise gained.
        notes: What one of the two states lacks.
    """

    file: str
    changed: Sequence[str] = ()
    worse: Sequence[str] = ()
    improved: Sequence[str] = ()
    notes: Sequence[str] = ()


def state(rows: Iterable[GateRow], smoke: bool) -> dict[str, Any]:
    """The content of a baseline. Run times are not in it."""
    record = environment()
    return {
        "schema": BASELINE_SCHEMA,
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


def write_latest(file: Path, store: Path, smoke: bool) -> None:
    """Makes the last state of each scene that passed, as a store has it, the known one.

    Raises:
        ScrewgaugeError: There is none, or the file cannot be written.
    """
    latest_state = latest(store, smoke)
    if not latest_state["scenes"]:
        raise DescriptionError(f"has no check that passed {'with' if smoke else 'without'} --smoke", str(store), FIRST)
    replace_file(file, json_text({"schema": BASELINE_SCHEMA, **latest_state}))


def write_baseline(file: Path, rows: Sequence[GateRow], smoke: bool) -> None:
    """Makes the state of these rows the known one.

    Raises:
        OutputError: One of them has no numbers, or the file cannot be written; it is then as it was.
    """
    if broken := [row.scene for row in rows if row.status in ("failed", "refused")]:
        what = f"a state in which {', '.join(broken)} cannot be checked is no baseline"
        raise OutputError(what, str(file), "mend that first, or leave out --update")
    replace_file(file, json_text(state(rows, smoke)))


def against(file: Path, rows: Sequence[GateRow], smoke: bool) -> Against:
    """Compares rows with a baseline.

    Raises:
        DescriptionError: There is none, or it is of another schema, of other scenes, or of other options.
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
            elif sentence := _grown(row.scene, one, then["errors"][one.key]):
                (worse if sentence[0] else improved).append(sentence[1])
        lost = then["errors"].keys() - {one.key for one in row.errors}
        worse += [f"{row.scene}: {key} is no longer compared" for key in sorted(lost)]
    notes += [f"{name} is in the baseline and was not checked" for name in before if name not in now["scenes"]]
    return Against(str(file), list(dict.fromkeys(changed)), worse, improved, notes)


def check_baseline(file: Path, *, force: bool = False) -> None:
    """Refuses to overwrite a file that is no baseline.

    Raises:
        OutputError: It is something else.
    """
    if not os.path.lexists(file) or force:
        return
    try:
        sound = _sound(read_json(file, "baseline", UPDATE))
    except DescriptionError:
        sound = False
    if not sound:
        raise OutputError("is there, and is no baseline", str(file), "name another file, or overwrite it by --force")


def read_baseline(file: Path, smoke: bool, scenes: Sequence[str]) -> dict[str, Any]:
    """The entries of a baseline.

    Raises:
        DescriptionError: It is none, or of another schema, of other scenes, or of other options.
    """
    known = read_json(file, "baseline", UPDATE)
    if known.keys() >= {"schema", "scenes", "environment"} and known["schema"] != BASELINE_SCHEMA:
        raise DescriptionError(f"has schema {shown(known['schema'])}, not {BASELINE_SCHEMA}", str(file), UPDATE)
    if not _sound(known):
        raise DescriptionError("is no baseline", str(file), UPDATE)
    before = known["scenes"]
    if known.get("smoke") is not smoke:
        made = "with" if known.get("smoke") else "without"
        raise DescriptionError(f"was made {made} --smoke", str(file), "check likewise, or make another by --update")
    if not before.keys() & {*scenes}:
        what = f"is a baseline of {', '.join(before) or 'nothing'}, not of {', '.join(scenes)}"
        raise DescriptionError(what, str(file), "name another file, or make one by --update")
    return known


def _sound(known: Mapping[str, Any]) -> bool:
    """Whether all entries are what `state` makes them."""
    scenes = known.get("scenes")
    if not is_record(known.get("environment"), TEXTS) or not isinstance(scenes, dict):
        return False
    return all(map(_sound_scene, scenes.values()))


def _sound_scene(entry: object) -> bool:
    if not isinstance(entry, dict) or not all(is_record(entry.get(key), TEXTS) for key in ("versions", "files")):
        return False
    errors = entry.get("errors")
    return isinstance(errors, dict) and all(map(_is_size, errors.values()))


def _is_size(value: object) -> bool:
    """Whether it is the size of an error; null stands for what is no number."""
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value < inf)


def _changes(whose: str, then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    """Sentences on entries that differ; a hash is not worth reading."""
    for name in dict.fromkeys([*then, *now]):
        a, b = str(then.get(name, "")), str(now.get(name, ""))
        if a != b:
            hashed = len(a) == 64 or len(b) == 64
            yield (
                f"{whose}{name} has changed" if hashed and a and b else f"{whose}{name}: {a or 'none'} -> {b or 'none'}"
            )


def _grown(scene: str, one: Residual, before: float | None) -> tuple[bool, str] | None:
    """Whether an error is worse or better than it was, beyond noise, and by how many digits."""
    then = float("nan") if before is None else float(before)
    a, b = digits(then), digits(one.error)
    sentence = f"{scene}: {one.key}: {then:.1e} -> {one.error:.1e}"
    if a != a or b != b:
        return None if a != a and b != b else (b != b, f"{sentence} ({'no number any more' if b != b else 'a number'})")
    if one.error > GROWN * max(then, NOISE):
        return True, f"{sentence}, {a - b:.1f} digits lost"
    if then > GROWN * max(one.error, NOISE):
        return False, f"{sentence}, {b - a:.1f} digits gained"
    return None
