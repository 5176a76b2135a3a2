"""A scene: which mechanism, how it moves, what acts on it, and what is wanted. Read from TOML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.engines import check_engines
from screwgauge.models.catalog import is_file, load_mechanism, mechanism_names, mechanism_path
from screwgauge.motion import Drive, read_drive
from screwgauge.quantities import QUANTITIES, check_quantities
from screwgauge.reference.description import check_keys, read_toml, required
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.expressions import number, vector
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.report.figures import Figure
from screwgauge.solution import Load, Motion, Wording

FOLDER = Path(__file__).parent / "scenes"
RULES = ("min_norm", "spherical_axial")
MOST = 10_000_000  # samples: beyond that the arrays of one engine alone fill the memory of any desk
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
        text: The tables ``motion``, ``gravity`` and ``loads`` as they were read, numbers still being text.
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
    text: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def at(self, times: Sequence[float] | Array) -> Scene:
        """The same scene on other times [s].

        Raises:
            DescriptionError: They are no finite numbers, or a motion from samples has none at one of them.
        """
        if isinstance(times, str) or np.ndim(np.asarray(times, dtype=object)) != 1:
            raise DescriptionError(f"{times!r} is not a list of times", "times", "give a list of times in s")
        return replace(self, motion=self.drive(_times(list(times), "times")))

    def wording(self) -> Wording:
        """The text of motion, gravity and loads; None for what was replaced by other doubles since it was read."""
        motion, gravity, loads = (self.text.get(key) for key in ("motion", "gravity", "loads"))
        return Wording(
            motion=motion if motion and _same_motion(motion, self) else None,
            gravity=gravity if gravity and np.array_equal(vector(gravity, "gravity"), self.gravity) else None,
            loads=tuple(loads) if loads is not None and _same_loads(loads, self) else None,
        )

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
    elif Path(name).suffix == ".toml" and is_file(Path(name)):
        path = Path(name)
    else:
        raise UnknownNameError("scene", str(name), [*scene_names(), "or the path of a TOML file"])
    return _read(path)


def _read(path: Path) -> Scene:
    data, where = read_toml(path), str(path)
    check_keys(data, _KEYS, where)
    file = _mechanism_file(_text(data, "mechanism", where), path.parent, where)
    mechanism = load_mechanism(file)
    motion_table = required(data, "motion", where)
    drive, sampled = read_drive(motion_table, list(mechanism.independent), path.parent, f"{where}, motion")
    engines = data.get("engines", list(DEFAULT_ENGINES))
    rule = data.get("rule", "min_norm")
    if rule not in RULES:
        raise UnknownNameError("rule", rule, RULES, where)
    if rule == "spherical_axial" and mechanism.axial is None:
        raise DescriptionError(
            f"rule '{rule}' needs a spherical joint", where, f"add [spherical_axial] to {mechanism.where}"
        )
    tolerances = data.get("tolerances", {})
    check_keys(tolerances, QUANTITIES, f"{where}, tolerances")
    return Scene(
        name=path.stem,
        title=_text(data, "title", where, path.stem),
        description=_text(data, "description", where, ""),
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
        text={
            "motion": motion_table,
            "gravity": data.get("gravity", [0, 0, "-9.81"]),
            "loads": _list(data, "loads", where),
        },
    )


def _same_motion(table: dict[str, Any], scene: Scene) -> bool:
    """Whether the scene moves as the table says; never so for samples, whose doubles are what is meant."""
    if "csv" in table:
        return False
    drive, _ = read_drive(table, list(scene.mechanism.independent), Path(), "motion")
    now, said = scene.motion, drive(scene.motion.t)
    pairs = ((now.y, said.y), (now.yd, said.yd), (now.ydd, said.ydd))
    return all(np.array_equal(a, b) for a, b in pairs)


def _same_loads(tables: list[Any], scene: Scene) -> bool:
    said = [_load(table, scene.mechanism, "loads") for table in tables]
    return [load.numbers() for load in said] == [load.numbers() for load in scene.loads]


def _mechanism_file(name: str, folder: Path, where: str) -> Path:
    beside = folder / name
    if name not in mechanism_names() and is_file(beside):
        return beside
    try:
        return mechanism_path(name)
    except UnknownNameError as error:
        raise UnknownNameError("mechanism", name, mechanism_names(), where) from error


def _text(table: dict[str, Any], key: str, where: str, default: str | None = None) -> str:
    value = required(table, key, where) if default is None else table.get(key, default)
    if not isinstance(value, str):
        raise DescriptionError(f"{value!r} is not text", f"{where}, {key}", "write it in quotes")
    return value


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
    _check_count(len(values), where)
    if all(isinstance(v, float) for v in values):  # also numpy's
        t = np.array(values, dtype=float)
    else:
        t = np.array([number(v.item() if isinstance(v, np.generic) else v, where) for v in values])
    if not len(t) or not np.isfinite(t).all():
        raise DescriptionError("the times are not finite numbers", where, "give at least one time in s")
    return t


def _check_count(n: float, where: str) -> None:
    if n > MOST:
        raise DescriptionError(
            f"{n:.3g} samples are asked for, more than {MOST:.0e}",
            where,
            "take a longer step or a shorter duration",
        )


def _grid(table: Any, sampled: Array | None, where: str) -> Array:
    if table is None:
        if sampled is None:
            raise DescriptionError(
                "there is no time grid", where, "add [time] with duration and step, or times"
            )
        return sampled
    check_keys(table, {"duration", "step", "times"}, where)
    if "times" in table:
        if not isinstance(table["times"], list) or len(table) > 1:
            raise DescriptionError(
                "'times' is no list on its own", where, "write times = [...], or duration and step"
            )
        return _times(table["times"], f"{where}.times")
    duration = _positive(required(table, "duration", where), f"{where}.duration")
    step = _positive(required(table, "step", where), f"{where}.step")
    _check_count(duration / step, where)
    # multiples of the step; a duration that is no whole number of steps ends at the last one before it
    return np.arange(int(duration / step * (1 + 1e-12)) + 1, dtype=float) * step


def _load(table: Any, mechanism: Mechanism, where: str) -> Load:
    """``by`` exerts the load, ``on`` feels it; one is a body, the other the environment."""
    check_keys(table, {"on", "by", "point", "force", "torque"}, where)
    on, by = (_text(table, key, where) for key in ("on", "by"))
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
    if table:
        check_engines(list(table), where)
    files = {engine: folder / _text(table, engine, where) for engine in table}
    for engine, file in files.items():
        if not is_file(file):
            raise DescriptionError(
                f"model file of {engine} does not exist ('{file}')", where, "check the path"
            )
    return files


def _figure(table: Any, where: str) -> Figure:
    check_keys(table, {"title", "quantity", "unit", "panels"}, where)
    quantity = check_quantities([required(table, "quantity", where)], where)[0]
    panels = required(table, "panels", where)
    lists = panels.values() if isinstance(panels, dict) else [None]
    if not all(isinstance(items, list) and all(isinstance(item, str) for item in items) for items in lists):
        raise DescriptionError("'panels' is not a table of lists", where, "write label = ['pattern', ...]")
    return Figure(
        title=_text(table, "title", where),
        quantity=quantity,
        unit=_text(table, "unit", where),
        panels=tuple((label, tuple(patterns)) for label, patterns in panels.items()),
    )
