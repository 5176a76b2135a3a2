"""Which joints and bodies of two models names, or a map of the user's, tell to be the same."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.tables import read_toml


@dataclass(frozen=True, slots=True)
class Names:
    """Partners by their names.

    Attributes:
        joints, bodies: Name in A -> name in B.
        how: Joint of A -> ``given``, ``name`` or ``similar name``.
    """

    joints: Mapping[str, str]
    bodies: Mapping[str, str]
    how: Mapping[str, str]


def read_map(path: Path) -> dict[str, str]:
    """Read names of A and of B from a TOML file.

    Raises:
        DescriptionError: It is no table of names.
    """
    given = read_toml(path)
    for name, other in given.items():
        if not isinstance(other, str):
            raise DescriptionError(f"'{name}' is no name", str(path), 'write lines such as "joint of A" = "joint of B"')
    return given


def partners(a: Reading, b: Reading, given: Mapping[str, str] | None = None) -> Names:
    """Find partners as given, by name, then by similar name.

    Args:
        given: Joints or bodies of A -> those of B.

    Raises:
        UnknownNameError: A given name is of neither.
    """
    given = given or {}
    for name, other in given.items():
        if name not in a.joints and name not in a.bodies:
            raise UnknownNameError("joint or body of A", name, [*a.joints, *a.bodies], "map")
        if other not in b.joints and other not in b.bodies:
            raise UnknownNameError("joint or body of B", other, [*b.joints, *b.bodies], "map")
    joints = {name: other for name, other in given.items() if name in a.joints and other in b.joints}
    how = dict.fromkeys(joints, "given")
    for similar, word in ((str, "name"), (_plain, "similar name")):
        found = _alike(a, b, joints, similar)
        joints, how = joints | found, how | dict.fromkeys(found, word)
    if not joints:
        joints = _prefixed(a, b)
        how = dict.fromkeys(joints, "similar name")
    bodies = {name: other for name, other in given.items() if name in a.bodies and other in b.bodies}
    bodies |= {name: name for name in a.bodies if name in b.bodies and name not in bodies}
    return Names(joints, bodies, how)


def _alike(a: Reading, b: Reading, joints: Mapping[str, str], similar: Callable[[str], str]) -> dict[str, str]:
    """Further joints of one kind whose names are the only ones that look so."""
    left = [name for name in b.joints if name not in joints.values()]
    keys, own = [similar(name) for name in left], [similar(name) for name in a.joints if name not in joints]
    found = {}
    for name in (name for name in a.joints if name not in joints):
        key = similar(name)
        if keys.count(key) == 1 == own.count(key):
            other = left[keys.index(key)]
            if a.joints[name].kind == b.joints[other].kind:
                found[name] = other
    return found


def _prefixed(a: Reading, b: Reading) -> dict[str, str]:
    """Joints of which the names of one model are those of the other with one and the same text before them."""
    for one, two, back in ((a, b, False), (b, a, True)):
        first = next(iter(one.joints), "")
        for prefix in (name.removesuffix(first) for name in two.joints if first and name.endswith(first)):
            longer = {name: prefix + name for name in one.joints}
            kinds = all(n in two.joints and two.joints[n].kind == one.joints[m].kind for m, n in longer.items())
            if kinds and len(longer) == len(two.joints):
                return {n: m for m, n in longer.items()} if back else longer
    return {}


def _plain(name: str) -> str:
    """A name without what files add to it: case, separators, the words joint and link, a robot's name before it."""
    return re.sub(r"[^a-z0-9]|joint|link|jnt", "", name.rpartition("/")[2].lower())
