"""Runs the check in fresh environments: one environment and one row for each pair of Pinocchio and MuJoCo versions."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from importlib.metadata import requires
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

import screwgauge
from screwgauge import processes
from screwgauge.judging.residual import JUDGE
from screwgauge.problem import Progress, Report, silent
from screwgauge.quantities import digits
from screwgauge.reference.errors import DescriptionError
from screwgauge.study.lifeline import end_with_thread
from screwgauge.study.outcome import EXIT
from screwgauge.study.runner import Executor, InTurn, Task, grow_table

#: Packages with which pin was built before version 4, but whose versions pin does not restrict: newer versions lack
#: libtinyxml2.so.10 or liburdfdom_sensor.so.4.0, so that importing pin fails (tried with pin 3.4.0 and 3.9.0).
BUILT_WITH = ("cmeel-tinyxml2<11", "cmeel-urdfdom<5")
#: Time limit of an installation, and of a check [s].
LIMIT = 3600.0


#: Result of a check: ``agree``, ``differ``, ``failed`` or ``not installed``; number of passing scenes, and of all
#: scenes; fewest digits to which two engines agree, with scene and quantity; quantities out of tolerance, with numbers
#: of scenes; sentence on the first scene that does not pass, or reason why there is no scene.
RESULT: dict[str, Any] = {
    "status": "",
    "passing": 0,
    "scenes": 0,
    "digits": float("nan"),
    "worst": "",
    "differing": "",
    "reason": "",
}
COLUMNS = ("pin", "mujoco", *RESULT)


class CannotError(Exception):
    """Raised if an environment cannot be created, or a command fails in it."""


Maker = Callable[[Path, Sequence[str]], Path]
"""Function that creates an environment, given its folder and its requirements, and returns the path of its Python."""


def matrix(
    pairs: Iterable[tuple[str, str]],
    file: Path,
    *,
    make: Maker | None = None,
    scenes: Sequence[str] = (),
    progress: Report = silent,
    execute: Executor | None = None,
) -> pd.DataFrame:
    """Check scenes with each pair of versions.

    Args:
        pairs: Versions of pin and of mujoco.
        file: File of the table; rows that were already computed for it are reused, see `grow_table`.
        make: Function that creates an environment; by default with uv or pip.
        scenes: Scenes, as for `screwgauge check`; all built-in scenes by default.
        execute: Executor of the checks; this process by default.

    Returns:
        The table, with columns `COLUMNS`.
    """
    named = {_name(pin, mujoco): (pin, mujoco) for pin, mujoco in pairs}
    text = grow_table(
        file,
        COLUMNS,
        [Task(name, partial(_row, *pair, make or make_environment, scenes)) for name, pair in named.items()],
        execute or InTurn(),
        lambda name, reason: _result(*named[name], status="failed", reason=reason),
        progress,
        [scenes],
    )
    missing = {"digits": ["nan", ""]}
    return pd.read_csv(StringIO(text), dtype={"pin": str, "mujoco": str}, keep_default_na=False, na_values=missing)


def _name(pin: str, mujoco: str) -> str:
    return f"pin {pin}, mujoco {mujoco}"


def check_versions(names: Sequence[str], package: str) -> Sequence[str]:
    """Reject a string that is not a version before it reaches an installer."""
    for name in names:
        if not re.fullmatch(r"\d+(\.\w+)*", name):
            raise DescriptionError(f"'{name}' is not a version", f"--{package}", "write 4.1.0, or 3.9.0,4.1.0")
    return names


def _row(pin: str, mujoco: str, make: Maker, scenes: Sequence[str], progress: Progress) -> list[dict[str, Any]]:
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        return [_check_in(Path(folder), pin, mujoco, make, scenes)]


def _result(pin: str, mujoco: str, **result: Any) -> dict[str, Any]:
    """Build a row, taking missing fields from `RESULT`."""
    return {"pin": pin, "mujoco": mujoco, **RESULT, **result}


def _check_in(folder: Path, pin: str, mujoco: str, make: Maker, scenes: Sequence[str]) -> dict[str, Any]:
    try:
        python = make(folder / "environment", requirements(pin=pin, mujoco=mujoco))
    except CannotError as error:
        return _result(pin, mujoco, status="not installed", reason=str(error))
    lay_out(folder / "package")
    try:
        return _result(pin, mujoco, **_check(python, folder, scenes))
    except CannotError as error:
        return _result(pin, mujoco, status="failed", reason=str(error))


def requirements(**pinned: str) -> list[str]:
    """Return requirements of this package with given versions pinned, plus packages that the pinned wheels need."""
    needed = [text for text in requires("screwgauge") or () if "extra ==" not in text]
    names = [match[0] for text in needed if (match := re.match(r"[\w.-]+", text))]
    texts = [f"{name}=={pinned[name]}" if name in pinned else text for name, text in zip(names, needed, strict=True)]
    return [*texts, *(BUILT_WITH if int(pinned["pin"].split(".")[0]) < 4 else ())]


def make_environment(folder: Path, wanted: Sequence[str]) -> Path:
    """Create an environment with this Python's version, using uv if available, otherwise venv and pip.

    Raises:
        CannotError: The environment cannot be created; the message is the last line printed by the installer.
    """
    python, uv = folder / "bin" / "python", shutil.which("uv")
    if uv:
        _run([uv, "venv", "--quiet", "--python", sys.executable, str(folder)])
        _run([uv, "pip", "install", "--quiet", "--python", str(python), *wanted])
    else:
        _run(processes.python("-m", "venv", str(folder)))
        _run([str(python), "-P", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *wanted])
    return python


def lay_out(folder: Path) -> None:
    """Copy the running version of this package to a folder, for use by a different Python."""
    for name in ("screwgauge", "screwgauge.reference", "screwgauge.models"):
        source = Path(str(import_module(name).__file__)).parent
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(source, folder.joinpath(*name.split(".")), ignore=ignored, dirs_exist_ok=True)
    metadata = folder / f"screwgauge-{screwgauge.__version__}.dist-info"
    metadata.mkdir()
    text = f"Metadata-Version: 2.1\nName: screwgauge\nVersion: {screwgauge.__version__}\n"
    (metadata / "METADATA").write_text(text, encoding="utf-8")


def _run(command: Sequence[str], folder: Path | None = None, ends: Collection[int] = (0,)) -> str:
    """Run a command and return its standard output.

    Args:
        folder: Current folder of the command, containing a copy of this package if the command needs it.
        ends: Allowed exit statuses; all if empty.

    Raises:
        CannotError: The command took too long, or its exit status is not in `ends`; the message states the error.
    """
    # keep compiled modules, since every process of a check imports the package
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    more = {"PYTHONPATH": str(folder / "package")} if folder else {}
    ask = partial(subprocess.run, capture_output=True, text=True, errors="replace", check=False, timeout=LIMIT)
    try:
        done = ask(command, cwd=folder, env={**kept, **more}, preexec_fn=end_with_thread())
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CannotError(f"{type(error).__name__}: {error}") from None
    if ends and done.returncode not in ends:
        lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
        raise CannotError(lines[-1] if lines else f"ended with status {done.returncode}")
    return str(done.stdout)


def _check(python: Path, folder: Path, scenes: Sequence[str]) -> dict[str, Any]:
    """Run `screwgauge check --smoke`, and return its result as fields of a row."""
    command = ["screwgauge.cli", "check", *scenes, "--smoke", "--json", "--out", str(folder / "out")]
    text = _run([str(python), "-P", "-m", *command], folder, (0, 1, 3))
    try:
        rows = json.loads(text)["rows"]
    except (ValueError, KeyError, TypeError):
        raise CannotError("the check printed no JSON") from None
    bad = [row for row in rows if EXIT[row["status"]]]
    pairs = [
        (digits(error["error"]), f"{row['scene']}: {error['quantity']}")
        for row in rows
        for error in row["errors"]
        if error["ok"] and error["b"] != JUDGE and error["error"] is not None
    ]
    fewest, worst = min(pairs, default=(float("nan"), ""))
    out = Counter(name for row in bad for name in dict.fromkeys(_exceeding_quantities(row["errors"])))
    failed = any(row["status"] in ("failed", "refused") for row in bad)
    first: Mapping[str, Any] = bad[0] if bad else {"scene": "", "sentence": ""}
    return {
        "status": "failed" if failed else "differ" if bad or not rows else "agree",
        "passing": len(rows) - len(bad),
        "scenes": len(rows),
        "digits": round(fewest, 1),
        "worst": worst,
        "differing": ", ".join(f"{name} {n}" for name, n in out.most_common()),
        "reason": f"{first['scene']}: {first['sentence']}" if bad else "",
    }


def _exceeding_quantities(errors: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the quantities in which two engines differ by more than the tolerance."""
    return (error["quantity"] for error in errors if not error["ok"] and error["b"] != JUDGE)
