"""Which singularity a pose is near, in one sentence, from the freedoms and constraints of the loops there."""

from __future__ import annotations

from functools import partial

import numpy as np

from screwgauge.reference.closed.loops import LoopEquations, loop_equations
from screwgauge.reference.couplings import component_name
from screwgauge.reference.equations.screws import velocity_at
from screwgauge.reference.errors import first_few
from screwgauge.reference.graph import Layout, output_body
from screwgauge.reference.pose import Pose
from screwgauge.reference.rotations import Array

#: Parts of a null vector below this share of its largest are left out of the sentence.
SHARE = 0.05
_named = partial(first_few, most=4)


def near_singularity(lay: Layout, at: Pose) -> str:
    """What happens at the singular pose that a pose is nearest to. `at` holds one sample.

    The smallest singular value's right vector is the motion that the loops no longer stop while the independent
    coordinates rest, its left vector the wrenches of cut joints that no longer stop it.
    """
    system = loop_equations(lay)
    U, _, Vt = np.linalg.svd(system.matrix(at)[0], full_matrices=False)
    motion = np.zeros(at.q.shape[1])
    motion[system.unknown] = Vt[-1]
    coordinates = [lay.mechanism.coordinates[i] for i in _large(motion)]
    bodies = _moved(lay, system, at, motion * system.size)
    chosen = ", ".join(lay.mechanism.independent)
    names = [*system.names, *(component_name(coupling) for coupling in lay.mechanism.couplings)]
    lost = [names[i] for i in _large(U[: len(names), -1], 0.3)]
    joints = list(dict.fromkeys(name.rsplit(".", 1)[0] for name in lost))
    constraint = f"; the constraint of {_named(joints)} is lost" if lost else ""
    freedom = f"a freedom that {chosen} do not determine ({_named(coordinates)} move){constraint}"
    if output_body(lay.mechanism) in bodies:
        return f"{output_body(lay.mechanism)} gains {freedom}"
    joint = next((j for j in lay.mechanism.joints if set(j.coordinates) >= set(coordinates)), None)
    if joint is not None and len(joint.coordinates) > 1:
        return f"{joint.name} locks: {_named(bodies)} turn idly ({_named(coordinates)} moves nothing else)"
    return f"{_named(bodies)} gain {freedom}"


def gimbal_lock(lay: Layout, cut: int) -> str:
    """What happens in gimbal lock of cut joint number `cut`."""
    joint = lay.cuts[cut]
    first, last = joint.coordinates[0], joint.coordinates[-1]
    return f"{joint.name} is in gimbal lock ({first} and {last} turn about one line)"


def _large(values: Array, share: float = SHARE) -> list[int]:
    """Indices of what is not small beside the largest, the largest first."""
    size = np.abs(values)
    order = np.argsort(-size, kind="stable")
    return [int(i) for i in order if size[i] > share * size.max(initial=0.0)]


def _moved(lay: Layout, system: LoopEquations, at: Pose, motion: Array) -> list[str]:
    """Bodies that a motion of the tree moves."""
    V = np.einsum("bi,i,ix->bx", lay.path, motion, at.S[0])[1:]
    linear = velocity_at(V, at.com[0]) / system.length
    speed = np.abs(np.concatenate([V[:, :3], linear], axis=1)).max(axis=1)
    return [lay.mechanism.bodies[i].name for i in sorted(_large(speed))]
