"""Errata of the paper's kinematics (1 to 7, 9 to 11) and of its numerical case (17, 18), each by a function."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from screwgauge.engines.screw.scheme import brackets, chain_accelerations, integrate
from screwgauge.engines.screw.twist import fixed_axes, subtracted
from screwgauge.reference import screws
from screwgauge.reference.kinematics import positions
from screwgauge.reference.mobility import mobility, output_freedoms
from screwgauge.reference.pose import centres_of_mass
from screwgauge.reference.rotations import Array
from screwgauge.study.paper import printed
from screwgauge.study.paper.case import HALF, Case, largest, longest, percent
from screwgauge.study.paper.errata import TABLE, Values

MILLIMETRES = 1e3
STEP_RK4 = 0.01  # s
AT_2_S = 40  # the sample at t = 2 s, where velocities in two units are set side by side


def overconstraint(case: Case) -> list[Values]:
    found = mobility(case.lay, case.rate.pose.rows([len(case.t) // 3]))
    unknowns, equations = len(found.names), 6 * found.bodies
    return [Values(unknowns - equations, found.overconstraints, words={"unknowns": unknowns, "equations": equations})]


def free_axes(case: Case) -> list[Values]:
    """Angle between the second free axis and the twists that the chains allow."""
    a, fixed = case.motion.y[:, 0], printed.FREE_TWISTS[:, 1]
    moved = np.stack([0 * a, np.cos(a), np.sin(a), 0 * a, 0 * a, 0 * a], axis=1)
    free = [output_freedoms(case.lay, case.rate.pose.rows([i])) for i in range(len(a))]
    right = max(_angle(space, axis) for space, axis in zip(free, moved, strict=True))
    return [Values(max(_angle(space, fixed) for space in free), right)]


def _angle(free: Array, twist: Array) -> float:
    """Angle [rad] between a unit twist and the space of free ones."""
    return float(np.arcsin(min(1.0, float(np.linalg.norm(twist - free @ (free.T @ twist))))))


def reciprocal_screws(case: Case) -> list[Values]:
    R, L = (float(case.side.start[0, 0, 3]), float(case.lay.mechanism.home[2]))
    forms, leaning = (printed.upu_wrench, printed.upu_wrench_right), np.linspace(0.2, 1.2, 11)

    def work(form: Callable[[float, float, float], Array], angle: float) -> float:
        return largest(screws.reciprocal_product(form(angle, R, L), printed.upu_screws(angle, R, L).T))

    freedoms = len(case.lay.columns["leg2.base"]) + 1 + len(case.lay.columns["leg2.wrist"])
    return [
        Values(*(max(work(form, angle) for angle in leaning) for form in forms)),
        Values(*(np.sum(~np.isfinite(form(0.0, R, L))) for form in forms)),
        Values(freedoms + 1, freedoms),
    ]


def _violation(case: Case, V: Array, chain: int) -> float:
    """What eq. (15) leaves over for one chain, largest over time."""
    w = case.side.solve(case.S, V[:, None])[:, chain]
    return longest((case.S[:, chain].swapaxes(1, 2) @ w[..., None])[..., 0] - V)


def subtraction(case: Case) -> list[Values]:
    D, V, _ = printed.trajectory(case.t)
    return [Values(_violation(case, subtracted(V, D[:, 3:]), 4), _violation(case, case.twist[0], 4))]


def joint_places(case: Case) -> list[Values]:
    """Where eq. (24) puts the centres C, against where the closed mechanism has them."""
    at, L = case.rate.pose, float(case.lay.mechanism.home[2])
    C = case.leg_ends(at.R[:, -1:], at.p[:, -1:])

    def off(length: float | None, turns: tuple[int, ...]) -> Array:
        found = printed.wrist_centre(case.side, case.theta, length, turns)
        return np.asarray(np.linalg.norm(found - C, axis=-1))

    right, one = off(None, (1, 2)).max(), off(None, (2,))
    wrong = (off(L, (2, 5))[0], one[20], one, off(L, (1, 2)))
    axis, printed_axis = (printed.wrist_axis(case.side, case.theta, turns) for turns in ((1, 2, 4), (2, 4)))
    e5 = at.S[:, case.lay.columns["leg1.wrist"][1], :3]
    tilt = 2.0 * np.arcsin(0.5 * longest(printed_axis - axis))
    return [*(Values(distance.max(), right) for distance in wrong), Values(tilt, longest(axis[:, 0] - e5))]


def references(case: Case) -> list[Values]:
    table = TABLE["references"]
    return [Values(sum(said != meant for _, said, meant in table), 0, words={"references": len(table)})]


def units(case: Case) -> list[Values]:
    """Eq. (26) on a twist that the UPU chain cannot make: what is left over, and what the units of length do."""
    side, V, right = case.side, fixed_axes(case.motion)[0], case.twist[0]
    run = integrate(case.lay, case.scene.moved, STEP_RK4, case.t[-1], twist="printed", method="rk4")
    S = side.walk(side.gather(run.q))[0][:, 0]
    made = (S.swapaxes(1, 2) @ side.gather(run.w)[:, 0, :, None])[..., 0]
    left_over = longest(made - fixed_axes(case.scene.moved(run.t))[0])

    def first(V: Array, unit: float) -> Array:
        scale = np.repeat([1.0, unit], 3)
        return side.solve(np.where(side.turns > 0, case.S * scale, case.S), (V * scale)[:, None])[:, 0, 0]

    metres, millimetres = first(V, 1.0), first(V, MILLIMETRES)
    return [
        Values(left_over, _violation(case, right, 0)),
        Values(metres[AT_2_S], millimetres[AT_2_S]),
        Values(largest(metres - millimetres), largest(first(right, 1.0) - first(right, MILLIMETRES))),
    ]


def bracket(case: Case) -> list[Values]:
    exact, forms = case.side.gather(case.beta), (printed.lie_bracket, screws.lie_bracket)
    found = (chain_accelerations(case.side, case.S, case.w, case.A[:, -1], form)[0] for form in forms)
    return [Values(*(percent(beta, exact) for beta in found))]


def last_bracket(case: Case) -> list[Values]:
    exact, A = case.side.gather(case.beta), case.A[:, -1:]
    sums = printed.chain_bias(case.side, case.S, case.w), brackets(case.S, case.w).sum(axis=-2)
    return [Values(*(percent(case.side.solve(case.S, A - one), exact) for one in sums))]


def point_acceleration(case: Case) -> list[Values]:
    V, A, com = case.rate.V[:, 1:-1], case.A[:, 1:-1], case.bodies.com[:, :-1]
    exact, forms = _second_difference(case), (printed.acceleration_at, screws.acceleration_at)
    return [Values(*(percent(form(V, A, com), exact) for form in forms))]


def _second_difference(case: Case) -> Array:
    """Accelerations of the legs' centres of mass from positions alone. Shape (n, 8, 3)."""
    h = 2e-3

    def com(t: Array) -> Array:
        return centres_of_mass(case.lay, positions(case.lay, case.scene.moved(t).y, t))[:, :-1]

    weights = {-2: -1, -1: 16, 0: -30, 1: 16, 2: -1}
    return np.asarray(sum(weight * com(case.t + k * h) for k, weight in weights.items()) / (12 * h * h))


def trajectory(case: Case) -> list[Values]:
    D, V, A = printed.trajectory(case.t)
    w, beta, P = case.rate.V[:, -1, :3], case.A[:, -1, :3], case.bodies.com[:, -1]
    (a, b), (ad, bd) = case.motion.y.T, case.motion.yd.T
    angular = np.stack([ad, bd * np.cos(a), bd * np.sin(a)], axis=1)
    # Rx(a) Ry(b) (0, 0, H)
    turned = np.stack([np.sin(b), -np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)], axis=1)
    turned *= case.lay.mechanism.body("platform").com[2]
    h = 1e-5  # s; central differences: is A the derivative of V, both as printed?
    slope = (printed.trajectory(case.t + h)[1] - printed.trajectory(case.t - h)[1]) / (2 * h)
    return [
        Values(largest(V[:, :3] - w), longest(angular - w)),
        Values(longest((A - slope)[:, :3]), longest((fixed_axes(case.motion)[1] - slope)[:, :3])),
        Values(longest(A[:, :3] - beta), longest(case.twist[1][:, :3] - beta)),
        Values(longest(D[:, 3:] - P), longest(turned - P)),
    ]


def leg_halves(case: Case) -> list[Values]:
    L = case.rate.pose.q[:, case.lay.mechanism.actuated_columns]
    return [Values(2.0 * HALF, L.max(), words={"shortest": L.min(), "longest": L.max()})]


_FIRST = (overconstraint, free_axes, reciprocal_screws, subtraction, joint_places, references, units)
_REST = {9: bracket, 10: last_bracket, 11: point_acceleration, 17: trajectory, 18: leg_halves}
ERRATA = {**dict(enumerate(_FIRST, 1)), **_REST}
