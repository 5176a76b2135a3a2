"""What a gate is asked to check: scenes and pairs of model files, from the arguments of the command; and tolerances."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from screwgauge.models.importing import is_model
from screwgauge.models.readings.loops import OWN as LOOPS
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.description import check_keys, read_toml
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.files import is_file, is_path
from screwgauge.scene.default import SUFFIX
from screwgauge.scene.entries import positive
from screwgauge.scene.read import scene_names


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
    for name in (file for item in found for file in item.files):
        if name not in scene_names() and not is_file(Path(name)):
            if not is_path(name) and not is_model(name):
                raise UnknownNameError("scene", name, [*scene_names(), "or the path of a TOML file, URDF or MJCF"])
            raise DescriptionError("does not exist, or is no regular file", name, "check the path")
    _check_names(found)
    return found


def _scenes(names: Iterable[str]) -> Iterator[str]:
    for name in names:
        if not Path(name).is_dir() or name in scene_names():
            yield name
            continue
        inside = [str(path) for path in sorted(Path(name).glob("*.toml")) if _is_scene(path)]
        if not inside:
            raise DescriptionError("has no scene", name, "name a folder of TOML files with the key 'mechanism'")
        yield from inside


def _is_scene(path: Path) -> bool:
    """Whether it is, or cannot even be read, which is for whoever checks it to say."""
    if path.name.endswith(LOOPS):
        return False
    try:
        return "mechanism" in tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
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
