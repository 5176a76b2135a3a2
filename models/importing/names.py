"""Names of a model file as a description accepts them."""

from __future__ import annotations

import re
from collections.abc import Iterable

from screwgauge.reference.mechanism import GROUND

#: Names that are taken: the fixed world of a description, that of MuJoCo, and who exerts loads.
TAKEN = (GROUND, "world", "environment")


def accept_names(names: Iterable[str], kind: str, taken: Iterable[str] = TAKEN) -> dict[str, str]:
    """Return each name, or a similar unused one that a description accepts.

    Args:
        kind: What stands in for a name that has no usable character.
    """
    wanted = list(dict.fromkeys(names))
    fine = {name for name in wanted if re.fullmatch(r"\w[\w.:+-]*", name) and name not in {*taken}}
    used, result = {*taken, *fine}, {}
    for name in wanted:
        result[name] = name if name in fine else free_name(re.sub(r"[^\w.:+-]+", "-", name).strip("-.:+") or kind, used)
    return result


def free_name(name: str, used: set[str]) -> str:
    """Return the name, numbered if it is used, and mark it as used."""
    number, base = 2, name
    while name in used:
        name, number = f"{base}-{number}", number + 1
    used.add(name)
    return name
