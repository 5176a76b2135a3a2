"""Converts names of a model file to names that a description accepts."""

from __future__ import annotations

import re
from collections.abc import Iterable

from screwgauge.reference.mechanism import GROUND

#: Reserved names: the ground of a description, MuJoCo's world, and the agent that exerts loads.
TAKEN = (GROUND, "world", "environment")


def accept_names(names: Iterable[str], kind: str, taken: Iterable[str] = TAKEN) -> dict[str, str]:
    """Map each name to itself, or to a similar unused name that a description accepts.

    Args:
        kind: Replacement for a name that lacks usable characters.
    """
    wanted = list(dict.fromkeys(names))
    fine = {name for name in wanted if re.fullmatch(r"\w[\w.:+-]*", name) and name not in {*taken}}
    used, result = {*taken, *fine}, {}
    for name in wanted:
        result[name] = name if name in fine else free_name(re.sub(r"[^\w.:+-]+", "-", name).strip("-.:+") or kind, used)
    return result


def free_name(name: str, used: set[str]) -> str:
    """Return the name, with a number appended if it is in use, and mark it as used."""
    number, base = 2, name
    while name in used:
        name, number = f"{base}-{number}", number + 1
    used.add(name)
    return name
