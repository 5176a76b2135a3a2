"""Which coordinates are independent, and what is driven where nothing says so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import in_lengths
from screwgauge.reference.pose import constraint_matrix, layout, pose
from screwgauge.reference.rotations import Array

#: A coordinate that is preferred is taken as long as so much of it is its own.
OWN = 0.05


def motions(mechanism: Mechanism) -> Array:
    """Orthonormal basis of all joint velocities that the loops allow at home, without dimension. Shape (n_q, k)."""
    lay = layout(replace(mechanism, independent={}))
    lay, at = in_lengths(lay, pose(lay, mechanism.home[None]))
    G = constraint_matrix(lay, at)[0]
    return linear.null_space(G) if G.size else np.eye(len(mechanism.coordinates))


def choose(
    mechanism: Mechanism, actuated: Sequence[str] | None, independent: Mapping[str, str] | None, where: str
) -> Mechanism:
    """The mechanism with its independent coordinates and actuators.

    Args:
        actuated: Joints that are driven; None are those of independent coordinates that can be.
        independent: Label -> coordinate that the user chose.

    Raises:
        DescriptionError: Nothing moves, or the coordinates chosen do not determine the motion.
    """
    K = motions(mechanism)
    if not K.shape[1]:
        raise DescriptionError("its loops leave no degree of freedom", where, "check the closures")
    names = mechanism.coordinates
    if independent is None:
        chosen = {names[i]: names[i] for i in pick(K, preferences(mechanism, actuated or ()))}
    else:
        for name in independent.values():
            if name not in names:
                raise UnknownNameError("coordinate", name, names, f"{where}, --independent")
        chosen = dict(independent)
        rank = linear.rank(K[[names.index(name) for name in chosen.values()]]) if chosen else 0
        if not rank == len(chosen) == K.shape[1]:
            what = f"{len(chosen)} coordinates of rank {rank} for {K.shape[1]} degrees of freedom"
            raise DescriptionError(what, f"{where}, --independent", f"name {K.shape[1]} that determine the motion")
    driven = {*chosen.values()} if actuated is None else {*actuated}
    joints = tuple(replace(joint, actuated=joint.kind in "RP" and joint.name in driven) for joint in mechanism.joints)
    return replace(mechanism, joints=joints, independent=chosen)


def preferences(mechanism: Mechanism, actuated: Sequence[str]) -> list[list[int]]:
    """Columns of coordinates in the order in which they are preferred: free poses, what is driven, simple joints."""
    tiers: list[list[int]] = [[], [], [], []]
    coupled = {coupling.coordinate for coupling in mechanism.couplings}
    for joint in mechanism.joints:
        simple = joint.kind in "RP" and joint.name not in coupled
        rank = 0 if joint.kind == "F" else 1 if joint.name in actuated else 2 if simple else 3
        tiers[rank] += mechanism.columns(joint.coordinates)
    return tiers


def pick(K: Array, tiers: Sequence[Sequence[int]]) -> list[int]:
    """Rows of a basis that determine the rest, as far from dependent as the order of preference lets them be.

    Rank-revealing QR by modified Gram-Schmidt with pivoting, tier by tier. Shape (n, k) -> k rows, ascending.
    """
    rest, chosen = K.copy(), list[int]()
    for i, tier in enumerate(tiers):
        least = OWN if i < len(tiers) - 1 else 0.0
        candidates = list(tier) if i < len(tiers) - 1 else list(range(len(K)))
        while len(chosen) < K.shape[1] and candidates:
            sizes = np.linalg.norm(rest[candidates], axis=1)
            best = int(np.argmax(np.round(sizes, 9)))  # of equals the first
            if not sizes[best] > least:
                break
            row = candidates.pop(best)
            chosen.append(row)
            along = rest[row] / sizes[best]
            rest = rest - np.outer(rest @ along, along)
    return sorted(chosen)
