"""A model file that nobody here wrote, made safe to hand to a library: one text, without meshes, all of it named."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.readings.checks import (
    MAKERS,
    carried_link,
    check_names,
    check_numbers,
    check_tree,
    number,
    root_link,
    world,
)
from screwgauge.models.readings.markup import parse
from screwgauge.models.readings.meshes import without_meshes
from screwgauge.models.readings.naming import joints_in, name_all
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import check_count

#: Root element -> format.
FORMATS = {"robot": "urdf", "mujoco": "mjcf"}
#: Name of the joint of a base that floats, as Pinocchio calls its own.
FLOATING = "root_joint"
#: Coefficients of `<mimic>`, lowest first, and what they are where the file does not say.
_MIMIC = (("offset", 0.0), ("multiplier", 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A model file, prepared.

    Attributes:
        form: ``urdf`` or ``mjcf``.
        root: All of it that a library is to see.
        ignored: What was taken out or changed, one phrase each.
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
        return root_link(self.root) if self.form == "urdf" else ""

    @property
    def mimics(self) -> dict[str, CouplingReading]:
        """Joints of a URDF that follow another one, by name; what follows a fixed one, which stays at 0, is held."""
        found, moving = {}, self.names("joint") if self.form == "urdf" else []
        for joint in self.root.iterfind("joint") if self.form == "urdf" else ():
            mimic, name = joint.find("mimic"), joint.get("name", "")
            if mimic is not None and name in moving:
                ratio = np.array([number(mimic, key, default, str(self.path)) for key, default in _MIMIC])
                leads = mimic.get("joint", "")
                found[name] = (
                    CouplingReading(name, leads, ratio) if leads in moving else CouplingReading(name, "", ratio[:1])
                )
        return found

    @property
    def fixed_joints(self) -> dict[str, str]:
        """Fixed joint of a URDF -> link that it carries; none of an MJCF."""
        joints = self.root.iterfind("joint[@type='fixed']") if self.form == "urdf" else ()
        return {joint.get("name", ""): carried_link(joint) for joint in joints}

    def names(self, what: str) -> list[str]:
        """Names of its links, bodies or moving joints; of an MJCF without those of which copies are made."""
        if self.form == "urdf":
            return [e.get("name", "") for e in self.root.iterfind(what) if e.get("type") != "fixed"]
        tags = ("joint", "freejoint") if what == "joint" else (what,)
        copied = {id(element) for tag in MAKERS for maker in self.root.iter(tag) for element in maker.iter()}
        found = (e for e in world(self.root) if e.tag in tags and id(e) not in copied)
        return [element.get("name", "") for element in found]

    def joints_of(self, body: str) -> list[str]:
        """Names of the joints of a body of an MJCF, from the ground outwards."""
        for element in self.root.iter("body"):
            if element.get("name") == body:
                return [joint.get("name", "") for joint in joints_in(element)]
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
    check_numbers(root, str(path))
    said += without_meshes(root, form, str(path))
    if form == "mjcf":
        name_all(root)
    elif "name" not in root.attrib:
        root.set("name", path.stem)  # which some readers refuse to do without
        said.append("no name of the robot: it has that of the file")
    check_names(root, form, str(path))
    if form == "urdf":
        check_tree(root, str(path))
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
            file = _resolved(folder / name)
            if file is None or not file.is_relative_to(folder):
                what = f"includes '{name}', which lies outside its folder"
                raise ModelFileError(what, str(path), "copy that file beside it")
            if name in seen:
                raise ModelFileError(f"includes '{name}' twice", str(path), "include it once")
            seen.append(name)
            element[i : i + 1] = [*parse(file)]
        waiting += element
    return [f"include {name}, put in its place before a library reads it" for name in seen]


def _resolved(path: Path) -> Path | None:
    """The path without links; None if there can be no such file."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # too long, links in a circle
        return None


def _float(root: ET.Element, form: str, path: Path) -> None:
    """Hangs the first link of a URDF on a joint that leaves it free."""
    if form != "urdf":
        raise ModelFileError("is an MJCF, which says itself what floats", str(path), "do not ask for a floating base")
    base, links = root_link(root), {link.get("name") for link in root.iterfind("link")}
    world = next(name for name in ("world", "world_", "world__") if name not in links)
    ET.SubElement(root, "link", name=world)
    joint = ET.SubElement(root, "joint", name=FLOATING, type="floating")
    ET.SubElement(joint, "parent", link=world)
    ET.SubElement(joint, "child", link=base)
