"""Mass and inertia that an MJCF takes from meshes, computed by MuJoCo and written into the elements of its bodies."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from screwgauge.models.formats import vector_text
from screwgauge.models.readings.compiled import compiled, warned
from screwgauge.models.readings.files import inside
from screwgauge.models.readings.meshes import classes_of, shapes, weighs
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import check_count, read_bytes

#: Sections that say what bodies weigh.
_KEPT = ("compiler", "option", "default", "asset", "worldbody")
_JOINTS = ("joint", "freejoint", "attach")


def weigh(root: ET.Element, path: Path, folder: Path) -> list[str]:
    """Gives bodies of which meshes determine the mass an ``<inertial>`` with what MuJoCo makes of the meshes.

    Args:
        root: Of an MJCF, all bodies of it having names.
        folder: In which all meshes have to lie.

    Returns:
        Names of these bodies.

    Raises:
        ModelFileError: A mesh lies outside the folder, cannot be read, or is refused by MuJoCo.
    """
    weighing = [shape for shape in weighs(root) if shape.body.tag == "body"]
    if not weighing:
        return []
    force = [compiler for compiler in root.iterfind("compiler") if compiler.get("inertiafromgeom") == "true"]
    bodies = {shape.body.get("name", ""): shape.body for shape in (shapes(root) if force else weighing)}
    bodies.pop("", None)  # geoms of the world
    bare, meshes = _bare(root, {id(shape.geom) for shape in weighing}, path, folder)
    with warned():
        model = compiled(ET.tostring(bare, encoding="unicode"), str(path), meshes=meshes)
    for name, body in bodies.items():
        inertial = _inertial(model, name, path)
        for old in body.findall("inertial"):
            body.remove(old)
        body.insert(0, inertial)
    for compiler in force:  # it would take geoms all the same, of which the meshes are gone
        del compiler.attrib["inertiafromgeom"]
    return list(dict.fromkeys(shape.body.get("name", "") for shape in weighing))


def _inertial(model: Any, name: str, path: Path) -> ET.Element:
    try:
        i = model.body(name).id
    except KeyError:
        what = f"mass of body {name}, of which copies are made, comes from meshes"
        raise ModelFileError(what, str(path), "give the body an <inertial>") from None
    values = {"pos": model.body_ipos, "quat": model.body_iquat, "diaginertia": model.body_inertia}
    texts = {key: vector_text(array[i]) for key, array in values.items()}
    return ET.Element("inertial", {"mass": repr(float(model.body_mass[i])), **texts})


def _bare(root: ET.Element, kept: set[int], path: Path, folder: Path) -> tuple[ET.Element, dict[str, bytes]]:
    """Bodies, their geoms and meshes alone; and what is in the files of these.

    Args:
        kept: Identities of the geoms that are to keep their meshes.
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
    """Leaves the meshes that are used, under names of their own; yields these and what is in the files."""
    directory, total = _directory(bare), 0
    for asset in bare.iterfind("asset"):
        for element in list(asset):
            file = element.get("file")
            name = element.get("name", Path(file or "").stem)
            if element.tag != "mesh" or name not in used:
                asset.remove(element)
            elif file is not None:
                place = inside(path, str(Path(directory) / file), folder, "takes mass from")
                data = read_bytes(place, "MB of a mesh")
                total += len(data)
                check_count(total / 1e6, "MB of meshes", str(path))
                element.set("name", name)
                element.set("file", key := f"{name}{place.suffix.lower()}")
                yield key, data


def _directory(bare: ET.Element) -> str:
    """Folder of the meshes; the compiler then looks for none."""
    found, strip = {"meshdir": "", "assetdir": ""}, False
    for compiler in bare.iterfind("compiler"):
        found |= {key: compiler.attrib.pop(key) for key in found if key in compiler.attrib}
        strip = compiler.attrib.pop("strippath", str(strip).lower()) == "true"
        for key in ("texturedir", "settotalmass"):  # what all bodies weigh together is not known here
            compiler.attrib.pop(key, None)
    if strip:
        for mesh in bare.iterfind("asset/mesh[@file]"):
            mesh.set("file", Path(mesh.get("file", "")).name)
    return found["meshdir"] or found["assetdir"]
