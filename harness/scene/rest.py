"""Samples of a given motion at which a joint with dry friction rests, so that forces are not unique."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from screwgauge.problem import GivenMotion
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.errors import first_few
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.resistance import DRY, REST, Resistance, resistances
from screwgauge.scene.scene import Scene

#: Number of joints named in a sentence.
SHOWN = 4


def at_rest(scene: Scene) -> dict[Resistance, NDArray[np.bool_]]:
    """Return dry friction -> mask of samples of a given motion at which its joint rests. Shape (n,)."""
    return {} if scene.simulated else _at_rest(scene.mechanism, scene.motion)


@lru_cache(maxsize=1)  # both arguments are immutable; called once for a run and once for each table
def _at_rest(mechanism: Mechanism, motion: GivenMotion) -> dict[Resistance, NDArray[np.bool_]]:
    friction = resistances(mechanism.joints, DRY)
    if not friction:
        return {}
    lay = layout(mechanism)
    q = positions(lay, motion.y, motion.t, (motion.yd, motion.ydd))
    rates = motion_at(lay, q, motion.yd).joint_velocity
    return {one: rests for one in friction if (rests := np.abs(rates[:, one.column]) <= REST).any()}


def unique_samples(scene: Scene) -> NDArray[np.bool_]:
    """Return True for samples where dry friction leaves all forces unique, or for all if there are none. Shape (n,)."""
    rests = np.any([np.zeros(len(scene.t), dtype=bool), *at_rest(scene).values()], axis=0)
    return np.asarray(~rests | rests.all())


def rest_warning(scene: Scene) -> Iterator[str]:
    """Warn if the direction of dry friction is undefined at some samples, and state its possible magnitude there."""
    if not (rests := at_rest(scene)):
        return
    rows = np.flatnonzero(np.any([*rests.values()], axis=0))
    named = (f"{one.coordinate} (up to {one.amount:g} {one.unit})" for one in rests)
    yield (
        "Dry friction is taken as zero where a joint rests, although it may be anything up to its limit: at "
        f"{len(rows)} of {len(scene.t)} samples, first at t = {scene.t[rows[0]]:g} s, in {first_few(named, SHOWN)}. "
        "Forces that depend on it are not unique there, and forces in tables are not compared at these samples."
    )
