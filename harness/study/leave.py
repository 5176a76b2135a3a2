"""Differences that a scene allows: ``allow = ["coupler.inertia", "models.mujoco.unread"]``."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.inertia import TRIANGLE
from screwgauge.reference.mechanism import triangle_excess
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution
from screwgauge.study.left_out import LeftOutForces
from screwgauge.study.mismatches import LOOPS, MODEL

#: Property of a file that a scene names but that no engine of a run reads.
UNREAD = "unread"
#: Owners of properties whose names differ between files.
_UNNAMED = ("closure", "coupling", "actuator")


def check_leave(scene: Scene) -> None:
    """Reject entries of ``allow`` that do not match any part of the mechanism or the scene.

    Raises:
        UnknownNameError: A property, body, joint or file is unknown.
    """
    if not scene.allow:
        return
    from screwgauge.diagnosis.properties import PARTS, PROPERTIES
    from screwgauge.diagnosis.words import EVENTS

    where, mechanism = f"{scene.file or scene.name}, allow", scene.mechanism
    joints = [name for joint in mechanism.joints for name in (joint.name, *joint.coordinates)]
    beyond = [each.of.partition(" ")[2] for each in mechanism.left_out]
    things = dict.fromkeys([*(body.name for body in mechanism.bodies), *joints, *beyond, MODEL, LOOPS])
    properties = (*PROPERTIES, *EVENTS, UNREAD, TRIANGLE)
    for entry in scene.allow:
        thing, _, what = entry.rpartition(".")
        if what not in properties:
            raise UnknownNameError("property", what, properties, where)
        if what == UNREAD:
            _check(thing, files_of(scene), "file of the scene", where)
        elif what == TRIANGLE:
            _check(thing, [body.name for body in mechanism.bodies], "body", where)
        elif what in PROPERTIES and what not in PARTS and PROPERTIES[what].owner not in _UNNAMED:
            _check(thing, things, "body or joint", where)


def _check(thing: str, known: Collection[str], kind: str, where: str) -> None:
    if thing not in known:
        raise UnknownNameError(kind, thing, known, where)


def files_of(scene: Scene) -> list[str]:
    """Return the keys under which a scene lists the files that engines and comparisons read."""
    return [*(f"models.{name}" for name in scene.models), *(f"tables.{name}" for name in scene.tables)]


def idle_entries(
    scene: Scene, solutions: Mapping[str, Solution], forces: LeftOutForces, unread: Collection[str]
) -> Iterator[str]:
    """Yield sentences on entries of ``allow`` that have no effect, if all model files of the scene were read.

    Args:
        unread: Keys of files that were not read.
    """
    found = {each.key for solution in solutions.values() for each in solution.otherwise}
    found |= {*unread, *forces.inertia}
    found |= {f"{body.name}.{TRIANGLE}" for body in scene.mechanism.bodies if triangle_excess(body.inertia)}
    if {*scene.models} <= {*solutions}:
        for entry in scene.allow:
            if entry not in found:
                yield f"allow lists {entry}, which has no effect; remove this entry"


def unread_files(scene: Scene, names: Collection[str]) -> dict[str, str]:
    """Return key in `Scene.allow` -> sentence, for files that a scene names but none of the given engines reads."""
    sentences = {}
    for name in (name for name in scene.models if name not in names):
        model = f"{scene.models[name]} (models.{name})"
        sentences[f"models.{name}.{UNREAD}"] = f"{model} is not read, because {name} was not run"
    for name in (name for name in scene.tables if name not in names):
        table = f"{scene.tables[name].file or 'an array'} (tables.{name})"
        sentences[f"tables.{name}.{UNREAD}"] = f"{table} is ignored, because no engine of that name was requested"
    return sentences
