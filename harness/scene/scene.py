"""A scene: mechanism, motion, acting forces and requested quantities. Scenes are plain data and can be pickled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.models.catalog import load_mechanism
from screwgauge.problem import GivenMotion, InitialValue, Problem, Wording
from screwgauge.quantities import QUANTITIES, integrated_tolerance
from screwgauge.reference.applied import Applied
from screwgauge.reference.content import same_content
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError, quote
from screwgauge.reference.expressions import vector
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.parameters import applied_with, changed_to, geometric, mechanism_with, numbers, resolve
from screwgauge.reference.points import Point
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_name
from screwgauge.scene.entries import Figure, as_written, read_applied, read_load, read_times
from screwgauge.scene.grid import GridMotion
from screwgauge.scene.idle import Followed, Freedom
from screwgauge.scene.keys import TABLES, choices_of
from screwgauge.scene.motion import Drive, read_drive
from screwgauge.scene.observables import Observable, Published, Recorded, merge_times

RULES = choices_of("scene", "rule")
LINE = 85  #: Characters above which a list is shown as a count.
DEFAULT_ENGINES: tuple[str, ...] = tuple(TABLES["scene"]["keys"]["engines"]["default"])


@dataclass(frozen=True, eq=False)
class Scene:
    """A mechanism with its motion, the acting forces and the quantities to compute.

    Attributes:
        mechanism_file: The description from which the mechanism was read; engines ``screw`` and ``truth`` also read it,
            unless the mechanism has been changed since.
        applied: Gravity, loads, springs and motors.
        task: A given motion, or an initial state from which the motion is integrated.
        rule: Rule for redundant actuators.
        tolerances: Quantity -> scaled tolerance, for quantities whose default the scene changes.
        models: Engine -> model file that replaces the generated file.
        figures: Figures of the report.
        allow: Allowed differences between model files and the description (``coupler.inertia``), unread files
            (``models.mujoco.unread``), and unphysical inertia tensors (``wrist.triangle``).
        file: File from which the scene was read.
        drive: The given motion as a function of time.
        text: The tables ``motion``, ``gravity`` and ``loads`` as read, with numbers as strings.
        observables: Observables of a simulation.
        known: Values of the observables from an independent source, if any.
        published: Published results for the scene.
        tables: Name -> the user's values, which are compared like the values of an engine.
        points: Named points of bodies.
    """

    name: str
    title: str
    description: str
    mechanism: Mechanism
    mechanism_file: Path
    applied: Applied
    task: GivenMotion | InitialValue
    rule: str
    engines: tuple[str, ...]
    quantities: tuple[str, ...]
    tolerances: Mapping[str, float]
    models: Mapping[str, Path]
    figures: tuple[Figure, ...]
    allow: tuple[str, ...] = ()
    file: Path | None = None
    drive: Drive | Followed | GridMotion | None = field(default=None, repr=False)
    text: Mapping[str, Any] = field(default_factory=dict, repr=False)
    observables: tuple[Observable, ...] = ()
    known: Recorded | None = None
    published: tuple[Published, ...] = ()
    tables: Mapping[str, Recorded] = field(default_factory=dict, repr=False)
    points: tuple[Point, ...] = ()

    def __post_init__(self) -> None:
        """Recompute a motion that follows from forces if the mechanism or the forces were replaced."""
        drive = self.drive
        if isinstance(drive, Followed) and (drive.mechanism, drive.applied) != (self.mechanism, self.applied):
            object.__setattr__(self, "drive", replace(drive, mechanism=self.mechanism, applied=self.applied))
            object.__setattr__(self, "task", self.moved(self.t))

    def __repr__(self) -> str:
        facts = self._facts
        return "\n".join([f"Scene {self.name}", *(f"  {name:<12}{text}" for name, text in facts.items() if text)])

    def _repr_html_(self) -> str:
        rows = (f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in self._facts.items() if text)
        return f"<table><caption>{escape(f'Scene {self.name}')}</caption>{''.join(rows)}</table>"

    @property
    def _facts(self) -> dict[str, str]:
        """Properties of the scene for display as text and HTML."""
        mechanism, t = self.mechanism, self.t
        freedoms = ", ".join(f"{label} = {name}" for label, name in mechanism.independent.items())
        acting = {name: getattr(self.applied, name) for name in ("loads", "springs", "motors")}
        counts = [f"{len(some)} {name[: -1 if len(some) == 1 else None]}" for name, some in acting.items() if some]
        g = self.applied.gravity
        wanted = ", ".join(self.quantities)
        return {
            "title": self.title,
            "mechanism": f"{mechanism.name}: {len(mechanism.bodies)} bodies, {len(mechanism.joints)} joints",
            "independent": freedoms if len(freedoms) < LINE else f"{len(mechanism.independent)} coordinates",
            "motion": f"{'integrated' if self.simulated else 'given'}, {len(t)} times from {t[0]:g} to {t[-1]:g} s",
            "acting": ", ".join([*([] if g is None else [f"gravity {np.asarray(g).tolist()} m/s^2"]), *counts]),
            "engines": ", ".join(self.engines),
            "quantities": wanted if len(wanted) < LINE else f"{len(self.quantities)}, see scene.quantities",
            "models": ", ".join(f"{engine}: {file.name}" for engine, file in self.models.items()),
            "file": "" if self.file is None else str(self.file),
        }

    @property
    def t(self) -> Array:
        """Times [s]. Shape (n,)."""
        return self.task.t

    @property
    def motion(self) -> GivenMotion:
        """The given motion.

        Raises:
            DescriptionError: The motion is integrated.
        """
        if isinstance(self.task, GivenMotion):
            return self.task
        raise DescriptionError("its motion is integrated, not given", self.name, "remove [forward]")

    @property
    def start(self) -> InitialValue:
        """The start of a simulation.

        Raises:
            DescriptionError: The motion is given.
        """
        if isinstance(self.task, InitialValue):
            return self.task
        raise DescriptionError("its motion is given, not integrated", self.name, "add [forward]")

    @property
    def undriven(self) -> tuple[Freedom, ...]:
        """Independent coordinates that no actuator drives, so that forces determine their motion."""
        return self.drive.freedoms if isinstance(self.drive, Followed | GridMotion) else ()

    @property
    def grid(self) -> GridMotion | None:
        """The grid of poses; None if the motion is not a grid."""
        return self.drive if isinstance(self.drive, GridMotion) else None

    @property
    def simulated(self) -> bool:
        """True if the motion is integrated."""
        return isinstance(self.task, InitialValue)

    @property
    def changed(self) -> bool:
        """True if the description has changed since the mechanism was read."""
        try:
            return not same_content(self.mechanism, load_mechanism(self.mechanism_file))
        except ScrewgaugeError:  # the file is missing or invalid
            return True

    def at(self, times: Sequence[float] | Array) -> Scene:
        """Return a copy of the scene at given times [s].

        Raises:
            DescriptionError: A time is not a finite number, or a sampled motion has no sample at a time.
        """
        if isinstance(times, str) or np.ndim(np.asarray(times, dtype=object)) != 1:
            raise DescriptionError(f"{quote(times)} is not a list of times", "times", "pass a list of times in s")
        t = read_times(list(times), "times")
        if isinstance(self.task, InitialValue):
            check_order(t, self.task.since)
            return replace(self, task=replace(self.task, t=t))
        return replace(self, task=self.moved(t))

    def beside(self, **tables: Recorded) -> Scene:
        """Return a copy of the scene with tables of numbers, which are compared and judged like the values of engines.

        The times of the tables are added to those of the scene.

        Raises:
            DescriptionError: A sampled motion lacks one of these times, a time lies outside the scene, or the motion is
                integrated.
        """
        times = merge_times(self.motion.t, [*tables.values()])
        engines = dict.fromkeys([*self.engines, *tables])
        return replace(self, task=self.moved(times), tables={**self.tables, **tables}, engines=tuple(engines))

    def moved(self, t: Array) -> GivenMotion:
        """Return the given motion at times [s]. Shape (n,)."""
        if self.drive is None:
            raise DescriptionError("its motion is not a function of time", self.name, "add a motion")
        self.applied.at(t)  # reject times that the file of a load lacks
        return self.drive(t)

    def under(self, **changes: Any) -> Scene:
        """Return a copy of the scene with different gravity, loads, springs or motors.

        Args:
            changes: `gravity`, `loads`, `springs`, `motors` in the format of a scene file: `loads=[{"on": "coupler",
                "by": "environment", "force": [0, 0, -20]}]`. Vectors may be arrays.

        Raises:
            ScrewgaugeError: A field is unknown, or an entry is invalid.
        """
        for name in changes:
            check_name("field", name, [each.name for each in fields(Applied)], "forces of the scene")
        folder = Path() if self.file is None else self.file.parent
        given = read_applied(self.mechanism, as_written(changes), "under", folder)
        return replace(self, applied=replace(self.applied, **given))

    def with_(self, changes: Mapping[str, Any]) -> Scene:
        """Return a copy of the scene with different numbers for its mechanism and the forces acting on it.

        Names are paths in a description, such as ``bodies.coupler.mass`` or ``joints.left.parent.x``; unique short
        forms, such as ``coupler.mass``; or patterns, such as ``*.mass``. If placements change, the home pose keeps its
        assembly mode and the values of its independent coordinates.

        Args:
            changes: Name or pattern -> number, or string in which x is the current value: ``"1.01 x"``, ``"x +
                0.002"``.

        Raises:
            ScrewgaugeError: A name is unknown, or a new value is invalid for a body, spring or closed loop.
        """
        from screwgauge.models.home import near_home  # a solver of many parts, which few scenes need

        known, values = numbers(self.mechanism, self.applied), dict[str, float]()
        for pattern, rule in changes.items():
            for name in resolve(known, [pattern], "with_"):
                values[name] = changed_to(rule, known[name], f"with_, {pattern}")

        def at(share: float) -> Mechanism:
            way = {name: known[name] + share * (x - known[name]) if share < 1.0 else x for name, x in values.items()}
            return mechanism_with(self.mechanism, way)

        made, applied = at(1.0), applied_with(self.applied, values)
        moved = any(map(geometric, values)) and bool(layout(self.mechanism).cuts or self.mechanism.couplings)
        return replace(self, mechanism=near_home(self.mechanism, at) if moved else made, applied=applied)

    def problem(self, wanted: Sequence[str] | frozenset[str], engine: str = "") -> Problem:
        """Return the problem that the scene poses to every engine.

        Args:
            wanted: Names of quantities.
            engine: Name of the engine that solves the problem, see `acting_on`; by default no particular engine.
        """
        applied = self.acting_on(engine)
        return Problem(applied, self.task, frozenset(wanted), self.rule, self.wording(), self.points)

    def acting_on(self, engine: str) -> Applied:
        """Return the forces that act on the model of an engine; a user's MJCF keeps its own gravity.

        The judge also checks the gravity of the MJCF. URDFs and descriptions do not specify gravity.
        """
        file = self.models.get(engine)
        return self.applied if file is None or file.suffix != ".xml" else replace(self.applied, gravity=None)

    def wording(self) -> Wording:
        """Return motion, gravity and loads as strings from the file; None where different doubles replaced them."""
        if not self.text:
            return Wording()
        motion, gravity, loads = (self.text[key] for key in ("motion", "gravity", "loads"))
        same_gravity = self.applied.gravity is not None and np.array_equal(
            vector(gravity, "gravity"), self.applied.gravity
        )
        same_loads = not any(load.sampled for load in self.applied.loads)  # sampled loads are defined by their doubles
        if same_loads:
            folder = Path() if self.file is None else self.file.parent
            stated = [read_load(self.mechanism, table, "loads", folder) for table in loads]
            same_loads = [load.numbers() for load in stated] == [load.numbers() for load in self.applied.loads]
        return Wording(
            motion=motion if self._moves_as(motion) else None,
            gravity=gravity if same_gravity else None,
            loads=tuple(loads) if same_loads else None,
        )

    def _moves_as(self, table: dict[str, Any]) -> bool:
        """Return True if the scene still moves as the table describes.

        False for samples, and for motion that follows from forces, because doubles define these motions.
        """
        if "csv" in table or {*table} != {*self.mechanism.independent}:
            return False
        stated, motion = read_drive(table, list(self.mechanism.independent), Path(), "motion")[0](self.t), self.motion
        pairs = ((motion.y, stated.y), (motion.yd, stated.yd), (motion.ydd, stated.ydd))
        return all(np.array_equal(a, b) for a, b in pairs)

    def tolerance(self, quantity: str) -> float:
        """Return the scaled tolerance of a quantity."""
        usual = QUANTITIES[quantity].tolerance
        if isinstance(self.task, InitialValue):
            usual = integrated_tolerance(self.task.integration.rtol, self.task.integration.atol)
        return self.tolerances.get(quantity, usual)


def check_scene_type(what: object, where: str) -> None:
    """Reject objects that are not scenes, such as the name of a scene."""
    if not isinstance(what, Scene):
        raise DescriptionError(f"{quote(what)} is not a scene", where, "pass a scene returned by load_scene")


def check_order(t: Array, since: float) -> None:
    """Reject times of a simulation that do not increase, or that precede its start."""
    if (np.diff(t) <= 0.0).any() or t[0] < since:
        raise DescriptionError(
            f"the times must increase, and must not precede the start at t = {since:g} s",
            "times",
            "sort the times, beginning at the start",
        )
