"""Reads SDF 1.5 to 1.12: merges included models and locates the frames of all models."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.content import Content
from screwgauge.models.files.parts import locate_file
from screwgauge.models.files.xml import parse
from screwgauge.models.formats import floats, of_rpy
from screwgauge.models.poses import matrix, relative
from screwgauge.models.readings.graph import WORLD
from screwgauge.reference.errors import ModelFileError, UnknownNameError
from screwgauge.reference.files import check_count, is_file
from screwgauge.reference.rotations import Array, quaternion_rotation

#: Supported versions, and the older versions among these, in which a joint may share the name of a link.
_VERSIONS, _OLD = tuple(f"1.{minor}" for minor in range(5, 13)), ("1.5", "1.6")
#: Separator between the name of a model and the name of its part.
OF = "::"
#: Parts of models that are frames; and children of an include that define which model is included and where.
_FRAMES, _OF_INCLUDES = ("link", "joint", "frame", "model"), ("uri", "name", "placement_frame")
_ROTATIONS = ("euler_rpy", "quat_xyzw")


def is_true(text: str | None) -> bool:
    return (text or "").strip() in ("true", "1")


def base_of(element: ET.Element) -> str:
    """Return the name of the frame relative to which an element is placed; empty if the element does not name one."""
    pose = element.find("pose")
    return "" if pose is None else pose.get("relative_to") or pose.get("frame") or ""


def expand(root: ET.Element, path: Path, folder: Path, depth: int = 0) -> tuple[list[Content], list[str]]:
    """Replace includes with the models that they name; return the includes as content, and warnings on renamed joints.

    Raises:
        ModelFileError: The version is unknown, or an included model lies outside `folder` or is not a model.
    """
    content, said, version = list[Content](), list[str](), root.get("version")
    check_count(depth, "nested models", str(path), "reduce the nesting")
    if version not in _VERSIONS:
        raise ModelFileError(f"is SDF {version or 'without a version'}", str(path), "save it as SDF 1.5 to 1.12")
    for model in root.iter("model") if version in _OLD else ():
        links = {link.get("name") for link in model.iterfind("link")}
        for joint in (each for each in model.iterfind("joint") if each.get("name") in links):
            name = f"{joint.get('name')}_joint"
            said.append(f"A joint and a link are both called '{joint.get('name')}'; the joint is renamed to '{name}'.")
            joint.set("name", name)
    for parent in [element for element in root.iter() if element.find("include") is not None]:
        for i, include in [(i, each) for i, each in enumerate(parent) if each.tag == "include"]:
            uri = (include.findtext("uri") or "").strip()
            file = _included_file(path, uri, folder)
            other = parse(file)
            more = expand(other, file, folder, depth + 1)
            parent[i] = _merge_include(include, other, file)
            content += [*more[0], Content("put in place", f"include {uri}, expanded before reading")]
            said += more[1]
    return content, said


def _included_file(path: Path, uri: str, folder: Path) -> Path:
    name = uri.removeprefix("model://").removeprefix("file://")
    path = folder / path.name if uri.startswith("model://") else path  # models are sibling folders
    if "://" in name:
        raise ModelFileError(
            f"includes '{uri}', which is not a local file", str(path), "copy that model into the folder of this file"
        )
    file = locate_file(path, name, folder, "includes")
    if is_file(file):
        return file
    config = file / "model.config"
    files = [each.text or "" for each in parse(config).iter("sdf")] if is_file(config) else ["model.sdf"]
    return locate_file(config, files[-1].strip() if files else "model.sdf", folder, "includes")


def _merge_include(include: ET.Element, root: ET.Element, file: Path) -> ET.Element:
    """Return the only model of a file, with the name, pose and further elements of the include that names the file."""
    models = root.findall("model")
    if len(models) != 1:
        raise ModelFileError(
            f"contains {len(models)} models, but an included file must contain one", str(file), "keep one model"
        )
    (model,) = models
    given = [each for each in include if each.tag not in _OF_INCLUDES]
    replaced = {each.tag for each in given} & {"pose", "static"}
    model[:] = [*given, *(each for each in model if each.tag not in replaced)]
    words = {key: include.findtext(key) for key in ("name", "placement_frame")} | {"merge": include.get("merge")}
    model.attrib |= {key: word for key, word in words.items() if word}
    return model


@dataclass(frozen=True, slots=True)
class Frame:
    """A link, joint, frame or model, treated as a frame. Names are full names, except a model's placement frame.

    Attributes:
        scope: Prefix of the names that the element uses.
        model: Frame to which ``__model__`` refers in these names.
        carrier: Frame with which the frame moves; for a link, the link itself.
        base: Frame relative to which the frame is placed; empty for the world.
        placed: Frame whose pose relative to `base` is given: the frame itself, or a model's placement frame.
        still: True if the frame belongs to a static model.
    """

    element: ET.Element
    scope: str
    model: str
    carrier: str
    base: str
    placed: str
    still: bool

    def resolve(self, name: str | None) -> str:
        """Return the full name of a frame to which the element refers."""
        name = (name or "").strip()
        return {"world": WORLD, "__model__": self.model}.get(name, f"{self.scope}{name}")


@dataclass(frozen=True, slots=True)
class Frames:
    """All frames of a file by full name, such as ``arm::hand::palm``.

    Attributes:
        alone: Common prefix of the names if only one model moves.
        poses: Full name -> world pose, available after `place`. Shape (4, 4) each.
    """

    where: str
    alone: str = ""
    by_name: dict[str, Frame] = field(default_factory=dict)
    poses: dict[str, Array] = field(default_factory=dict)

    def add(self, owner: ET.Element, scope: str = "", model: str = WORLD, *, still: bool = False) -> None:
        """Add all frames in a model or in the world."""
        for e in (each for each in owner if each.tag in _FRAMES):
            own = name = f"{scope}{e.get('name', '')}"
            attached, tip = "__model__", e.get("placement_frame")
            resolve = Frame(e, scope, model, name, model, name, still).resolve
            if e.tag == "model":
                merged = is_true(e.get("merge"))
                own, inner = f"{name}{OF}__model__", scope if merged else f"{name}{OF}"
                self.add(e, inner, own, still=still or is_true(e.findtext("static")))
                carrier = f"{inner}{e.get('canonical_link') or next(_links_of(e), '')}"
                tip = tip and f"{inner}{tip}"
            else:
                attached = e.get("attached_to") or e.findtext("child") or attached
                carrier = name if e.tag == "link" else resolve(attached)
            base = resolve(base_of(e) or attached)
            if own in self.by_name or not e.get("name"):
                what = f"has two elements named '{name}'" if e.get("name") else f"a {e.tag} has no name"
                raise ModelFileError(what, self.where, "use unique names")
            self.by_name[own] = Frame(e, scope, model, carrier, base, tip or own, still)

    def place(self) -> None:
        """Compute the poses of all frames.

        Raises:
            ModelFileError: A frame is placed relative to itself or to a missing frame.
        """
        steps = defaultdict[str, list[tuple[str, Array]]](list)
        for frame in self.by_name.values():
            near, far, T = self.key(frame.base), self.key(frame.placed), self.pose(frame.element)
            steps[near].append((far, T))
            steps[far].append((near, relative(T, np.eye(4))))
        self.poses[WORLD], waiting = np.eye(4), [WORLD]
        while waiting:
            near = waiting.pop()
            for far, T in steps[near]:
                if far not in self.poses:
                    self.poses[far] = self.poses[near] @ T
                    waiting.append(far)
        if lost := next((name for name in self.by_name if name not in self.poses), ""):
            raise ModelFileError(
                f"places the frame '{lost}' relative to itself", self.where, "place it relative to another frame"
            )

    def key(self, name: str) -> str:
        """Return the key of a frame in `by_name`; the name of a model stands for the frame of that model."""
        model = f"{name}{OF}__model__"
        key = name if name in self.by_name or model not in self.by_name else model
        if key and key not in self.by_name:
            raise UnknownNameError("frame", key, self.by_name, self.where)
        return key

    def reading_name(self, name: str) -> str:
        """Return the name that a link or joint has in the reading."""
        return name.removeprefix(self.alone)

    def at(self, name: str) -> Array:
        """Return the world pose of a frame. Shape (4, 4)."""
        return self.poses[self.key(name)]

    def link(self, name: str) -> str:
        """Return the name of the link with which a frame moves; `WORLD` for the world."""
        for _ in (*self.by_name, ""):
            if not (key := self.key(name)) or self.by_name[key].element.tag == "link":
                return self.reading_name(key)
            name = self.by_name[key].carrier
        raise ModelFileError(f"attaches the frame '{key}' to itself", self.where, "attach it to a link")

    def vector(self, element: ET.Element, tag: str, default: str, n: int) -> Array:
        """Read n numbers from an element. Shape (n,)."""
        words = ((element.findtext(tag) or "").strip() or default).split()
        what = f"{tag} of {element.tag} {element.get('name', '')}".rstrip()
        return floats(words, n, what, self.where, infinite=tag.startswith("limit/"))

    def number(self, element: ET.Element, tag: str, default: float) -> float:
        """Read a number from an element."""
        return float(self.vector(element, tag, repr(default), 1)[0])

    def pose(self, element: ET.Element) -> Array:
        """Return the placement that the ``<pose>`` of an element defines. Shape (4, 4)."""
        pose = element.find("pose")
        form = "euler_rpy" if pose is None else pose.get("rotation_format", "euler_rpy")
        if form not in _ROTATIONS:
            raise UnknownNameError("rotation_format", form, _ROTATIONS, self.where)
        if form == "quat_xyzw":
            x = self.vector(element, "pose", "0 0 0 0 0 0 1", 7)
            return matrix(x[:3], quaternion_rotation(x[[6, 3, 4, 5]] / (float(np.linalg.norm(x[3:])) or 1.0)))
        x = self.vector(element, "pose", "0 0 0 0 0 0", 6)
        degrees = pose is not None and is_true(pose.get("degrees"))
        return matrix(x[:3], of_rpy(np.radians(x[3:]) if degrees else x[3:]))


def _links_of(model: ET.Element) -> Iterator[str]:
    """Yield the names of a model's links in the model's scope; links of nested models come last."""
    yield from (link.get("name", "") for link in model.iterfind("link"))
    for nested in model.iterfind("model"):
        inner = "" if is_true(nested.get("merge")) else f"{nested.get('name')}{OF}"
        yield from (f"{inner}{name}" for name in _links_of(nested))
