"""Merges the files that an MJCF includes, finds the files that it attaches, and names unnamed elements."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree as ET

from screwgauge.models.files.xml import parse
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import check_count

#: Pattern of the names given to unnamed constraints and actuators.
NUMBERED = re.compile(r"[a-z]+_\d+_*")


def name_all(root: ET.Element, taken: set[str | None]) -> None:
    """Assign names to unnamed bodies, joints, constraints and actuators, such as ``body_2``, ``connect_1``.

    Args:
        taken: Names already in use; the assigned names are added to it.
    """

    def name(element: ET.Element, wanted: str) -> None:
        if "name" in element.attrib:
            return
        while wanted in taken:
            wanted += "_"
        taken.add(wanted)
        element.set("name", wanted)

    bodies = [body for world in root.iterfind("worldbody") for body in world.iter("body")]
    for i, body in enumerate(bodies):
        name(body, f"body_{i + 1}")
        for k, joint in enumerate(joints_in(body)):
            name(joint, f"{body.get('name')}_joint" + (f"_{k + 1}" if k else ""))
    for section in ("equality", "actuator"):
        for i, entry in enumerate(entry for part in root.iterfind(section) for entry in part):
            name(entry, f"{entry.tag}_{i + 1}")


def joints_in(body: ET.Element) -> list[ET.Element]:
    """List the joints of a body in file order, including joints in frames."""
    joints, waiting = list[ET.Element](), [*body]
    while waiting:
        element = waiting.pop(0)
        if element.tag in ("joint", "freejoint"):
            joints.append(element)
        elif element.tag == "frame":
            waiting = [*element, *waiting]
    return joints


#: Elements of an MJCF that generate bodies without naming them.
MAKERS = ("replicate", "composite", "flexcomp")


def world(root: ET.Element) -> Iterator[ET.Element]:
    """Yield all elements below the world bodies of an MJCF."""
    for body in root.iterfind("worldbody"):
        yield from body.iter()


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A file with its includes merged.

    Attributes:
        models: Name of each attached model (empty if the attached file defines the name) -> path.
        included: Names of included files.
    """

    path: Path
    root: ET.Element
    models: dict[str, Path] = field(default_factory=dict)
    included: list[str] = field(default_factory=list)


def parts(root: ET.Element, path: Path, folder: Path | None = None) -> list[Part]:
    """List a file and all files that it attaches, directly or indirectly, once each; attached files come first.

    Args:
        root: Root element of the file.
        folder: Folder that must contain all files; by default, the folder of the file.

    Raises:
        ScrewgaugeError: A file lies outside the folder, cannot be read, is not an MJCF, or includes or attaches itself.
    """
    collected: dict[Path, Part] = {}
    _collect(root, path, folder or path.parent.resolve(), (), collected)
    _check_size(collected)
    return list(collected.values())


def _collect(root: ET.Element, path: Path, folder: Path, above: tuple[Path, ...], collected: dict[Path, Part]) -> None:
    """Append a file after the files that it attaches.

    Args:
        folder: Folder that must contain all files.
        above: Chain of files that attach this file.
    """
    part = Part(path, root, included=_include(root, path, folder))
    above = (*above, path.resolve())
    check_count(len(above), "nested models", str(path), "reduce the nesting")
    for model in root.iterfind("asset/model"):
        file = locate_file(path, model.get("file", ""), folder, "attaches")
        if file in above:
            raise ModelFileError(f"attaches itself by '{model.get('file')}'", str(path), "remove that model")
        if file not in collected:
            child = parse(file)
            if child.tag != "mujoco":
                what = f"attaches '{model.get('file')}', which is not an MJCF"
                raise ModelFileError(what, str(path), "attach an MJCF")
            _collect(child, file, folder, above, collected)
        part.models[model.get("name", "")] = file
    collected[path] = part


def _check_size(collected: Mapping[Path, Part]) -> None:
    """Reject files that attach each other so often that the model would have too many bodies or elements."""
    bodies = dict[Path, float]()
    for path, part in collected.items():
        names = {name or collected[file].root.get("model", ""): file for name, file in part.models.items()}
        attached = {name: bodies[file] for name, file in names.items()}
        bodies[path] = _check_copies(part.root, str(path), attached)


def _check_copies(root: ET.Element, where: str, attached: Mapping[str, float] = MappingProxyType({})) -> float:
    """Count the bodies that MuJoCo generates from an MJCF, and reject too many bodies or copies.

    Args:
        attached: Name of an attached model -> number of bodies that MuJoCo generates from it.

    Raises:
        DescriptionError: MuJoCo would generate too many bodies or copies.
    """
    bodies = copies = 0.0
    waiting = [(root, 1.0)]
    while waiting:
        element, times = waiting.pop()
        if element.tag in MAKERS:
            times *= _count(element)
        if element.tag == "attach":
            bodies += times * attached.get(element.get("model", ""), 0.0)
        elif element.tag in ("body", "composite") or (element.tag == "flexcomp" and element.get("rigid") != "true"):
            bodies += times
        copies += times if times > 1.0 else 0.0
        waiting += [(child, times) for child in element]
    check_count(bodies, "links", where)
    check_count(copies, "copies", where)
    return bodies


def check_made(path: Path) -> None:
    """Reject an MJCF from which MuJoCo would generate too many elements, counting included and attached files.

    Raises:
        ScrewgaugeError: The MJCF is too large or cannot be read.
    """
    for part in parts(parse(path), path, Path("/")):
        _check_sizes(part.root, str(part.path))


def _check_sizes(root: ET.Element, where: str) -> None:
    """Reject an MJCF that reserves too much user data or too many keyframes.

    Raises:
        DescriptionError: The file reserves too many user entries or keyframes.
    """
    for key, value in (item for size in root.iter("size") for item in size.items()):
        if (key.startswith("nuser") or key == "nkey") and value.isdecimal():
            check_count(float(value), "entries", f"{where}, {key} of size")


def _count(maker: ET.Element) -> float:
    """Return an upper bound on the copies of an element's content; ignore non-numeric counts, which MuJoCo rejects."""
    words = maker.get("count", "10 10 10" if maker.tag == "flexcomp" else "").split()
    counts = [max(float(word), 1.0) for word in words if word.isdecimal()]
    return max(math.prod(counts), len(maker.get("point", "").split()) / 3)


def _include(root: ET.Element, path: Path, folder: Path) -> list[str]:
    """Replace each ``<include>`` with the elements of the included file, as MuJoCo does; return the file names."""
    waiting, seen = [root], list[str]()
    while waiting:
        element = waiting.pop()
        i = 0
        while i < len(element):
            if element[i].tag != "include":
                i += 1
                continue
            name = element[i].get("file", "")
            file = locate_file(path, name, folder, "includes")
            if name in seen:
                raise ModelFileError(f"includes '{name}' twice", str(path), "include it once")
            seen.append(name)
            element[i : i + 1] = [*parse(file)]
        waiting += element
    return seen


_ALLOWED: ContextVar[tuple[Path, ...]] = ContextVar("_ALLOWED", default=())


@contextmanager
def files_allowed(folder: Path, names: Iterable[str]) -> Iterator[None]:
    """Allow models, within a `with` block, to refer to files outside their own folder.

    Args:
        names: Paths of files or folders, relative to `folder`; a name without ``/`` is not a path and is ignored.
    """
    token = _ALLOWED.set(tuple((folder / name).resolve() for name in names if "/" in name))
    try:
        yield
    finally:
        _ALLOWED.reset(token)


def locate_file(path: Path, name: str, folder: Path, verb: str) -> Path:
    """Resolve the path of a file that a model file names.

    Args:
        verb: Verb for the error message, such as ``includes``.

    Raises:
        ModelFileError: The path is invalid or lies outside `folder`.
    """
    try:
        file = (path.parent / name).resolve()
    except (OSError, RuntimeError, ValueError):  # path too long, or circular symbolic links
        file = Path()
    if not any(map(file.is_relative_to, (folder, *_ALLOWED.get()))):
        what = f"{verb} '{name}', which lies outside the model's folder"
        raise ModelFileError(
            what, str(path), "copy that file into the folder, or allow it (import and run: --allow PATH)"
        )
    return file
