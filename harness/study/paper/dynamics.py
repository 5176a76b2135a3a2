"""Errata of the paper's dynamics, measured: numbers 12 to 14 and 16."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.paper import printed
from screwgauge.reference.reactions import joint_point
from screwgauge.reference.rotations import Array
from screwgauge.study.paper.errata import Case, Erratum, erratum, largest, longest
from screwgauge.study.paper.forces import Forces, solve_forces


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
            side: printed.Side = "child" if joint.child == body.name else "parent"
            # the lever of F_S does not stand in eq. (55) at all: that is erratum 14
            how: printed.Reading = "right" if joint.name == "s" else reading
            arms = forces.point[:, k] - case.bodies.com[:, i]
            total += printed.body_moment(
                arms,
                forces.joint_F[:, k],
                forces.joint_T[:, k],
                side,
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
