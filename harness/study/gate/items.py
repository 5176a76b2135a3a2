"""What a gate is asked to check: scenes and pairs of model files, from the arguments of the command; and tolerances."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from screwgauge.models.importing import SUFFIXES, is_model
from screwgauge.models.readings.loops import OWN as LOOPS
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.files import is_file, is_path, why
from screwgauge.reference.tables import check_keys, positive, read_toml
from screwgauge.scene.default import SUFFIX
from screwgauge.scene.read import scene_names

#: Keys that only scenes have: a file that misses one of them is no other file but a scene that is refused.
_OF_SCENES = frozenset(("mechanism", "motion", "time", "forward"))


@dataclass(frozen=True, slots=True)
class Item:
    """A scene, or a pair of model files.

    Attributes:
        name: What it is called in tables, baselines and JUnit.
        files: Built-in name or path; two of a pair.
    """

    name: str
    files: tuple[str, ...]


def items(what: Iterable[str | Path]) -> list[Item]:
    """What arguments mean: two model files are a pair, four are two; one is a scene as `run` makes it.

    Args:
        what: Built-in scenes, files, folders; nothing for all built-in scenes.

    Raises:
        ScrewgaugeError: There is no such thing, a folder has no scene, or two are of one name.
    """
    what = [*what]
    for each in what:
        if not isinstance(each, str | Path) or each == "":  # which would be the current folder
            raise DescriptionError(f"{each!r:.100} is no name or path", "check", "name scenes, files or folders")
    given = [*map(str, what)] or scene_names()
    models = [name for name in given if is_model(name)]
    if len(models) > 1 and len(models) % 2:
        what_is = f"{len(models)} model files: the last, {models[-1]}, has no partner"
        raise DescriptionError(what_is, "check", "give pairs A B, or one model alone")
    found = [Item(_stem(name), (name,)) for name in _scenes(name for name in given if name not in models)]
    if len(models) == 1:
        found.append(Item(_stem(models[0]), (models[0],)))
    else:
        pairs = zip(models[::2], models[1::2], strict=True)
        found += [Item(f"{Path(a).name} - {Path(b).name}", (a, b)) for a, b in pairs]
    for name in given:
        if name not in scene_names() and not is_file(Path(name)) and not _is_folder(name):
            if not is_path(name) and not is_model(name):
                raise UnknownNameError("scene", name, [*scene_names(), "or the path of a TOML file, URDF or MJCF"])
            raise DescriptionError("does not exist, or is no regular file", name, "check the path")
    _check_names(found)
    return found


def _is_folder(name: str) -> bool:
    return name not in scene_names() and os.path.isdir(name)


def _scenes(names: Iterable[str]) -> Iterator[str]:
    for name in names:
        if not _is_folder(name):
            yield name
            continue
        inside = [str(path) for path in _files_in(name, ".toml") if _is_scene(path)]
        if not inside:
            raise DescriptionError("has no scene", name, "name a folder of TOML files with the key 'mechanism'")
        yield from inside


def _files_in(folder: str, *endings: str) -> list[Path]:
    """What stands in a folder and ends so.

    Raises:
        DescriptionError: The folder cannot be read.
    """
    try:
        names = sorted(os.listdir(folder))
    except OSError as error:
        raise DescriptionError(f"cannot be read ({why(error)})", folder, "check the path") from None
    return [Path(folder) / name for name in names if name.lower().endswith(endings)]


def unread(what: Iterable[str | Path], read: Iterable[str]) -> list[str]:
    """Descriptions, scenes and models in the folders among the arguments that are none of the files that were read.

    Args:
        what: As `items` takes it.
        read: Paths.
    """
    known = {os.path.realpath(name) for name in read}
    found = [
        str(path)
        for folder in filter(_is_folder, map(str, what))
        for path in _files_in(folder, ".toml", *SUFFIXES)
        if os.path.realpath(path) not in known and not path.name.endswith(LOOPS)
    ]
    return list(dict.fromkeys(found))


def _is_scene(path: Path) -> bool:
    """Whether it is one, if only by half, or cannot even be read, which is for whoever checks it to say."""
    if path.name.endswith(LOOPS):
        return False
    try:
        return not _OF_SCENES.isdisjoint(read_toml(path))
    except DescriptionError:
        return True


def _stem(name: str) -> str:
    return name if name in scene_names() else Path(name).name.removesuffix(SUFFIX).removesuffix(".toml")


def _check_names(found: Iterable[Item]) -> None:
    before: dict[str, Item] = {}
    for item in found:
        other = before.setdefault(item.name, item)
        if other is not item:
            what = f"two are called '{item.name}': {', '.join(other.files)} and {', '.join(item.files)}"
            raise DescriptionError(what, "check", "rename one of them, or check it by itself")


def read_tolerances(given: str | Path | Mapping[str, float] | None) -> dict[str, float]:
    """Scaled errors that are admitted, by quantity.

    Args:
        given: A TOML file with ``quantity = value``, or its entries.

    Raises:
        ScrewgaugeError: There is no such quantity, or a value is no positive number.
    """
    if given is None:
        return {}
    table, where = (dict(given), "tolerances") if isinstance(given, Mapping) else (read_toml(Path(given)), str(given))
    check_keys(table, QUANTITIES, where)
    return {name: positive(value, f"{where}, {name}") for name, value in table.items()}
