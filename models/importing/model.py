"""A URDF or MJCF, with the loops that stand beside it, as a mechanism."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from screwgauge.models.importing.convert import Imported, Wanted, describe
from screwgauge.models.importing.write import description
from screwgauge.models.readings.compiled import warned
from screwgauge.models.readings.loops import OWN, loops_for, with_loops
from screwgauge.models.readings.mujoco import is_single, loaded
from screwgauge.models.readings.read import dropped, libraries_of, read_source
from screwgauge.models.readings.source import Source, prepare
from screwgauge.models.urdf import read_loops
from screwgauge.reference.errors import ModelFileError

#: Keyframe that users of MJCF call so.
HOME = "home"


@dataclass(frozen=True, slots=True)
class Options:
    """How a model file is imported.

    Attributes:
        loops: A file beside a URDF that says what closes its loops; by default one of its name, if there is one.
        library: Who reads it; by default that of its format.
        floating: The base of a URDF moves freely.
        meshes: Mass and inertia are computed from meshes in the folder of an MJCF where they come from these.
        wanted: What the user chose to be independent and actuated.
    """

    loops: Path | None = None
    library: str = ""
    floating: bool = False
    meshes: bool = False
    wanted: Wanted = field(default_factory=Wanted)


def import_model(path: Path, options: Options | None = None) -> Imported:
    """The mechanism of a model file.

    Raises:
        ScrewgaugeError: It is no model, or one that a description cannot hold.
    """
    options = options or Options()
    source = prepare(path, floating=options.floating, meshes=options.meshes)
    library, loops = options.library or libraries_of(source.form)[0], loops_for(path, options.loops)
    own = read_loops(loops) if loops is not None and loops.name.endswith(OWN) else None
    keyframes = _keyframes(source) if own is None else {HOME: own.home}
    reading = read_source(source, library, home=keyframes.pop(HOME, None))
    if lost := dropped(source, reading):
        raise ModelFileError("; ".join(each.sentence for each in lost), str(path), "let another library read it")
    reading = reading if loops is None else with_loops(reading, loops)
    wanted, given = options.wanted, own.joints if own else ()
    if own is not None:
        wanted = wanted.otherwise(own.independent, [joint.coordinates[0] for joint in own.joints if joint.actuated])
    imported = describe(reading, str(path), wanted, given, keyframes)
    said = f"Imported from {path.name} as {library} reads it{f', with the loops of {loops.name}' if loops else ''}."
    return replace(imported, remarks=(said, *source.resolved, *imported.remarks))


def _keyframes(source: Source) -> dict[str, dict[str, float]]:
    """Coordinates of hinges and slides in each keyframe of an MJCF [rad or m]; those without a name are numbered."""
    if source.form != "mjcf" or source.root.find("keyframe/key") is None:
        return {}
    with warned():
        model = loaded(source)
    single = {model.joint(i).name: model.jnt_qposadr[i] for i in range(model.njnt) if is_single(model, i)}
    return {
        model.key(k).name or str(k + 1): {name: float(model.key_qpos[k][at]) for name, at in single.items()}
        for k in range(model.nkey)
    }


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


_imported: dict[Path, tuple[Path, Imported]] = {}


def imported_file(path: Path) -> tuple[Path, Imported]:
    """A description made from a model file, in a folder that goes away with the process; made once."""
    return _imported.get(path) or keep(path, import_model(path))


def keep(path: Path, imported: Imported) -> tuple[Path, Imported]:
    """Keeps what was imported from a model file as a description, see `imported_file`."""
    file = scratch_folder() / f"{path.stem}.toml"
    file.write_text(description(imported.mechanism, notes(imported)), encoding="utf-8")
    _imported[path] = file, imported
    return _imported[path]


def notes(imported: Imported) -> tuple[str, ...]:
    """What stands above a description that was imported."""
    renamed = ", ".join(f"'{old}' is '{new}'" for old, new in imported.names.items())
    left = [f"Left out: {'; '.join(imported.left_out)}."] if imported.left_out else []
    return (*imported.remarks, *([f"Names: {renamed}."] if renamed else []), *left)
