"""Detects singular home poses: first-order motions without a finite motion, e.g. of a straight fixed leg."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwgauge.models.importing.assemble import motions
from screwgauge.reference import linear
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.errors import first_few
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Mechanism

#: Step of the difference quotients [rad or lengths], and size of second derivatives that exceeds rounding error.
STEP, CURVED = 1e-4, 1e-6
#: Share of the largest rate below which a joint is not involved, and number of joints that are named.
PART, NAMED = 0.05, 9


def singular_joints(mechanism: Mechanism) -> tuple[str, ...]:
    """Return joints whose motion at the home pose opens loops to second order; empty if the home pose is regular.

    Constraints that are dependent only at the home pose, ``l G = 0``, do not prevent rates with ``G v = 0``; a finite
    motion exists only where ``l dG(v) v = 0``.
    """
    lay = layout(replace(mechanism, independent={}))
    loops, q = loop_equations(lay), mechanism.home[None]
    K = motions(mechanism)[0]
    v = K[loops.unknown]
    dependent = linear.null_space(loops.constraints(q)[0].T)
    if not dependent.size or not v.size:
        return ()
    bends = np.empty((dependent.shape[1], v.shape[1], v.shape[1]))
    for j, way in enumerate(v.T):
        step = np.zeros_like(q)
        step[0, loops.unknown] = STEP * loops.sizes[loops.unknown] * way
        slope = (loops.constraints(q + step)[0] - loops.constraints(q - step)[0]) / (2.0 * STEP)
        bends[:, :, j] = dependent.T @ slope @ v
    moved = np.linalg.norm(np.einsum("ak,lkj->lja", K, bends), axis=(0, 1))
    if not moved.max() > CURVED:
        return ()
    large = {mechanism.coordinates[i] for i in np.flatnonzero(moved > PART * moved.max())}
    return tuple(joint.name for joint in mechanism.joints if joint.constrains and large & {*joint.coordinates})


def why_singular(mechanism: Mechanism) -> str:
    """Explain which joints make the home pose singular; return an empty string if the home pose is regular."""
    joints = singular_joints(mechanism)
    if not joints:
        return ""
    return f"{first_few(joints, NAMED)} can begin a motion that the loops then stop"
