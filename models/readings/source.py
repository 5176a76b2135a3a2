"""A model file that nobody here wrote, made safe to hand to a library: one text, without meshes, all of it named."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.readings.markup import parse
from screwgauge.models.readings.meshes import without_meshes
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import check_count

#: Root element -> format.
FORMATS = {"robot": "urdf", "mujoco": "mjcf"}
#: Name of the joint of a base that floats, as Pinocchio calls its own.
FLOATING = "root_joint"
#: Attributes that hold no numbers, though what they hold may look like one.
_TEXT = ("name", "link", "class", "childclass", "filename", "file", "model")


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A model file, prepared.

    Attributes:
        form: ``urdf`` or ``mjcf``.
        root: All of it that a library is to see.
        ignored: What was taken out, one phrase each.
    """

    path: Path
    form: str
    root: ET.Element
    ignored: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Of the model."""
        return self.root.get("name" if self.form == "urdf" else "model", self.path.stem)

    @property
    def text(self) -> str:
        """As XML."""
        return ET.tostring(self.root, encoding="unicode")

    @property
    def root_link(self) -> str:
        """Name of the first link of a URDF; empty of an MJCF."""
        return _root_link(self.root) if self.form == "urdf" else ""

    @property
    def mimics(self) -> dict[str, CouplingReading]:
        """Joints of a URDF that follow another one, by name."""
        found = {}
        for joint in self.root.iterfind("joint") if self.form == "urdf" else ():
            mimic, name = joint.find("mimic"), joint.get("name", "")
            if mimic is not None:
                ratio = [float(mimic.get("offset", 0.0)), float(mimic.get("multiplier", 1.0))]
                found[name] = CouplingReading(name, mimic.get("joint", ""), np.array(ratio))
        return found

    def joints_of(self, body: str) -> list[str]:
        """Names of the joints of a body of an MJCF, from the ground outwards."""
        for element in self.root.iter("body"):
            if element.get("name") == body:
                return [joint.get("name", "") for joint in element if joint.tag in ("joint", "freejoint")]
        return []


def prepare(path: Path, *, floating: bool = False) -> Source:
    """Reads a model file and takes out what a library must not see.

    Args:
        floating: The base of a URDF moves freely.

    Raises:
        ScrewgaugeError: It cannot be read, is no model, or asks for what is not done here; says what to do.
    """
    root = parse(path)
    if any(element.tag.startswith("xacro:") for element in root.iter()):
        command = f"xacro {path.name} > robot.urdf"
        raise ModelFileError("is a xacro file, from which a URDF is made", str(path), f"expand it first: {command}")
    if root.tag not in FORMATS:
        what = f"is no model: its root element is <{root.tag}>"
        raise ModelFileError(what, str(path), "give a URDF (<robot>) or an MJCF (<mujoco>)")
    form = FORMATS[root.tag]
    said = _include(root, path) if form == "mjcf" else []
    check_count(sum(element.tag in ("link", "body") for element in root.iter()), "links", str(path))
    _check_numbers(root, path)
    said += without_meshes(root, form, str(path))
    if form == "mjcf":
        _name_all(root)
    _check_names(root, form, path)
    if floating:
        _float(root, form, path)
    return Source(path, form, root, tuple(said))


def _include(root: ET.Element, path: Path) -> list[str]:
    """Puts the elements of included files in the place of ``<include>``, as MuJoCo does."""
    folder, waiting, seen = path.parent.resolve(), [root], list[str]()
    while waiting:
        element = waiting.pop()
        i = 0
        while i < len(element):
            if element[i].tag != "include":
                i += 1
                continue
            name = element[i].get("file", "")
            file = (folder / name).resolve()
            if not file.is_relative_to(folder):
                what = f"includes '{name}', which lies outside its folder"
                raise ModelFileError(what, str(path), "copy that file beside it")
            if name in seen:
                raise ModelFileError(f"includes '{name}' twice", str(path), "include it once")
            seen.append(name)
            element[i : i + 1] = [*parse(file)]
        waiting += element
    return [f"include {name}, put in its place before the library reads it" for name in seen]


def _check_numbers(root: ET.Element, path: Path) -> None:
    for element in root.iter():
        for attribute, value in element.items():
            words = value.lower().split() if attribute not in _TEXT else []
            if any(re.fullmatch(r"[+-]?nan(\(.*\))?", word) for word in words):
                whose = f" {element.get('name')}" if element.get("name") else ""
                what = f"{attribute} of {element.tag}{whose} is not a number ({value})"
                raise ModelFileError(what, str(path), "write a number")


def _world(root: ET.Element) -> Iterator[ET.Element]:
    """All elements below the world bodies of an MJCF."""
    for world in root.iterfind("worldbody"):
        yield from world.iter()


def _name_all(root: ET.Element) -> None:
    """Names what has no name, so that all libraries call it the same."""
    taken = {element.get("name") for element in root.iter()}

    def free(name: str) -> str:
        while name in taken:
            name += "_"
        taken.add(name)
        return name

    bodies = [element for element in _world(root) if element.tag == "body"]
    for i, body in enumerate(bodies):
        if "name" not in body.attrib:
            body.set("name", free(f"body_{i + 1}"))
    for body in bodies:
        for k, joint in enumerate(element for element in body.iter() if element.tag in ("joint", "freejoint")):
            if "name" not in joint.attrib and joint in _own(body):
                joint.set("name", free(f"{body.get('name')}_joint" + (f"_{k + 1}" if k else "")))
    for section in ("equality", "actuator"):
        for i, element in enumerate(entry for part in root.iterfind(section) for entry in part):
            if "name" not in element.attrib:
                element.set("name", free(f"{element.tag}_{i + 1}"))


def _own(body: ET.Element) -> list[ET.Element]:
    """What is in a body itself, in frames or not."""
    found, waiting = list[ET.Element](), [*body]
    while waiting:
        element = waiting.pop(0)
        if element.tag == "frame":
            waiting = [*element, *waiting]
        elif element.tag != "body":
            found.append(element)
    return found


def _check_names(root: ET.Element, form: str, path: Path) -> None:
    """Refuses names that two links or two joints share: most libraries keep one of them in silence."""
    kinds = (
        {"link": ("link",), "joint": ("joint",)}
        if form == "urdf"
        else {"body": ("body",), "joint": ("joint", "freejoint")}
    )
    places = list(root) if form == "urdf" else list(_world(root))
    for what, tags in kinds.items():
        names = Counter(element.get("name") for element in places if element.tag in tags)
        for name, count in names.items():
            if name is None:
                raise ModelFileError(f"a {what} has no name", str(path), "give it one")
            if count > 1:
                raise ModelFileError(
                    f"{count} {tags[0]}s are called '{name}'", str(path), "give each a name of its own"
                )


def _root_link(root: ET.Element) -> str:
    children = {child.get("link") for child in root.iterfind("joint/child")}
    return next((link.get("name", "") for link in root.iterfind("link") if link.get("name") not in children), "")


def _float(root: ET.Element, form: str, path: Path) -> None:
    """Hangs the first link of a URDF on a joint that leaves it free."""
    if form != "urdf":
        raise ModelFileError("is an MJCF, which says itself what floats", str(path), "leave that out")
    base, links = _root_link(root), {link.get("name") for link in root.iterfind("link")}
    world = next(name for name in ("world", "world_", "world__") if name not in links)
    ET.SubElement(root, "link", name=world)
    joint = ET.SubElement(root, "joint", name=FLOATING, type="floating")
    ET.SubElement(joint, "parent", link=world)
    ET.SubElement(joint, "child", link=base)
