"""From two readings and their differences to a cause and its proof."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from screwgauge.diagnosis.causes.attribution import Attribution, Torques, attribute
from screwgauge.diagnosis.causes.backfill import Backfill, backfill
from screwgauge.diagnosis.causes.growth import Growth
from screwgauge.diagnosis.causes.hypotheses import hypotheses
from screwgauge.diagnosis.causes.hypothesis import Files
from screwgauge.diagnosis.causes.ranking import Cause
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.change import Change, Difference
from screwgauge.diagnosis.files.layout import UnpatchableError
from screwgauge.diagnosis.files.opened import Opened, opened
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.files import read_file

PROOF = "proof by backfill"


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """Why the torques of two models differ.

    Attributes:
        proof: None where the torques do not differ, nothing explains it, or there was no time for it.
        growth: Of the torque difference with speed; None where it does not vanish at rest.
        soft: Attribution of forces of soft equalities to their softness; None where that does not differ.
        fix: The same of all changes, what no torque shows among them; None where there are none.
        causes: All differences by cause, the one with the largest share first.
    """

    attribution: Attribution
    proof: Backfill | None
    fix: Backfill | None = None
    growth: Growth | None = None
    soft: Attribution | None = None
    causes: tuple[Cause, ...] = ()


def explained(
    torques: Torques,
    readings: tuple[Reading, Reading],
    paths: tuple[Path | None, Path | None],
    differences: Sequence[Difference],
    read: Callable[[Path], Reading],
    deadline: Deadline,
) -> Explanation:
    """Attributes the torque difference of B to its static differences and proves it.

    Args:
        readings, paths: Of A and B, as they were read.
        differences: Of B to A, in the order in which their changes are to be made.
        read: Reads a copy of B's file by B's library.
    """
    a, b = readings
    files = Files(_beside(paths[0], a), _beside(paths[1], b))
    attribution = attribute(torques, b, differences, hypotheses(differences, b, files), deadline)
    if not attribution.steps or deadline.over(PROOF):
        return Explanation(attribution, None)
    return Explanation(attribution, proved(torques, b, attribution.changes, paths, read))


def proved(
    torques: Torques,
    b: Reading,
    changes: Sequence[Change],
    paths: tuple[Path | None, Path | None],
    read: Callable[[Path], Reading],
) -> Backfill:
    """Proof by backfill, in the reading where both are of one file: no change of it makes two loaders agree."""
    if paths[0] is None or paths[0] != paths[1]:
        return backfill(torques, b, changes, paths[1], read)
    proof = backfill(torques, b, changes, None, read)
    return replace(proof, why_not=("A and B are one file, which two libraries read differently",))


def _beside(path: Path | None, reading: Reading) -> Opened | None:
    """A model file beside its reading; None where the two do not fit, or there is none."""
    try:
        return opened(read_file(path), reading) if path else None
    except (ScrewgaugeError, UnpatchableError):
        return None
