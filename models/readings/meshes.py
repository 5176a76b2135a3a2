"""Removes references to meshes, textures and other files from an MJCF; computes the mass of bodies from meshes."""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from screwgauge.models.content import Content, kind_of
from screwgauge.models.files.parts import joints_in, locate_file
from screwgauge.models.formats import vector_text
from screwgauge.models.mjcf import MOMENTS
from screwgauge.models.readings.compiled import collect_warnings, compile_text
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import check_count, read_bytes

_FROM_FILES = ("mesh", "hfield", "sdf")
#: Sections of an MJCF that a reading does not need; they refer to removed elements or set memory sizes.
_SECTIONS = ("asset", "visual", "sensor", "statistic", "custom", "size")
#: Elements that read files although they lack an attribute `file`.
_READERS = ("skin",)


def _without_sections(root: ET.Element) -> None:
    """Remove `_SECTIONS` from an MJCF, except for principal moments stored as custom numbers."""
    for section in [section for name in _SECTIONS for section in root.findall(name)]:
        for each in [*section]:
            if not each.get("name", "").startswith(MOMENTS):
                section.remove(each)
        if not len(section):
            root.remove(section)


def without_meshes(root: ET.Element, where: str, *, moving: Collection[str] = ()) -> list[Content]:
    """Remove meshes, other files, and all references to them from an MJCF.

    Args:
        moving: Tags of elements that a different model attaches and may move: ``body``, ``worldbody``.

    Returns:
        The removed content that affects mechanics.

    Raises:
        ModelFileError: The mass of a moving body depends on removed elements.
    """
    content = list[Content]()
    _without_sections(root)
    for shape in weighing_shapes(root):
        what = f"mass of body {shape.body.get('name', '(unnamed)')}"
        if shape.moves or shape.body.tag in moving:
            remedy = "add an <inertial> to the body, or read meshes (--meshes of import, run, check and diagnose)"
            raise ModelFileError(f"{what} comes from meshes, which are not read", where, remedy)
        if shape.body.tag == "body":
            content.append(Content("put in place", f"{what} from meshes, since the body is fixed"))
    classes = classes_of(root)
    for shape in [shape for shape in shapes(root) if shape.from_file(classes)]:
        shape.parent.remove(shape.geom)
        content.append(Content("contacts of geoms", "contacts of geoms"))
    for default in root.iter("default"):
        _without_files(default)
    for element in root.iter():
        element.attrib.pop("material", None)
        for child in [child for child in element if "file" in child.attrib or child.tag in _READERS]:
            element.remove(child)
            content.append(Content(kind_of(child.tag), f"{child.tag} {child.get('name', '')}".rstrip()))
    content += [*_pairs(root), *_idle_plugins(root)]
    return list(dict.fromkeys(content))


def _idle_plugins(root: ET.Element) -> Iterator[Content]:
    """Remove plugins that were used only by removed elements, such as sensors; yield the plugins as content."""
    declared = {id(each) for extension in root.iter("extension") for each in extension.iter("plugin")}
    used = {each.get(key) for each in root.iter("plugin") if id(each) not in declared for key in ("plugin", "instance")}
    for extension in root.findall("extension"):
        for plugin in extension.findall("plugin"):
            names = {plugin.get("plugin"), *(each.get("name") for each in plugin.iterfind("instance"))}
            if not names & (used - {None}):
                extension.remove(plugin)
                yield Content("plugins", f"plugin {plugin.get('plugin', '')}".rstrip())


def _without_files(default: ET.Element) -> None:
    """Remove meshes and materials from a default class."""
    for child in list(default):
        if child.tag in ("mesh", "material"):
            default.remove(child)
        elif child.tag == "geom" and (child.get("type") in _FROM_FILES or "mesh" in child.attrib):
            child.attrib.pop("type", None)
            child.attrib.pop("mesh", None)


def _pairs(root: ET.Element) -> Iterator[Content]:
    """Remove contact pairs that refer to a removed geom, and all contact exclusions; yield removed pairs."""
    geoms = {geom.get("name") for geom in root.iter("geom")}
    for section in root.iterfind("contact"):
        for row in list(section):
            lost = row.tag == "pair" and not {row.get("geom1"), row.get("geom2")} <= geoms
            if lost:
                yield Content("contact pairs", "contact pairs")
            if lost or row.tag == "exclude":
                section.remove(row)


def weighing_shapes(root: ET.Element) -> list[MeshShape]:
    """Return the mesh geoms from which bodies of an MJCF take their mass."""
    force = any(compiler.get("inertiafromgeom") == "true" for compiler in root.iterfind("compiler"))
    classes, found = classes_of(root), []
    for shape in shapes(root):
        weightless = any(_is_zero(shape.values(classes).get(key)) for key in ("mass", "density"))
        if shape.from_file(classes) and not weightless and (force or shape.body.find("inertial") is None):
            found.append(shape)
    return found


def _is_zero(value: str | None) -> bool:
    try:
        return value is not None and float(value) == 0.0
    except ValueError:
        return False


@dataclass(frozen=True, slots=True)
class MeshShape:
    """A geom with its body, its parent element, its default class, and whether the body moves."""

    geom: ET.Element
    body: ET.Element
    parent: ET.Element
    around: str
    moves: bool

    def values(self, classes: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
        """Return the attributes of the geom, completed with the defaults of its class."""
        return {**classes.get(self.around, {}), **self.geom.attrib}

    def from_file(self, classes: Mapping[str, Mapping[str, str]]) -> bool:
        """Return True if the geom is read from a file, e.g. a mesh."""
        values = self.values(classes)
        return values.get("type") in _FROM_FILES or bool({"mesh", "hfield"} & values.keys())


def shapes(root: ET.Element) -> Iterator[MeshShape]:
    """Yield every geom of an MJCF."""
    waiting = [(world, world, "", False) for world in root.iterfind("worldbody")]
    while waiting:
        body, parent, around, moves = waiting.pop()
        for element in parent:
            inner = element.get("childclass", around)
            if element.tag == "geom":
                yield MeshShape(element, body, parent, element.get("class", around), moves)
            elif element.tag == "body":
                waiting.append((element, element, inner, moves or bool(joints_in(element))))
            elif element.tag in ("frame", "replicate"):
                waiting.append((body, element, inner, moves))


def classes_of(root: ET.Element) -> dict[str, dict[str, str]]:
    """Return default class -> attributes of its geoms; the outermost class is also listed under the empty name."""
    classes: dict[str, dict[str, str]] = {}
    outermost = root.findall("default")
    waiting: list[tuple[ET.Element, dict[str, str]]] = [(default, {}) for default in outermost]
    while waiting:
        default, above = waiting.pop(0)
        values = {**above, **classes.get(default.get("class", ""), {})}
        for geom in default.iterfind("geom"):
            values |= geom.attrib
        classes[default.get("class", "")] = values
        if default in outermost:
            classes[""] = {**classes.get("", {}), **values}
        waiting += [(child, values) for child in default.iterfind("default")]
    return classes


#: Sections needed to compute the masses of bodies.
_KEPT = ("compiler", "option", "default", "asset", "worldbody")
_JOINTS = ("joint", "freejoint", "attach")


def weigh(root: ET.Element, path: Path, folder: Path, *, own: bool = True) -> list[str]:
    """Write an ``<inertial>`` for bodies whose mass depends on meshes; MuJoCo computes the values.

    Args:
        root: Root element of an MJCF in which all bodies have names.
        folder: Folder that must contain all meshes.
        own: True unless a different model attaches this one. If True, bodies that are not moved by a joint are fixed to
            the world and do not need mass.

    Returns:
        Names of the bodies that received an ``<inertial>``.

    Raises:
        ModelFileError: A mesh lies outside the folder, cannot be read, or is rejected by MuJoCo.
    """
    weighing = [shape for shape in weighing_shapes(root) if shape.body.tag == "body" and (shape.moves or not own)]
    if not weighing:
        return []
    force = [compiler for compiler in root.iterfind("compiler") if compiler.get("inertiafromgeom") == "true"]
    bodies = {shape.body.get("name", ""): shape.body for shape in (shapes(root) if force else weighing)}
    bodies.pop("", None)  # geoms of the world
    bare, meshes = _bare(root, {id(shape.geom) for shape in weighing}, path, folder)
    with collect_warnings():
        model = compile_text(ET.tostring(bare, encoding="unicode"), str(path), meshes=meshes)
    for name, body in bodies.items():
        inertial = _inertial(model, name, path)
        for old in body.findall("inertial"):
            body.remove(old)
        body.insert(0, inertial)
    for compiler in force:  # if kept, geoms would override <inertial>, although their meshes have been removed
        del compiler.attrib["inertiafromgeom"]
    return list(dict.fromkeys(shape.body.get("name", "") for shape in weighing))


def _inertial(model: Any, name: str, path: Path) -> ET.Element:
    try:
        i = model.body(name).id
    except KeyError:
        what = f"mass of body {name}, which is replicated, comes from meshes"
        raise ModelFileError(what, str(path), "add an <inertial> to the body") from None
    values = {"pos": model.body_ipos, "quat": model.body_iquat, "diaginertia": model.body_inertia}
    texts = {key: vector_text(array[i]) for key, array in values.items()}
    return ET.Element("inertial", {"mass": repr(float(model.body_mass[i])), **texts})


def _bare(root: ET.Element, kept: set[int], path: Path, folder: Path) -> tuple[ET.Element, dict[str, bytes]]:
    """Copy only bodies, geoms and meshes of the model; return the copy and the contents of the mesh files.

    Args:
        kept: Values of `id` of the geoms that keep their meshes.
    """
    marks = {id(shape.geom): shape for shape in shapes(root)}
    for number, geom in marks.items():
        geom.geom.set("kept", str(number in kept))
    bare = copy.deepcopy(root)
    for shape in marks.values():
        del shape.geom.attrib["kept"]
    for section in [section for section in bare if section.tag not in _KEPT]:
        bare.remove(section)
    classes, used = classes_of(bare), set[str]()
    for shape in list(shapes(bare)):
        mesh = shape.values(classes).get("mesh")
        if shape.geom.attrib.pop("kept") == "True" and mesh:
            used.add(mesh)
        elif shape.from_file(classes):
            shape.parent.remove(shape.geom)
    for element in bare.iter():
        element.attrib.pop("material", None)
        unused = ("material",) if element.tag == "default" else _JOINTS
        for child in [child for child in element if child.tag in unused]:
            element.remove(child)
    return bare, dict(_meshes(bare, used, path, folder))


def _meshes(bare: ET.Element, used: Iterable[str], path: Path, folder: Path) -> Iterator[tuple[str, bytes]]:
    """Give each mesh in use a unique file name and remove other assets; yield names and contents of the files."""
    directory, total = _directory(bare), 0
    for asset in bare.iterfind("asset"):
        for element in list(asset):
            file = element.get("file")
            name = element.get("name", Path(file or "").stem)
            if element.tag != "mesh" or name not in used:
                asset.remove(element)
            elif file is not None:
                place = locate_file(path, str(Path(directory) / file), folder, "takes mass from")
                data = read_bytes(place, "MB of a mesh")
                total += len(data)
                check_count(total / 1e6, "MB of meshes", str(path))
                element.set("name", name)
                element.set("file", key := f"{name}{place.suffix.lower()}")
                yield key, data


def _directory(bare: ET.Element) -> str:
    """Return the folder of the meshes, and remove it from the compiler settings."""
    folders, strip = {"meshdir": "", "assetdir": ""}, False
    for compiler in bare.iterfind("compiler"):
        folders |= {key: compiler.attrib.pop(key) for key in folders if key in compiler.attrib}
        strip = compiler.attrib.pop("strippath", str(strip).lower()) == "true"
        for key in ("texturedir", "settotalmass"):  # the total mass of all bodies is unknown here
            compiler.attrib.pop(key, None)
    if strip:
        for mesh in bare.iterfind("asset/mesh[@file]"):
            mesh.set("file", Path(mesh.get("file", "")).name)
    return folders["meshdir"] or folders["assetdir"]
