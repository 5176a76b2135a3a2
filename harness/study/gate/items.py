"""Items, which represent the arguments of a gate, and rows with their results. Both can be pickled."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from screwgauge.judging.residual import JUDGE, Residual
from screwgauge.models.files.loops import OWN as LOOPS
from screwgauge.models.importing import SUFFIXES, is_model
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.errors import DescriptionError, UnknownNameError, quote
from screwgauge.reference.files import A_PATH, is_file, is_path, why
from screwgauge.reference.tables import check_keys, positive, read_toml
from screwgauge.scene.default import SUFFIX
from screwgauge.scene.read import scene_names
from screwgauge.study.outcome import EXIT, Outcome

#: Keys that only scenes have: a file with any of them is treated as a scene, and rejected if it is incomplete.
_OF_SCENES = frozenset(("mechanism", "motion", "time", "forward"))


@dataclass(frozen=True, slots=True)
class Item:
    """A scene, or a pair of model files.

    Attributes:
        name: Name in tables, baselines and JUnit.
        files: Built-in name or path; two paths for a pair.
    """

    name: str
    files: tuple[str, ...]


def items(what: Iterable[str | Path]) -> list[Item]:
    """Convert arguments to items: model files form pairs, in order; a single model file counts as a scene.

    Args:
        what: Built-in scenes, files, folders; all built-in scenes if empty.

    Raises:
        ScrewgaugeError: An argument is unknown, a folder has no scene, or two items have the same name.
    """
    what = [*what]
    for each in what:
        if not isinstance(each, str | Path) or each == "":  # an empty path would mean the current folder
            raise DescriptionError(f"{quote(each)} is not a name or path", "check", "pass scenes, files or folders")
    given = [*map(str, what)] or scene_names()
    models = [name for name in given if is_model(name)]
    if len(models) > 1 and len(models) % 2:
        what_is = f"an odd number of model files ({len(models)}): the last file, {models[-1]}, has no partner"
        raise DescriptionError(what_is, "check", "pass model files in pairs, or a single file")
    every = [Item(_stem(name), (name,)) for name in _scenes(name for name in given if name not in models)]
    if len(models) == 1:
        every.append(Item(_stem(models[0]), (models[0],)))
    else:
        pairs = zip(models[::2], models[1::2], strict=True)
        every += [Item(f"{Path(a).name} - {Path(b).name}", (a, b)) for a, b in pairs]
    for name in given:
        if name not in scene_names() and not is_file(Path(name)) and not _is_folder(name):
            if not is_path(name) and not is_model(name):
                raise UnknownNameError("scene", name, scene_names(), besides=A_PATH)
            raise DescriptionError("does not exist or is not a regular file", name, "check the path")
    _check_names(every)
    return every


def _is_folder(name: str) -> bool:
    return name not in scene_names() and os.path.isdir(name)


def _scenes(names: Iterable[str]) -> Iterator[str]:
    for name in names:
        if not _is_folder(name):
            yield name
            continue
        inside = [str(path) for path in _files_in(name, ".toml") if _is_scene(path)]
        if not inside:
            raise DescriptionError("contains no scene", name, "choose a folder of TOML files with the key 'mechanism'")
        yield from inside


def _files_in(folder: str, *endings: str) -> list[Path]:
    """Return the files in a folder that have one of the given extensions.

    Raises:
        DescriptionError: The folder cannot be read.
    """
    try:
        names = sorted(os.listdir(folder))
    except OSError as error:
        raise DescriptionError(f"cannot be read ({why(error)})", folder, "check the path") from None
    return [Path(folder) / name for name in names if name.lower().endswith(endings)]


def find_unread(what: Iterable[str | Path], read: Iterable[str]) -> list[str]:
    """Return descriptions, scenes and models that were not read although their folder is among the arguments.

    Args:
        what: Arguments of `items`.
        read: Paths of the files that were read.
    """
    known = {os.path.realpath(name) for name in read}
    files = [
        str(path)
        for folder in filter(_is_folder, map(str, what))
        for path in _files_in(folder, ".toml", *SUFFIXES)
        if os.path.realpath(path) not in known and not path.name.endswith(LOOPS)
    ]
    return list(dict.fromkeys(files))


def _is_scene(path: Path) -> bool:
    """Return True for a scene, even if incomplete, and for an unreadable file, so that the check reports the reason."""
    if path.name.endswith(LOOPS):
        return False
    try:
        return not _OF_SCENES.isdisjoint(read_toml(path))
    except DescriptionError:
        return True


def _stem(name: str) -> str:
    return name if name in scene_names() else Path(name).name.removesuffix(SUFFIX).removesuffix(".toml")


def _check_names(every: Iterable[Item]) -> None:
    before: dict[str, Item] = {}
    for item in every:
        other = before.setdefault(item.name, item)
        if other is not item:
            what = f"two items are named '{item.name}': {', '.join(other.files)} and {', '.join(item.files)}"
            raise DescriptionError(what, "check", "rename one of them, or check them separately")


def read_tolerances(given: str | Path | Mapping[str, float] | None) -> dict[str, float]:
    """Read the largest allowed scaled error of each quantity."""
    if given is None:
        return {}
    table, where = (dict(given), "tolerances") if isinstance(given, Mapping) else (read_toml(Path(given)), str(given))
    check_keys(table, QUANTITIES, where)
    return {name: positive(value, f"{where}, {name}") for name, value in table.items()}


#: Allowed scaled errors above this value are reported.
WIDE = 1e-2


def admissions(tolerances: Mapping[str, float], allow: Iterable[str] = ()) -> list[str]:
    """List what a user explicitly allows: entries of ``allow``, and tolerances above `WIDE`."""
    wide = (f"{quantity} to {value:.3g}" for quantity, value in tolerances.items() if value > WIDE)
    return [*allow, *wide]


@dataclass(frozen=True, slots=True)
class GateRow:
    """Result for a scene or a pair of models.

    Attributes:
        scene: Name of the scene; for a pair, ``A.urdf - B.xml``.
        status: Outcome.
        sentence: Description of the result, with the cause if known.
        errors: One error for each quantity, pair and unit.
        coverage: Sentence on what the motion tests.
        versions: Engine -> version.
        files: File -> SHA-256.
        doubts: Sentences that qualify an agreement, given for any status: on implausible values and on model files.
        remarks: Sentences that do not qualify an agreement, e.g. that the home pose was solved for.
        file, line: Likely place of the cause; line 0 if unknown.
        unread: Sentences on files that the scene names but that were not read.
        read: Names of the files that were read, as given.
        more: Sentence on content of the files that is not part of the compared rigid machine; empty if there is none.
        admitted: What the user explicitly allows: differences and files listed in the scene, and tolerances above
            `WIDE`.
        curve: For a scene that does not pass, time [s] and both values of the worst component at selected samples.
    """

    scene: str
    status: Outcome
    sentence: str
    errors: Sequence[Residual] = ()
    coverage: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    file: str = ""
    line: int = 0
    seconds: float = 0.0
    doubts: Sequence[str] = ()
    unread: Sequence[str] = ()
    read: Sequence[str] = ()
    more: str = ""
    admitted: Sequence[str] = ()
    curve: Sequence[tuple[float, float, float]] = ()
    remarks: Sequence[str] = ()

    @property
    def ok(self) -> bool:
        """True if the row passes."""
        return EXIT[self.status] == 0

    @property
    def worst(self) -> Residual | None:
        """The largest error relative to its tolerance; errors out of tolerance, then those of pairs, come first."""
        return max(self.errors, key=lambda one: (not one.ok, one.b != JUDGE, one.share), default=None)
