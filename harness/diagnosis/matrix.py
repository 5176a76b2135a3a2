"""All readings of both files: a difference of models, of loaders or of engines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.differences.static import differences, distinct, sorted_by_size
from screwgauge.diagnosis.differences.words import with_sides
from screwgauge.diagnosis.library_dynamics import LibraryCheck, library_checks
from screwgauge.diagnosis.model import Model, Read
from screwgauge.diagnosis.pairing.branches import missing
from screwgauge.diagnosis.pairing.common import brought
from screwgauge.diagnosis.pairing.mapping import Pairing, paired
from screwgauge.models.readings.read import libraries_for
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError, first_few

_NAMED = 4


@dataclass(frozen=True, slots=True)
class Cell:
    """A file as one library reads it.

    Attributes:
        side: ``A`` or ``B``.
        joints, freedoms, bodies: Counts; zero where the library refuses it.
        mass: Of all that moves [kg].
        refused: Why; empty if it reads it.
    """

    side: str
    library: str
    joints: int = 0
    freedoms: int = 0
    bodies: int = 0
    mass: float = 0.0
    refused: str = ""


@dataclass(frozen=True, slots=True)
class Between:
    """Two readings.

    Attributes:
        kind: ``model`` (two files, one library), ``loader`` (one file, two libraries) or ``both``.
        differences: In words; none if they are the same.
    """

    first: tuple[str, str]
    second: tuple[str, str]
    kind: str
    differences: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Matrix:
    """All of it, in words in `sentences`."""

    cells: tuple[Cell, ...]
    pairs: tuple[Between, ...]
    witnesses: tuple[LibraryCheck, ...]
    sentences: tuple[str, ...]


def matrix_of(a: Model, b: Model, given: Mapping[str, str] | None, seed: int, load: Read, deadline: Deadline) -> Matrix:
    """Reads both files by all libraries that read their formats."""
    cells, models = list[Cell](), dict[tuple[str, str], Model]()
    for side, model in (("A", a), ("B", b)):
        for library in _libraries(model):
            if deadline.over(f"reading of {side} by {library}"):
                continue
            try:
                one = model if library == model.library else _read(model, library, load)
            except ScrewgaugeError as error:
                cells.append(Cell(side, library, refused=error.what))
                continue
            models[side, library] = one
            cells.append(_cell(side, one))
    pairs = tuple(
        _between(models, keys, given, deadline)
        for keys in combinations(models, 2)
        if not deadline.over(f"{' by '.join(keys[0])} beside {' by '.join(keys[1])}")
    )
    seen = tuple(
        replace(witness, side=side)
        for (side, _), model in models.items()
        for witness in library_checks([model], seed, deadline)
    )
    trees = {key: model.reading.roots for key, model in models.items()}
    return Matrix(tuple(cells), pairs, seen, tuple(_sentences(cells, pairs, seen, trees)))


def _libraries(model: Model) -> Sequence[str]:
    return [model.library] if model.file is None or model.library == "screwgauge" else libraries_for(model.file)


def _read(model: Model, library: str, load: Read) -> Model:
    assert model.file is not None
    other = replace(model, library=library)
    return replace(other, reading=other.read_again(model.file, load))


def _cell(side: str, model: Model) -> Cell:
    reading = model.reading
    return Cell(side, model.library, len(reading.joints), reading.freedom, len(reading.bodies), reading.mass)


def _between(
    models: Mapping[tuple[str, str], Model],
    keys: tuple[tuple[str, str], tuple[str, str]],
    given: Mapping[str, str] | None,
    deadline: Deadline,
) -> Between:
    first, second = keys
    one, two = models[first].reading, models[second].reading
    # names of A are given with those of B; the other way round they are the same file's
    pairing = paired(one, two, given if first[0] != second[0] else None)
    sentences = [each.sentence for each in differences_between(one, two, pairing, deadline)]
    kind = "loader" if first[0] == second[0] else "model" if first[1] == second[1] else "both"
    if kind == "loader":
        sentences = [
            with_sides(sentence, f"as {first[1]} reads it", f"as {second[1]} reads it") for sentence in sentences
        ]
    return Between(first, second, kind, tuple(sentences))


def differences_between(
    one: Reading, two: Reading, pairing: Pairing, deadline: Deadline | None = None
) -> list[Difference]:
    """Differences of two readings: parts that one of them lacks, then the largest first."""
    lost = [*missing(one, two, pairing)]
    if not pairing.joints:
        return lost
    return lost + sorted_by_size(distinct(differences(brought(one, two, pairing), deadline)[0]))


def _sentences(
    cells: Sequence[Cell],
    pairs: Sequence[Between],
    seen: Sequence[LibraryCheck],
    trees: Mapping[tuple[str, str], list[str]],
) -> Iterator[str]:
    """What the matrix shows."""
    for cell in cells:
        if cell.refused:
            yield f"{cell.library} refuses {cell.side}: {cell.refused}."
    for side in "AB":
        yield from _loaders(side, [cell for cell in cells if cell.side == side and not cell.refused], pairs, trees)
    for pair in pairs:
        if pair.kind == "model":
            what = first_few(pair.differences, _NAMED, "; ") or "nothing differs"
            yield f"The two files, both read by {pair.first[1]}: {what}."
    for witness in seen:
        if not witness.agrees:
            what = witness.failed or f"computes otherwise than it reads ({max(witness.scaled.values()):.2g})"
            yield f"{witness.library} on {witness.side}: {what}."
        if witness.omits:
            yield f"Inverse dynamics of {witness.library} on {witness.side} leave out {', '.join(witness.omits)}."


def _loaders(
    side: str, cells: Sequence[Cell], pairs: Sequence[Between], trees: Mapping[tuple[str, str], list[str]]
) -> Iterator[str]:
    """How one file is read by several libraries."""
    own = [pair for pair in pairs if pair.kind == "loader" and pair.first[0] == side]
    if own and not any(pair.differences for pair in own):
        yield f"{side} is read alike by {' and '.join(cell.library for cell in cells)}."
    full = max(cells, key=lambda cell: cell.freedoms, default=None)
    for cell in cells:
        if full is not None and cell.freedoms < full.freedoms:
            yield (
                f"The loader of {cell.library} keeps {cell.freedoms} of {full.freedoms} degrees of freedom of {side}, "
                f"{cell.bodies} of {full.bodies} bodies and {cell.mass:.6g} of {full.mass:.6g} kg, without a word"
                f"{_trees(trees[side, cell.library], trees[side, full.library])}."
            )
    for pair in own:
        if pair.differences:
            what = first_few(pair.differences, _NAMED, "; ")
            yield f"{side} by {pair.first[1]} and by {pair.second[1]}: {what}."


def _trees(kept: Sequence[str], full: Sequence[str]) -> str:
    """Which of the trees that hang on the ground a loader keeps, if not all."""
    if len(kept) >= len(full):
        return ""
    first = "the first, " if list(kept) == list(full[: len(kept)]) and len(kept) == 1 else ""
    return f": of the {len(full)} trees that hang on the ground ({', '.join(full)}) only {first}{', '.join(kept)}"
