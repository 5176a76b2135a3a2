"""Takes meshes, textures and other files out of a model, and says where mass would have come from them."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree as ET

from screwgauge.reference.errors import ModelFileError

_FROM_FILES = ("mesh", "hfield", "sdf")
#: Sections of an MJCF without mechanics that name what is taken out.
_SECTIONS = ("asset", "visual", "sensor", "skin", "contact", "statistic", "custom")


def without_meshes(root: ET.Element, form: str, where: str) -> list[str]:
    """Takes them out of a model.

    Returns:
        What was taken out that has to do with mechanics, one phrase each.

    Raises:
        ModelFileError: Mass of a moving body would come from what is taken out.
    """
    return _urdf(root) if form == "urdf" else _mjcf(root, where)


def _urdf(root: ET.Element) -> list[str]:
    said = []
    for link in root.iterfind("link"):
        for shape in [*link.iterfind("visual"), *link.iterfind("collision")]:
            geometry = shape.find("geometry")
            if shape.tag == "visual" or geometry is None or geometry.find("mesh") is not None:
                link.remove(shape)
                if shape.tag == "collision" and link.find("inertial") is None:
                    said.append(f"mass of link {link.get('name')}, which MuJoCo takes from meshes, which are not read")
    for material in root.findall("material"):
        root.remove(material)
    return list(dict.fromkeys(said))


def _mjcf(root: ET.Element, where: str) -> list[str]:
    said = []
    for name in _SECTIONS:
        for section in root.findall(name):
            if name == "asset":
                said += [f"model {model.get('name', '')}" for model in section.iterfind("model")]
            if name == "contact" and section.find("pair") is not None:
                said.append("contact pairs")
            root.remove(section)
    defaults = _Defaults(root)
    force = any(compiler.get("inertiafromgeom") == "true" for compiler in root.iterfind("compiler"))
    for body, around, element in list(_shapes(root)):
        if defaults.value(element, around, "type") in _FROM_FILES or {"mesh", "hfield"} & element.attrib.keys():
            owner = next(parent for parent in body.iter() if element in list(parent))
            owner.remove(element)
            weighs = not {defaults.value(element, around, key) for key in ("mass", "density")} & {"0", "0.0"}
            if body.tag == "body" and weighs and (force or body.find("inertial") is None):
                what = f"mass of body {body.get('name', '')} comes from meshes, which are not read"
                raise ModelFileError(what, where, "give the body an <inertial>")
    for default in root.iter("default"):
        for tag in ("mesh", "material"):
            for element in default.findall(tag):
                default.remove(element)
        for geom in default.iterfind("geom"):
            if geom.get("type") in _FROM_FILES:
                del geom.attrib["type"]
            geom.attrib.pop("mesh", None)
    for element in root.iter():
        element.attrib.pop("material", None)
        for child in [child for child in element if "file" in child.attrib or child.tag in ("skin", "attach")]:
            element.remove(child)
            said.append(f"{child.tag} {child.get('name', '')}".strip())
    return said


def _shapes(root: ET.Element) -> Iterator[tuple[ET.Element, str, ET.Element]]:
    """Every geom of an MJCF with the body that it is in, and the class that counts there."""
    waiting = [(world, world, "") for world in root.iterfind("worldbody")]
    while waiting:
        body, parent, around = waiting.pop()
        for element in parent:
            if element.tag == "geom":
                yield body, around, element
            elif element.tag == "body":
                waiting.append((element, element, element.get("childclass", around)))
            elif element.tag in ("frame", "replicate"):
                waiting.append((body, element, element.get("childclass", around)))


class _Defaults:
    """Attributes of geoms by class."""

    def __init__(self, root: ET.Element) -> None:
        self.of: dict[str, dict[str, str]] = {"": {}}
        waiting = [(default, "", True) for default in root.iterfind("default")]
        while waiting:
            default, above, top = waiting.pop(0)
            name = "" if top else default.get("class", "")
            values = {**self.of[above], **self.of.get(name, {})}
            for geom in default.iterfind("geom"):
                values |= geom.attrib
            self.of[name] = values
            if top and "class" in default.attrib:
                self.of[default.get("class", "")] = values
            waiting += [(child, name, False) for child in default.iterfind("default")]

    def value(self, geom: ET.Element, around: str, key: str) -> str | None:
        """Of an attribute of a geom in bodies of a class."""
        return geom.get(key, self.of.get(geom.get("class", around), {}).get(key))
