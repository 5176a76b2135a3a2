"""The history of a gate: a Parquet file for each check, which never changes, so that nothing is locked; for DuckDB."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from importlib.util import find_spec
from io import BytesIO
from math import nan
from numbers import Real
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import pandas as pd

from screwgauge.environment import environment
from screwgauge.quantities import digits
from screwgauge.reference.errors import DescriptionError, OutputError, UnknownNameError
from screwgauge.reference.files import parse_json, replace_file, why
from screwgauge.scene.motion import read_parquet
from screwgauge.study.gate.row import EXIT, GateRow

#: Of the columns.
SCHEMA = 1
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
        found = parse_json(text, "table", "", "")
    except DescriptionError:
        return False
    return isinstance(found, dict) and all(map(_is_text, found.values()))


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
    """Finds out before long work whether there can be a history.

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


def asked(store: Path, query: str, **values: Any) -> pd.DataFrame:
    """What a query finds in a store; ``ERRORS`` in it stands for the table of all errors.

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
    found, remedy = read_parquet(file), "remove the file, which does not belong there"
    for name, holds in _COLUMNS.items():
        if name not in found:
            raise DescriptionError(f"is no history of checks (column '{name}' is missing)", str(file), remedy)
        for value in found[name]:
            if not holds(value):
                raise DescriptionError(f"is no history of checks ({name} is {value!r:.60})", str(file), remedy)
    return found[[*_COLUMNS]].astype({"error": float, "tolerance": float, "seconds": float})


def history(store: Path, scene: str | None = None) -> pd.DataFrame:
    """A row for each check of a scene, the oldest first: when, with what, the error nearest to its tolerance, time.

    Raises:
        ScrewgaugeError: There is no such history.
    """
    known = asked(store, "select distinct scene from ERRORS order by scene")["scene"].tolist()
    if scene is not None and scene not in known:
        raise UnknownNameError("scene", scene, known, str(store))
    found = asked(
        store,
        """select scene, date, run, any_value(status) as status, any_value(versions) as versions,
            any_value(files) as files, any_value(cpu) as cpu, bool_or(smoke) as smoke, any_value(seconds) as seconds,
            arg_max(key, share) as worst, arg_max(coalesce(error, 'inf'), share) as error
        from (select *, coalesce(error / tolerance, 'inf') as share from ERRORS)
        where $scene is null or scene = $scene group by scene, date, run order by scene, date, run""",
        scene=scene,
    )
    found["digits"] = found["error"].map(digits)
    return found


def latest(store: Path, smoke: bool) -> Mapping[str, Any]:
    """The entries of a baseline: of each scene the last check that passed, see `screwgauge.study.gate.baseline`."""
    found = asked(
        store,
        """select scene, versions, files, packages, platform, cpu, key, error from ERRORS
        where status in ('agree', 'judged') and smoke = $smoke
        qualify dense_rank() over (partition by scene order by date desc, run) = 1 order by date, scene, key""",
        smoke=smoke,
    )
    scenes: dict[str, Any] = {}
    rows = [dict[Any, Any](row) for row in found.to_dict("records")]
    for row in rows:
        entry = {"versions": json.loads(row["versions"]), "files": json.loads(row["files"]), "errors": {}}
        scenes.setdefault(row["scene"], entry)["errors"][row["key"]] = row["error"]
    last = rows[-1] if rows else {"platform": "", "cpu": "", "packages": "{}"}
    machine = {"platform": last["platform"], "cpu": last["cpu"], **json.loads(last["packages"])}
    return {"smoke": smoke, "environment": machine, "scenes": scenes}
