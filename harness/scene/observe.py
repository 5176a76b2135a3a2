"""Observables from joint coordinates, by the description, and their values from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwgauge.problem import Rows
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.pose import Layout, pose
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.scene.setting import Observable
from screwgauge.solution import Values


def observe(lay: Layout, observables: Sequence[Observable], q: Array) -> Values:
    """Values of the observables at joint coordinates `q`, shape (n, n_q)."""
    at, columns = pose(lay, q), []
    for item in observables:
        if item.point is None:
            columns.append(q[:, lay.mechanism.coordinates.index(item.coordinate)])
        else:
            i = lay.mechanism.body_index[item.body]
            columns.append(at.p[:, i, item.axis] + at.R[:, i, item.axis] @ item.point)
    return _values(observables, np.stack(columns, axis=1))


def known_values(scene: Scene) -> tuple[Values, Rows]:
    """The reference on the scene's times, NaN where it has none, and the rows where it has.

    Raises:
        DescriptionError: It has none of the scene's times.
    """
    t, known = scene.motion.t, scene.known
    array = np.full((len(t), len(scene.observables)), np.nan)
    if known is None:
        return _values(scene.observables, array), np.arange(0)
    nearest = np.abs(known.t[None] - t[:, None]).argmin(axis=1)
    # times that differ only in how their decimals were rounded are the same
    rows: Rows = np.flatnonzero(np.isclose(known.t[nearest], t, rtol=1e-12, atol=1e-15))
    if not rows.size:
        raise DescriptionError(
            "the reference has none of the scene's times", scene.name, "leave out [time], or change its step"
        )
    array[rows] = known.values[nearest[rows]]
    return _values(scene.observables, array), rows


def _values(observables: Sequence[Observable], array: Array) -> Values:
    names, units = zip(*((item.name, item.unit) for item in observables), strict=True)
    return Values(names, units, array)
