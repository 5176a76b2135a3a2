"""Reads any URDF or MJCF by any library that reads it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from screwgauge.models.readings.mujoco import read_mujoco
from screwgauge.models.readings.pinocchio import read_pinocchio
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import Source, prepare
from screwgauge.models.readings.unread import unread
from screwgauge.models.readings.yourdfpy import read_yourdfpy
from screwgauge.reference.errors import ModelFileError, UnknownNameError
from screwgauge.reference.rotations import Array

#: Library -> the formats that it reads, its own first, and how.
LIBRARIES: dict[str, tuple[tuple[str, ...], Callable[[Source, Mapping[str, float]], Reading]]] = {
    "pinocchio": (("urdf", "mjcf"), read_pinocchio),
    "mujoco": (("mjcf", "urdf"), read_mujoco),
    "yourdfpy": (("urdf",), read_yourdfpy),
}


def libraries_for(path: Path) -> tuple[str, ...]:
    """Installed libraries that read a model file, the one of its format first.

    Raises:
        ScrewgaugeError: It is no model, or one that is refused before a library sees it.
    """
    return libraries_of(prepare(path).form)


def libraries_of(form: str) -> tuple[str, ...]:
    """Installed libraries that read a format, its own first."""
    able = [name for name, (forms, _) in LIBRARIES.items() if form in forms and find_spec(name)]
    return tuple(sorted(able, key=lambda name: LIBRARIES[name][0].index(form)))


def read(path: Path, library: str, *, home: Mapping[str, float] | None = None, floating: bool = False) -> Reading:
    """Reads a model file in this process; a library that crashes takes it with it.

    Args:
        library: One of `LIBRARIES`.
        home: Coordinates of hinges and slides at home [rad or m]; those of the file by default.
        floating: The base of a URDF moves freely.

    Raises:
        UnknownNameError: There is no such library.
        ScrewgaugeError: The file cannot be read, by this library or at all.
    """
    if library not in LIBRARIES:
        raise UnknownNameError("library", library, LIBRARIES)
    return read_source(prepare(path, floating=floating), library, home=home)


def read_source(source: Source, library: str, *, home: Mapping[str, float] | None = None) -> Reading:
    """The same of a file that is prepared."""
    (forms, reader), path = LIBRARIES[library], source.path
    if source.form not in forms:
        raise ModelFileError(f"{library} reads no {source.form.upper()}", str(path), "take another library")
    try:
        reading = reader(source, home or {})
    except ImportError as error:
        raise ModelFileError(
            f"{library} cannot be loaded ({error})", str(path), "install it, or take another"
        ) from None
    _check(reading, str(path))
    return replace(reading, form=source.form, content=unread(source, reading), frames=source.fixed_joints)


def _check(reading: Reading, where: str) -> None:
    """Refuses what moves nothing, is not finite, or has negative mass.

    Raises:
        ModelFileError: So it is.
    """
    if not reading.joints:
        raise ModelFileError(f"has no degree of freedom, as {reading.library} reads it", where, "give it a joint")
    for name, body in reading.bodies.items():
        values: dict[str, float | Array] = {
            "mass": body.mass,
            "centre of mass": body.com,
            "inertia": body.inertia,
            "pose": body.pose,
        }
        for what, value in values.items():
            if not np.isfinite(value).all():
                raise ModelFileError(f"{what} of body {name} is not finite", where, "write finite numbers")
        if body.mass < 0.0:
            raise ModelFileError(f"mass of body {name} is {body.mass:g} kg", where, "give it one that is not negative")
    for name, joint in reading.joints.items():
        if not (np.isfinite(joint.screw).all() and np.isfinite(joint.centre).all()):
            raise ModelFileError(f"axis of joint {name} is not finite", where, "write finite numbers")
        if joint.kind in ("hinge", "slide") and not joint.screw.any():
            raise ModelFileError(f"axis of joint {name} is 0", where, "give it a direction")
