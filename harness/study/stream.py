"""Solution of scenes with more samples than fit in memory: parts are solved, returned and discarded one by one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from screwgauge.engines.registry import check_engines
from screwgauge.models.home import check_home
from screwgauge.quantities import check_quantities
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError
from screwgauge.reference.rotations import Array
from screwgauge.scene.preflight import SampleWalk, determined_at_home
from screwgauge.scene.scene import Scene, check_scene_type
from screwgauge.solution import Solution
from screwgauge.study.solving import solve

PART = 4096  # samples per part: following them takes some 50 MB, and preparing a part takes a twentieth of its time


def times(count: int, step: float, *, first: float = 0.0, part: int = PART) -> Iterator[Array]:
    """Yield evenly spaced times [s], ``first + k step`` for k below `count`, in parts, so that they fit in memory.

    Raises:
        DescriptionError: `count`, `part` or `step` is not positive, or a number is not finite.
    """
    if not (count > 0 and part > 0 and 0.0 < step < np.inf and np.isfinite(first)):
        what = f"cannot divide {count} times, {step:g} s apart from {first:g} s on, into parts of {part}"
        raise DescriptionError(what, "times", "use positive finite numbers")
    for begin in range(0, count, part):
        yield first + np.arange(begin, min(begin + part, count), dtype=float) * step


def stream(
    scene: Scene, parts: Iterable[Array], *, engine: str = "screw", quantities: Iterable[str] | None = None
) -> Iterator[tuple[Array, Solution]]:
    """Solve a scene for times in parts, using memory for only one part at a time.

    Every part starts from the home pose; for joints that are cut in an engine's tree, angles are counted from there.
    The motion is not checked beforehand: a part that meets or passes a singular pose, or cannot be solved, raises an
    error when its turn comes.

    Args:
        parts: Arrays of times [s], shape (m,) each, such as the arrays that `times` yields.
        engine: Name of the engine.
        quantities: Names of the quantities to compute; by default as in the scene.

    Yields:
        Times and solution of each part; forces that too few actuators cannot produce are omitted, with a note.

    Raises:
        ScrewgaugeError: The input is invalid, or the engine cannot solve a part.
    """
    check_scene_type(scene, "stream")
    (name,) = check_engines([engine])
    wanted = check_quantities(scene.quantities if quantities is None else quantities)
    if scene.simulated:
        raise DescriptionError("a forward scene is integrated, not streamed", scene.name, "use run")
    wanted, left = determined_at_home(scene, wanted)
    walk = SampleWalk(check_home(scene.mechanism))
    for t in parts:
        t = np.asarray(t, dtype=float)
        if t.ndim != 1 or not len(t) or not np.isfinite(t).all():
            raise DescriptionError("every part must be an array of finite times", "parts", "pass arrays of times in s")
        motion = scene.moved(t)
        walk.part(motion)
        solutions, failures = solve(replace(scene, task=motion), (name,), wanted)
        if failures:
            where = f"{scene.name}, t = {t[0]:g} to {t[-1]:g} s"
            raise ScrewgaugeError(f"{name} failed: {failures[name].reason}", where, "change the motion at these times")
        one = solutions[name]
        yield t, replace(one, notes=(*one.notes, *left)) if left else one
