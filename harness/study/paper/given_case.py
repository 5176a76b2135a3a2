"""Errata of the paper's numerical case, eq. (60) and the tables, measured: numbers 17 and 18."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.paper import printed
from screwgauge.reference.paper import twist as paper_twist
from screwgauge.reference.rotations import Array
from screwgauge.study.paper.errata import Case, Erratum, erratum, largest, longest

HALF = 0.3  # m, a leg half: the length beside p_3 in eq. (24)


def given_case_errata(case: Case) -> list[Erratum]:
    """All of them, in the order of their numbers."""
    return [*_trajectory(case), _leg_halves(case)]


def _trajectory(case: Case) -> list[Erratum]:
    D, V, A = printed.trajectory(case.t)
    right_V, right_A, P = case.rate.V[:, -1, :3], case.A[:, -1, :3], case.bodies.com[:, -1]
    h = 1e-5  # s; central differences: is A the derivative of V, both as printed?
    slope = (printed.trajectory(case.t + h)[1] - printed.trajectory(case.t - h)[1]) / (2 * h)
    alone = paper_twist.fixed_axes(case.motion)[1]
    chain = paper_twist.platform_screws(case.lay, case.motion, case.t)[1]
    V_P = largest(V[:, :3] - right_V), longest(_angular(case) - right_V)
    derivative = longest((A - slope)[:, :3]), longest((alone - slope)[:, :3])
    A_P = longest(A[:, :3] - right_A), longest(chain[:, :3] - right_A)
    D_P = longest(D[:, 3:] - P), longest(_turned(case) - P)
    as_printed = "0.2 cos t + 0.2, 0.1 sin t"
    return [
        erratum(17, "(60) V_P", "angular velocity off", ("(a', b', 0)", "(a', b' cos a, b' sin a)"), V_P, "rad/s"),
        erratum(17, "(60) A_P", "A_P less the derivative of V_P", (as_printed, "a'', b''"), derivative, "rad/s^2"),
        erratum(
            17,
            "(60) A_P",
            "angular acceleration off",
            (as_printed, "eq. (44) of the S chain"),
            A_P,
            "rad/s^2",
        ),
        erratum(
            17,
            "(60) D_P",
            "P away from (0, 0, H)",
            ("P stays at (0, 0, H)", "P turns with the platform"),
            D_P,
            "m",
        ),
    ]


def _angular(case: Case) -> Array:
    """``(a', b' cos a, b' sin a)``. Shape (n, 3)."""
    a, (ad, bd) = case.motion.y[:, 0], case.motion.yd.T
    return np.stack([ad, bd * np.cos(a), bd * np.sin(a)], axis=1)


def _turned(case: Case) -> Array:
    """``Rx(a) Ry(b) (0, 0, H)``. Shape (n, 3)."""
    a, b = case.motion.y.T
    H = case.lay.mechanism.body("platform").com[2]
    return np.asarray(H * np.stack([np.sin(b), -np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)], axis=1))


def _leg_halves(case: Case) -> Erratum:
    L = case.rate.pose.q[:, case.lay.mechanism.actuated_columns]
    return erratum(
        18,
        "Tables 1-3",
        f"longest leg, {L.min():.3f} to {L.max():.3f} m",
        ("two halves of 0.3 m", "distance A to C on the path"),
        (2.0 * HALF, L.max()),
        "m",
    )
