"""What a model file of the user's own says otherwise than the description, in physical terms, with both values."""

from __future__ import annotations

from pathlib import Path

from screwgauge.diagnosis.differences.change import Difference
from screwgauge.diagnosis.differences.digits import ALL, digits_of, marked
from screwgauge.diagnosis.differences.static import differences, sorted_by_size
from screwgauge.diagnosis.differences.words import with_sides
from screwgauge.diagnosis.pairing.branches import missing
from screwgauge.diagnosis.pairing.common import brought
from screwgauge.diagnosis.pairing.mapping import paired
from screwgauge.engines.registry import get_engine
from screwgauge.models.expected import expected_reading
from screwgauge.models.readings.read import LIBRARIES, read
from screwgauge.problem import ModelFiles
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.files import read_file
from screwgauge.scene.scene import Scene
from screwgauge.study.departures import of_loops

#: Library -> what the description does not say and the library does not apply: `departures` says what becomes of it.
_UNUSED = {"pinocchio": {"limits", "damping", "friction", "stiffness", "rest"}, "mujoco": {"limits"}}


def otherwise(scene: Scene, name: str, files: ModelFiles) -> tuple[str, ...]:
    """Sentences on mass properties, geometry, gravity and closures, the largest difference first; on the loops file."""
    sides = "in the description", f"in {files.model.name}"
    said = (with_sides(each.sentence, *sides) for each in physical(scene, name, files.model))
    return (*said, *of_loops(scene, name, files)[1])


def physical(scene: Scene, name: str, model: Path) -> list[Difference]:
    """Differences of a model file from the description, the largest first; those that rounding makes are marked.

    Args:
        name: The engine, which reads a URDF or MJCF of the user's own; of others nothing is said.
    """
    engine, mechanism, library = get_engine(name), scene.mechanism, name.partition("-")[0]
    if library not in LIBRARIES or engine.reads not in (".urdf", ".xml"):
        return []
    expected = expected_reading(mechanism, engine.cut, scene.applied.g)
    try:
        home = dict(zip(mechanism.coordinates, map(float, mechanism.home), strict=True))
        found = read(model, library, home=home)
        digits = digits_of(read_file(model))
    except ScrewgaugeError:
        return []  # `departures` says that it cannot be compared
    silent = _UNUSED.get(library, set()) | ({"closure", "gravity", "coupling"} if found.gravity is None else set())
    pairing = paired(expected, found)
    said = [*missing(expected, found, pairing), *differences(brought(expected, found, pairing))[0]]
    return sorted_by_size([each for each in marked(said, (ALL, digits)) if each.what not in silent])
