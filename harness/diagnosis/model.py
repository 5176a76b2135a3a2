"""One of the two models of a diagnosis: a model file as a library reads it."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from screwgauge.diagnosis.facts.fact import ALL, SINGLE, STANDARD, digits_of, longest_number
from screwgauge.models.catalog import load_mechanism
from screwgauge.models.check import expected_reading, with_limits
from screwgauge.models.files.loops import OWN, read_loops
from screwgauge.models.importing import is_model
from screwgauge.models.importing.assemble import assemble
from screwgauge.models.importing.homes import Loops as LoopEquations
from screwgauge.models.importing.homes import few_of
from screwgauge.models.kinematics import rehome, tree_of
from screwgauge.models.readings.loops import loops_for, with_loops
from screwgauge.models.readings.read import LIBRARIES, libraries_for, read
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import form_of, weighed_copy
from screwgauge.reference.errors import ClosureError, DescriptionError, ModelFileError, UnknownNameError, quote
from screwgauge.reference.files import digest, is_file, read_file
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.default import gravity_of

#: Function that reads a file with a library: (file, library, floating).
Read = Callable[[Path, str, bool], Reading]
#: Loops files of URDFs: one file for both models, or a separate file for each model.
Loops = str | Path | Sequence[str | Path | None] | None
CUTS = ("minimal", "full")
#: Largest gap of loops that count as closed at the home pose, as for a description [rad or model lengths].
HOME = 1e-9


@dataclass(frozen=True, eq=False)
class Model:
    """A model as one library reads it.

    Attributes:
        label: Name as given by the user.
        file: Model file; None for a built-in mechanism.
        library: ``pinocchio``, ``mujoco``, ``yourdfpy``; ``screwgauge`` for a description.
        floating: True if the base of a URDF is read as floating.
        digits: Number of digits to which the numbers in the file are rounded.
        sha256: Digest of the file; empty without a file.
        loops: File with the closures of a URDF; `loops_sha256`: its digest.
        own: The user's file, if `file` is a copy of it with mass and inertia from meshes.
        as_read: The library's own reading, without closures and joint types from a loops file; None if it equals
            `reading`.
        open_by: Gaps of the loops at the home pose of the file, formatted; empty if the loops are closed there.
        never_closed: Loops that do not close from any start, formatted; empty if all loops close.
        remarks: Sentences about changes made by the reader.
    """

    label: str
    file: Path | None
    library: str
    reading: Reading
    floating: bool = False
    digits: int = ALL
    sha256: str = ""
    loops: Path | None = None
    as_read: Reading | None = None
    own: Path | None = None
    open_by: str = ""
    never_closed: str = ""
    loops_sha256: str = ""
    remarks: tuple[str, ...] = ()

    @property
    def described(self) -> bool:
        """True for a description, False for a model file."""
        return not self.reading.form

    @property
    def retyped(self) -> bool:
        """True if the loops file changes joint types or adds rotors, which the library ignores."""
        return self.as_read is not None

    @property
    def says_closures(self) -> bool:
        """True if the files of the model can define closures; a URDF alone cannot."""
        return self.reading.form != "urdf" or self.loops is not None

    @property
    def text(self) -> str:
        """Text of a URDF or MJCF file; empty for other formats, which cannot be changed."""
        return read_file(self.file) if self.file is not None and self.reading.form in ("urdf", "mjcf") else ""

    @property
    def longest(self) -> int:
        """Number of digits of the longest number in the file; 0 for a description."""
        if self.reading.form == "usd":
            return SINGLE
        return 0 if self.described or self.file is None else longest_number(read_file(self.file))

    @cached_property
    def home(self) -> dict[str, float]:
        """Home coordinates of a URDF, taken from its loops file [rad or m]."""
        own = self.loops is not None and self.loops.name.endswith(OWN)
        home = read_loops(self.loops).home if own and self.loops else {}
        return {name: q for name, q in home.items() if name in self.reading.joints}

    def read_again(self, file: Path, load: Read) -> Reading:
        """Read a different file instead of the model's file, using the same library."""
        reading = load(file, self.library, self.floating)
        return with_loops(reading, self.loops) if self.loops else reading

    @cached_property
    def posed(self) -> Reading:
        """The reading at its home pose, which a URDF alone cannot define."""
        return rehome(self.reading, self.home)[0]


@dataclass(frozen=True, slots=True)
class Weighed:
    """One model of a diagnosis, with a copy of its file that has mass and inertia from meshes.

    Attributes:
        given: Name as given by the user.
        copy: Copy of the file; the file itself if no mass comes from meshes.
    """

    given: str
    copy: Path

    def __str__(self) -> str:
        return self.given


def weigh_side(given: str | Path, folder: Path) -> Weighed:
    """Copy a model's file with mass and inertia computed from meshes, if any mass comes from meshes.

    Args:
        folder: Folder for the copy.

    Raises:
        ScrewgaugeError: Meshes cannot be read, or are outside the folder of the file.
    """
    file = Path(_split_library(given)[0])
    copy = weighed_copy(file, folder) if is_model(file) else None
    return Weighed(str(given), copy or file)


def read_here(file: Path, library: str, floating: bool) -> Reading:
    """Read a file in this process."""
    return read(file, library, floating=floating)


def load_side(given: str | Path | Weighed, load: Read = read_here, loops: Path | None = None) -> Model:
    """Load one model: a file and the loops file in its folder, ``FILE@library``, or a description.

    Args:
        loops: Loops file of a URDF, used instead of the loops file in its folder.

    Raises:
        ScrewgaugeError: The model cannot be read.
    """
    text, library = _split_library(given)
    own = Path(text)
    if _is_description(text, library):
        if loops is not None:
            raise ModelFileError("defines its own loop closures", text, "omit --loops")
        return _load_description(text)
    file = given.copy if isinstance(given, Weighed) else own
    library = library or libraries_for(file)[0]
    form, sha256 = form_of(file), digest(own)
    digits = SINGLE if form == "usd" else digits_of(read_file(own))
    model = Model(str(given), file, library, load(file, library, False), False, digits, sha256)
    model = replace(model, own=own if file != own else None)
    if (loops := loops_for(own, loops)) is None:
        return model
    reading = with_loops(model.reading, loops)
    as_read = model.reading if _joints(reading) != _joints(model.reading) else None
    return replace(model, as_read=as_read, loops=loops, reading=reading, loops_sha256=digest(loops))


def _joints(reading: Reading) -> dict[str, tuple[str, float]]:
    """Return the kind and the rotor inertia of each joint."""
    return {name: (joint.kind, joint.armature) for name, joint in reading.joints.items()}


def loops_of_sides(
    loops: Loops, sides: tuple[str | Path | Weighed, str | Path | Weighed]
) -> tuple[Path | None, Path | None]:
    """Return the loops file of each model, given a pair of files or one file for all URDFs.

    Raises:
        ScrewgaugeError: The value is neither a file nor a pair, or no model is a URDF.
    """
    if loops is None:
        return None, None
    if isinstance(loops, str | Path):
        one, two = (Path(loops) if _is_urdf(side) else None for side in sides)
        if one is None and two is None:
            what = "define their own loop closures"
            raise ModelFileError(what, f"{sides[0]} and {sides[1]}", "omit --loops")
        return one, two
    given = list(loops) if isinstance(loops, Sequence) else []
    if len(given) != len(sides) or not all(each is None or isinstance(each, str | Path) for each in given):
        raise DescriptionError(f"{quote(loops)} is not a loops file", "loops", "pass one file, or one per model")
    one, two = (None if not each else Path(each) for each in given)
    return one, two


def _split_library(given: str | Path | Weighed) -> tuple[str, str]:
    """Split the argument for a model into the file or name and the requested library, which may be empty."""
    text, library = str(given), ""
    if "@" in text and not os.path.exists(text):
        text, _, library = text.rpartition("@")
        if library not in LIBRARIES:
            raise UnknownNameError("library", library, LIBRARIES, str(given))
    return text, library


def _is_description(text: str, library: str) -> bool:
    file = Path(text)
    return not library and (file.suffix == ".toml" or (not file.suffix and not os.path.exists(file)))


def _is_urdf(given: str | Path | Weighed) -> bool:
    text, library = _split_library(given)
    return not _is_description(text, library) and form_of(Path(text)) == "urdf"


def _load_description(name: str) -> Model:
    mechanism = load_mechanism(name)
    file = Path(name) if is_file(Path(name)) else None
    sha256 = digest(file) if file else ""
    reading = _read_description(mechanism, "full", gravity_of(name))
    return Model(name, file, "screwgauge", reading, sha256=sha256, remarks=mechanism.remarks)


def _read_description(mechanism: Mechanism, cut: str, gravity: Array | None) -> Reading:
    return replace(with_limits(expected_reading(mechanism, cut, STANDARD), mechanism), gravity=gravity)


def match_cuts(a: Model, b: Model, load: Read = read_here) -> tuple[Model, Model]:
    """Choose the cut of a description that best matches the other model; give a URDF a floating base if needed."""
    return _match_cut(a, b, load), _match_cut(b, a, load)


def check_loops(models: tuple[Model, Model]) -> tuple[Model, Model]:
    """Measure the loop gaps of both models at their home poses, and try to close the loops.

    Raises:
        ClosureError: The loops of neither model close from any start.
    """
    measured, refused = list[Model](), list[ClosureError]()
    for model in models:
        system = LoopEquations(tree_of(model.posed))
        gaps = system.gaps(system.home, HOME)
        try:
            assemble(model.reading, model.label, {}) if gaps else None
            measured.append(replace(model, open_by=few_of(gaps)))
        except ClosureError as error:
            refused.append(error)
            measured.append(replace(model, open_by=few_of(gaps), never_closed=error.what))
    if len(refused) == len(models):
        raise refused[0]
    return measured[0], measured[1]


def _match_cut(model: Model, other: Model, load: Read) -> Model:
    if model.described:
        mechanism = load_mechanism(model.label)
        cuts = [_read_description(mechanism, cut, model.reading.gravity) for cut in CUTS]
        best = max(cuts, key=lambda cut: (len({*cut.joints} & {*other.reading.joints}), -len(cut.joints)))
        return replace(model, reading=best)
    free = [any(joint.kind == "free" for joint in each.reading.joints.values()) for each in (model, other)]
    if model.file is not None and free == [False, True] and model.reading.gravity is None:
        floating = replace(model, floating=True)
        return replace(floating, reading=floating.read_again(model.file, load))
    return model
