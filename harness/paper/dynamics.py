"""Errata of the paper's dynamics, measured: numbers 12 to 16, and what its own case can test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from screwgauge.paper.errata import Case, Erratum, erratum, largest, longest, paper_case
from screwgauge.reference import dynamics, printed, screws
from screwgauge.reference.linear import SINGULAR
from screwgauge.reference.paper import Bracket
from screwgauge.reference.reactions import Reactions, joint_point
from screwgauge.reference.rotations import Array

NEAR_TURN = 6.283  # s: the sample of the paper's 1 ms grid that is nearest to t = 2 pi


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """All forces of the case, preload-free.

    Attributes:
        c: Matrix of eq. (57). Shape (n, 54, 56).
        system: The same with the two rows of the rule. Shape (n, 56, 56).
        F, T: Its right side. Shape (n, n_body, 3) each.
        unknown: Reaction components, then actuator forces. Shape (n, 56).
        joint_F, joint_T: Force and moment about its point that each joint, its actuator included, exerts on its
            child. Shape (n, n_joint, 3) each.
        point: Where. Shape (n, n_joint, 3).
    """

    reactions: Reactions
    c: Array
    system: Array
    F: Array
    T: Array
    unknown: Array
    joint_F: Array
    joint_T: Array
    point: Array


def solve_forces(case: Case, rule: str = "min_norm") -> tuple[Forces, Array]:
    """Forces under a rule, and the condition number of their equations, shape (n,)."""
    lay, at = case.lay, case.rate.pose
    F, T = case.wrench(case.scene.gravity, case.loads)
    reactions = dynamics.joint_reactions(lay, at)
    c = dynamics.force_matrix(lay, at, case.bodies.com, reactions)
    rows = np.zeros((len(case.t), 2, c.shape[2]))
    if rule == "min_norm":
        rows[:, :, -4:] = dynamics.preload_space(case.B).swapaxes(1, 2)
    else:
        rows[:, :, [reactions.names.index(f"s.f{x}") for x in "xyz"]] = dynamics.axial_directions(lay, at)
    unknown, condition = dynamics.solve_newton_euler(c, F, T, rows)
    wrenches = _joint_wrenches(case, reactions, unknown)
    return Forces(reactions, c, np.concatenate([c, rows], axis=1), F, T, unknown, *wrenches), condition


def _joint_wrenches(case: Case, reactions: Reactions, unknown: Array) -> tuple[Array, Array, Array]:
    mechanism, at = case.lay.mechanism, case.rate.pose
    force, moment = np.zeros((2, len(case.t), len(mechanism.joints), 3))
    m = len(reactions.names)
    for k, joint in enumerate(reactions.joints):
        force[:, joint] += unknown[:, k, None] * reactions.force[:, k]
        moment[:, joint] += unknown[:, k, None] * reactions.moment[:, k]
    for k, (joint, column) in enumerate(zip(mechanism.actuators, mechanism.actuated_columns, strict=True)):
        force[:, mechanism.joints.index(joint)] += unknown[:, m + k, None] * at.S[:, column, 3:]
    index = mechanism.body_index
    points = [joint_point(j, at.R[:, index[j.child]], at.p[:, index[j.child]]) for j in mechanism.joints]
    return force, moment, np.stack(points, axis=1)


def dynamic_errata(case: Case) -> list[Erratum]:
    """All of them, in the order of their numbers."""
    forces, _ = solve_forces(case)
    return [
        *_gravity(case, forces),
        *_levers(case, forces),
        *_platform(case, forces),
        *_right_inverse(forces),
    ]


def _gravity(case: Case, forces: Forces) -> list[Erratum]:
    F, T = case.wrench(-case.scene.gravity, case.loads)
    wrong, right = case.generalized(F, T)[:, 0], case.generalized(forces.F, forces.T)[:, 0]
    driving = case.driving(F, T), case.driving(forces.F, forces.T)
    i = int(np.argmax(np.abs(wrong - right)))
    j, leg = np.unravel_index(np.argmax(np.abs(driving[0] - driving[1])), driving[0].shape)
    words = ("m a + m g, g = (0, 0, -9.81)", "m (a - g)")
    return [
        erratum(12, "(51), (53)-(55)", "Q_a, where it differs most", words, (wrong[i], right[i]), "N m"),
        erratum(
            12,
            "(51), (53)-(55)",
            "driving force, differs most",
            words,
            (driving[0][j, leg], driving[1][j, leg]),
            "N",
        ),
    ]


def _unbalanced(case: Case, forces: Forces, reading: printed.Reading, kind: str) -> float:
    """Largest moment [N m] by which the true forces miss the printed balance of one kind of body."""
    mechanism, index, worst = case.lay.mechanism, case.lay.mechanism.body_index, 0.0
    for body in mechanism.bodies:
        if body.name.rsplit(".", 1)[-1] != kind:
            continue
        i, total = index[body.name] - 1, np.zeros((len(case.t), 3))
        for k, joint in enumerate(mechanism.joints):
            if body.name not in (joint.parent, joint.child):
                continue
            side = "child" if joint.child == body.name else "parent"
            # the lever of F_S does not stand in eq. (55) at all: that is erratum 14
            how: printed.Reading = "right" if joint.name == "s" else reading
            arms = forces.point[:, k] - case.bodies.com[:, i]
            total += printed.body_moment(
                arms,
                forces.joint_F[:, k],
                forces.joint_T[:, k],
                cast("printed.Literal['child', 'parent']", side),
                how,
            )
        worst = max(worst, longest(total - forces.T[:, i]))
    return worst


def _levers(case: Case, forces: Forces) -> list[Erratum]:
    rows = []
    for equation, kind in (("(53)", "lower"), ("(54)", "upper"), ("(55)", "platform")):
        right = _unbalanced(case, forces, "right", kind)
        readings: tuple[tuple[printed.Reading, str], ...] = (("to", "D - X"), ("from", "X - D"))
        for reading, words in readings:
            wrong = _unbalanced(case, forces, reading, kind)
            if wrong < 1e-6:  # (55) has terms of one kind only: one reading is right
                continue
            rows.append(
                erratum(
                    13,
                    equation,
                    f"{kind}: imbalance, arms {words}",
                    (f"X r_D = {words}", "X - D, in both terms"),
                    (wrong, right),
                    "N m",
                )
            )
    return [*rows, _slide_moment(case, forces)]


def _slide_moment(case: Case, forces: Forces) -> Erratum:
    """T_B about two points that could be meant: C, and the end of the lower half, 0.3 m from A."""
    mechanism = case.lay.mechanism
    worst = (0.0, 0.0, 0.0)
    for k, joint in enumerate(mechanism.joints):
        if joint.role != "slide":
            continue
        A = joint_point(mechanism.joint(joint.name.replace("slide", "base")), *_body_pose(case, joint.parent))
        C = forces.point[:, k]
        axis = (C - A) / np.linalg.norm(C - A, axis=1, keepdims=True)
        T_C = forces.joint_T[:, k]
        shift = np.linalg.norm(np.cross(C - (A + 0.3 * axis), forces.joint_F[:, k]), axis=1)
        T_B = np.linalg.norm(T_C + np.cross(C - (A + 0.3 * axis), forces.joint_F[:, k]), axis=1)
        i = int(np.argmax(shift))
        worst = max(worst, (float(shift[i]), float(T_B[i]), longest(T_C[i])))
    return erratum(
        13,
        "(53)-(54)",
        "T_B, where its point matters most",
        ("about a point 0.3 m from A", "about C, and saying so"),
        worst[1:],
        "N m",
        kind="A",
        effect=worst[0],
    )


def _body_pose(case: Case, body: str) -> tuple[Array, Array]:
    i = case.lay.mechanism.body_index[body]
    return case.rate.pose.R[:, i], case.rate.pose.p[:, i]


def _platform(case: Case, forces: Forces) -> list[Erratum]:
    joints = [joint.name for joint in case.lay.mechanism.joints]
    wrist, s = joints.index("leg1.wrist"), joints.index("s")
    T_C, F_S = forces.joint_T[:, wrist], forces.joint_F[:, s]
    others = forces.joint_T[:, [joints.index(f"leg{k}.wrist") for k in (2, 3, 4)]].sum(axis=1)
    lever = np.cross(forces.point[:, s] - case.bodies.com[:, -1], F_S)
    balance = _unbalanced(case, forces, "right", "platform")
    missing = longest(others - T_C - lever)
    return [
        erratum(
            14,
            "below (54)",
            "T_C of the UPU leg, largest",
            ("zero for PU", "zero for PS only"),
            (0.0, longest(T_C)),
            "N m",
        ),
        erratum(
            14,
            "(55)",
            "moment of F_S about P, largest",
            ("left out", "(O - P) x F_S"),
            (0.0, longest(lever)),
            "N m",
        ),
        erratum(
            14,
            "(55)",
            "platform: imbalance of moments",
            ("T_C of k = 2 ... 4, no (O - P) x F_S", "T_C of k = 1, (O - P) x F_S"),
            (missing, balance),
            "N m",
        ),
    ]


@dataclass(frozen=True, slots=True, eq=False)
class AxialRule:
    """Driving forces under eq. (56) beside the smallest ones, every 10 ms.

    Attributes:
        t: Time [s]. Shape (n,).
        size, least: Largest driving force under each rule [N]; not a number where eq. (56) has no solution. Shape (n,).
        condition: Smallest condition number (2-norm) of the equations under each rule, eq. (56) first.
        singular: How many of t = 0, pi, 2 pi, 3 pi are singular under each rule.
        equations: How many equations eq. (56) stands for.
    """

    t: Array
    size: Array
    least: Array
    condition: tuple[float, float]
    singular: tuple[int, int]
    equations: int


def axial_rule() -> AxialRule:
    """Runs eq. (56) as the two equations that it stands for."""
    case = paper_case(np.union1d(np.arange(1001) * 0.01, [NEAR_TURN]))
    forces, condition = solve_forces(case, "spherical_axial")
    size = np.where(condition <= SINGULAR, np.abs(forces.unknown[:, -4:]).max(axis=1), np.nan)
    least = np.abs(case.driving(forces.F, forces.T)).max(axis=1)
    some, turns = paper_case(np.arange(1, 100) * 0.1), paper_case(np.arange(4) * np.pi)
    rules = ("spherical_axial", "min_norm")
    best = [float(np.linalg.cond(solve_forces(some, rule)[0].system).min()) for rule in rules]
    singular = [int(np.sum(solve_forces(turns, rule)[1] > SINGULAR)) for rule in rules]
    equations = dynamics.axial_directions(case.lay, case.rate.pose).shape[1]
    return AxialRule(case.t, size, least, (best[0], best[1]), (singular[0], singular[1]), equations)


def axial_errata(found: AxialRule) -> list[Erratum]:
    """The rows of erratum 15."""
    words, regular = ("F_S along O P", "minimum norm"), np.isfinite(found.size)
    ratio = np.median(found.size[regular] / found.least[regular])

    def at(time: float) -> tuple[float, float]:
        i = int(np.argmin(np.abs(found.t - time)))
        return found.size[i], found.least[i]

    count = erratum(
        15, "(56)", "equations that it stands for", ("one", "two, across O P"), (1, found.equations), "count"
    )
    medians = float(np.median(found.size[regular])), float(np.median(found.least[regular]))
    return [
        count,
        erratum(15, "(56)", "singular of t = 0, pi, 2 pi, 3 pi", words, found.singular, "count"),
        erratum(15, "(56)", "largest driving force, median", words, medians, "N"),
        erratum(15, "(56)", "the same, median of the ratio", words, (ratio, 1.0), "factor", effect=ratio),
        erratum(15, "(56)", "driving force at t = 6.28 s", words, at(6.28), "N"),
        erratum(15, "(56)", "driving force at t = 6.283 s", words, at(NEAR_TURN), "N"),
        erratum(15, "(56)", "condition number, smallest", words, found.condition, "1"),
    ]


def _right_inverse(forces: Forces) -> list[Erratum]:
    c = forces.c
    b = np.concatenate([forces.F, forces.T], axis=2).reshape(len(c), -1)
    y = np.linalg.solve(c @ c.swapaxes(1, 2), b[..., None])
    Q = (c.swapaxes(1, 2) @ y)[..., 0]
    # fifty-four numbers for fifty-six unknowns: read as the first of them, the rest zero
    as_printed = np.concatenate([y[..., 0], np.zeros((len(y), c.shape[2] - y.shape[1]))], axis=1)
    left = [largest((c @ q[..., None])[..., 0] - b) / largest(b) * 100.0 for q in (as_printed, Q)]
    words = ("(c c^T)^-1 b", "c^T (c c^T)^-1 b")
    return [
        erratum(16, "(58)", "numbers for the 56 unknowns", words, (y.shape[1], Q.shape[1]), "count"),
        erratum(16, "(58)", "c Q - b, share of the largest b", words, (left[0], left[1]), "%"),
    ]


@dataclass(frozen=True, slots=True)
class Reach:
    """What the paper's own case can test.

    Attributes:
        load, gravity, inertia: Largest share of each in the generalised force Q_a [N m].
        driving: Largest driving force [N].
        bracket: Largest change of a driving force by the bracket of eq. (36) as printed [N].
        joint_error: Largest error that the same bracket makes in joint accelerations [%].
    """

    load: float
    gravity: float
    inertia: float
    driving: float
    bracket: float
    joint_error: float

    @property
    def sentence(self) -> str:
        share = 100.0 * self.bracket / self.driving
        return (
            f"The paper's own case tests statics and hardly any dynamics: in Q_a the load makes {self.load:.0f} N m, "
            f"gravity {self.gravity:.0f} and inertia {self.inertia:.2g}; a bracket that is wrong by "
            f"{self.joint_error:.0f} % in joint accelerations changes its driving forces by {self.bracket:.2g} N "
            f"of {self.driving:.0f} N, {share:.2g} %."
        )


def reach(case: Case) -> Reach:
    """Splits Q_a into its causes, and runs the wrong bracket through to the driving forces."""
    still = np.zeros(3)
    parts = []
    inertia = case.wrench(still, [])
    for gravity, loads in ((still, case.loads), (case.scene.gravity, [])):
        F, T = case.wrench(gravity, loads)
        parts.append(largest(case.generalized(F - inertia[0], T - inertia[1])[:, 0]))
    right, wrong = (_driving_by(case, form) for form in (screws.lie_bracket, printed.lie_bracket))
    beta = printed.accelerations(case.side, case.S, case.w, case.A[:, -1], printed.lie_bracket)[0]
    exact = case.side.gather(case.beta)
    return Reach(
        load=parts[0],
        gravity=parts[1],
        inertia=largest(case.generalized(*inertia)[:, 0]),
        driving=largest(right),
        bracket=largest(wrong - right),
        joint_error=100.0 * largest(beta - exact) / largest(exact),
    )


def _driving_by(case: Case, bracket: Bracket) -> Array:
    """Driving forces [N] with all accelerations by eqs. (44) and (26) under a bracket. Shape (n, 4)."""
    lay, side = case.lay, case.side
    _, along = printed.accelerations(side, case.S, case.w, case.A[:, -1], bracket)
    A = np.zeros_like(case.A)
    for joint in lay.mechanism.joints:
        chain, last = np.argwhere(side.used & (side.columns == lay.columns[joint.name][-1]))[0]
        A[:, lay.mechanism.body_index[joint.child]] = along[:, chain, last]
    motion = dynamics.body_motion(lay, case.rate.pose, case.rate.V, A)
    F, T = dynamics.required_wrench(lay, case.rate.pose, motion, case.scene.gravity, case.loads)
    return case.driving(F, T)
