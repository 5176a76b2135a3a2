"""A scene: which mechanism, how it moves, what acts on it, and what is wanted. Read from TOML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.engines import check_engines
from screwgauge.figures import Figure
from screwgauge.models.catalog import load_mechanism, mechanism_names, mechanism_path
from screwgauge.motion import Drive, read_drive
from screwgauge.quantities import QUANTITIES, check_quantities
from screwgauge.reference.description import check_keys, read_toml, required
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.expressions import number, vector
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import Load, Motion

FOLDER = Path(__file__).parent / "scenes"
RULES = ("min_norm", "spherical_axial")
DEFAULT_ENGINES = ("screw", "pinocchio", "mujoco")
_KEYS = {
    *("title", "description", "mechanism", "motion", "time", "gravity", "loads", "rule"),
    *("engines", "quantities", "tolerances", "models", "figures"),
}


@dataclass(frozen=True, eq=False)
class Scene:
    """A mechanism in motion.

    Attributes:
        mechanism_file: Its description, the model file of the engine ``screw``.
        motion: Independent coordinates over time.
        gravity: World axes [m/s^2]. Shape (3,).
        loads: What acts on the bodies.
        rule: What fixes the redundant actuation.
        tolerances: Scaled tolerance by quantity, where the scene changes the default.
        models: Model files that replace the generated ones, by engine.
        figures: What the report draws.
        drive: The motion as a function of time.
    """

    name: str
    title: str
    description: str
    mechanism: Mechanism
    mechanism_file: Path
    motion: Motion
    gravity: Array
    loads: tuple[Load, ...]
    rule: str
    engines: tuple[str, ...]
    quantities: tuple[str, ...]
    tolerances: Mapping[str, float]
    models: Mapping[str, Path]
    figures: tuple[Figure, ...]
    drive: Drive = field(repr=False)

    def at(self, times: Sequence[float] | Array) -> Scene:
        """The same scene on other times [s]."""
        return replace(self, motion=self.drive(_times(list(times), "times")))

    def tolerance(self, quantity: str) -> float:
        return self.tolerances.get(quantity, QUANTITIES[quantity].tolerance)


def scene_names() -> list[str]:
    """Names of the built-in scenes."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_scene(name: str | Path) -> Scene:
    """Reads a scene by built-in name or path of a TOML file.

    Raises:
        ScrewgaugeError: It does not exist or is no scene.
    """
    if str(name) in scene_names():
        path = FOLDER / f"{name}.toml"
    elif Path(name).suffix == ".toml" and Path(name).is_file():
        path = Path(name)
    else:
        raise UnknownNameError("scene", str(name), [*scene_names(), "or the path of a TOML file"])
    return _read(path)


def _read(path: Path) -> Scene:
    data, where = read_toml(path), str(path)
    check_keys(data, _KEYS, where)
    file = _mechanism_file(required(data, "mechanism", where), path.parent, where)
    mechanism = load_mechanism(file)
    motion_table = required(data, "motion", where)
    drive, sampled = read_drive(motion_table, list(mechanism.independent), path.parent, f"{where}, motion")
    engines = data.get("engines", list(DEFAULT_ENGINES))
    rule = data.get("rule", "min_norm")
    if rule not in RULES:
        raise UnknownNameError("rule", str(rule), RULES, where)
    if rule == "spherical_axial" and mechanism.axial is None:
        raise DescriptionError(
            f"rule '{rule}' needs a spherical joint", where, f"add [spherical_axial] to {mechanism.where}"
        )
    tolerances = data.get("tolerances", {})
    check_keys(tolerances, QUANTITIES, f"{where}, tolerances")
    return Scene(
        name=path.stem,
        title=str(data.get("title", path.stem)),
        description=str(data.get("description", "")),
        mechanism=mechanism,
        mechanism_file=file,
        motion=drive(_grid(data.get("time"), sampled, f"{where}, time")),
        gravity=vector(data.get("gravity", [0, 0, "-9.81"]), f"{where}, gravity"),
        loads=tuple(_load(item, mechanism, f"{where}, loads") for item in _list(data, "loads", where)),
        rule=rule,
        engines=check_engines(engines, where),
        quantities=check_quantities(data.get("quantities", list(QUANTITIES)), where),
        tolerances={key: _positive(value, f"{where}, tolerances.{key}") for key, value in tolerances.items()},
        models=_models(data.get("models", {}), path.parent, f"{where}, models"),
        figures=tuple(_figure(item, f"{where}, figures") for item in _list(data, "figures", where)),
        drive=drive,
    )


def _mechanism_file(name: Any, folder: Path, where: str) -> Path:
    beside = folder / str(name)
    if str(name) not in mechanism_names() and beside.is_file():
        return beside
    try:
        return mechanism_path(str(name))
    except UnknownNameError as error:
        raise UnknownNameError("mechanism", str(name), mechanism_names(), where) from error


def _list(data: dict[str, Any], key: str, where: str) -> list[Any]:
    items = data.get(key, [])
    if not isinstance(items, list):
        raise DescriptionError(f"'{key}' is not a list", where, f"write [[{key}]]")
    return items


def _positive(value: Any, where: str) -> float:
    result = number(value, where)
    if result <= 0.0:
        raise DescriptionError(f"{result:g} is not positive", where, "give a positive number")
    return result


def _times(values: list[Any], where: str) -> Array:
    t = vector(values, where, len(values)) if all(isinstance(v, int | str) for v in values) else np.array(values, float)
    if t.ndim != 1 or not len(t) or not np.isfinite(t).all():
        raise DescriptionError("the times are not finite numbers", where, "give at least one time in s")
    return t


def _grid(table: Any, sampled: Array | None, where: str) -> Array:
    if table is None:
        if sampled is None:
            raise DescriptionError("there is no time grid", where, "add [time] with duration and step, or times")
        return sampled
    check_keys(table, {"duration", "step", "times"}, where)
    if "times" in table:
        return _times(list(table["times"]), f"{where}.times")
    duration = _positive(required(table, "duration", where), f"{where}.duration")
    step = _positive(required(table, "step", where), f"{where}.step")
    # multiples of the step; a duration that is no whole number of steps ends at the last one before it
    return np.arange(int(duration / step * (1 + 1e-12)) + 1) * step


def _load(table: Any, mechanism: Mechanism, where: str) -> Load:
    """``by`` exerts the load, ``on`` feels it; one is a body, the other the environment."""
    check_keys(table, {"on", "by", "point", "force", "torque"}, where)
    on, by = (str(required(table, key, where)) for key in ("on", "by"))
    names = [body.name for body in mechanism.bodies]
    if (on == "environment") == (by == "environment"):
        raise DescriptionError(f"on = '{on}', by = '{by}'", where, "one is a body, the other 'environment'")
    body, sign = (on, 1.0) if by == "environment" else (by, -1.0)
    if body not in names:
        raise UnknownNameError("body", body, [*names, "environment"], where)
    point = table.get("point", "com")
    return Load(
        body=body,
        point=None if point == "com" else vector(point, f"{where}.point"),
        force=sign * vector(table.get("force", [0, 0, 0]), f"{where}.force"),
        torque=sign * vector(table.get("torque", [0, 0, 0]), f"{where}.torque"),
    )


def _models(table: Any, folder: Path, where: str) -> dict[str, Path]:
    if not isinstance(table, dict):
        raise DescriptionError(f"{table!r} is not a table", where, "write engine = 'file'")
    check_engines(list(table), where)
    files = {engine: folder / str(file) for engine, file in table.items()}
    for engine, file in files.items():
        if not file.is_file():
            raise DescriptionError(f"model file '{file}' of {engine} does not exist", where, "check the path")
    return files


def _figure(table: Any, where: str) -> Figure:
    check_keys(table, {"title", "quantity", "unit", "panels"}, where)
    quantity = check_quantities([required(table, "quantity", where)], where)[0]
    panels = required(table, "panels", where)
    if not isinstance(panels, dict):
        raise DescriptionError("'panels' is not a table", where, "write label = ['pattern', ...]")
    return Figure(
        title=str(required(table, "title", where)),
        quantity=quantity,
        unit=str(required(table, "unit", where)),
        panels=tuple((label, tuple(str(p) for p in patterns)) for label, patterns in panels.items()),
    )
