"""The scene that a description gets if it has none: an exciting motion, and all forces that can be compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.formats import key, lines
from screwgauge.models.importing import is_model
from screwgauge.problem import GivenMotion
from screwgauge.quantities import GIVEN
from screwgauge.reference.applied import Applied, JointSpring
from screwgauge.reference.description import read_toml
from screwgauge.reference.expressions import vector
from screwgauge.reference.files import beside, is_file, is_path
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.exciting import exciting
from screwgauge.scene.scene import DEFAULT_ENGINES, RULES, Scene

if TYPE_CHECKING:
    from screwgauge.models.importing.convert import Imported

#: Of a scene beside its description: ``panda.toml`` has ``panda.scene.toml``.
SUFFIX = ".scene.toml"


def scene_file(path: Path) -> Path:
    """The scene that a path means: itself, or that of a description or model file.

    A description has the scene beside it, or else the usual one, as a model file has, in a folder that goes away with
    the process.

    Raises:
        ScrewgaugeError: The file cannot be read, or no scene can be made of it.
    """
    from screwgauge.models.importing.model import imported_file, scratch_folder

    if is_model(path):
        description, imported = imported_file(path)
        acting = acting_on(imported)
    else:
        tables = read_toml(path)
        if "mechanism" in tables or not {"bodies", "joints", "extends"} & tables.keys():
            return path
        scene = path.with_name(f"{path.stem}{SUFFIX}")
        if is_file(scene):
            return scene
        description, acting = path.resolve(), dict[str, Any]()
    file = scratch_folder() / f"{path.stem}{SUFFIX}"
    mechanism = replace(load_mechanism(description), where=str(path))  # what is wrong is wrong in the user's file
    file.write_text(default_scene(mechanism, description, **acting), encoding="utf-8")
    return file


def gravity_of(name: str) -> Array | None:
    """What a model file, or the scene beside a description, says of gravity.

    Returns:
        World axes [m/s^2], shape (3,); None where neither says anything.
    """
    from screwgauge.models.importing.model import imported_file

    path = beside(Path(), name)
    if is_model(path):
        return imported_file(path)[1].gravity
    file = path.with_name(f"{path.stem}{SUFFIX}")
    said = read_toml(file).get("gravity") if is_path(name) and is_file(file) else None
    return None if said is None else vector(said, f"{file}, gravity")


def acting_on(imported: Imported) -> dict[str, Any]:
    """What `default_scene` takes from a model file besides its mechanism."""
    from screwgauge.models.importing.model import notes

    return {"gravity": imported.gravity, "springs": imported.springs, "description": " ".join(notes(imported))}


def default_scene(
    mechanism: Mechanism,
    file: Path,
    *,
    gravity: Array | None = None,
    springs: Sequence[JointSpring] = (),
    description: str = "",
) -> str:
    """A scene as TOML.

    Args:
        file: The description, by its full path or beside the scene.
        gravity: World axes [m/s^2]; the usual one by default. Shape (3,).
        springs: Springs and dampers of joints.

    Raises:
        ScrewgaugeError: The mechanism is refused, or has no room to move.
    """
    scene = exciting(_at_rest(mechanism, file, Applied(gravity=gravity, springs=tuple(springs))))
    out = [f"# {wrap(description, 116)[0]}"] if description else []
    out += lines({"mechanism": str(file), "description": f"{description} {scene.description.strip()}".strip()})
    if gravity is not None:
        out += lines({"gravity": gravity})
    step = float(scene.t[1] - scene.t[0])
    out += ["", "[time]", *lines({"duration": float(f"{scene.t[-1]:.9g}"), "step": step})]
    for label, table in scene.text["motion"].items():
        rows = ", ".join(f"[{', '.join(row)}]" for row in table["harmonics"])
        out += ["", f"[motion.{key(label)}]", f"offset = {table['offset']}", f"harmonics = [{rows}]"]
    for spring in springs:
        entries = {"coordinate": spring.coordinate, "stiffness": spring.stiffness, "rest": spring.rest}
        out += ["", "[[springs]]", *lines({**entries, "damping": spring.damping})]
    return "\n".join(out) + "\n"


def _at_rest(mechanism: Mechanism, file: Path, applied: Applied) -> Scene:
    home = mechanism.home[mechanism.independent_columns][None]
    none = np.zeros_like(home)
    return Scene(
        name=mechanism.name,
        title=mechanism.title,
        description="",
        mechanism=mechanism,
        mechanism_file=file,
        applied=applied,
        task=GivenMotion(np.zeros(1), home, none, none),
        rule=RULES[0],
        engines=DEFAULT_ENGINES,
        quantities=GIVEN,
        tolerances={},
        models={},
        figures=(),
    )
