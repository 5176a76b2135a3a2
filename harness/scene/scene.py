"""A scene: which mechanism, how it moves, what acts on it, and what is wanted. Read from TOML."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.engines.registry import check_engines
from screwgauge.models.catalog import is_file, load_mechanism, mechanism_names, mechanism_path
from screwgauge.problem import Motion, Wording
from screwgauge.quantities import FORWARD, INVERSE, QUANTITIES, check_quantities, integrated_tolerance
from screwgauge.reference.applied import Load, Motor, Spring
from screwgauge.reference.description import check_keys, read_text, read_toml, required
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.expressions import vector
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.elements import read_load, read_motor, read_spring
from screwgauge.scene.entries import positive, read_figure, read_grid, read_list, read_models, read_times
from screwgauge.scene.figures import Figure
from screwgauge.scene.motion import Drive, read_drive
from screwgauge.scene.setting import (
    Forward,
    Known,
    Observable,
    Published,
    read_forward,
    read_known,
    read_observable,
    read_published,
)

FOLDER = Path(__file__).parents[1] / "scenes"
RULES = ("min_norm", "spherical_axial")
DEFAULT_ENGINES = ("screw", "pinocchio", "mujoco")
_KEYS = {
    *("title", "description", "mechanism", "motion", "time", "gravity", "loads", "rule"),
    *("engines", "quantities", "tolerances", "models", "figures"),
    *("springs", "motors", "forward", "observables", "reference", "published"),
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
        springs, motors: What acts besides loads and actuators.
        forward: Start and method, if the motion is to be integrated; `motion` then has times only, all else NaN.
        observables: What is followed in a forward scene.
        known: Their values from elsewhere, if there are any.
        published: What others have published.
        text: The tables ``motion``, ``gravity`` and ``loads`` as they were read, numbers still being text.
        file: Where it was read from.
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
    springs: tuple[Spring, ...] = ()
    motors: tuple[Motor, ...] = ()
    forward: Forward | None = None
    observables: tuple[Observable, ...] = ()
    known: Known | None = None
    published: tuple[Published, ...] = ()
    file: Path | None = None

    def at(self, times: Sequence[float] | Array) -> Scene:
        """The same scene on other times [s].

        Raises:
            DescriptionError: They are no finite numbers, or a motion from samples has none at one of them.
        """
        if isinstance(times, str) or np.ndim(np.asarray(times, dtype=object)) != 1:
            raise DescriptionError(f"{times!r} is not a list of times", "times", "give a list of times in s")
        if self.forward is not None:
            return replace(self, motion=_clock(read_times(list(times), "times"), self.motion, self.forward.since))
        return replace(self, motion=self.drive(read_times(list(times), "times")))

    def wording(self) -> Wording:
        """The text of motion, gravity and loads; None for what was replaced by other doubles since it was read."""
        motion, gravity, loads = (self.text.get(key) for key in ("motion", "gravity", "loads"))
        return Wording(
            motion=motion if motion and _same_motion(motion, self) else None,
            gravity=gravity if gravity and np.array_equal(vector(gravity, "gravity"), self.gravity) else None,
            loads=tuple(loads) if loads is not None and _same_loads(loads, self) else None,
        )

    def tolerance(self, quantity: str) -> float:
        """Scaled tolerance of a quantity."""
        usual = QUANTITIES[quantity].tolerance
        if self.forward is not None:
            usual = integrated_tolerance(self.forward.method.rtol, self.forward.method.atol)
        return self.tolerances.get(quantity, usual)


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
    file = _mechanism_file(read_text(data, "mechanism", where), path.parent, where)
    mechanism = load_mechanism(file)
    if "forward" in data:
        return _read_forward(data, path, file, mechanism)
    for key in ("observables", "reference", "published"):
        if key in data:
            raise DescriptionError(f"'{key}' belongs to a forward scene", where, "add [forward] or remove it")
    motion_table = required(data, "motion", where)
    drive, sampled = read_drive(motion_table, list(mechanism.independent), path.parent, f"{where}, motion")
    rule = data.get("rule", "min_norm")
    if rule not in RULES:
        raise UnknownNameError("rule", rule, RULES, where)
    if rule == "spherical_axial" and mechanism.axial is None:
        raise DescriptionError(
            f"rule '{rule}' needs a spherical joint", where, f"add [spherical_axial] to {mechanism.where}"
        )
    return Scene(
        **_common(data, path, file, mechanism),
        motion=drive(read_grid(data.get("time"), sampled, f"{where}, time")),
        rule=rule,
        quantities=check_quantities(data.get("quantities", list(INVERSE)), where, INVERSE),
        drive=drive,
        text={
            "motion": motion_table,
            "gravity": data.get("gravity", [0, 0, "-9.81"]),
            "loads": read_list(data, "loads", where),
        },
    )


def _common(data: dict[str, Any], path: Path, file: Path, mechanism: Mechanism) -> dict[str, Any]:
    """The entries that all scenes have."""
    where = str(path)
    tolerances = data.get("tolerances", {})
    check_keys(tolerances, QUANTITIES, f"{where}, tolerances")

    def items(key: str, read: Callable[[Any, Mechanism, str], Any]) -> tuple[Any, ...]:
        return tuple(read(item, mechanism, f"{where}, {key}") for item in read_list(data, key, where))

    return {
        "name": path.stem,
        "file": path,
        "title": read_text(data, "title", where, path.stem),
        "description": read_text(data, "description", where, ""),
        "mechanism": mechanism,
        "mechanism_file": file,
        "gravity": vector(data.get("gravity", [0, 0, "-9.81"]), f"{where}, gravity"),
        "loads": items("loads", read_load),
        "springs": items("springs", read_spring),
        "motors": items("motors", read_motor),
        "engines": check_engines(data.get("engines", list(DEFAULT_ENGINES)), where),
        "tolerances": {key: positive(value, f"{where}, tolerances.{key}") for key, value in tolerances.items()},
        "models": read_models(data.get("models", {}), path.parent, f"{where}, models"),
        "figures": tuple(read_figure(item, f"{where}, figures") for item in read_list(data, "figures", where)),
    }


def _read_forward(data: dict[str, Any], path: Path, file: Path, mechanism: Mechanism) -> Scene:
    where = str(path)
    for key in ("motion", "rule"):
        if key in data:
            raise DescriptionError(f"'{key}' does not belong to a forward scene", where, f"remove [forward] or {key}")
    observables = tuple(
        read_observable(item, mechanism, f"{where}, observables") for item in read_list(data, "observables", where)
    )
    names = [observable.name for observable in observables]
    if len(set(names)) < len(names):
        raise DescriptionError("two observables share a name", f"{where}, observables", "name them apart")
    known = None
    if "reference" in data:
        known = read_known(data["reference"], names, path.parent, f"{where}, reference")
    t = read_grid(data.get("time"), None if known is None else known.t, f"{where}, time")
    forward = read_forward(data["forward"], mechanism, float(t[0]), f"{where}, forward")
    blank = np.full((0, len(mechanism.independent)), np.nan)
    motion = _clock(t, Motion(t[:0], blank, blank, blank), forward.since)
    scene = Scene(
        **_common(data, path, file, mechanism),
        motion=motion,
        rule=RULES[0],
        quantities=check_quantities(data.get("quantities", list(FORWARD)), where, FORWARD),
        drive=lambda times: _clock(times, motion, forward.since),
        forward=forward,
        observables=observables,
        known=known,
        published=tuple(read_published(item, f"{where}, published") for item in read_list(data, "published", where)),
    )
    if not _driven(scene):
        raise DescriptionError(
            "nothing exerts a force in this forward scene",
            where,
            "add gravity, [[loads]], [[springs]] or [[motors]]",
        )
    return scene


def _driven(scene: Scene) -> bool:
    """Whether anything acts at all; entries that are zero do not."""
    return (
        bool(scene.gravity.any())
        or any(load.force.any() or load.torque.any() for load in scene.loads)
        or any(spring.stiffness or spring.damping for spring in scene.springs)
        or any(motor.polynomial.any() or motor.harmonics[:, 1:].any() for motor in scene.motors)
    )


def _clock(t: Array, like: Motion, since: float) -> Motion:
    """Times of a motion that is yet to be integrated; its coordinates are NaN."""
    if (np.diff(t) <= 0.0).any() or t[0] < since:
        raise DescriptionError(
            f"the times do not increase from t = {since:g} s on",
            "times",
            "give times in order, from the start on",
        )
    y = np.full((len(t), like.y.shape[1]), np.nan)
    return Motion(t, y, y, y)


def _same_motion(table: dict[str, Any], scene: Scene) -> bool:
    """Whether the scene moves as the table says; never so for samples, whose doubles are what is meant."""
    if "csv" in table:
        return False
    drive, _ = read_drive(table, list(scene.mechanism.independent), Path(), "motion")
    now, said = scene.motion, drive(scene.motion.t)
    pairs = ((now.y, said.y), (now.yd, said.yd), (now.ydd, said.ydd))
    return all(np.array_equal(a, b) for a, b in pairs)


def _same_loads(tables: list[Any], scene: Scene) -> bool:
    said = [read_load(table, scene.mechanism, "loads") for table in tables]
    return [load.numbers() for load in said] == [load.numbers() for load in scene.loads]


def _mechanism_file(name: str, folder: Path, where: str) -> Path:
    beside = folder / name
    if name not in mechanism_names() and is_file(beside):
        return beside
    try:
        return mechanism_path(name)
    except UnknownNameError as error:
        raise UnknownNameError("mechanism", name, mechanism_names(), where) from error
