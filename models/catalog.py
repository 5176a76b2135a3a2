"""Finds mechanisms: built-in names, paths to TOML files, or model files, which are imported."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path
from typing import Any

from screwgauge.models.importing import is_model
from screwgauge.reference.description import read_mechanism, read_tables, read_toml
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.files import beside, is_file, is_path
from screwgauge.reference.mechanism import Mechanism

FOLDER = Path(__file__).parent


def mechanism_names() -> list[str]:
    """Names of the built-in mechanisms."""
    return sorted(path.parent.name for path in FOLDER.glob("*/*.toml") if path.stem == path.parent.name)


def mechanism_path(name: str | Path, folder: Path = Path(), where: str = "") -> Path:
    """Path of the description of a built-in mechanism, or of what a name means in a folder; a model file is imported.

    Args:
        where: What to blame.

    Raises:
        UnknownNameError: Neither a built-in name nor a file, and nothing that is meant to be one.
    """
    if str(name) in mechanism_names():
        return FOLDER / str(name) / f"{name}.toml"
    path = beside(folder, str(name))
    if is_model(path):
        from screwgauge.models.importing.model import imported_file

        return imported_file(path)[0]
    if is_path(str(name)) or (where and is_file(path)):
        return path
    raise UnknownNameError(
        "mechanism", str(name), [*mechanism_names(), "or the path of a TOML file, URDF or MJCF"], where
    )


def load_mechanism(name: str | Path) -> Mechanism:
    """Reads a mechanism by built-in name or path.

    Raises:
        ScrewgaugeError: It does not exist or does not describe a mechanism.
    """
    path = mechanism_path(name)
    return _built_in(path) if FOLDER in path.parents else _read(path)


def _read(path: Path) -> Mechanism:
    return read_mechanism(path, partial(mechanism_path, folder=path.parent, where=str(path)))


#: What comes with the package does not change; what is worked out once a mechanism is kept with it.
_built_in = cache(_read)


def description_files(path: Path) -> list[Path]:
    """A description that can be read, and those that it extends."""
    found = [path]
    while "extends" in (said := read_toml(found[-1])):
        found.append(mechanism_path(said["extends"], found[-1].parent, str(found[-1])))
    return found


def mechanism_tables(name: str | Path) -> dict[str, Any]:
    """The tables of a description as text, with what it extends: numbers that nothing has rounded yet.

    Raises:
        ScrewgaugeError: It does not exist or cannot be read.
    """
    path = mechanism_path(name)
    return read_tables(path, partial(mechanism_path, folder=path.parent, where=str(path)))
