"""The files that make up an MJCF: what it includes is put in its place, what it attaches stays a model of its own.

Nothing is opened outside the folder of the file that was given, whatever paths and links say.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET

from screwgauge.models.readings.markup import parse
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import check_count


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A file, with what it includes.

    Attributes:
        models: Name by which it attaches another file, empty for that which the other one gives itself -> its path.
        included: Names of included files.
    """

    path: Path
    root: ET.Element
    models: dict[str, Path] = field(default_factory=dict)
    included: list[str] = field(default_factory=list)


def parts(root: ET.Element, path: Path) -> list[Part]:
    """The file and all that it attaches, each once and after those that it attaches itself.

    Args:
        root: Of the file.

    Raises:
        ScrewgaugeError: A file lies outside the folder, cannot be read, is no MJCF, or includes or attaches itself.
    """
    found: dict[Path, Part] = {}
    _collect(root, path, path.parent.resolve(), (), found)
    _check_size(found)
    return list(found.values())


def _collect(root: ET.Element, path: Path, folder: Path, above: tuple[Path, ...], found: dict[Path, Part]) -> None:
    """Adds a file after those that it attaches.

    Args:
        folder: In which all files are.
        above: Files that attach this one.
    """
    part = Part(path, root, included=_include(root, path, folder))
    above = (*above, path.resolve())
    check_count(len(above), "nested models", str(path), "attach fewer to each other")
    for model in root.iterfind("asset/model"):
        file = inside(path, model.get("file", ""), folder, "attaches")
        if file in above:
            raise ModelFileError(f"attaches itself by '{model.get('file')}'", str(path), "take that model out")
        if file not in found:
            child = parse(file)
            if child.tag != "mujoco":
                what = f"attaches '{model.get('file')}', which is no MJCF"
                raise ModelFileError(what, str(path), "give the MJCF of that model")
            _collect(child, file, folder, above, found)
        part.models[model.get("name", "")] = file
    found[path] = part


def _check_size(found: Mapping[Path, Part]) -> None:
    """Refuses files that attach each other so often that there would be too many bodies."""
    counts = dict[Path, int]()
    for path, part in found.items():
        own = sum(element.tag == "body" for element in part.root.iter())
        names = {name or found[file].root.get("model", ""): file for name, file in part.models.items()}
        attached = [names.get(element.get("model", "")) for element in part.root.iter("attach")]
        counts[path] = own + sum(counts[file] for file in attached if file is not None)
        check_count(counts[path], "links", str(path))


def _include(root: ET.Element, path: Path, folder: Path) -> list[str]:
    """Puts the elements of included files in the place of ``<include>``, as MuJoCo does; returns their names."""
    waiting, seen = [root], list[str]()
    while waiting:
        element = waiting.pop()
        i = 0
        while i < len(element):
            if element[i].tag != "include":
                i += 1
                continue
            name = element[i].get("file", "")
            file = inside(path, name, folder, "includes")
            if name in seen:
                raise ModelFileError(f"includes '{name}' twice", str(path), "include it once")
            seen.append(name)
            element[i : i + 1] = [*parse(file)]
        waiting += element
    return seen


def inside(path: Path, name: str, folder: Path, verb: str) -> Path:
    """A file that another one names by its way from there, without links.

    Args:
        verb: What the other one does with it.

    Raises:
        ModelFileError: There can be no such file, or it lies outside `folder`.
    """
    try:
        file = (path.parent / name).resolve()
    except (OSError, RuntimeError, ValueError):  # too long, links in a circle
        file = Path()
    if not file.is_relative_to(folder):
        what = f"{verb} '{name}', which lies outside its folder"
        raise ModelFileError(what, str(path), "copy that file beside it")
    return file
