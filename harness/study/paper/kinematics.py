"""Errata of the paper's kinematics, measured: numbers 1 to 5, 7 and 9 to 11."""

from __future__ import annotations

import numpy as np

from screwgauge.reference import screws
from screwgauge.reference.kinematics import positions
from screwgauge.reference.mobility import mobility, output_freedoms
from screwgauge.reference.paper import printed
from screwgauge.reference.paper import scheme as paper
from screwgauge.reference.paper import twist as paper_twist
from screwgauge.reference.pose import Pose
from screwgauge.reference.rotations import Array
from screwgauge.study.paper.errata import Case, Erratum, erratum, largest, longest, percent

MILLIMETRES = 1e3
STEP_RK4 = 0.01  # s
MOMENT = 2.0  # s, at which rates in two units are set side by side


def kinematic_errata(case: Case) -> list[Erratum]:
    """All of them, in the order of their numbers."""
    return [
        _overconstraint(case),
        _free_axes(case),
        *_reciprocal_screws(case),
        _subtraction(case),
        *_joint_places(case),
        *_units(case),
        _bracket(case),
        _last_bracket(case),
        _point_acceleration(case),
    ]


def _sample(at: Pose, i: int) -> Pose:
    return Pose(at.q[i : i + 1], at.R[i : i + 1], at.p[i : i + 1], at.S[i : i + 1], at.gap[i : i + 1])


def _overconstraint(case: Case) -> Erratum:
    found = mobility(case.lay, _sample(case.rate.pose, len(case.t) // 3))
    unknowns, equations = len(found.names), 6 * found.bodies
    return erratum(
        1,
        "title, sect. 2",
        "redundant constraints",
        (f"{unknowns} unknowns less {equations} equations", "constraint components less their rank"),
        (unknowns - equations, found.overconstraints),
        "count",
    )


def _free_axes(case: Case) -> Erratum:
    """Angle between the y-axis and the twists that the chains allow."""
    fixed, angles, right = printed.FREE_TWISTS[:, 1], [], []
    a = case.motion.y[:, 0]
    moved = np.stack([0 * a, np.cos(a), np.sin(a), 0 * a, 0 * a, 0 * a], axis=1)
    for i in range(len(case.t)):
        free = output_freedoms(case.lay, _sample(case.rate.pose, i))
        angles.append(_angle(free, fixed))
        right.append(_angle(free, moved[i]))
    return erratum(
        2,
        "(14), abstract",
        "angle of the second free axis",
        ("the y-axis, whatever the pose", "(0, cos a, sin a)"),
        (max(angles), max(right)),
        "rad",
    )


def _angle(free: Array, twist: Array) -> float:
    """Angle [rad] between a unit twist and the space of free ones."""
    outside = twist - free @ (free.T @ twist)
    return float(np.arcsin(min(1.0, float(np.linalg.norm(outside)))))


def _reciprocal_screws(case: Case) -> list[Erratum]:
    R, L = (float(case.side.p0[0, 0]), float(case.lay.mechanism.home[2]))
    leaning, upright = np.linspace(0.2, 1.2, 11), 0.0
    left = [_work(printed.upu_screws(x, R, L), printed.upu_wrench(x, R, L)) for x in leaning]
    straight = printed.upu_wrench(upright, R, L), printed.upu_wrench_right(upright, R, L)
    chain = len(case.lay.columns["leg2.base"]) + 1 + len(case.lay.columns["leg2.wrist"])
    return [
        erratum(
            3,
            "(6)-(9)",
            "work of the wrench on the screws",
            ("(9), leaning leg: it holds", "null space of (8)"),
            (
                max(left),
                max(_work(printed.upu_screws(x, R, L), printed.upu_wrench_right(x, R, L)) for x in leaning),
            ),
            "m",
            kind="A",
        ),
        erratum(
            3,
            "(9)",
            "infinite entries at theta = 0",
            ("R - L / sin theta", "null space of (8)"),
            (np.sum(~np.isfinite(straight[0])), np.sum(~np.isfinite(straight[1]))),
            "count",
            kind="A",
        ),
        erratum(
            3,
            "(4)",
            "terms in the sum of a UPS chain",
            ("i = 0 ... N", "i = 0 ... N - 1"),
            (len(range(chain + 1)), len(range(chain))),
            "count",
            kind="A",
        ),
    ]


def _work(S: Array, wrench: Array) -> float:
    return largest(screws.reciprocal_product(wrench, S.T))


def _residual(case: Case, V: Array, chain: int) -> float:
    """What eq. (15) leaves over for one chain, largest over time."""
    S = case.S[:, chain].swapaxes(1, 2)
    w = case.side.solve(case.S, V[:, None])[:, chain]
    return longest((S @ w[..., None])[..., 0] - V)


def _subtraction(case: Case) -> Erratum:
    D, V, _ = printed.trajectory(case.t)
    right, _ = paper_twist.platform_screws(case.lay, case.motion, case.t)
    return erratum(
        4,
        "(22)-(23)",
        "violation of the S chain",
        ("(60), less [0; w x r_P]", "nothing subtracted"),
        (_residual(case, paper_twist.subtracted(V, D[:, 3:]), 4), _residual(case, right, 4)),
        "m/s",
    )


def _joint_places(case: Case) -> list[Erratum]:
    """Where eq. (24) puts the centres C, against where the closed mechanism has them."""
    mechanism, at = case.lay.mechanism, case.rate.pose
    platform = mechanism.body_index["platform"]
    levers = np.stack([mechanism.joint(f"leg{k}.wrist").child_frame.p for k in range(1, 5)])
    C = at.p[:, None, platform] + (at.R[:, None, platform] @ levers[..., None])[..., 0]
    L = float(mechanism.home[2])

    def off(length: float | None, turns: tuple[int, ...], rows: slice = slice(None)) -> float:
        return longest((printed.wrist_centre(case.side, case.theta, length, turns) - C)[rows])

    best = off(None, (1, 2))
    tilt = [printed.wrist_axis(case.side, case.theta, first) for first in (1, 2)]
    angle = 2.0 * np.arcsin(0.5 * longest(tilt[1] - tilt[0]))
    rates = case.lay.columns["leg1.wrist"][1]
    e5 = case.rate.pose.S[:, rates, :3]
    return [
        erratum(5, "(24)", what, (form, "R_1 R_2 (0.3 + p_3) z"), (value, best), "m")
        for what, form, value in (
            ("C off, at home", "R_2 R_5 r_AC", off(L, (2, 5), slice(0, 1))),
            ("C off, without R_5, t = 1 s", "R_2 (0.3 + p_3) z", off(None, (2,), slice(20, 21))),
            ("C off, without R_5, at most", "R_2 (0.3 + p_3) z", off(None, (2,))),
            ("C off, r_AC constant, at most", "R_1 R_2 0.6 z", off(L, (1, 2))),
        )
    ] + [
        erratum(
            5,
            "(24)",
            "axis e_5 off, at most",
            ("product from n = 2", "product from n = 1"),
            (angle, longest(tilt[0][:, 0] - e5)),
            "rad",
        )
    ]


def _units(case: Case) -> list[Erratum]:
    """Eq. (26) on a twist that the UPU chain cannot make: what is left over, and what the units of length do."""
    side, (V, _) = case.side, paper_twist.fixed_axes(case.motion)
    own = paper.integrate(case.lay, case.scene.drive, STEP_RK4, case.t[-1], twist="printed", method="rk4")
    S = side.walk(side.gather(own.q))[0][:, 0]
    made = (S.swapaxes(1, 2) @ side.gather(own.w)[:, 0, :, None])[..., 0]
    left = longest(made - paper_twist.fixed_axes(case.scene.drive(own.t))[0])
    right, _ = paper_twist.platform_screws(case.lay, case.motion, case.t)
    metres = side.solve(case.S, V[:, None])[:, 0, 0]
    longer = np.array([1.0] * 3 + [MILLIMETRES] * 3)
    millimetres = side.solve(np.where(side.turns > 0, case.S * longer, case.S), (V * longer)[:, None])[:, 0, 0]
    i = int(np.argmin(np.abs(case.t - MOMENT)))
    return [
        erratum(
            7,
            "(25)-(26), (60)",
            "UPU chain: |S w - V|",
            ("V of (60), along the scheme's own path", "right V"),
            (left, _residual(case, right, 0)),
            "rad/s, m/s",
        ),
        erratum(
            7,
            "(25)-(26), (60)",
            f"UPU w_1, t = {MOMENT:g} s, in m and in mm",
            ("lengths in metres", "lengths in millimetres"),
            (metres[i], millimetres[i]),
            "rad/s",
        ),
        erratum(
            7,
            "(25)-(26), (60)",
            "UPU w_1, largest change by units",
            ("V of (60), m against mm", "right V, m against mm"),
            (largest(metres - millimetres), _unit_change(case, right, longer)),
            "rad/s",
        ),
    ]


def _unit_change(case: Case, V: Array, longer: Array) -> float:
    side = case.side
    metres = side.solve(case.S, V[:, None])[:, 0, 0]
    other = side.solve(np.where(side.turns > 0, case.S * longer, case.S), (V * longer)[:, None])[:, 0, 0]
    return largest(metres - other)


def _bracket(case: Case) -> Erratum:
    exact, V_dot = case.side.gather(case.beta), case.A[:, -1]
    forms = (printed.lie_bracket, screws.lie_bracket)
    wrong, right = (printed.accelerations(case.side, case.S, case.w, V_dot, form)[0] for form in forms)
    return erratum(
        9,
        "(32), (36)",
        "joint accelerations, error",
        ("first row w1 x v2 - w2 x v1", "first row w1 x w2"),
        (percent(wrong, exact), percent(right, exact)),
        "%",
    )


def _last_bracket(case: Case) -> Erratum:
    exact, V_dot = case.side.gather(case.beta), case.A[:, -1]
    wrong = case.side.solve(case.S, V_dot[:, None] - printed.chain_bias(case.side, case.S, case.w))
    right = case.side.solve(case.S, V_dot[:, None] - paper.bias(case.S, case.w))
    return erratum(
        10,
        "(38a)-(43)",
        "joint accelerations, error",
        ("last bracket [N-2, N]", "last bracket [N-1, N]"),
        (percent(wrong, exact), percent(right, exact)),
        "%",
    )


def _point_acceleration(case: Case) -> Erratum:
    legs = slice(1, -1)
    V, A, com = case.rate.V[:, legs], case.A[:, legs], case.bodies.com[:, :-1]
    exact = _second_difference(case)
    wrong, right = printed.acceleration_at(V, A, com), screws.acceleration_at(V, A, com)
    return erratum(
        11,
        "(49)",
        "centres of mass of the legs, error",
        ("v_C = w x r_C", "v_C = v_O + w x r_C"),
        (percent(wrong, exact), percent(right, exact)),
        "%",
    )


def _second_difference(case: Case) -> Array:
    """Accelerations of the legs' centres of mass from positions alone. Shape (n, 8, 3)."""
    h = 2e-3
    bodies = case.lay.mechanism.bodies[:-1]
    local = np.stack([body.com for body in bodies])

    def com(t: Array) -> Array:
        at = positions(case.lay, case.scene.drive(t).y, t)
        return np.asarray(at.p[:, 1:-1] + (at.R[:, 1:-1] @ local[..., None])[..., 0])

    c2, c1, c0, d1, d2 = (com(case.t + k * h) for k in (-2, -1, 0, 1, 2))
    return np.asarray((-c2 + 16 * c1 - 30 * c0 + 16 * d1 - d2) / (12 * h * h))
