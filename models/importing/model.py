"""A URDF or MJCF, with the loops that stand beside it, as a mechanism."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from screwgauge.models.importing.convert import Imported, Wanted, describe
from screwgauge.models.importing.write import description
from screwgauge.models.loops import LoopsFile, read_loops
from screwgauge.models.readings.read import libraries_for, read
from screwgauge.models.readings.reading import ClosureReading, CouplingReading, Reading
from screwgauge.models.importing.with_loops_tmp import with_loops
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import is_file
from screwgauge.reference.mechanism import GROUND, Frame
from screwgauge.reference.rotations import Array

#: How the names of model files end.
SUFFIXES = (".urdf", ".xml", ".mjcf")
#: What ends the name of a loops file of `screwgauge.models.loops`.
OWN_LOOPS = ".loops.toml"


@dataclass(frozen=True, slots=True)
class Options:
    """How a model file is imported.

    Attributes:
        loops: A file beside a URDF that says what closes its loops; by default one of its name, if there is one.
        library: Who reads it; by default that of its format.
        floating: The base of a URDF moves freely.
        wanted: What the user chose to be independent and actuated.
    """

    loops: Path | None = None
    library: str = ""
    floating: bool = False
    wanted: Wanted = Wanted()


def is_model(path: Path | str) -> bool:
    """Whether a name means a model file, as its ending says."""
    return str(path).lower().endswith(SUFFIXES)


def import_model(path: Path, options: Options = Options()) -> Imported:
    """The mechanism of a model file.

    Raises:
        ScrewgaugeError: It is no model, or one that a description cannot hold.
    """
    library, loops = options.library or libraries_for(path)[0], options.loops or loops_beside(path)
    own = read_loops(loops) if loops is not None and loops.name.endswith(OWN_LOOPS) else None
    home = {name: float(q) for j in own.joints for name, q in zip(j.coordinates, j.home, strict=True)} if own else None
    reading = read(path, library, home=home, floating=options.floating)
    if own is not None:
        reading = _with_own_loops(reading, own, str(loops))
    elif loops is not None:
        reading = with_loops(reading, loops)
    wanted, given = options.wanted, own.joints if own else ()
    if own is not None and wanted.independent is None:
        wanted = replace(wanted, independent=own.independent)
    imported = describe(reading, str(path), wanted, given)
    said = f"Imported from {path.name} as {library} reads it{f', with the loops of {loops.name}' if loops else ''}."
    return replace(imported, remarks=(said, *imported.remarks))


def loops_beside(path: Path) -> Path | None:
    """The file beside a URDF that says what closes its loops: of the same name, or called ``robot.yaml``."""
    if path.suffix != ".urdf":
        return None
    stem = path.with_suffix("")
    for file in (stem.with_name(f"{stem.name}{OWN_LOOPS}"), path.with_suffix(".yaml"), path.with_name("robot.yaml")):
        if is_file(file):
            return file
    return None


def frame_of(reading: Reading, link: str, where: str) -> tuple[str, Array]:
    """The body (or ground) that a link is part of, and its frame in that. Shape (4, 4).

    Raises:
        ModelFileError: There is no such link.
    """
    if link == GROUND or link in reading.fixed:
        return GROUND, reading.fixed.get(link, np.eye(4))
    for name, body in reading.bodies.items():
        if link == name or link in body.fixed:
            return name, body.fixed.get(link, np.eye(4))
    raise ModelFileError(f"names the link '{link}', which the model does not have", where, "name one that it has")


def _with_own_loops(reading: Reading, file: LoopsFile, where: str) -> Reading:
    """The reading with the closures and actuators of a loops file of ours."""
    closures = {}
    for closure in file.closures:
        sides = closure.parent, closure.child
        frames = [[f] for f in (closure.parent_frame, closure.child_frame)]
        if closure.type != "weld":
            frames = [[Frame(p) for p in points] for points in (closure.parent_points, closure.child_points)]
        for i, pair in enumerate(zip(*frames, strict=True)):
            (a, A), (b, B) = (frame_of(reading, side, where) for side in sides)
            first, second = (T @ _matrix(frame) for T, frame in zip((A, B), pair, strict=True))
            kind = "weld" if closure.type == "weld" else "point"
            name = closure.joint if len(frames[0]) == 1 else f"{closure.joint}.{i + 1}"
            closures[name] = ClosureReading(kind, a, first, b, second)
    actuators = {joint.name: (joint.coordinates[0], 1.0) for joint in file.joints if joint.actuated}
    couplings = {one.name: CouplingReading(one.coordinate, one.of, one.polynomial) for one in file.couplings}
    return replace(reading, closures=closures, couplings=couplings, actuators=actuators)


def _matrix(frame: Frame) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = frame.R, frame.p
    return T


@cache
def _folder() -> TemporaryDirectory[str]:
    """Goes away with the process."""
    return TemporaryDirectory(prefix="screwgauge-imported-")


def scratch_folder() -> Path:
    """A new folder that goes away with the process."""
    root = Path(_folder().name)
    folder = root / str(len([*root.iterdir()]))
    folder.mkdir()
    return folder


@cache
def imported_file(path: Path) -> tuple[Path, Imported]:
    """A description made from a model file, in a folder that goes away with the process; made once."""
    imported = import_model(path)
    file = scratch_folder() / f"{path.stem}.toml"
    file.write_text(description(imported.mechanism, notes(imported)), encoding="utf-8")
    return file, imported


def notes(imported: Imported) -> tuple[str, ...]:
    """What stands above a description that was imported."""
    renamed = ", ".join(f"'{old}' is '{new}'" for old, new in imported.names.items())
    left = [f"Left out: {'; '.join(imported.left_out)}."] if imported.left_out else []
    return (*imported.remarks, *([f"Names: {renamed}."] if renamed else []), *left)
