"""Sections 3 and 4 of the paper and its numerical case, from positions to accelerations: errata 4, 5, 9-11, 17, 18."""

from collections.abc import Callable

import numpy as np
from paper.case import HALF, S_CHAIN, UPU_CHAIN, Case, largest, longest, percent
from paper.erratum import Erratum, Form

from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.equations import screws
from screwgauge.reference.equations.kinematics import pose
from screwgauge.reference.rotations import Array, rotation
from screwgauge.study.bench.scheme import Chains, fixed_axes, subtract_origin
from support import at_origin

_X, _Y, _Z = np.eye(3)
Bracket = Callable[[Array, Array], Array]

# --- the formulas, as printed -----------------------------------------------------------------------------------------


def wrist_centre(side: Chains, theta: Array, L: float | None, turns: tuple[int, ...]) -> Array:
    """Centres C of the legs by eq. (24), ``R_Z (r_A + product of R_n  r_AC)``, in some reading. Shape (n, 4, 3).

    Args:
        side: The chains, the four legs first.
        theta: Coordinates chain by chain. Shape (n, n_chain, m).
        L: Constant length of r_AC [m]; None for the length of the leg.
        turns: Numbers n of the rotations in the product; (2, 5) as printed, (1, 2) is right.
    """
    length = theta[:, :4, 2] if L is None else L
    return side.start[:4, :3, 3] + (_turned(side, theta, turns) @ _Z) * np.asarray(length)[..., None]


def wrist_axis(side: Chains, theta: Array, turns: tuple[int, ...]) -> Array:
    """Second axis of the wrist, e_5, by eq. (24): `turns` is (2, 4) as printed, (1, 2, 4) is right. Shape (n, 4, 3)."""
    return _turned(side, theta, turns) @ _Y


def _turned(side: Chains, theta: Array, turns: tuple[int, ...]) -> Array:
    """``R_Z`` times the product of ``R_n`` over some rotations n, for each leg. Shape (n, 4, 3, 3)."""
    R = np.broadcast_to(side.start[:4, :3, :3], (len(theta), 4, 3, 3))
    for n in turns:
        R = R @ rotation(_X if n in (1, 4) else _Y, theta[:, :4, n - 1])
    return R


def lie_bracket(first: Array, second: Array) -> Array:
    """Eq. (36): both rows are ``w1 x v2 - w2 x v1``. Shape (..., 6)."""
    w1, v1, w2, v2 = first[..., :3], first[..., 3:], second[..., :3], second[..., 3:]
    row = np.cross(w1, v2) - np.cross(w2, v1)
    return np.concatenate([row, row], axis=-1)


def brackets(S: Array, w: Array, bracket: Bracket = screws.lie_bracket) -> Array:
    """Terms of ``w^T S_L w`` of eq. (44), for each freedom j: [V before j, S_j w_j]. Shape (..., m, 6)."""
    terms = S * w[..., None]
    return bracket(np.cumsum(terms, axis=-2) - terms, terms)


def chain_bias(side: Chains, S: Array, w: Array) -> Array:
    """Sum of brackets of eqs. (42)-(43): the last joins joints N-2 and N, not N-1 and N. Shape (n, n_chain, 6).

    Args:
        S: Screws. Shape (n, n_chain, m, 6).
        w: Joint velocities. Shape (n, n_chain, m).
    """
    terms, out = S * w[..., None], brackets(S, w).sum(axis=-2)
    for k, N in enumerate(side.used.sum(axis=1)):
        third_last, second_last, last = (terms[:, k, N - i] for i in (3, 2, 1))
        out[:, k] += screws.lie_bracket(third_last - second_last, last)
    return out


def chain_accelerations(case: Case, bracket: Bracket = screws.lie_bracket) -> tuple[Array, Array]:
    """Joint accelerations of every chain by eqs. (44), (26), and the acceleration screws after each freedom.

    Args:
        bracket: The Lie bracket of eq. (48).

    Returns:
        Shapes (n, n_chain, m), (n, n_chain, m, 6).
    """
    terms = brackets(case.screws, case.w, bracket)
    beta = case.side.solve(case.screws, case.A[:, -1:] - terms.sum(axis=-2))
    return beta, np.cumsum(case.screws * beta[..., None] + terms, axis=-2)


def acceleration_at(twist: Array, acceleration: Array, r: Array) -> Array:
    """Eq. (49) with ``v_C = w x r_C``, as if the body turned about O. Shape (..., 3)."""
    w, beta = twist[..., :3], acceleration[..., :3]
    return acceleration[..., 3:] + np.cross(beta, r) + np.cross(w, np.cross(w, r))


def trajectory(t: Array) -> tuple[Array, Array, Array]:
    D, V, A = np.zeros((3, len(t), 6))
    D[:, 0], D[:, 1], D[:, 5] = -0.2 * np.cos(t) + 0.2, 0.1 * np.sin(t), 3.0 * np.sqrt(3.0) / 10.0
    V[:, 0], V[:, 1] = 0.2 * np.sin(t), 0.1 * np.cos(t)
    A[:, 0], A[:, 1] = 0.2 * np.cos(t) + 0.2, 0.1 * np.sin(t)
    return D, V, A


# --- the errata -------------------------------------------------------------------------------------------------------


def subtraction(case: Case) -> list[Erratum]:
    """4: with V_P of eq. (60) taken about O nothing may be subtracted, or the S joint moves away from O."""
    D, V, _ = trajectory(case.t)
    printed = Form("(60), less [0; w x r_P]", case.left_over(subtract_origin(V, D[:, 3:]), S_CHAIN))
    right = Form("nothing subtracted", case.left_over(case.twist[0], S_CHAIN))
    return [Erratum(4, "E", "(22)-(23)", "violation of the S chain", printed, right, "m/s")]


def joint_places(case: Case) -> list[Erratum]:
    """5: in eq. (24) the product starts at joint 1, R_5 does not turn r_AC, and r_AC is as long as the leg."""
    at, L = case.at.pose, float(case.lay.mechanism.home[2])
    C = case.leg_ends(at.R[:, -1:], at.p[:, -1:])

    def off(length: float | None, turns: tuple[int, ...]) -> Array:
        return np.linalg.norm(wrist_centre(case.side, case.theta, length, turns) - C, axis=-1)

    right = Form("R_1 R_2 (0.3 + p_3) z", off(None, (1, 2)).max())
    without, after_1_s = off(None, (2,)), int(np.argmin(np.abs(case.t - 1.0)))
    short = "R_2 (0.3 + p_3) z"
    forms = {
        "at home": Form("R_2 R_5 r_AC", off(L, (2, 5))[0].max()),
        "without R_5, t = 1 s": Form(short, without[after_1_s].max()),
        "without R_5, at most": Form(short, without.max()),
        "r_AC constant, at most": Form("R_1 R_2 0.6 z", off(L, (1, 2)).max()),
    }
    axis, printed = (wrist_axis(case.side, case.theta, turns) for turns in ((1, 2, 4), (2, 4)))
    tilt = Form("product from n = 2", 2.0 * np.arcsin(0.5 * longest(printed - axis)))
    e5 = case.at.screws[:, case.lay.columns["leg1.wrist"][1], :3]
    none = Form("product from n = 1", longest(axis[:, UPU_CHAIN] - e5))
    return [
        *(Erratum(5, "E", "(24)", f"C off, {where}", form, right, "m") for where, form in forms.items()),
        Erratum(5, "E", "(24)", "axis e_5 off, at most", tilt, none, "rad"),
    ]


def bracket(case: Case) -> list[Erratum]:
    """9: the first row of the bracket is the angular one, w1 x w2."""
    exact = case.side.gather(case.beta)
    printed = Form("first row w1 x v2 - w2 x v1", percent(chain_accelerations(case, lie_bracket)[0], exact))
    right = Form("first row w1 x w2", percent(chain_accelerations(case)[0], exact))
    return [Erratum(9, "E", "(32), (36)", "joint accelerations, error", printed, right, "%")]


def last_bracket(case: Case) -> list[Erratum]:
    """10: the last bracket of eqs. (42) and (43) joins the last two joints, as eq. (48) has it."""
    exact, A = case.side.gather(case.beta), case.A[:, -1:]
    sums = chain_bias(case.side, case.screws, case.w), brackets(case.screws, case.w).sum(axis=-2)
    errors = (percent(case.side.solve(case.screws, A - bias), exact) for bias in sums)
    forms = map(Form, ("last bracket [N-2, N]", "last bracket [N-1, N]"), errors)
    return [Erratum(10, "E", "(38a)-(43)", "joint accelerations, error", *forms, "%")]


def point_acceleration(case: Case) -> list[Erratum]:
    """11: a leg does not turn about O, so that v_O belongs to eq. (49). Against differences of positions."""
    V, A, com = case.at.V[:, 1:-1], case.A[:, 1:-1], case.at.com[:, :-1]
    exact = _second_difference(case)
    printed = Form("v_C = w x r_C", percent(acceleration_at(V, A, com), exact))
    right = Form("v_C = v_O + w x r_C", percent(at_origin.acceleration_at(V, A, com), exact))
    return [Erratum(11, "E", "(49)", "centres of mass of the legs, error", printed, right, "%")]


def _second_difference(case: Case) -> Array:
    h = 2e-3

    def com(t: Array) -> Array:
        return pose(case.lay, positions(case.lay, case.scene.moved(t).y, t)).com[:, :-1]

    weights = {-2: -1, -1: 16, 0: -30, 1: 16, 2: -1}
    return sum(weight * com(case.t + k * h) for k, weight in weights.items()) / (12 * h * h)


def given_motion(case: Case) -> list[Erratum]:
    """17: V_P lacks what the second axis turns with the first, A_P is not its derivative, and P turns about O."""
    D, V, A = trajectory(case.t)
    w, beta, P = case.at.V[:, -1, :3], case.A[:, -1, :3], case.at.com[:, -1]
    (a, b), (ad, bd) = case.motion.y.T, case.motion.yd.T
    angular = np.stack([ad, bd * np.cos(a), bd * np.sin(a)], axis=1)
    # Rx(a) Ry(b) (0, 0, H)
    turned = np.stack([np.sin(b), -np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)], axis=1)
    turned *= case.lay.mechanism.body("platform").com[2]
    h = 1e-5  # s; central differences: is A the derivative of V, both as printed?
    slope = (trajectory(case.t + h)[1] - trajectory(case.t - h)[1]) / (2 * h)
    second = fixed_axes(case.motion)[1]
    V_P = Form("(a', b', 0)", largest(V[:, :3] - w)), Form("(a', b' cos a, b' sin a)", longest(angular - w))
    A_P = "0.2 cos t + 0.2, 0.1 sin t"
    less = Form(A_P, longest((A - slope)[:, :3])), Form("a'', b''", longest((second - slope)[:, :3]))
    off = Form(A_P, longest(A[:, :3] - beta)), Form("eq. (44) of the S chain", longest(case.twist[1][:, :3] - beta))
    away = Form("P stays at (0, 0, H)", longest(D[:, 3:] - P)), Form("P turns with the platform", longest(turned - P))
    return [
        Erratum(17, "E", "(60) V_P", "angular velocity off", *V_P, "rad/s"),
        Erratum(17, "E", "(60) A_P", "A_P less the derivative of V_P", *less, "rad/s^2"),
        Erratum(17, "E", "(60) A_P", "angular acceleration off", *off, "rad/s^2"),
        Erratum(17, "E", "(60) D_P", "P away from (0, 0, H)", *away, "m"),
    ]


def leg_halves(case: Case) -> list[Erratum]:
    """18: legs as long as the path makes them cannot be made of two halves of 0.3 m."""
    L = case.at.q[:, case.lay.mechanism.actuated_columns]
    measure = f"longest leg, {L.min():.3f} to {L.max():.3f} m"
    forms = Form("two halves of 0.3 m", 2.0 * HALF), Form("distance A to C on the path", L.max())
    return [Erratum(18, "E", "Tables 1-3", measure, *forms, "m")]


def errata(case: Case) -> list[Erratum]:
    of_the_case = subtraction, joint_places, bracket, last_bracket, point_acceleration, given_motion, leg_halves
    return [row for measured in of_the_case for row in measured(case)]
