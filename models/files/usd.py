"""Opens USD stages whose layers are all in the folder of the stage, and lists their physics as XML elements."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.files.parts import locate_file
from screwgauge.models.formats import floats
from screwgauge.models.importing import USD
from screwgauge.reference.errors import ModelFileError, UnknownNameError, remedy_of_import
from screwgauge.reference.files import check_count, digest, is_file
from screwgauge.reference.rotations import Array

#: Suffix of packages, which contain other files.
PACKAGE = ".usdz"
AXES = "XYZ"
#: Number of characters of a usd-core error message that are shown.
_SAID = 160
#: Prefixes of attributes that are not purely visual; after some of them, the name specifies a degree of freedom.
_PHYSICS = ("physics", "physx", "newton", "mjc", "drive", "limit", "state", "omniphysics")
_INSTANCES = ("drive", "limit", "state", "physxLimit", "physxMimicJoint", "physxJointAxis")


def is_usd(path: Path) -> bool:
    """Return True if a file has a USD suffix."""
    return path.suffix.lower() in USD


def stage_of(path: Path) -> Any:
    """Open a stage with all its layers, references and payloads.

    Raises:
        ScrewgaugeError: usd-core is not installed, or a file is not USD, is missing or lies outside the folder.
    """
    try:
        from pxr import Sdf, Tf, Usd, UsdUtils
    except ImportError as error:
        remedy = remedy_of_import(error, "'screwgauge[usd]'")
        raise ModelFileError("is USD, which requires usd-core", str(path), remedy) from None
    quiet = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        waiting, seen = [path], set[Path]()
        while waiting:
            file = waiting.pop()
            if file.resolve() in seen:
                continue
            seen.add(file.resolve())
            check_count(len(seen), "links", str(path))
            digest(file)  # rejects all but regular files, and records that the file was read
            names = [] if file.suffix == PACKAGE else Sdf.Layer.FindOrOpen(str(file)).GetCompositionAssetDependencies()
            for name in filter(None, names):
                other = locate_file(file, name, path.parent.resolve(), "references")
                if not is_file(other):
                    raise ModelFileError(f"references '{name}', which does not exist", str(file), "add that file")
                waiting.append(other)
        return Usd.Stage.Open(str(path))
    except (Tf.ErrorException, AttributeError) as error:  # AttributeError: an unreadable layer is None
        words = " ".join(str(error).rpartition(" : '")[2].partition("matching pxr")[0].split()).strip("' ")
        said = words[:_SAID] if isinstance(error, Tf.ErrorException) else "no layer"
        raise ModelFileError(f"cannot be read as USD ({said})", str(path), "correct the file") from None
    finally:
        quiet.TakeUncoalescedDiagnostics()


def prims(top: Any) -> Iterator[Any]:
    """Yield a prim and all active prims below it, including prims of instances."""
    from pxr import Usd

    return iter(Usd.PrimRange(top, Usd.TraverseInstanceProxies()))


def is_joint(prim: Any) -> bool:
    """Return True for a joint, and for a prim of an unknown type whose type name ends in ``Joint``."""
    from pxr import UsdPhysics

    return bool(prim.IsA(UsdPhysics.Joint)) or str(prim.GetTypeName()).endswith("Joint")


def names_of(some: list[Any]) -> list[str]:
    """Return the names of prims; replace names that occur several times with full paths."""
    short = [prim.GetName() for prim in some]
    return [
        n if short.count(n) == 1 else str(p.GetPath())[1:].replace("/", ".") for n, p in zip(short, some, strict=True)
    ]


def value(prim: Any, name: str, default: Any = None) -> Any:
    """Return the value of an attribute, at the earliest time if it varies."""
    from pxr import Usd

    attribute = prim.GetAttribute(name)
    found = attribute.Get(Usd.TimeCode.EarliestTime()) if attribute else None
    return default if found is None else found


def numbers(prim: Any, *names: str, default: Sequence[float]) -> Array:
    """Return the numbers of the first attribute that has a value; round 32-bit values to their shortest decimals.

    Args:
        default: Values to use if no attribute has a value; infinite values in the file are accepted only if a default
            is infinite. Shape (n,).

    Raises:
        ModelFileError: The value does not consist of n numbers, or a number is NaN or, with finite defaults, infinite.
    """
    for name in names:
        if (found := value(prim, name)) is not None and np.size(found):
            words = [found.GetReal(), *found.GetImaginary()] if hasattr(found, "GetReal") else np.atleast_1d(found)
            where, infinite = prim.GetStage().GetRootLayer().realPath, bool(np.isinf(default).any())
            kind = str(prim.GetAttribute(name).GetTypeName().cppTypeName)
            x = floats(words, len(default), f"{name} of {prim.GetPath()}", where, infinite=infinite)
            return np.array([float(str(np.float32(e))) for e in x]) if kind == "float" or kind.endswith("f") else x
    return np.array(default)


def number(prim: Any, *names: str, default: float = 0.0) -> float:
    """Return a number; see `numbers`."""
    return float(numbers(prim, *names, default=(default,))[0])


def axis_of(prim: Any, name: str, default: str) -> str:
    """Return the axis ``X``, ``Y`` or ``Z`` that an attribute names.

    Raises:
        UnknownNameError: The attribute has a different value.
    """
    found = str(value(prim, name, default))
    if found not in AXES:
        raise UnknownNameError(f"{name} of {prim.GetPath()}", found, AXES, prim.GetStage().GetRootLayer().realPath)
    return found


def triangles_of(prim: Any, n: int) -> Array:
    """Split the faces of a mesh into triangle fans and return the corner indices. Shape (m, 3).

    Args:
        n: Number of points of the mesh.

    Raises:
        ModelFileError: A face refers to a missing point, or the face counts do not match the indices.
    """
    corners, counts = (np.array(value(prim, f"faceVertex{what}", ()), dtype=int) for what in ("Indices", "Counts"))
    if counts.sum() != len(corners) or counts.min(initial=0) < 0 or not ((corners >= 0) & (corners < n)).all():
        where = prim.GetStage().GetRootLayer().realPath
        raise ModelFileError(f"mesh {prim.GetPath()} has faces with missing corners", where, "correct its faces")
    starts = (np.cumsum(counts) - counts).tolist()
    pairs = zip(starts, counts.tolist(), strict=True)
    fans = [(at, at + k, at + k + 1) for at, count in pairs for k in range(1, count - 1)]
    return np.asarray(corners[np.array(fans, dtype=int).reshape(-1, 3)])


def elements(stage: Any) -> ET.Element:
    """Convert prims with authored physics to elements: body, joint, collider, material, scene or prim."""
    from pxr import UsdPhysics

    default = stage.GetDefaultPrim()
    root = ET.Element("usd", {"name": default.GetName()} if default else {})
    for prim in prims(stage.GetPseudoRoot()):
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
    """Replace the instance in the name of an attribute: ``drive:angular:physics:stiffness`` -> ``drive:*:...``."""
    first, *rest = name.split(":")
    known = first in _INSTANCES and len(rest) > 1 and rest[0] != "distance"  # limits of distance joints are ignored
    return ":".join([first, "*", *rest[1:]]) if known else name
