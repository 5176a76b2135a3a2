"""A side of a diagnosis: a model file, by the library that is to read it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from screwgauge.diagnosis.differences.digits import ALL, digits_of
from screwgauge.diagnosis.pairing.common import STANDARD
from screwgauge.diagnosis.pairing.cuts import Copy, copies, united
from screwgauge.diagnosis.pairing.mapping import Pairing, paired
from screwgauge.models.catalog import load_mechanism
from screwgauge.models.expected import expected_reading
from screwgauge.models.importing import is_model
from screwgauge.models.readings.loops import with_loops
from screwgauge.models.readings.read import LIBRARIES, libraries_for, read
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import weighed_copy
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.files import read_file
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.default import gravity_of

#: Reads a file by a library: (file, library, floating).
Read = Callable[[Path, str, bool], Reading]
CUTS = ("minimal", "full")


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A model as one library reads it.

    Attributes:
        label: As it was given.
        file: None of a mechanism built in.
        library: ``pinocchio``, ``mujoco``, ``yourdfpy``; ``screwgauge`` of a description.
        floating: Whether the base of a URDF is read as moving freely.
        digits: That its numbers are cut to.
        sha256: Of the file; empty without one.
        loops: File beside a URDF that says what closes its loops.
        parts: Bodies that are taken for parts of others, as the other model has them.
        own: The user's file, where `file` is a copy of it that says mass and inertia of meshes.
        as_read: What the library itself has of the file, without these and without joints of which a file beside it
            changes the types; None where that is the reading.
    """

    label: str
    file: Path | None
    library: str
    reading: Reading
    floating: bool = False
    digits: int = ALL
    sha256: str = ""
    loops: Path | None = None
    parts: tuple[Copy, ...] = ()
    as_read: Reading | None = None
    own: Path | None = None

    @property
    def says_closures(self) -> bool:
        """A URDF cannot, without a file beside it."""
        return self.library == "screwgauge" or self.reading.gravity is not None or bool(self.reading.closures)

    def read_again(self, file: Path, load: Read) -> Reading:
        """What its library reads from a file in its place."""
        reading = load(file, self.library, self.floating)
        return united(with_loops(reading, self.loops) if self.loops else reading, self.parts)

    def united(self, parts: Iterable[Copy]) -> Model:
        """With bodies that are parts of others."""
        given = tuple(parts)
        if not given:
            return self
        return replace(self, parts=given, as_read=self.as_read or self.reading, reading=united(self.reading, given))


@dataclass(frozen=True, slots=True)
class Weighed:
    """A side of a diagnosis beside a copy of it that says mass and inertia of meshes.

    Attributes:
        given: What the user gave.
        copy: Of the file; the file itself where no mass comes from meshes.
    """

    given: str
    copy: Path

    def __str__(self) -> str:
        return self.given


def weighed(given: str | Path, folder: Path) -> Weighed:
    """A side of a diagnosis with mass and inertia from meshes, if some come from there.

    Args:
        folder: Of the copy.

    Raises:
        ScrewgaugeError: Meshes cannot be read, or lie outside the folder of the file.
    """
    file, _ = _split(str(given))
    copy = weighed_copy(file, folder) if is_model(file) else None
    return Weighed(str(given), copy or file)


def in_process(file: Path, library: str, floating: bool) -> Reading:
    """Reads in this process."""
    return read(file, library, floating=floating)


def loaded(given: str | Path | Weighed, load: Read = in_process, loops: Path | None = None) -> Model:
    """Loads one side: a file, ``FILE@library``, or a description.

    Args:
        loops: Says what closes the loops of a URDF.

    Raises:
        ScrewgaugeError: It cannot be read.
    """
    own, library = _split(str(given))
    if not library and (own.suffix == ".toml" or (not own.suffix and not own.exists())):
        return _described(str(own))
    file = given.copy if isinstance(given, Weighed) else own
    library = library or libraries_for(file)[0]
    content = read_file(own)
    sha256 = hashlib.sha256(content.encode()).hexdigest()
    model = Model(str(given), file, library, load(file, library, False), False, digits_of(content), sha256)
    model = replace(model, own=own) if file != own else model
    if loops is None or model.says_closures:
        return model
    reading = with_loops(model.reading, loops)
    as_read = None if _kinds(reading) == _kinds(model.reading) else model.reading
    return replace(model, loops=loops, reading=reading, as_read=as_read)


def _kinds(reading: Reading) -> dict[str, str]:
    return {name: joint.kind for name, joint in reading.joints.items()}


def _split(given: str) -> tuple[Path, str]:
    """A file, and the library that is to read it; empty where none is named."""
    if "@" not in given or Path(given).exists():
        return Path(given), ""
    text, _, library = given.rpartition("@")
    if library not in LIBRARIES:
        raise UnknownNameError("library", library, LIBRARIES, given)
    return Path(text), library


def _described(name: str) -> Model:
    mechanism = load_mechanism(name)
    file = Path(name) if Path(name).is_file() else None
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest() if file else ""
    return Model(name, file, "screwgauge", _expected(mechanism, "full", gravity_of(name)), sha256=sha256)


def _expected(mechanism: Mechanism, cut: str, gravity: Array | None) -> Reading:
    return replace(expected_reading(mechanism, cut, STANDARD), gravity=gravity)


def alike(a: Model, b: Model, load: Read = in_process) -> tuple[Model, Model]:
    """Both, a description cut as the other one's file is, and a URDF's base floating where the other one's does."""
    return _like(a, b, load), _like(b, a, load)


def cut_alike(a: Model, b: Model, given: Mapping[str, str] | None) -> tuple[Model, Model, Pairing]:
    """Both, loops that one closes by a copy of a body being cut as the other one's are; and their partners."""
    pairing = paired(a.reading, b.reading, given)
    back = {other: name for name, other in pairing.bodies.items()}
    one = a.united(copies(a.reading, b.reading, pairing.only_a, pairing.bodies))
    two = b.united(copies(b.reading, a.reading, pairing.only_b, back))
    return one, two, paired(one.reading, two.reading, given) if one.parts or two.parts else pairing


def _like(model: Model, other: Model, load: Read) -> Model:
    if model.library == "screwgauge":
        mechanism = load_mechanism(model.label)
        cuts = [_expected(mechanism, cut, model.reading.gravity) for cut in CUTS]
        best = max(cuts, key=lambda cut: (len({*cut.joints} & {*other.reading.joints}), -len(cut.joints)))
        return replace(model, reading=best)
    free = [any(joint.kind == "free" for joint in each.reading.joints.values()) for each in (model, other)]
    if model.file is not None and free == [False, True] and model.reading.gravity is None:
        floating = replace(model, floating=True)
        return replace(floating, reading=floating.read_again(model.file, load))
    return model
