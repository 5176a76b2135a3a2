"""Finds mechanisms: built-in names or paths to TOML files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from screwgauge.reference.description import read_mechanism, read_tables
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.mechanism import Mechanism

FOLDER = Path(__file__).parent


def mechanism_names() -> list[str]:
    """Names of the built-in mechanisms."""
    return sorted(path.parent.name for path in FOLDER.glob("*/*.toml") if path.stem == path.parent.name)


def is_file(path: Path) -> bool:
    """Whether there is such a file; what can be no path at all, being too long, is none."""
    try:
        return path.is_file()
    except OSError:
        return False


def mechanism_path(name: str | Path) -> Path:
    """Path of the description of a built-in mechanism, or the path itself.

    Raises:
        UnknownNameError: Neither a built-in name nor a file.
    """
    if str(name) in mechanism_names():
        return FOLDER / str(name) / f"{name}.toml"
    if Path(name).suffix == ".toml" and is_file(Path(name)):
        return Path(name)
    raise UnknownNameError("mechanism", str(name), [*mechanism_names(), "or the path of a TOML file"])


def load_mechanism(name: str | Path) -> Mechanism:
    """Reads a mechanism by built-in name or path.

    Raises:
        ScrewgaugeError: It does not exist or does not describe a mechanism.
    """
    path = mechanism_path(name)
    return read_mechanism(path, _finder(path))


def mechanism_tables(name: str | Path) -> dict[str, Any]:
    """The tables of a description as text, with what it extends: numbers that nothing has rounded yet.

    Raises:
        ScrewgaugeError: It does not exist or cannot be read.
    """
    path = mechanism_path(name)
    return read_tables(path, _finder(path))


def _finder(path: Path) -> Callable[[str], Path]:
    """Finds what a description extends: a file beside it, or a built-in one."""

    def find(base: str) -> Path:
        beside = path.parent / base
        return beside if is_file(beside) else mechanism_path(base)

    return find
