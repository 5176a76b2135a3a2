"""Addresses: digests of all that affects the result of a computation. Stored results are looked up by address."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distributions, version
from importlib.util import find_spec
from pathlib import Path
from platform import python_version
from typing import Any

from screwgauge.engines.registry import further_entries
from screwgauge.environment import environment
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.files import digest
from screwgauge.truth.cache import digest as digest_of

#: Packages, in addition to those in `environment`, on which results or pickled data depend.
PACKAGES = ("scipy", "llvmlite", "loky", "distributed", "cloudpickle")
#: Packages that make up this distribution.
ROOMS = ("screwgauge", "screwgauge.reference", "screwgauge.models")
OURS = (".py", ".toml", ".csv", ".urdf", ".xml")


def address(*parts: Any, files: Iterable[Path] = ()) -> str:
    """Compute the digest that identifies a computation.

    Args:
        parts: Inputs of the computation: strings, numbers, and tables of strings and numbers.
        files: All files opened for the computation, including files that they refer to.
    """
    return digest_of(_machine(), versions(), _distributions(), parts, [[str(file), _digest(file)] for file in files])


def versions() -> dict[str, str]:
    """Return the package versions that affect results, and digests of this package's code and of external engines."""
    packages = dict(_machine()["packages"]) | {"python": python_version(), "screwgauge's code": _code()}
    for name in PACKAGES:
        try:
            packages[name] = version(name)
        except PackageNotFoundError:
            packages[name] = "not installed"
    return packages | _engines()


_machine = cache(environment)


@cache
def _distributions() -> list[str]:
    """List all distributions with their versions, because an engine may depend on any of them."""
    return sorted({f"{each.metadata['Name']} {each.version}" for each in distributions()})


@cache
def _code() -> str:
    folders = [Path(str(import_module(name).__file__)).parent for name in ROOMS]
    return _of_files(path for folder in folders for path in _files_in(folder) if path[1].suffix in OURS)


@cache
def _engines() -> dict[str, str]:
    """Return external engine -> its version and a digest of the files of its distribution and module.

    The module is located without importing it.
    """
    found = {}
    for name, entry in further_entries().items():
        files, dist = [*_of_module(entry.module.partition(".")[0])], entry.dist
        if dist is not None:
            files += ((str(each), Path(str(each.locate()))) for each in dist.files or () if each.suffix != ".pyc")
        found[f"engine {name}"] = f"{dist.version if dist else ''} {_of_files(files)}"
    return found


def _of_module(name: str) -> Iterator[tuple[str, Path]]:
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):
        spec = None
    if spec is not None and spec.submodule_search_locations is not None:
        for folder in spec.submodule_search_locations:
            yield from _files_in(Path(folder))
    elif spec is not None and spec.origin is not None:
        yield name, Path(spec.origin)


def _files_in(folder: Path) -> Iterator[tuple[str, Path]]:
    for path in folder.rglob("*"):
        if "__pycache__" not in path.parts:
            yield f"{folder.name}/{path.relative_to(folder)}", path


def _of_files(files: Iterable[tuple[str, Path]]) -> str:
    text = hashlib.sha256()
    for name, path in sorted(files):
        if path.is_file():
            text.update(f"{name} {_digest(path)} ".encode())
    return text.hexdigest()[:12]


def _digest(path: Path) -> str:
    try:
        return digest(path, "MB of a report's file")
    except DescriptionError as error:
        return str(error)
