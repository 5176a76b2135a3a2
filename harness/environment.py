"""Record of the environment of a run: computer, versions, threads. It omits paths, user and host names, and imports no
engine.
"""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.processes import ONE

CODE = ("harness", "models", "reference", "pyproject.toml")
PACKAGES = ("screwgauge", "numpy", "pandas", "pin", "mujoco", "python-flint")


def environment() -> dict[str, Any]:
    """Return the record that goes into ``environment.json`` and the report."""
    record: dict[str, Any] = {
        "platform": platform.platform(),
        "cpu": _cpu(),
        "cores": _cores(),
        "python": platform.python_version(),
        "packages": dict(_packages()),
        "blas": _blas(),
        "threads": {name: os.environ.get(name, "not set") for name in ONE},
    }
    commit = _commit()
    return {**record, "commit": commit} if commit else record


def plain(value: Any, text: Callable[[str], str] = str) -> Any:
    """Convert a value to JSON types; non-finite numbers become null, and strings are passed through `text`."""
    if isinstance(value, Mapping):
        return {str(key): plain(item, text) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item, text) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist(), text)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, (bool, int, float)) else text(str(value))


def json_text(value: Any, *, escaped: bool = False) -> str:
    """Format a value as indented JSON that every parser accepts; if `escaped`, as ASCII, for any stream or log."""
    text = json.dumps(plain(value), indent=2, ensure_ascii=escaped, allow_nan=False) + "\n"
    return text.replace("##", "#\\u0023") if escaped else text  # CI services read ## as a command


@cache
def _packages() -> dict[str, str]:
    versions = dict.fromkeys(PACKAGES, "not installed")
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    return versions


def _cpu() -> str:
    with suppress(OSError):  # not Linux
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _blas() -> str:
    config: dict[str, Any] = dict(np.show_config(mode="dicts") or {})
    blas = config.get("Build Dependencies", {}).get("blas", {})
    return f"{blas.get('name', 'unknown')} {blas.get('version', '')}".strip()


@cache
def _commit() -> str | None:
    """Return the commit of the checkout that this package runs from, marked if its code was changed; None outside a
    checkout.
    """
    root = Path(__file__).resolve().parents[1]
    if not (root / ".git").exists() or not (root / "pyproject.toml").is_file():
        return None

    def git(*words: str) -> str:
        command = ["git", "-C", str(root), *words]
        return subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()

    try:  # reports are excluded: a rewritten report does not make the code dirty
        return git("rev-parse", "HEAD") + "-dirty" * bool(git("status", "--porcelain", "--", *CODE))
    except (OSError, subprocess.SubprocessError):  # git is missing, or does not trust the checkout
        return None
