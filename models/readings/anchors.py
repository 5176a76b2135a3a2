"""Closures of an MJCF as Pinocchio reads them: two frames in the frames of two of its joints."""

from __future__ import annotations

import copy
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.content import Content
from screwgauge.models.readings.assemble import Assembly
from screwgauge.models.readings.overheard import overheard
from screwgauge.models.readings.reading import ClosureReading
from screwgauge.reference.mechanism import GROUND

_KINDS = {"connect": "point", "weld": "weld"}
_LOST = "dropped by the library"
_JOINED = ("body1", "body2", "site1", "site2")


@contextmanager
def as_file(root: ET.Element) -> Iterator[str]:
    """Path of a file with an MJCF: Pinocchio reads no text.

    Without its keyframes: of a model of which it drops a part, Pinocchio would refuse those of the whole. And without
    the models that it attaches, which Pinocchio drops.
    """
    root = copy.copy(root)
    for section in (*root.findall("keyframe"), *root.findall("asset")):
        root.remove(section)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.xml"
        path.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
        yield str(path)


def _numbered(root: ET.Element, known: Collection[str], found: list[Content]) -> list[tuple[str, str]]:
    """Gives closures between frames that are known names in their order, and removes the others.

    Returns:
        Kind and former name of each.
    """
    named = list[tuple[str, str]]()
    for section in root.iterfind("equality"):
        for row in [row for row in section if row.tag in _KINDS]:
            if missing := [row.get(side, "") for side in _JOINED if side in row.attrib and row.get(side) not in known]:
                section.remove(row)
                found.append(Content(_LOST, f"{row.tag} {row.get('name')}: Pinocchio cannot place {missing[0]}"))
            else:
                named.append((_KINDS[row.tag], row.get("name", "")))
                row.set("name", f"{len(named):06}")
    return named


def closures(model: Any, assembly: Assembly, root: ET.Element, found: list[Content]) -> dict[str, ClosureReading]:
    """Closures by name.

    Pinocchio 4.1 crashes on those of bodies that it has dropped, and gives sites of bodies that do not move a placement
    of uninitialised memory: such closures it is not shown, and they are added to `found`.
    """
    import pinocchio

    root = copy.deepcopy(root)
    named = _numbered(root, {frame.name for frame in model.frames}, found)
    build = getattr(pinocchio, "buildModelAndLegacyConstraintsFromMJCF", None)
    if build is None:  # before Pinocchio 4
        found += [Content(_LOST, f"closure {name}") for _, name in named]
    if build is None or not named:
        return {}
    try:
        with overheard(), as_file(root) as path:
            model, constraints = build(path)
    except (ValueError, RuntimeError, LookupError) as error:
        found.append(Content(_LOST, f"closures, which Pinocchio refuses ({' '.join(str(error).split())})"))
        return {}
    kinds = ["weld" if c.type == pinocchio.ContactType.CONTACT_6D else "point" for c in constraints]
    # Pinocchio forgets the names; it has points first, each kind in the order of the names that were set above
    named.sort(key=lambda entry: entry[0])
    if [kind for kind, _ in named] != kinds:
        named = [(kind, f"{kind}_{i + 1}") for i, kind in enumerate(kinds)]
    at = {0: (GROUND, np.eye(4))}  # joint -> body that it carries, and the joint's frame in it
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY and frame.parentJoint not in at:
            body, T = assembly.places[frame.name]
            at[frame.parentJoint] = body, T @ np.linalg.inv(frame.placement.homogeneous)
    closed = {}
    for (kind, name), c in zip(named, constraints, strict=True):
        sides = ((c.joint1_id, c.joint1_placement), (c.joint2_id, c.joint2_placement))
        (first, T1), (second, T2) = ((at[i][0], at[i][1] @ placement.homogeneous) for i, placement in sides)
        closed[name] = ClosureReading(kind, first, T1, second, T2)
    return closed
