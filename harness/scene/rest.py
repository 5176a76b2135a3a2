"""Samples of a given motion at which a joint with dry friction rests, so that forces are not unique."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.errors import first_few
from screwgauge.reference.graph import layout
from screwgauge.reference.resistance import REST
from screwgauge.scene.scene import Scene

#: Joints that a sentence names.
SHOWN = 4


def at_rest(scene: Scene) -> Iterator[str]:
    """A sentence if dry friction has no direction at some samples, with how large it may be there."""
    mechanism, motion = scene.mechanism, scene.motion
    friction = [one for one in mechanism.resistances if one.what == "friction"]
    if not friction:
        return
    lay = layout(mechanism)
    q = positions(lay, motion.y, motion.t, (motion.yd, motion.ydd))
    rates = motion_at(lay, q, motion.yd).joint_velocity[:, [one.column for one in friction]]
    rests = np.abs(rates) <= REST
    if not rests.any():
        return
    rows = np.flatnonzero(rests.any(axis=1))
    named = (
        f"{x.coordinate} (up to {x.amount:g} {x.unit})" for x, at in zip(friction, rests.T, strict=True) if at.any()
    )
    yield (
        "Dry friction counts as none where a joint rests, and may be anything up to its size there: at "
        f"{len(rows)} of {len(motion)} samples, first at t = {motion.t[rows[0]]:g} s, of {first_few(named, SHOWN)}. "
        "Forces that depend on it are not unique there."
    )
