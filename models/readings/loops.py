"""Finds and applies the file that closes the loops of a URDF: a screwgauge loops file or a ``robot.yaml``."""

from __future__ import annotations

from pathlib import Path

from screwgauge.models.files.loops import OWN, with_loops_file
from screwgauge.models.files.robot_yaml import with_robot_yaml
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import form_of
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import is_file


def loops_for(path: Path, given: Path | None = None) -> Path | None:
    """Return the file that closes the loops of a model file, or None.

    Args:
        given: File named by the user; by default, a file in the folder of the URDF that has the same name or is called
            ``robot.yaml``.

    Raises:
        ScrewgaugeError: The model defines its own loops, or cannot be read.
    """
    if form_of(path) != "urdf":
        if given is not None:
            raise ModelFileError("defines its own loop closures", str(path), "omit --loops")
        return None
    return given or loops_beside(path)


def loops_beside(path: Path) -> Path | None:
    """Return the file in a URDF's folder that closes the URDF's loops, or None."""
    candidates = (path.with_name(f"{path.stem}{OWN}"), path.with_suffix(".yaml"), path.with_name("robot.yaml"))
    return next((file for file in candidates if is_file(file)), None)


def with_loops(reading: Reading, path: Path) -> Reading:
    """Add the closures, motors and spherical joints of a loops file to the reading of its URDF.

    Raises:
        ScrewgaugeError: The file cannot be read, or refers to items that the reading lacks.
    """
    return with_loops_file(reading, path) if path.name.endswith(OWN) else with_robot_yaml(reading, path)
