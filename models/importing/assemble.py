"""Finds a home pose with closed loops, independent coordinates at that pose, and the driven joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.models.importing.homes import CLOSED, OWN, Home, Loops, choose_home, few_of, limits
from screwgauge.models.importing.joints import SHOWN, few_names
from screwgauge.models.kinematics import rehome, tree_of
from screwgauge.models.readings.reading import Reading
from screwgauge.reference import linear
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.equations.kinematics import twists
from screwgauge.reference.errors import DescriptionError, UnknownNameError, first_few
from screwgauge.reference.graph import check_connected, layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array

#: Limits of a joint without limits.
FREE = (-float("inf"), float("inf"))


def assemble(
    reading: Reading, where: str, keyframes: Mapping[str, Mapping[str, float]]
) -> tuple[Reading, tuple[str, ...]]:
    """Find a closed pose near the file's home pose; it is within limits and well conditioned if possible.

    Args:
        keyframes: See `homes.choose_home`.

    Returns:
        The reading with that home pose, and sentences on which coordinates moved and why.

    Raises:
        ClosureError: A loop does not close from any starting pose.
    """
    loops = Loops(tree_of(reading))
    home, why = choose_home(loops, keyframes, where)
    free = {name: replace(reading.joints[name], limits=FREE) for name in home.beyond}
    reading = replace(reading, joints={**reading.joints, **free})
    there = {name: home.q[place] for name, place in loops.tree.places.items() if (home.q != loops.home)[place].any()}
    return rehome(reading, there)[0], _sentences(loops, home, why)


def _sentences(loops: Loops, chosen: Home, why: tuple[str, ...]) -> tuple[str, ...]:
    home = loops.values(loops.home)
    moved = {name: value - home[name] for name, value in loops.values(chosen.q).items() if value != home[name]}
    sentences, opened = [], loops.gaps(loops.home, CLOSED)
    if moved:
        most = max(moved, key=lambda name: abs(moved[name]))
        near = " near the file's own home pose" if chosen.start == OWN else ""
        aim = f"closed loops{near}" if opened else "a margin to the limits"
        what = f"{len(moved)} coordinates are moved; '{most}' moves the most, by {moved[most]:.3g}"
        sentences.append(f"The home pose is moved to a pose with {aim}: {what}.")
    sentences += why
    if opened:
        sentences.append(f"At the file's own home pose, loops are open: {few_of(opened)}.")
    if chosen.error > CLOSED:
        rounding = few_of(loops.gaps(chosen.q, CLOSED))
        sentences.append(
            f"Rounding in the file leaves loops slightly open; frames are moved to close them: {rounding}."
        )
    if tight := [f"'{name}'" for name, (low, high) in limits(loops) if not low < high]:
        sentences.append(f"The limits of {few_of(tight)} leave no range of motion and are left out.")
    if chosen.beyond:
        sentences.append(f"Loops or couplings keep {few_of(chosen.beyond)} outside limits; these limits are left out.")
    return tuple(sentences)


#: A preferred coordinate is chosen if more than this share of its motion is independent of already chosen coordinates;
#: for a driven coordinate, whose stroke may be short compared with the machine, the share is relative to its own
#: stroke. A driven coordinate that moves less than the third value at the home pose is at a dead centre.
PREFERRED, OWN_SHARE, DEAD = 0.05, 1e-3, 1e-6


#: Singular values of the loop equations below this value are probably zeros obscured by rounding in the file.
HIDDEN = 1e-4


#: Remedy to suggest for such values.
FULL = "write angles and axes with all digits, e.g. pi/2 as 1.5707963267948966"


def rounding_sentence(hidden: Array) -> str:
    """State how many loop equations are independent only because of rounding."""
    return f"without rounding errors of about {hidden.max():.0e}, they would leave {len(hidden)} more"


def motions(mechanism: Mechanism) -> tuple[Array, Array]:
    """Compute the dimensionless motions that the loops allow at the home pose.

    Returns:
        Orthonormal basis of admissible joint velocities, shape (n_q, k); and the small singular values, which belong to
        equations that are nearly, but not exactly, redundant.
    """
    at = loop_equations(layout(replace(mechanism, independent={}))).closing_system(mechanism.home[None])
    G = at.system.A[0]
    free, s = linear.null_space(G), np.linalg.svd(G, compute_uv=False)
    s = s[: G.shape[1] - free.shape[1]]
    w = at.spread(free.T * at.loops.size)
    with np.errstate(divide="ignore", invalid="ignore"):
        K = np.nan_to_num(at.joint_rates(w, twists(at.pose, w)) / at.loops.sizes).T  # ignore angles in gimbal lock
    return np.linalg.qr(K)[0], s[s < HIDDEN * s[0]] if len(s) else s


def choose(
    mechanism: Mechanism, actuated: Sequence[str] | None, independent: Mapping[str, str] | None, where: str
) -> tuple[Mechanism, tuple[str, ...]]:
    """Choose independent coordinates and actuators; return the mechanism and messages about unusual choices.

    Args:
        actuated: Driven joints; None selects the joints of the independent coordinates that can be driven.
        independent: Label -> coordinate, as chosen by the user.

    Raises:
        DescriptionError: The loops consist of coupled joints only, the mechanism cannot move, or the chosen coordinates
            do not determine the motion.
    """
    check_connected(mechanism, where)
    K, hidden = motions(mechanism)
    if not K.shape[1]:
        hint = f"; {rounding_sentence(hidden)}" if len(hidden) else ""
        remedy = FULL if hint else "check the closures"
        raise DescriptionError(f"its loops leave no degree of freedom{hint}", where, remedy)
    names, passed = mechanism.coordinates, ""
    if independent is None:
        tiers = preferences(mechanism, actuated or ())
        picked = pick(K, tiers)
        chosen, passed = {names[i]: names[i] for i in picked}, _passed_sentence(K, tiers[DRIVEN], picked, names)
    else:
        for name in independent.values():
            if name not in names:
                raise UnknownNameError("coordinate", name, names, f"{where}, --independent")
        chosen = dict(independent)
        rank = linear.rank(K[[names.index(name) for name in chosen.values()]])
        if not rank == len(chosen) == K.shape[1]:
            what = f"{len(chosen)} coordinates have rank {rank}, but the mechanism has {K.shape[1]} degrees of freedom"
            raise DescriptionError(
                what, f"{where}, --independent", f"choose {K.shape[1]} coordinates that determine the motion"
            )
    driven = {*chosen.values()} if actuated is None else {*actuated}
    joints = tuple(
        replace(joint, actuated=len(joint.coordinates) == 1 and joint.name in driven) for joint in mechanism.joints
    )
    doubt = (
        f"Its loops leave {K.shape[1]} degrees of freedom; {rounding_sentence(hidden)}: {FULL}." if len(hidden) else ""
    )
    return replace(mechanism, joints=joints, independent=chosen), tuple(filter(None, (passed, doubt)))


#: Index of the tier of driven joints in `preferences`.
DRIVEN = 1


def preferences(mechanism: Mechanism, actuated: Sequence[str]) -> list[list[int]]:
    """Return columns of coordinates in tiers, best first: free, driven, simple and remaining joints."""
    tiers: list[list[int]] = [[], [], [], []]
    coupled = {coupling.coordinate for coupling in mechanism.couplings}
    for joint in mechanism.joints:
        simple = len(joint.coordinates) == 1 and joint.name not in coupled
        rank = 0 if not joint.constrains else 1 if joint.name in actuated else 2 if simple else 3
        tiers[rank] += mechanism.columns(joint.coordinates)
    return tiers


def pick(K: Array, tiers: Sequence[Sequence[int]]) -> list[int]:
    """Select independent rows, early tiers first, by rank-revealing QR (modified Gram-Schmidt with pivoting).

    Rows of the tier `DRIVEN` are compared relative to their own length. Shape (n, k) -> k rows, ascending.
    """
    rest, chosen, strokes = K.copy(), list[int](), np.linalg.norm(K, axis=1)
    for i, tier in enumerate([*tiers[:-1], range(len(K))]):
        candidates, least = list(tier), PREFERRED if i < len(tiers) - 1 else 0.0
        if i == DRIVEN:
            candidates, least = [row for row in tier if strokes[row] > DEAD], OWN_SHARE
        while len(chosen) < K.shape[1] and candidates:
            sizes = np.linalg.norm(rest[candidates], axis=1)
            shares = sizes / strokes[candidates] if i == DRIVEN else sizes
            best = int(np.argmax(np.round(shares, 9)))  # the first row in case of a tie
            if not shares[best] > least:
                break
            row = candidates.pop(best)
            chosen.append(row)
            along = rest[row] / sizes[best]
            rest = rest - np.outer(rest @ along, along)
    return sorted(chosen)


def _passed_sentence(K: Array, driven: Sequence[int], chosen: Sequence[int], names: Sequence[str]) -> str:
    """List the driven coordinates that are not independent, and why; return an empty string if all are independent."""
    followers: dict[str, list[str]] = {}
    for row in sorted({*driven} - {*chosen}):
        reason = "at a dead centre at the home pose"
        if np.linalg.norm(K[row]) > DEAD:
            shares = np.linalg.solve(K[chosen].T, K[row]) * np.linalg.norm(K[chosen], axis=1)
            leads = [names[i] for i, share in zip(chosen, np.abs(shares), strict=True) if share > DEAD]
            reason = f"determined by {few_names(leads)}"
        followers.setdefault(reason, []).append(names[row])
    reasons = [f"{few_names(some)} ({reason})" for reason, some in followers.items()]
    return f"These coordinates are driven but not independent: {first_few(reasons, SHOWN)}." if reasons else ""
