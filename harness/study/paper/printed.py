"""Formulas of the paper as they are printed, wrong ones included, to be run beside the right ones.

None of them is used by the solver. What is right stands in `screws`, `pose`, `kinematics` and `dynamics`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from screwgauge.engines.screw.scheme import Chains, brackets
from screwgauge.reference import screws
from screwgauge.reference.linear import null_space
from screwgauge.reference.rotations import Array, rotation

_X, _Y, _Z = np.eye(3)


def upu_screws(theta: float, R: float, L: float) -> Array:
    """Screws of the UPU chain leaning by `theta` from the z-axis, eq. (6). Shape (6, 5), columns as in eq. (7)."""
    s, c = np.sin(theta), np.cos(theta)
    rows = [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, R],
        [0, 0, 0, -s, 0, c],
        [c, 0, s, 0, -R * s + L, 0],
        [0, 1, 0, -L * c, 0, R - L * s],
    ]
    return np.array(rows, dtype=float).T


def upu_wrench(theta: float, R: float, L: float) -> Array:
    """The wrench reciprocal to them, eq. (9): infinite for an upright leg. Shape (6,)."""
    with np.errstate(divide="ignore"):
        return np.array([0.0, 1.0, 0.0, 0.0, 0.0, R - np.divide(L, np.sin(theta))])


def upu_wrench_right(theta: float, R: float, L: float) -> Array:
    """The same line for every `theta`: the null space of eq. (8) over its largest entry. Shape (6,)."""
    S = upu_screws(theta, R, L)
    wrench = null_space(np.concatenate([S[3:], S[:3]]).T)[:, 0]
    return np.asarray(wrench / np.abs(wrench).max())


#: The free twists of the platform, eq. (14): fixed axes whatever the pose. Shape (6, 2).
FREE_TWISTS = np.eye(6)[:, :2]


def trajectory(t: Array) -> tuple[Array, Array, Array]:
    """D_P, V_P and A_P of eq. (60), angular components first. Shape (n, 6) each."""
    D, V, A = np.zeros((3, len(t), 6))
    D[:, 0], D[:, 1], D[:, 5] = -0.2 * np.cos(t) + 0.2, 0.1 * np.sin(t), 3.0 * np.sqrt(3.0) / 10.0
    V[:, 0], V[:, 1] = 0.2 * np.sin(t), 0.1 * np.cos(t)
    A[:, 0], A[:, 1] = 0.2 * np.cos(t) + 0.2, 0.1 * np.sin(t)
    return D, V, A


def _turned(side: Chains, theta: Array, turns: tuple[int, ...]) -> Array:
    """``R_Z`` times the product of ``R_n`` over some rotations n, for each leg. Shape (n, 4, 3, 3)."""
    R = np.broadcast_to(side.start[:4, :3, :3], (len(theta), 4, 3, 3))
    for n in turns:
        R = R @ rotation(_X if n in (1, 4) else _Y, theta[:, :4, n - 1])
    return R


def wrist_centre(side: Chains, theta: Array, L: float | None, turns: tuple[int, ...]) -> Array:
    """Centres C of the legs by eq. (24), ``R_Z (r_A + product of R_n  r_AC)``, in some reading. Shape (n, 4, 3).

    Args:
        side: The chains, the four legs first.
        theta: Coordinates chain by chain. Shape (n, n_chain, m).
        L: Constant length of r_AC [m]; None for the length of the leg.
        turns: Numbers n of the rotations in the product; (2, 5) as printed, (1, 2) is right.
    """
    length = theta[:, :4, 2] if L is None else L
    return np.asarray(side.start[:4, :3, 3] + (_turned(side, theta, turns) @ _Z) * np.asarray(length)[..., None])


def wrist_axis(side: Chains, theta: Array, turns: tuple[int, ...]) -> Array:
    """Second axis of the wrist, e_5, by eq. (24): `turns` is (2, 4) as printed, (1, 2, 4) is right. Shape (n, 4, 3)."""
    return np.asarray(_turned(side, theta, turns) @ _Y)


def lie_bracket(first: Array, second: Array) -> Array:
    """Eq. (36): both rows are ``w1 x v2 - w2 x v1``. Shape (..., 6)."""
    w1, v1, w2, v2 = first[..., :3], first[..., 3:], second[..., :3], second[..., 3:]
    row = np.cross(w1, v2) - np.cross(w2, v1)
    return np.concatenate([row, row], axis=-1)


def chain_bias(side: Chains, S: Array, w: Array) -> Array:
    """Sum of brackets of eqs. (42)-(43): the last joins joints N-2 and N, not N-1 and N. Shape (n, n_chain, 6).

    Args:
        S: Screws. Shape (n, n_chain, m, 6).
        w: Joint velocities. Shape (n, n_chain, m).
    """
    terms, out = S * w[..., None], np.asarray(brackets(S, w).sum(axis=-2))
    for k, N in enumerate(side.used.sum(axis=1)):
        third_last, second_last, last = (terms[:, k, N - i] for i in (3, 2, 1))
        out[:, k] += screws.lie_bracket(third_last - second_last, last)
    return out


def acceleration_at(twist: Array, acceleration: Array, r: Array) -> Array:
    """Eq. (49) with ``v_C = w x r_C``, as if the body turned about O. Shape (..., 3)."""
    w, beta = twist[..., :3], acceleration[..., :3]
    return np.asarray(acceleration[..., 3:] + np.cross(beta, r) + np.cross(w, np.cross(w, r)))


Side = Literal["child", "parent"]
"""A body of a joint: the one that it carries, or the one on the ground side."""
Reading = Literal["right", "to", "from"]
"""How a lever arm such as A r_D is read: as D - A (``to``), as A - D (``from``), or as each term needs it."""


def body_moment(arms: Array, F: Array, T: Array, side: Side, reading: Reading) -> Array:
    """What a joint contributes to the moment balance of one of its bodies, eqs. (53)-(55). Shape (n, 3).

    Args:
        arms: From the body's centre of mass to the joint [m]. Shape (n, 3).
        F, T: Force [N] and moment [N m] of the joint on its child. Shape (n, 3) each.
        side: Which body of the joint this is.
        reading: The terms of the child are printed as ``X r_D x F_X``, those of the parent as ``-(D r_X) x F_X``.
    """
    wrong = {"right": None, "to": "child", "from": "parent"}[reading] == side
    moment = (-1.0 if wrong else 1.0) * np.cross(arms, F) + T
    return np.asarray(moment if side == "child" else -moment)
