"""What of a scene is legal and seldom meant: bodies and joints that no machine has, angles that are degrees."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from screwgauge.reference.lint import TURNED, WRITTEN, hinges, implausible, in_degrees
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene

#: Rates at both ends of a motion that comes from rest and goes to rest, of the largest one.
REST = 1e-6


def doubts(scene: Scene) -> tuple[str, ...]:
    """Sentences on bodies, joints and motion."""
    return (*implausible(scene.mechanism), *(_started(scene) if scene.simulated else _moved(scene)))


def _angles(scene: Scene) -> Iterator[tuple[int, str, int]]:
    """Independent coordinates that are angles of hinges: number, label and column."""
    mechanism, free = scene.mechanism, {hinge.name for hinge in hinges(scene.mechanism)}
    for k, label in enumerate(mechanism.independent):
        column = int(mechanism.independent_columns[k])
        if mechanism.coordinates[column] in free:
            yield k, label, column


def _started(scene: Scene) -> Iterator[str]:
    """On each angle that starts more than a turn from home."""
    for k, label, column in _angles(scene):
        value = float(scene.start.start[k])
        if abs(value - scene.mechanism.home[column]) > 2.0 * np.pi:
            yield f"the start {label} = {value:g} rad is more than a turn from home ({WRITTEN})"


def _moved(scene: Scene) -> Iterator[str]:
    """On each angle that begins more than a turn from home, or goes several turns to and fro or from rest to rest.

    What runs round, as a crank does, may turn as much as it likes.
    """
    motion, home = scene.motion, scene.mechanism.home
    for k, label, column in _angles(scene):
        y, yd = motion.y[:, k], motion.yd[:, k]
        way = float(np.ptp(y))
        if abs(y[0] - home[column]) > 2.0 * np.pi:
            yield f"{label}: {in_degrees('a start', float(y[0]))} ({WRITTEN})"
        elif way > TURNED and (_returns(y) or _rests(yd)):
            yield f"{label}: {in_degrees('a motion', way)} ({WRITTEN})"


def _returns(y: Array) -> bool:
    """Whether it goes back by more than a turn. Shape (n,)."""
    back = (np.maximum.accumulate(y) - y).max(), (y - np.minimum.accumulate(y)).max()
    return bool(min(back) > 2.0 * np.pi)


def _rests(yd: Array) -> bool:
    """Whether it comes from rest and goes to rest. Shape (n,)."""
    return bool(max(abs(yd[0]), abs(yd[-1])) <= REST * np.abs(yd).max())
