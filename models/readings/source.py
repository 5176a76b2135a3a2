"""Prepares an untrusted model file for a library: merges includes, removes meshes, names unnamed elements."""

from __future__ import annotations

import os
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from screwgauge.models.content import Content
from screwgauge.models.files.parts import MAKERS, Part, joints_in, name_all, parts, world
from screwgauge.models.files.sdf import expand
from screwgauge.models.files.urdf import (
    add_floating_base,
    carried_link,
    check_tree,
    fixed_joints,
    mimics,
    root_link,
    without_shapes,
)
from screwgauge.models.files.usd import elements, is_usd, stage_of
from screwgauge.models.files.xml import check_numbers, parse
from screwgauge.models.readings.meshes import weigh, without_meshes
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.errors import ModelFileError, first_few
from screwgauge.reference.files import check_count
from screwgauge.reference.lint import DEGREES, TURNED, in_degrees

#: Root element -> format.
FORMATS = {"robot": "urdf", "mujoco": "mjcf", "sdf": "sdf", "usd": "usd"}
#: Elements of an unexpanded xacro file, except calls of macros: calls to undefined macros also remain after expansion.
_OF_XACRO = {f"xacro:{name}" for name in ("include", "macro", "property", "arg", "if", "unless", "insert_block")}
#: Pattern of a decimal number.
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
#: Number of bodies that a sentence names.
_NAMED = 6


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A prepared model file.

    Attributes:
        form: ``urdf``, ``mjcf``, ``sdf`` or ``usd``.
        root: Root element, with everything that a library should read.
        content: Content that was removed or changed.
        attached: Key of a file that an MJCF attaches -> root element, with everything that a library should read.
        resolved: Sentences on the preparation of the file, e.g. on values that MuJoCo computed in advance.
    """

    path: Path
    form: str
    root: ET.Element
    content: tuple[Content, ...] = ()
    attached: Mapping[str, ET.Element] = field(default_factory=dict)
    resolved: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.root.get("model" if self.form == "mjcf" else "name", self.path.stem)

    @property
    def text(self) -> str:
        """XML text of the prepared model file."""
        return ET.tostring(self.root, encoding="unicode")

    @property
    def models(self) -> dict[str, str]:
        """Key of an attached file -> XML text of that file."""
        return {file: ET.tostring(root, encoding="unicode") for file, root in self.attached.items()}

    @property
    def root_link(self) -> str:
        """Name of the root link of a URDF; empty for an MJCF."""
        return root_link(self.root) if self.form == "urdf" else ""

    @property
    def mimics(self) -> dict[str, CouplingReading]:
        """Couplings of a URDF's mimic joints, by joint; a joint that mimics a fixed joint is locked."""
        return mimics(self.root, str(self.path)) if self.form == "urdf" else {}

    @property
    def fixed_joints(self) -> dict[str, str]:
        """Fixed joint of a URDF -> link that the joint carries; empty for an MJCF."""
        return fixed_joints(self.root) if self.form == "urdf" else {}

    def names(self, what: str) -> list[str]:
        """List the names of links, bodies or moving joints; for an MJCF, omit replicated elements.

        The list is empty for formats that screwgauge itself reads, since it does not drop any elements.
        """
        if self.form in ("sdf", "usd"):
            return []
        if self.form == "urdf":
            return [e.get("name", "") for e in self.root.iterfind(what) if e.get("type") != "fixed"]
        tags = ("joint", "freejoint") if what == "joint" else (what,)
        copied = {id(element) for tag in MAKERS for maker in self.root.iter(tag) for element in maker.iter()}
        elements = (e for e in world(self.root) if e.tag in tags and id(e) not in copied)
        return [element.get("name", "") for element in elements]

    def joints_of(self, body: str) -> list[str]:
        """List the joints of a body of an MJCF, from the ground outwards."""
        for element in self.root.iter("body"):
            if element.get("name") == body:
                return [joint.get("name", "") for joint in joints_in(element)]
        return []


def prepare(path: Path, *, floating: bool = False, meshes: bool = False) -> Source:
    """Read a model file and remove everything that a library must not read.

    Args:
        floating: Give a URDF a floating base.
        meshes: Let MuJoCo compute mass and inertia of bodies of an MJCF from meshes in its folder.

    Raises:
        ScrewgaugeError: The file cannot be read, is not a model, or requires unsupported preprocessing; the message
            names the remedy.
    """
    root = elements(stage_of(path)) if is_usd(path) else parse(path)
    if any(element.tag in _OF_XACRO for element in root.iter()):
        command = f"xacro {path.name} > robot.urdf"
        raise ModelFileError("is a xacro file, not a URDF", str(path), f"expand it first: {command}")
    if root.tag not in FORMATS:
        what = f"is not a model: its root element is <{root.tag}>"
        raise ModelFileError(what, str(path), "choose a URDF (<robot>), MJCF (<mujoco>) or SDF (<sdf>)")
    form = FORMATS[root.tag]
    if form == "mjcf":
        source = _mjcf(root, path, meshes)
    else:
        source = {"urdf": _urdf, "sdf": _sdf}[form](root, path) if form != "usd" else Source(path, form, root)
    if floating and form != "urdf":
        what = f"is {form.upper()}, which defines its floating bodies itself"
        raise ModelFileError(what, str(path), "do not request a floating base")
    if floating:
        add_floating_base(root)
    return source


def form_of(path: Path) -> str:
    """Return the format, determined from the root element or from a USD suffix; empty if it is unknown.

    Raises:
        ScrewgaugeError: The file cannot be read or is not XML.
    """
    return "usd" if is_usd(path) else FORMATS.get(parse(path).tag, "")


def check_names(root: ET.Element, form: str, where: str) -> None:
    """Reject names shared by two links or two joints, since most libraries silently keep only one of the two.

    Raises:
        ModelFileError: Two links or two joints share a name, a link or body lacks a name, or the file has no link or
            body.
    """
    kinds: dict[str, tuple[str, ...]] = {"body": ("body",), "joint": ("joint", "freejoint")}
    if form == "urdf":
        kinds = {"link": ("link",), "joint": ("joint",)}
    places = list(root) if form == "urdf" else list(world(root))
    for what, tags in kinds.items():
        names = Counter(element.get("name") for element in places if element.tag in tags)
        if what != "joint" and not names and not any(place.tag in (*MAKERS, "attach") for place in places):
            raise ModelFileError(f"has no {what}", where, "choose the file that describes the robot")
        for name, count in names.items():
            if not name:
                raise ModelFileError(f"a {what} has no name", where, "name it")
            if count > 1:
                shared = f"'{name}' is the name of {count} {tags[0]} elements"
                raise ModelFileError(shared, where, "use unique names")


def _urdf(root: ET.Element, path: Path) -> Source:
    check_count(len(root.findall("link")), "links", str(path))
    check_numbers(root, str(path))
    content = without_shapes(root)
    if "name" not in root.attrib:
        root.set("name", path.stem)  # some readers reject a model without a name
        content.append(Content("put in place", "name of the robot, taken from the file name"))
    check_names(root, "urdf", str(path))
    check_tree(root, str(path))
    return Source(path, "urdf", root, tuple(content), resolved=tuple(_turn_warnings(root)))


def _turn_warnings(root: ET.Element) -> Iterator[str]:
    """Yield messages about URDF origins and SDF poses whose angles exceed two turns and are probably in degrees."""
    for parent in root.iter():
        for place in (each for each in parent if each.tag in ("origin", "pose") and each.get("degrees") != "true"):
            text = place.get("rpy") if place.tag == "origin" else " ".join((place.text or "").split()[3:6])
            angles = [float(word) for word in (text or "").split() if _NUMBER.fullmatch(word)]
            if far := [x for x in angles if TURNED < abs(x) <= DEGREES]:
                owner = f"{place.tag} of {parent.tag} {parent.get('name', '')}".rstrip()
                yield f"Check this: {in_degrees(f'{owner}: an angle', max(far, key=abs))}: multiply it by pi/180."


def _sdf(root: ET.Element, path: Path) -> Source:
    content, said = expand(root, path, path.parent.resolve())
    return Source(path, "sdf", root, tuple(content), resolved=(*said, *_turn_warnings(root)))


def _mjcf(root: ET.Element, path: Path, meshes: bool) -> Source:
    files = parts(root, path)
    included = (name for part in files for name in part.included)
    content = [Content("put in place", f"include {name}, merged before a library reads it") for name in included]
    taken = {element.get("name") for part in files for element in part.root.iter()}
    keys = {part.path: f"{i + 1}.xml" for i, part in enumerate(files)}
    whole = any("body" not in attach.attrib for part in files for attach in part.root.iter("attach"))
    resolved, attached = list[str](), dict[str, ET.Element]()
    for part in files:
        where, own = str(part.path), part.root is root
        check_numbers(part.root, where)
        name_all(part.root, taken)
        if meshes and (weighed := weigh(part.root, part.path, path.parent.resolve(), own=own)):
            names = first_few(weighed, _NAMED)
            resolved.append(f"MuJoCo computes mass and inertia of {names} from the meshes.")
        moving = () if own else ("body", "worldbody") if whole else ("body",)
        content += without_meshes(part.root, where, moving=moving)
        check_names(part.root, "mjcf", where)
        _key_models(part, keys)
        if not own:
            attached[keys[part.path]] = part.root
    if attached:
        resolved.append(f"MuJoCo attaches models: {', '.join(part.path.name for part in files[:-1])}.")
    return Source(path, "mjcf", root, tuple(content), attached, tuple(resolved))


def weighed_copy(path: Path, folder: Path) -> Path | None:
    """Write copies of an MJCF and of the files that it attaches, with mass and inertia computed from meshes.

    Args:
        folder: Folder for the copies.

    Returns:
        The path of the copy; None if no mass comes from meshes.

    Raises:
        ScrewgaugeError: See `prepare`.
    """
    if form_of(path) != "mjcf":
        return None
    root = parse(path)
    files, home = parts(root, path), path.parent.resolve()
    taken = {element.get("name") for part in files for element in part.root.iter()}
    names = list[str]()
    for part in files:
        name_all(part.root, taken)
        names += weigh(part.root, part.path, home, own=part.root is root)
        at = path.name if part.root is root else part.path.relative_to(home)
        for model in part.root.iterfind("asset/model"):  # with resolved symbolic links, since the copy lacks them
            file = part.models[model.get("name", "")]
            model.set("file", os.path.relpath(file, part.path.resolve().parent))
        copy = folder / at
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(ET.tostring(part.root, encoding="unicode"), encoding="utf-8")
    return folder / path.name if names else None


def _key_models(part: Part, keys: Mapping[Path, str]) -> None:
    """Add elements that refer to the attached models of a file by their keys."""
    if part.models:
        asset = ET.SubElement(part.root, "asset")
        for name, file in part.models.items():
            ET.SubElement(asset, "model", {"file": keys[file], **({"name": name} if name else {})})


Branch = tuple[str, tuple[str, ...], Any]
"""A branch at a link: name by which siblings are sorted, moving joints, and where further branches start."""


def by_name(source: Source) -> tuple[str, ...]:
    """List the joints in Pinocchio's order for a URDF, where siblings are sorted by the names of their joints."""
    return _joints(source, by_names=True)


def in_file(source: Source) -> tuple[str, ...]:
    """List the joints in MuJoCo's order: from the ground outwards, with siblings in file order."""
    return _joints(source, by_names=False)


def _joints(source: Source, *, by_names: bool) -> tuple[str, ...]:
    branches: Callable[[Any], Iterable[Branch]] = _bodies
    place: Any = source.root.iterfind("worldbody")
    if source.form == "urdf":
        carried = defaultdict[str, list[Branch]](list)
        for joint in source.root.iterfind("joint"):
            near, name = joint.find("parent"), joint.get("name", "")
            branch = name, (name,) if joint.get("type") != "fixed" else (), carried_link(joint)
            carried["" if near is None else near.get("link", "")].append(branch)
        branches, place = carried.__getitem__, source.root_link
    order, waiting = list[str](), [(tuple[str, ...](), place)]
    while waiting:
        joints, place = waiting.pop()
        order += joints
        some = [*branches(place)]
        if by_names:
            some.sort(key=lambda branch: branch[0])
        waiting += [(moving, behind) for _, moving, behind in reversed(some)]
    return tuple(order)


def _bodies(elements: Iterable[ET.Element]) -> Iterator[Branch]:
    """Yield the bodies directly inside the given elements, including bodies in frames."""
    for child in chain.from_iterable(elements):
        if child.tag == "frame":
            yield from _bodies([child])
        elif child.tag == "body":
            joints = tuple(joint.get("name", "") for joint in joints_in(child))
            yield joints[0] if joints else child.get("name", ""), joints, [child]
