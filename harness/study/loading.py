"""Runs readers and importers of model files in separate processes, in case a library crashes or hangs.

Pinocchio's parser crashes on a chain of 20 000 links; a single muscle in an MJCF can keep MuJoCo busy for minutes.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from screwgauge.diagnosis.model import Weighed, weigh_side
from screwgauge.models.importing.model import Imported, Options, import_model, scratch_folder
from screwgauge.models.readings.read import read
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import LoaderError, ModelFileError
from screwgauge.solution import Failure
from screwgauge.study.isolation import Limits, call_isolated

#: Limits for reading, where the largest models take a second, and for importing, where they take a few seconds.
LOADING, IMPORTING = Limits(seconds=60.0, memory=4.0), Limits(seconds=120.0, memory=4.0)


def read_isolated(path: Path, library: str, floating: bool = False) -> Reading:
    """Read a file in a process reserved for a library.

    Raises:
        ScrewgaugeError: The file cannot be read.
        LoaderError: The library crashed or exceeded a limit.
    """
    reading = call_isolated(f"{library}-reading", partial(read, path, library, floating=floating), LOADING)
    if isinstance(reading, Failure):
        what = f"{library} failed to read the file ({_reason(reading)})"
        raise LoaderError(what, str(path), "choose another library")
    return reading


def sides(a: str, b: str, meshes: bool) -> tuple[str | Weighed, str | Weighed]:
    """Return both models of a diagnosis; `meshes`: compute mass and inertia from meshes, see `weigh_side`.

    Raises:
        ScrewgaugeError: A mesh cannot be read, or is outside the folder of the file.
        LoaderError: MuJoCo crashed or exceeded a limit.
    """
    if not meshes:
        return a, b
    models = list[Weighed]()
    for each in (a, b):
        one = call_isolated("meshes", partial(weigh_side, each, scratch_folder()), LOADING)
        if isinstance(one, Failure):
            what = f"mujoco failed to read the meshes ({_reason(one)})"
            raise LoaderError(what, each, "add an <inertial> to the bodies")
        models.append(one)
    return models[0], models[1]


def import_isolated(path: Path, options: Options | None = None) -> Imported:
    """Run `import_model` in a separate process.

    Raises:
        ScrewgaugeError: The file is not a model, a description cannot express the model, or the reader fails.
    """
    imported = call_isolated("import", partial(import_model, path, options or Options()), IMPORTING)
    if isinstance(imported, Failure):
        remedy = "choose another library with --reader, or use a smaller model"
        raise ModelFileError(f"cannot be read: {_reason(imported)}", str(path), remedy)
    return imported


def _reason(failure: Failure) -> str:
    """Return the reason why reading failed, without advice on engine options, which do not set these limits."""
    return failure.reason.partition("; --")[0]
