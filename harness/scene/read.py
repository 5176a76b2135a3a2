"""Reads scenes from TOML files, see ``harness/scenes/README.md``. Names of engines are not checked."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.models.catalog import load_mechanism, mechanism_names, mechanism_path
from screwgauge.models.importing import MESHES, is_model
from screwgauge.problem import InitialValue, Integration
from screwgauge.quantities import GIVEN, OF_MOTION, QUANTITIES, SIMULATED, check_quantities
from screwgauge.reference.applied import Applied
from screwgauge.reference.courses import Samples
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.expressions import number
from screwgauge.reference.files import A_PATH, is_file, is_path, named_file
from screwgauge.reference.inertia import TRIANGLE
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, positive, read_items, read_toml, require
from screwgauge.scene.default import scene_file
from screwgauge.scene.entries import read_applied, read_figure, read_grid, read_models, read_points
from screwgauge.scene.grid import GridMotion, check_contours, check_timeless, is_grid, read_grid_motion
from screwgauge.scene.grounding import hold_to_ground
from screwgauge.scene.idle import Followed, read_given, read_undriven
from screwgauge.scene.keys import TABLES, read_keys
from screwgauge.scene.motion import Analytic, Sampled
from screwgauge.scene.observables import Recorded, read_known, read_observable, read_published, read_tables
from screwgauge.scene.scene import RULES, Scene, check_order

FOLDER = Path(__file__).parents[1] / "scenes"
_GRAVITY = TABLES["scene"]["keys"]["gravity"]["default"]


def scene_names() -> list[str]:
    """Return the names of the built-in scenes."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_scene(name: str | Path) -> Scene:
    """Read a built-in scene by name, or a scene from a TOML file; a description or model file gets the default scene.

    Raises:
        ScrewgaugeError: The name is unknown, the file does not exist, or the file is not a scene.
    """
    if str(name) in scene_names():
        return _built_in(FOLDER / f"{name}.toml")
    if is_path(str(name)) or is_model(name):
        return _read(scene_file(named_file(Path(), str(name))))
    raise UnknownNameError("scene", str(name), scene_names(), besides=A_PATH)


def is_scene(name: str) -> bool:
    """Return True for a TOML file that names a mechanism, and for a built-in scene unless a mechanism has its name."""
    path = named_file(Path(), name)
    if is_path(name) and path.suffix == ".toml" and is_file(path):
        return "mechanism" in read_toml(path)
    return name in scene_names() and name not in mechanism_names()


def _read(path: Path) -> Scene:
    data, where = read_toml(path), str(path)
    given = read_keys("scene", data, where)
    _check_kind(data, where)
    allow, tolerances = given["allow"], given["tolerances"]
    files = [entry for entry in allow if entry == MESHES or "/" in entry]
    tensors = [entry for entry in allow if entry.endswith(f".{TRIANGLE}")]
    file = mechanism_path(given["mechanism"], path.parent, where, [*files, *tensors], floating=given["floating"])
    file, mechanism, data = hold_to_ground(file, load_mechanism(file), data, path, _times)
    read = _read_simulated if "forward" in data else _read_given
    check_keys(tolerances, QUANTITIES, f"{where}, tolerances")
    name = path.stem.removesuffix(".scene")
    scene = Scene(
        name=name,
        title=name if given["title"] is None else given["title"],
        description=given["description"],
        mechanism=mechanism,
        mechanism_file=file,
        engines=given["engines"],
        tolerances={key: positive(value, f"{where}, tolerances.{key}") for key, value in tolerances.items()},
        models=read_models(given["models"], path.parent, f"{where}, models"),
        figures=read_items(data, "figures", where, read_figure),
        points=read_points(mechanism, data, where),
        allow=tuple(entry for entry in allow if entry not in files),
        file=path,
        rule=given["rule"],
        **read(data, path, mechanism),
    )
    check_contours(scene.figures, scene.grid, where)
    return scene.beside(**scene.tables) if scene.tables else scene


def _check_kind(data: dict[str, Any], where: str) -> None:
    """Reject keys of simulated scenes in a scene with a given motion, and vice versa."""
    kind = "simulated" if "forward" in data else "given"
    for key in data:
        one = TABLES["scene"]["keys"][key]
        if one.get("kind", kind) != kind and kind == "given":
            raise DescriptionError(f"'{key}' requires a forward scene", where, "add [forward] or remove it")
        if one.get("kind", kind) != kind:
            remedy = one.get("remedy", f"remove [forward] or {key}")
            raise DescriptionError(f"'{key}' is not allowed in a forward scene", where, remedy)


_built_in = cache(_read)  # files of the package do not change


def _read_forces(data: dict[str, Any], mechanism: Mechanism, where: str) -> Applied:
    return Applied(**read_applied(mechanism, {"gravity": _GRAVITY, **data}, where, Path(where).parent))


def _grid(
    data: dict[str, Any], sampled: Array | None, tables: Mapping[str, Recorded], applied: Applied, where: str
) -> Array:
    """Return the times of a given motion from ``[time]`` or, without it, from samples, tables or loads. Shape (n,)."""
    files = [course.t for load in applied.loads for course in load.courses if isinstance(course, Samples)]
    if sampled is None and (known := [table.t for table in tables.values()] or files[:1]):
        sampled = np.unique(np.concatenate(known))
    return read_grid(data.get("time"), sampled, f"{where}, time")


def _times(data: dict[str, Any], mechanism: Mechanism, sampled: Array | None, path: Path) -> Array:
    """Return the times of `_grid` before tables and loads have been read. Shape (n,)."""
    if "time" in data or sampled is not None:
        return read_grid(data.get("time"), sampled, f"{path}, time")
    tables = read_tables(data.get("tables", {}), path.parent, f"{path}, tables")
    loads = _read_forces({"loads": data.get("loads", [])}, mechanism, str(path))
    return _grid(data, sampled, tables, loads, str(path))


def _read_given(data: dict[str, Any], path: Path, mechanism: Mechanism) -> dict[str, Any]:
    """Read the fields of a scene with a given motion."""
    where = str(path)
    motion = require(data, "motion", where)
    given: Analytic | Sampled | GridMotion
    sampled: Array | None
    if is_grid(motion, mechanism):
        given = read_grid_motion(motion, mechanism, f"{where}, motion")
        sampled, labels = np.arange(float(len(given.cells))), tuple(mechanism.independent)
    else:
        given, sampled, labels = read_given(motion, mechanism, path.parent, f"{where}, motion")
    tables = read_tables(data.get("tables", {}), path.parent, f"{where}, tables")
    applied = _read_forces(data, mechanism, where)
    if isinstance(given, GridMotion):
        check_timeless(data, applied, where)
    rule = data.get("rule", RULES[0])
    if rule == "spherical_axial" and mechanism.axial is None:
        remedy = f"add [spherical_axial] to {mechanism.where}"
        raise DescriptionError(f"rule '{rule}' needs a spherical joint", where, remedy)
    t = _grid(data, sampled, tables, applied, where)
    applied.at(t)  # reject times that the file of a load lacks
    stated = read_undriven(data.get("idle", {}), labels, mechanism, f"{where}, idle")
    drive: Analytic | Sampled | GridMotion | Followed = given
    if not isinstance(given, GridMotion) and len(labels) < len(mechanism.independent):
        drive = Followed(given, labels, stated, float(t[0]), mechanism, applied)
    return {
        "applied": applied,
        "task": drive(t),
        "quantities": check_quantities(data.get("quantities", list(GIVEN)), where, OF_MOTION),
        "drive": drive,
        "tables": tables,
        "text": {"motion": motion, "gravity": data.get("gravity", _GRAVITY), "loads": data.get("loads", [])},
    }


def _read_simulated(data: dict[str, Any], path: Path, mechanism: Mechanism) -> dict[str, Any]:
    """Read the fields of a scene with a simulated motion."""
    where = str(path)
    observables = read_items(data, "observables", where, partial(read_observable, mechanism))
    names = [observable.name for observable in observables]
    if len(set(names)) < len(names):
        raise DescriptionError("two observables have the same name", f"{where}, observables", "rename one")
    known = None
    if "reference" in data:
        known = read_known(data["reference"], names, path.parent, f"{where}, reference")
    t = read_grid(data.get("time"), None if known is None else known.t, f"{where}, time")
    task = _read_start(data["forward"], mechanism, t, f"{where}, forward")
    check_order(t, task.since)
    applied = _read_forces(data, mechanism, where)
    if any(load.sampled for load in applied.loads):
        what = "a CSV column has no values between its samples, where a simulation needs them"
        raise DescriptionError(what, f"{where}, loads", "use polynomial and harmonics")
    if not (_acts(applied) or mechanism.resistances):
        remedy = "add gravity, [[loads]], [[springs]] or [[motors]]"
        raise DescriptionError("nothing exerts a force in this forward scene", where, remedy)
    return {
        "applied": applied,
        "task": task,
        "quantities": check_quantities(data.get("quantities", list(SIMULATED)), where, SIMULATED),
        "observables": observables,
        "known": known,
        "published": read_items(data, "published", where, read_published),
    }


def _acts(applied: Applied) -> bool:
    """Return True if any force acts; zero entries do not count."""
    return (
        bool(applied.g.any())
        or not all(load.nothing for load in applied.loads)
        or any(spring.stiffness or spring.damping for spring in applied.springs)
        or not all(motor.course.nothing for motor in applied.motors)
    )


def _read_start(table: Any, mechanism: Mechanism, t: Array, where: str) -> InitialValue:
    """Read the initial state and the integration settings from ``[forward]``."""
    given, home = read_keys("forward", table, where), mechanism.home[mechanism.independent_columns]
    return InitialValue(
        start=_state(given["start"], mechanism, home, f"{where}.start"),
        rates=_state(given["rates"], mechanism, np.zeros_like(home), f"{where}.rates"),
        since=float(t[0]),
        t=t,
        integration=Integration(given["method"], given["rtol"], given["atol"], given["near"]),
    )


def _state(table: Any, mechanism: Mechanism, usual: Array, where: str) -> Array:
    """Read label -> value; labels that the table omits get their default values. Shape (k,)."""
    values = dict(zip(mechanism.independent, usual.tolist(), strict=True))
    check_keys(table, values, where)
    values |= {label: number(value, f"{where}.{label}") for label, value in table.items()}
    return np.array(list(values.values()))
