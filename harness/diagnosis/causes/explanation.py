"""Why torques of two models differ: from their differences to causes and proof."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from screwgauge.diagnosis.causes.attribution import Attribution, Torques, attribute, changes_of
from screwgauge.diagnosis.causes.backfill import Backfill, backfill
from screwgauge.diagnosis.causes.edits import Files, Group, edits
from screwgauge.diagnosis.causes.grouping import Grouping
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.patch import Opened, opened
from screwgauge.diagnosis.properties import Change
from screwgauge.models.files.xml import UnpatchableError
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.files import read_file

PROOF = "proof by backfill"


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """Why the torques of two models differ.

    Attributes:
        proof: Of all changes; None where torques do not differ, no change of B is known, or there was no time for it.
        fix: The same, where torques agree, too; None where there are no changes.
    """

    attribution: Attribution
    proof: Backfill | None = None
    fix: Backfill | None = None


def explained(
    torques: Torques,
    readings: tuple[Reading, Reading],
    paths: tuple[Path | None, Path | None],
    differences: Sequence[Difference],
    read: Callable[[Path], Reading],
    deadline: Deadline,
    written: Reading | None = None,
    of_whole: Group | None = None,
) -> Explanation:
    """Attributes the torque difference of B to its static differences and proves it.

    Args:
        readings, paths: Of A and B, as they were read.
        differences: Of B to A, in the order in which their changes are to be made.
        read: Reads a copy of B's file by B's library.
        written: Reading of B's file, where its loops are cut elsewhere to be compared.
        of_whole: Differences that one statement on the whole explains.
    """
    a, b = readings
    files = Files(_opened(paths[0], a), _opened(paths[1], b))
    made = edits(differences, b, files)

    def groups(weight: Callable[[int], float]) -> list[Group]:
        return Grouping(differences, b, files, weight, made, of_whole).groups()

    attribution = attribute(torques, b, differences, groups, made, deadline, of_whole.differences if of_whole else ())
    changes, seen = changes_of(differences), changes_of(differences[i] for i in attribution.seen)
    if not changes or deadline.over(PROOF):
        return Explanation(attribution)
    whole = _proved(torques, b, changes, paths, read, written)
    if not whole.agrees and 0 < len(seen) < len(changes):  # what no torque shows may stand in the way
        alone = _proved(torques, b, seen, paths, read, written)
        whole = alone if alone.agrees else whole
    return Explanation(attribution, whole if seen else None, whole)


def _proved(
    torques: Torques,
    b: Reading,
    changes: Sequence[Change],
    paths: tuple[Path | None, Path | None],
    read: Callable[[Path], Reading],
    written: Reading | None,
) -> Backfill:
    """Proof by backfill, in the reading where both are of one file: no change of it makes two loaders agree."""
    if paths[0] is None or paths[0] != paths[1]:
        return backfill(torques, b, changes, paths[1], read, written, read_file(paths[0]) if paths[0] else "")
    proof = backfill(torques, b, changes, None, read)
    return replace(proof, why_not=("A and B are one file, which two libraries read differently",))


def _opened(path: Path | None, reading: Reading) -> Opened | None:
    """A model file with its reading; None where the two do not match, or there is none."""
    try:
        return opened(read_file(path), reading) if path else None
    except (ScrewgaugeError, UnpatchableError):
        return None
