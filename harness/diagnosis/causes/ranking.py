"""What two models differ in as causes: one factor on many parts is one, and the one with the largest share leads."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.diagnosis.causes.attribution import Torques, changes_of
from screwgauge.diagnosis.causes.conventions import UNITS
from screwgauge.diagnosis.differences.change import Difference, applied
from screwgauge.diagnosis.differences.words import NAMES
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import UnknownNameError, first_few
from screwgauge.reference.rotations import Array

#: Properties that one factor may change in many places, and how these are called.
SCALED = {
    **dict.fromkeys(("mass", "inertia", "gravcomp"), ("body", "bodies")),
    **dict.fromkeys(("armature", "damping", "friction", "stiffness"), ("joint", "joints")),
    "gear": ("motor", "motors"),
}
PLURALS = {"mass": "masses", "inertia": "inertias", "stiffness": "stiffnesses", "gear": "gears"}
#: From how many places on a factor is one cause; and how far each may be from it, relative.
SEVERAL, FACTOR = 3, 1e-5
#: A share below which a cause counts as one that no torque shows.
NOTHING = 1e-9
_NAMED = 3


@dataclass(frozen=True, slots=True)
class Cause:
    """One or several differences with one cause.

    Attributes:
        sentence: What it is.
        differences: Numbers of them.
        share: Of the torque difference, the projection of what it makes on all of that, one scale a unit; the shares of
            all causes add up to 1 where they do not depend on each other. NaN where no change of B is known.
    """

    sentence: str
    differences: tuple[int, ...]
    share: float = math.nan


def ranked(found: Sequence[Difference], torques: Torques, b: Reading) -> tuple[Cause, ...]:
    """All causes: what nothing can be said of by torques, then those with the largest share.

    Args:
        b: The reading that the changes are of.
    """
    start = _weighed(torques, torques.of(b) - torques.a)
    total = float(np.vdot(start, start))

    def share(cause: Cause) -> float:
        changes = changes_of(found[i] for i in cause.differences)
        if not changes or not 0.0 < total < math.inf:
            return math.nan
        try:
            left = _weighed(torques, torques.of(applied(b, changes)) - torques.a)
        except UnknownNameError:  # of a part that another change brings
            return math.nan
        off = float(np.vdot(start, start - left)) / total
        return off if math.isfinite(off) else math.nan

    causes = [replace(cause, share=share(cause)) for cause in _grouped(found, b)]
    return tuple(sorted(causes, key=lambda cause: _order(cause, found)))


def _order(cause: Cause, found: Sequence[Difference]) -> tuple[int, float, float]:
    size = max(found[i].size for i in cause.differences)
    if math.isnan(cause.share):
        return (0 if math.isinf(size) else 2), 0.0, -size
    return 1, -cause.share if abs(cause.share) > NOTHING else 0.0, -size


def _weighed(torques: Torques, off: Array) -> Array:
    """A difference over the largest torque of the same unit."""
    units, most = np.array(torques.unit), np.abs(torques.a).max(axis=0, initial=0.0)
    scale = np.array([most[units == unit].max() or 1.0 for unit in units])
    return np.asarray(off / scale)


def _grouped(found: Sequence[Difference], b: Reading) -> Iterator[Cause]:
    """Differences that one factor, or one value, makes in many places as one; each other one alone."""
    groups: dict[tuple[str, str, float], list[int]] = defaultdict(list)
    for i, each in enumerate(found):
        if each.what in SCALED and each.kind == "model" and (key := _factor(each)):
            groups[each.what, *key].append(i)
    groups = {key: numbers for key, numbers in groups.items() if len(numbers) >= SEVERAL}
    said = {i for numbers in groups.values() for i in numbers}
    for (what, how, value), numbers in groups.items():
        yield Cause(_sentence(what, how, value, [found[i] for i in numbers], b), tuple(numbers))
    alone: dict[str, list[int]] = defaultdict(list)
    for i, each in enumerate(found):
        if i not in said:
            alone[each.sentence].append(i)  # shares of one body have its sentence
    for sentence, numbers in alone.items():
        yield Cause(sentence, tuple(numbers))


def _factor(each: Difference) -> tuple[str, float] | None:
    """``times`` and what B's value is of A's, or ``is`` and the value where A has none."""
    if each.a is None or each.b is None:
        return None
    a, b = each.whole if each.whole and each.whole[0] is not None else (each.a, each.b)
    a, b = np.asarray(a, dtype=float).ravel(), np.asarray(b, dtype=float).ravel()
    square = float(a @ a)
    if square == 0.0:
        return ("is", float(f"{b[0]:.6g}")) if len(b) == 1 else None
    factor = float(a @ b) / square
    fits = float(np.abs(b - factor * a).max()) <= FACTOR * float(np.abs(b).max())
    return ("times", float(f"{factor:.5g}")) if fits and factor != 1.0 else None


def _sentence(what: str, how: str, value: float, members: Sequence[Difference], b: Reading) -> str:
    one, many = SCALED[what]
    all_ = len(b.joints if one == "joint" else b.actuators if one == "motor" else _solid(b))
    who = f"all {len(members)} {many}" if len(members) >= all_ else f"{len(members)} of {all_} {many}"
    names = first_few([each.item_a or each.item_b for each in members], _NAMED)
    noun = PLURALS.get(what, NAMES.get(what, what))
    if how == "is":
        return f"{noun} of {who}: {value:g} {members[0].unit} in B, 0 in A ({names})"
    unit = UNITS.get(what, {}).get(value, "")
    percent = f"{100.0 * (value - 1.0):+.2f} %" if 0.0 < value < 10.0 else f"x {value:g}"
    meant = f", as if written {unit}" if unit else ""
    return f"{noun} of {who}: {value:g} times those of A in B ({percent}{meant}: {names})"


def _solid(b: Reading) -> list[str]:
    return [name for name, body in b.bodies.items() if body.mass]
