"""USD as stages: opened with what lies in their folder only, and their physics as elements that tables know."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from screwgauge.models.files.parts import inside
from screwgauge.models.importing import USD
from screwgauge.reference.errors import ModelFileError, remedy_of_import
from screwgauge.reference.files import check_count, digest, is_file

#: Ending of files that hold others.
PACKAGE = ".usdz"
#: Signs of a complaint of usd-core that are passed on.
_SAID = 160
#: What names of attributes begin with that are no matter of looks; after some stands which freedom is meant.
_PHYSICS = ("physics", "physx", "newton", "mjc", "drive", "limit", "state", "omniphysics")
_INSTANCES = ("drive", "limit", "state", "physxLimit", "physxMimicJoint", "physxJointAxis")


def is_usd(path: Path) -> bool:
    """Whether a file is USD, as its ending says."""
    return path.suffix.lower() in USD


def stage_of(path: Path) -> Any:
    """Opens a stage with all its layers, references and payloads.

    Raises:
        ScrewgaugeError: usd-core is not installed, or a file is none, is missing or lies outside the folder.
    """
    try:
        from pxr import Sdf, Tf, Usd, UsdUtils
    except ImportError as error:
        remedy = remedy_of_import(error, "'screwgauge[usd]'")
        raise ModelFileError("is USD, which usd-core reads", str(path), remedy) from None
    quiet = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        waiting, seen = [path], set[Path]()
        while waiting:
            file = waiting.pop()
            if file.resolve() in seen:
                continue
            seen.add(file.resolve())
            check_count(len(seen), "links", str(path))
            digest(file)  # which refuses what is no regular file, and notes what was read
            names = [] if file.suffix == PACKAGE else Sdf.Layer.FindOrOpen(str(file)).GetCompositionAssetDependencies()
            for name in filter(None, names):
                other = inside(file, name, path.parent.resolve(), "references")
                if not is_file(other):
                    raise ModelFileError(f"references '{name}', which is not there", str(file), "put it there")
                waiting.append(other)
        return Usd.Stage.Open(str(path))
    except (Tf.ErrorException, AttributeError) as error:  # a layer that is None cannot be read
        words = " ".join(str(error).rpartition(" : '")[2].partition("matching pxr")[0].split()).strip("' ")
        said = words[:_SAID] if isinstance(error, Tf.ErrorException) else "no layer"
        raise ModelFileError(f"cannot be read as USD ({said})", str(path), "mend the file") from None
    finally:
        quiet.TakeUncoalescedDiagnostics()


def prims(stage: Any) -> Iterator[Any]:
    """All prims that are active, those of instances among them."""
    from pxr import Usd

    return iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))


def is_joint(prim: Any) -> bool:
    """Whether a prim is a joint, or one of a type that usd-core does not know."""
    from pxr import UsdPhysics

    return bool(prim.IsA(UsdPhysics.Joint)) or str(prim.GetTypeName()).endswith("Joint")


def names_of(some: list[Any]) -> list[str]:
    """Names of prims, those that several have with the names of all that they are in."""
    short = [prim.GetName() for prim in some]
    return [
        n if short.count(n) == 1 else str(p.GetPath())[1:].replace("/", ".") for n, p in zip(short, some, strict=True)
    ]


def value(prim: Any, *names: str, default: Any = None) -> Any:
    """Value of the first of some attributes that has one; floats of 32 bits by their shortest decimals."""
    for name in names:
        attribute = prim.GetAttribute(name)
        found = attribute.Get() if attribute else None
        if found is not None:
            kind = str(attribute.GetTypeName().cppTypeName)
            return _decimal(found) if kind == "float" or kind.endswith("f") else found
    return default


def triangles_of(prim: Any) -> Any:
    """Corners of the triangles of a mesh, its faces being fans of them. Shape (m, 3)."""
    import numpy as np

    corners, at = np.array(prim.GetAttribute("faceVertexIndices").Get() or (), dtype=int), 0
    fans = []
    for count in prim.GetAttribute("faceVertexCounts").Get() or ():
        fans += [(at, at + k, at + k + 1) for k in range(1, count - 1)]
        at += count
    return corners[np.array(fans, dtype=int).reshape(-1, 3)]


def _decimal(found: Any) -> Any:
    """Floats of 32 bits as what was written, up to nine digits: a scalar, vector or quaternion (w, x, y, z)."""
    import numpy as np

    if hasattr(found, "GetReal"):
        found = [found.GetReal(), *found.GetImaginary()]
    numbers = [float(str(np.float32(x))) for x in np.atleast_1d(found)]
    return numbers if np.ndim(found) else numbers[0]


def elements(stage: Any) -> ET.Element:
    """Prims with the physics that a file states of them, as elements: body, joint, collider, material, scene, prim."""
    from pxr import UsdPhysics

    default = stage.GetDefaultPrim()
    root = ET.Element("usd", {"name": default.GetName()} if default else {})
    for prim in prims(stage):
        said = {a.GetName(): str(a.Get()) for a in prim.GetAuthoredAttributes() if a.GetName().startswith(_PHYSICS)}
        if not said:
            continue
        tags = {
            "body": prim.HasAPI(UsdPhysics.RigidBodyAPI),
            "joint": is_joint(prim),
            "collider": prim.HasAPI(UsdPhysics.CollisionAPI),
            "scene": prim.IsA(UsdPhysics.Scene),
            "material": prim.HasAPI(UsdPhysics.MaterialAPI),
            "prim": True,
        }
        tag = next(tag for tag, fits in tags.items() if fits)
        ET.SubElement(root, tag, {"name": prim.GetName(), **{_without_instance(n): v for n, v in said.items()}})
    return root


def _without_instance(name: str) -> str:
    """``drive:*:physics:stiffness`` of ``drive:angular:physics:stiffness``."""
    first, *rest = name.split(":")
    return ":".join([first, "*", *rest[1:]]) if first in _INSTANCES and len(rest) > 1 else name
