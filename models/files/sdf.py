"""SDF 1.5 to 1.12 as text: included models put in their place, and the frames of all models."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.content import Content
from screwgauge.models.files.parts import inside
from screwgauge.models.files.xml import parse
from screwgauge.models.poses import matrix
from screwgauge.models.readings.graph import WORLD
from screwgauge.reference.errors import ModelFileError, UnknownNameError
from screwgauge.reference.files import check_count, is_file
from screwgauge.reference.rotations import Array, quaternion_rotation, rotation

#: Versions that are read.
_VERSIONS = tuple(f"1.{minor}" for minor in range(5, 13))
#: What separates the name of a model from that of a part of it.
OF = "::"


def expand(root: ET.Element, path: Path, folder: Path, depth: int = 0) -> list[Content]:
    """Puts models in the place of the includes that name them; returns what was included.

    Raises:
        ModelFileError: The version is unknown, or a model lies outside `folder` or is none.
    """
    where, content = str(path), list[Content]()
    check_count(depth, "nested models", where, "include fewer in each other")
    if root.get("version") not in _VERSIONS:
        raise ModelFileError(f"is SDF {root.get('version', 'without a version')}", where, "save it as SDF 1.5 to 1.12")
    for parent in [element for element in root.iter() if element.find("include") is not None]:
        for i, include in enumerate(parent):
            if include.tag != "include":
                continue
            uri = (include.findtext("uri") or "").strip()
            file = _included_file(path, uri, folder)
            other = parse(file)
            content += expand(other, file, folder, depth + 1)
            model = copy.deepcopy(_only_model(other, file))
            for tag in ("pose", "static"):
                if (given := include.find(tag)) is not None:
                    for old in model.findall(tag):
                        model.remove(old)
                    model.append(given)
            model.set("name", include.findtext("name") or model.get("name") or "")
            placement = include.findtext("placement_frame")
            model.attrib |= {"merge": include.get("merge", "")} | ({"placement_frame": placement} if placement else {})
            parent[i] = model
            content.append(Content("put in place", f"include {uri}, put in its place before it is read"))
    return content


def gives_mass(link: ET.Element) -> str:
    """What gives a link its mass: ``numbers``, ``shapes``, or nothing."""
    inertial = link.find("inertial")
    return "" if inertial is None else "shapes" if is_true(inertial.get("auto")) else "numbers"


def _included_file(path: Path, uri: str, folder: Path) -> Path:
    name = uri.removeprefix("model://").removeprefix("file://")
    path = folder / path.name if uri.startswith("model://") else path  # models lie beside each other
    if "://" in name:
        raise ModelFileError(f"includes '{uri}', which is not on this machine", str(path), "copy that model beside it")
    file = inside(path, name, folder, "includes")
    if is_file(file):
        return file
    config = file / "model.config"
    files = [each.text or "" for each in parse(config).iter("sdf")] if is_file(config) else ["model.sdf"]
    return inside(file / "model.config", files[-1].strip(), folder, "includes")


def _only_model(root: ET.Element, file: Path) -> ET.Element:
    models = root.findall("model")
    if len(models) != 1:
        raise ModelFileError(f"holds {len(models)} models, and is included as one", str(file), "let it hold one")
    return models[0]


def is_true(text: str | None) -> bool:
    return (text or "").strip() in ("true", "1")


@dataclass(frozen=True, slots=True)
class Frame:
    """A link, joint, frame or model as a frame of its own.

    Attributes:
        base: Frame that it is placed in, by its full name; empty for the world.
        carrier: Frame that it moves with; itself of a link.
        scope: What precedes the names that it uses; `model`: the frame that these call ``__model__``.
        still: Whether its model is static.
    """

    element: ET.Element
    base: str
    carrier: str
    scope: str
    model: str
    still: bool

    def named(self, name: str) -> str:
        """Full name of a frame that the element names."""
        return {"world": "", "__model__": self.model}.get(name, f"{self.scope}{name}")


@dataclass(frozen=True, slots=True)
class Frames:
    """All frames of a file by their full names, such as ``arm::hand::palm``.

    Attributes:
        alone: What names of the only model that moves begin with.
    """

    where: str
    alone: str
    by_name: dict[str, Frame] = field(default_factory=dict)

    def add(self, owner: ET.Element, scope: str, model: str, *, still: bool) -> None:
        """Adds all that is in a model, or in the world."""
        for e in owner:
            if e.tag not in ("link", "joint", "frame", "model"):
                continue
            name, pose = f"{scope}{e.get('name', '')}", e.find("pose")
            frame = Frame(e, model, name, scope, model, still)
            if e.tag == "model":
                merged = is_true(e.get("merge"))
                own = f"{scope}_merged__{e.get('name')}__model__" if merged else f"{name}{OF}__model__"
                inner, first = scope if merged else f"{name}{OF}", (e.get("canonical_link"), *_links_of(e), "")
                frame = replace(frame, carrier=f"{inner}{next(each for each in first if each is not None)}")
                self.add(e, inner, own, still=still or is_true(e.findtext("static")))
                name = own
            elif e.tag != "link":
                carrier = frame.named((e.get("attached_to") or e.findtext("child") or "__model__").strip())
                frame = replace(frame, base=carrier, carrier=carrier)
            other = pose is not None and (pose.get("relative_to") or pose.get("frame"))
            if name in self.by_name:
                raise ModelFileError(f"has two parts of the name '{name}'", self.where, "give each a name of its own")
            self.by_name[name] = replace(frame, base=frame.named(other)) if other else frame

    def key(self, name: str) -> str:
        """Name by which a frame is kept; one that only names a model means the frame of that."""
        model = f"{name}{OF}__model__"
        return model if name not in self.by_name and model in self.by_name else name

    def short(self, name: str) -> str:
        """Name of a link or joint in the reading."""
        return name.removeprefix(self.alone)

    def __getitem__(self, name: str) -> Frame:
        if (key := self.key(name)) not in self.by_name:
            raise UnknownNameError("frame", key, self.by_name, self.where)
        return self.by_name[key]

    def at(self, name: str, root: str = "", passed: tuple[str, ...] = ()) -> Array:
        """Pose of a frame in another one that it is placed in, by default in the world. Shape (4, 4)."""
        if (key := self.key(name)) == self.key(root):
            return np.eye(4)
        if key in passed or not key:
            raise ModelFileError(f"places the frame '{key}' by itself", self.where, "place it by another frame")
        frame = self[key]
        T = self.pose(frame.element)
        if placed := frame.element.get("placement_frame"):
            T = T @ np.linalg.inv(self.at(f"{name.removesuffix('__model__')}{placed}", name))
        return np.asarray(self.at(frame.base, root, (*passed, key)) @ T)

    def link(self, name: str, passed: tuple[str, ...] = ()) -> str:
        """Name of the link that a frame moves with; `WORLD` for the world."""
        if not name:
            return WORLD
        key, frame = self.key(name), self[name]
        if key in passed:
            raise ModelFileError(f"attaches the frame '{key}' to itself", self.where, "attach it to a link")
        return self.short(key) if frame.element.tag == "link" else self.link(frame.carrier, (*passed, key))

    def vector(self, element: ET.Element, tag: str, default: str, n: int) -> Array:
        """So many numbers in an element. Shape (n,)."""
        text = (element.findtext(tag) or "").strip() or default
        try:
            values = np.array([float(word) for word in text.split()])
        except ValueError:
            values = np.zeros(0)
        bad = np.isnan(values) if tag.startswith("limit/") else ~np.isfinite(values)
        if len(values) != n or bad.any():
            what = f"{tag} of {element.tag} {element.get('name', '')}".rstrip()
            due = f"{n} finite numbers" if n > 1 else "a finite number"
            raise ModelFileError(f"{what} is '{text[:60]}', not {due}", self.where, "write that")
        return values

    def number(self, element: ET.Element, tag: str, default: float) -> float:
        """A number in an element."""
        return float(self.vector(element, tag, repr(default), 1)[0])

    def pose(self, element: ET.Element) -> Array:
        """Placement by the ``<pose>`` in an element. Shape (4, 4)."""
        pose = element.find("pose")
        if pose is not None and pose.get("rotation_format") == "quat_xyzw":
            x = self.vector(element, "pose", "0 0 0 0 0 0 1", 7)
            return matrix(x[:3], quaternion_rotation(x[[6, 3, 4, 5]] / (float(np.linalg.norm(x[3:])) or 1.0)))
        x = self.vector(element, "pose", "0 0 0 0 0 0", 6)
        roll, pitch, yaw = np.radians(x[3:]) if pose is not None and is_true(pose.get("degrees")) else x[3:]
        X, Y, Z = np.eye(3)
        return matrix(x[:3], rotation(Z, yaw) @ rotation(Y, pitch) @ rotation(X, roll))


def _links_of(model: ET.Element) -> Iterator[str]:
    """Names of the links of a model in its own scope, those of nested models last."""
    yield from (link.get("name", "") for link in model.iterfind("link"))
    for nested in model.iterfind("model"):
        inner = "" if nested.get("merge") in ("true", "1") else f"{nested.get('name')}{OF}"
        yield from (f"{inner}{name}" for name in _links_of(nested))
