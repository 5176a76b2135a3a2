"""Makes one tree follow the motion of a second tree, wherever their loops are cut.

The poses of all bodies together determine coordinates, velocities and accelerations of the tree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from screwgauge.diagnosis.machine.pair import Pair, Partner
from screwgauge.models.kinematics import ReadingTree, home
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, rotation_vector
from screwgauge.witness.constraints import DEPENDENT, STEPS, move_joints, newton_step, residual
from screwgauge.witness.kinematics import Moving, move
from screwgauge.witness.tree import FixedFrame, TreeStates, stack_frames

#: Largest misfit of closures and of the poses of partners [rad or machine lengths]; placements of partners are accurate
#: to 1e-9.
FITS = 1e-8
#: Misfit from which a single Newton step reaches rounding error [rad or machine lengths].
NEAR = 1e-8


#: Body of the leader, body of the follower, and the latter's frame relative to the former, shape (4, 4); joint of the
#: leader -> joint of the follower, for initial coordinates.
Partners = tuple[Sequence[tuple[str, str, Array]], Mapping[str, Partner]]


def partners_of(pair: Pair) -> Partners:
    """Return the partners of A's bodies, including all members of each body."""
    poses = pair.b.reading.poses
    bodies = [
        (name, member, np.linalg.inv(pair.a.bodies[name].pose) @ pair.placed[name] @ poses[member])
        for name, other in pair.bodies.items()
        for member in pair.b.bodies[other].members
    ]
    return bodies, pair.joints


def namesakes(reading: Reading) -> Partners:
    """Match a reading with the same model at a different home pose."""
    bodies = [(name, name, np.eye(4)) for name in reading.bodies]
    return bodies, {name: Partner(name) for name in reading.joints}


def follow(
    leader: ReadingTree, states: TreeStates, tree: ReadingTree, partners: Partners
) -> tuple[TreeStates, Array, NDArray[np.bool_]]:
    """Use Newton's method to find the states of a tree at which its bodies move like their partners.

    Returns:
        States of the follower; matrix that maps the leader's velocities to the follower's velocities, shape
        (n, n_freedom, n_leader); True where all bodies follow and all loops are closed, shape (n,).
    """
    bodies, joints = partners
    at = stack_frames([_frame(leader, name, T) for name, _, T in bodies])
    own = stack_frames([_frame(tree, other, np.eye(4)) for _, other, _ in bodies])
    lead, there = move(leader, states), _start(leader, states, tree, joints)
    wanted = lead.links.frames(at)
    for _ in range(STEPS):
        motion = move(tree, there)
        here = motion.links.frames(own)
        off, (Q, R) = _pose_errors(here, wanted), np.linalg.qr(_rows(motion.jacobian(own, here.p)))
        step = newton_step(R, (np.swapaxes(Q, 1, 2) @ off[..., None])[..., 0])
        there = replace(there, q=move_joints(tree, there.q, step))
        if np.abs(off).max(initial=0.0) <= NEAR * tree.length:  # quadratic convergence: this step reaches rounding
            break
    Q, R = np.linalg.qr(_rows(move(tree, there).jacobian(own, wanted.p)))
    back = np.linalg.pinv(R, rcond=DEPENDENT) @ np.swapaxes(Q, 1, 2)
    C = back @ _rows(lead.jacobian(at, wanted.p))
    there = replace(there, qd=(C @ states.qd[..., None])[..., 0])
    motion = move(tree, there)
    here = motion.links.frames(own)
    missing = (wanted.acceleration - here.acceleration).reshape(len(C), -1, 1)
    gaps = [_pose_errors(here, wanted), (here.velocity - wanted.velocity).reshape(len(C), -1), residual(motion)]
    fits = np.abs(np.hstack(gaps)).max(axis=1, initial=0.0) <= FITS * max(tree.length, 1.0)
    return replace(there, qdd=(back @ missing)[..., 0]), C, fits


def _frame(tree: ReadingTree, body: str, T: Array) -> FixedFrame:
    """Attach a frame to a body at the pose T, shape (4, 4)."""
    if body == GROUND:
        return FixedFrame().place(T[:3, :3], T[:3, 3])
    number = [*tree.reading.bodies].index(body)
    return FixedFrame(*(each[number] for each in tree.bodies)).place(T[:3, :3], T[:3, 3])


def _start(leader: ReadingTree, states: TreeStates, tree: ReadingTree, joints: Mapping[str, Partner]) -> TreeStates:
    """Return states at rest with the coordinates of partners, or home coordinates for unmatched joints."""
    n = len(states.q)
    still = home(tree.reading)
    q, rest = still.q.repeat(n, axis=0), np.zeros((n, tree.freedom))
    for name, partner in joints.items():
        own, other = leader.places[name], tree.places[partner.name]
        if own.stop - own.start == other.stop - other.start:
            single = own.stop - own.start == 1
            q[:, other] = partner.sign * states.q[:, own] + partner.zero if single else states.q[:, own]
    return TreeStates(q, rest, rest)


def _pose_errors(here: Moving, wanted: Moving) -> Array:
    """Compute rotation vectors [rad] and translations [m] from the target poses to the current ones. Shape (n, 6 m)."""
    off = np.concatenate([rotation_vector(here.R @ wanted.R.swapaxes(2, 3)), here.p - wanted.p], axis=2)
    return off.reshape(len(off), -1)


def _rows(J: Array) -> Array:
    """Stack the Jacobians of all bodies. Shape (n, m, 6, n_freedom) -> (n, 6 m, n_freedom)."""
    return J.reshape(len(J), -1, J.shape[-1])
