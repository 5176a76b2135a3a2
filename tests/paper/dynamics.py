"""Section 5 of the paper, dynamics: errata 12 to 16, and what its own case can show of them."""

from copy import copy
from typing import Literal

import numpy as np
from paper.case import HALF, Case, every, largest, longest, percent
from paper.erratum import Erratum, Form
from paper.kinematics import Bracket, chain_accelerations, lie_bracket

from screwgauge.reference.equations import screws
from screwgauge.reference.equations.forward import NewtonEuler, balances
from screwgauge.reference.equations.joint_types import constraint_wrenches
from screwgauge.reference.linear import SINGULAR
from screwgauge.reference.mechanism import by_role
from screwgauge.reference.rotations import Array

NEAR_TURN = 6.283  # s: the sample of the paper's 1 ms grid that is nearest to t = 2 pi
RULES = ("spherical_axial", "min_norm")  # eq. (56), and what is right
#: A body of a joint: the one that it carries, or the one on the ground side.
Side = Literal["child", "parent"]
#: How a lever arm such as A r_D is read: as D - A (``to``), as A - D (``from``), or as each term needs it.
Reading = Literal["right", "to", "from"]


class Forces:
    """All forces of the case under a rule.

    Attributes:
        c: Matrix of eq. (57). Shape (n, 54, 56).
        system: The same with the two rows of the rule. Shape (n, 56, 56).
        rule: These two. Shape (n, 2, 56).
        condition: Condition number of the equations. Shape (n,).
        W: What the bodies need. Shape (n, b, 6).
        b: The same as right side of the equations, and the moments in it. Shapes (n, 54), (n, n_body, 3).
        actuator: Actuator forces [N]. Shape (n, 4).
        joint_F, joint_T: Force and moment about its point that each joint, its actuator included, exerts on its
            child. Shape (n, n_joint, 3) each.
        point: Where. Shape (n, n_joint, 3).
    """

    def __init__(self, case: Case, rule: str = "min_norm") -> None:
        at, joints = copy(case.at), case.lay.mechanism.joints
        at.axial = rule != "min_norm"
        equations, self.W = NewtonEuler(at), case.wrench()
        self.b = balances(at.com, self.W)
        self.T = self.b.reshape(len(case.t), -1, 6)[..., 3:]
        self.c, self.rule = equations.c, equations.rule
        self.system = np.concatenate([self.c, self.rule], axis=1)
        unknown, self.condition = equations.solve(self.b[..., None])[..., 0], equations.condition
        self.actuator = unknown[:, len(equations.names) :]
        wrench, first = np.zeros((len(case.t), len(joints), 6)), 0
        for joint in by_role(joints):
            along = constraint_wrenches(at.pose.joint(joint))
            own = unknown[:, first : first + along.shape[1]]
            wrench[:, joints.index(joint)] = np.einsum("nm,nmx->nx", own, along)
            first += along.shape[1]
        self.point = np.stack([at.pose.joint(joint).p_child for joint in joints], axis=1)
        self.joint_F, self.joint_T = wrench[..., :3], wrench[..., 3:] - np.cross(self.point, wrench[..., :3])
        for k, joint in enumerate(case.lay.mechanism.actuators):
            direction = at.screws[:, case.lay.columns[joint.name][0], 3:]
            self.joint_F[:, joints.index(joint)] += self.actuator[:, k, None] * direction


def gravity(case: Case, forces: Forces) -> list[Erratum]:
    """12: it is m (a - g); the sign as printed is right only for g along +z. Forces, each where the two differ most."""
    wrong, right = case.wrench(-case.scene.applied.g), forces.W
    measures = {
        ("Q_a, where it differs most", "N m"): (case.generalized(wrong)[:, 0], case.generalized(right)[:, 0]),
        ("driving force, differs most", "N"): (case.driving(wrong), case.driving(right)),
    }
    rows = []
    for (measure, unit), (one, other) in measures.items():
        i = int(np.argmax(np.abs(one - other)))
        forms = Form("m a + m g, g = (0, 0, -9.81)", one.flat[i]), Form("m (a - g)", other.flat[i])
        rows.append(Erratum(12, "E", "(51), (53)-(55)", measure, *forms, unit))
    return rows


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
    return moment if side == "child" else -moment


def imbalance(case: Case, forces: Forces, reading: Reading, kind: str) -> float:
    """Largest moment [N m] by which the true forces miss the printed balance of one kind of body."""
    worst = 0.0
    for i, body in enumerate(case.lay.mechanism.bodies):
        if body.name.rsplit(".", 1)[-1] != kind:
            continue
        total = np.zeros_like(forces.T[:, i])
        for k, joint in enumerate(case.lay.mechanism.joints):
            if body.name in (joint.parent, joint.child):
                side: Side = "child" if joint.child == body.name else "parent"
                # the lever of F_S does not stand in eq. (55) at all: that is erratum 14
                how: Reading = "right" if joint.name == "s" else reading
                arms = forces.point[:, k] - case.at.com[:, i]
                total += body_moment(arms, forces.joint_F[:, k], forces.joint_T[:, k], side, how)
        worst = max(worst, longest(total - forces.T[:, i]))
    return worst


#: Equation, kind of body and wrong reading of its lever arms. Eq. (55) has terms of one kind only: ``from`` is right.
WRONG_ARMS: tuple[tuple[str, str, Reading], ...] = (
    ("(53)", "lower", "to"),
    ("(53)", "lower", "from"),
    ("(54)", "upper", "to"),
    ("(54)", "upper", "from"),
    ("(55)", "platform", "to"),
)


def levers(case: Case, forces: Forces) -> list[Erratum]:
    """13: no single reading of the lever arms is right for both terms, and T_B has no point that it is about."""
    rows = []
    for equation, kind, reading in WRONG_ARMS:
        arms = {"to": "D - X", "from": "X - D"}[reading]
        printed = Form(f"X r_D = {arms}", imbalance(case, forces, reading, kind))
        right = Form("X - D, in both terms", imbalance(case, forces, "right", kind))
        rows.append(Erratum(13, "E", equation, f"{kind}: imbalance, arms {arms}", printed, right, "N m"))
    base, slide = _joints(case, "base"), _joints(case, "slide")
    A, C, T_C = forces.point[:, base], forces.point[:, slide], forces.joint_T[:, slide]
    end = A + HALF * (C - A) / np.linalg.norm(C - A, axis=2, keepdims=True)
    shift = np.cross(C - end, forces.joint_F[:, slide])
    size = np.linalg.norm(shift, axis=2)
    worst = np.unravel_index(np.argmax(size), size.shape)
    end_of_half = Form("about a point 0.3 m from A", longest((T_C + shift)[worst]))
    about_C, measure = Form("about C, and saying so", longest(T_C[worst])), "T_B, where its point matters most"
    return [*rows, Erratum(13, "A", "(53)-(54)", measure, end_of_half, about_C, "N m", size[worst])]


def _joints(case: Case, role: str) -> list[int]:
    """That joint of each leg."""
    return [i for i, joint in enumerate(case.lay.mechanism.joints) if joint.name.endswith(f".{role}")]


def platform(case: Case, forces: Forces) -> list[Erratum]:
    """14: T_C is zero for PS, not PU; eq. (55) sums it over the wrong legs and leaves out the lever of F_S."""
    upu, *ups = _joints(case, "wrist")
    s = case.lay.mechanism.joints.index(case.lay.mechanism.joint("s"))
    T_C, rest = forces.joint_T[:, upu], forces.joint_T[:, ups].sum(axis=1)
    lever = np.cross(forces.point[:, s] - case.at.com[:, -1], forces.joint_F[:, s])
    leg = Form("zero for PU", 0.0), Form("zero for PS only", longest(T_C))
    arm = Form("left out", 0.0), Form("(O - P) x F_S", longest(lever))
    printed = Form("T_C of k = 2 ... 4, no (O - P) x F_S", longest(rest - T_C - lever))
    right = Form("T_C of k = 1, (O - P) x F_S", imbalance(case, forces, "right", "platform"))
    return [
        Erratum(14, "E", "below (54)", "T_C of the UPU leg, largest", *leg, "N m"),
        Erratum(14, "E", "(55)", "moment of F_S about P, largest", *arm, "N m"),
        Erratum(14, "E", "(55)", "platform: imbalance of moments", printed, right, "N m"),
    ]


class AxialRule:
    """Driving forces under eq. (56) and the smallest ones, every 10 ms.

    Attributes:
        case: The case at these times.
        size, least: Largest driving force under each rule [N]; not a number where eq. (56) has no solution. Shape (n,).
    """

    def __init__(self) -> None:
        self.case = Case(np.union1d(every(0.01), [NEAR_TURN]))
        forces = Forces(self.case, "spherical_axial")
        self.size = np.where(forces.condition <= SINGULAR, np.abs(forces.actuator).max(axis=1), np.nan)
        self.least = np.abs(self.case.driving(forces.W)).max(axis=1)


def one_dimension(rule: AxialRule) -> list[Erratum]:
    """15: eq. (56) stands for two equations, is singular wherever a = 0 or b = 0, and makes large forces."""
    case, size, least = rule.case, rule.size, rule.least
    some, turns = Case(every(0.1)[1:]), Case(np.arange(4.0) * np.pi)
    regular = np.isfinite(size)
    ratio = float(np.median(size[regular] / least[regular]))
    singular = (int(np.sum(Forces(turns, name).condition > SINGULAR)) for name in RULES)
    condition = (np.linalg.cond(Forces(some, name).system).min() for name in RULES)

    def both(printed: float, right: float) -> tuple[Form, Form]:
        return Form("F_S along O P", printed), Form("minimum norm", right)

    def at(time: float) -> tuple[Form, Form]:
        i = int(np.argmin(np.abs(case.t - time)))
        return both(size[i], least[i])

    equations = Form("one", 1), Form("two, across O P", Forces(turns, "spherical_axial").rule.shape[1])
    median = both(np.median(size[regular]), np.median(least[regular]))
    return [
        Erratum(15, "E", "(56)", "equations that it stands for", *equations, "count"),
        Erratum(15, "E", "(56)", "singular of t = 0, pi, 2 pi, 3 pi", *both(*singular), "count"),
        Erratum(15, "E", "(56)", "largest driving force, median", *median, "N"),
        Erratum(15, "E", "(56)", "the same, median of the ratio", *both(ratio, 1.0), "factor", ratio),
        Erratum(15, "E", "(56)", "driving force at t = 6.28 s", *at(6.28), "N"),
        Erratum(15, "E", "(56)", "driving force at t = 6.283 s", *at(NEAR_TURN), "N"),
        Erratum(15, "E", "(56)", "condition number, smallest", *both(*condition), "1"),
    ]


def right_inverse(case: Case, forces: Forces) -> list[Erratum]:
    """16: a wide matrix has a right inverse, c^T (c c^T)^-1; (c c^T)^-1 b are not even as many numbers as unknowns."""
    c = forces.c
    b = forces.b
    y = np.linalg.solve(c @ c.swapaxes(1, 2), b[..., None])
    Q = (c.swapaxes(1, 2) @ y)[..., 0]
    # fifty-four numbers for fifty-six unknowns: read as the first of them, the rest zero
    as_printed = np.concatenate([y[..., 0], np.zeros((len(y), c.shape[2] - y.shape[1]))], axis=1)
    left = (100.0 * largest((c @ q[..., None])[..., 0] - b) / largest(b) for q in (as_printed, Q))
    words = "(c c^T)^-1 b", "c^T (c c^T)^-1 b"
    count, share = map(Form, words, (y.shape[1], Q.shape[1])), map(Form, words, left)
    return [
        Erratum(16, "E", "(58)", "numbers for the 56 unknowns", *count, "count"),
        Erratum(16, "E", "(58)", "c Q - b, share of the largest b", *share, "%"),
    ]


class Reach:
    """Q_a split into its causes, and a wrong bracket carried through to the driving forces.

    Attributes:
        load, gravity, inertia: Largest share of each in the generalised force Q_a [N m].
        driving: Largest driving force [N].
        bracket: Largest change of a driving force by the bracket of eq. (36) as printed [N].
        joint_error: Largest error that the same bracket makes in joint accelerations [%].
    """

    def __init__(self, case: Case) -> None:
        inertia = case.generalized(case.wrench(np.zeros(3), loaded=False))[:, 0]
        self.load = largest(case.generalized(case.wrench(np.zeros(3)))[:, 0] - inertia)
        self.gravity = largest(case.generalized(case.wrench(loaded=False))[:, 0] - inertia)
        self.inertia = largest(inertia)
        (right, _), (wrong, beta) = (_by_bracket(case, form) for form in (screws.lie_bracket, lie_bracket))
        self.driving, self.bracket = largest(right), largest(wrong - right)
        self.joint_error = percent(beta, case.side.gather(case.beta))

    @property
    def sentence(self) -> str:
        share = 100.0 * self.bracket / self.driving
        return (
            f"The paper's own case tests statics and hardly any dynamics: in Q_a the load makes {self.load:.0f} N m, "
            f"gravity {self.gravity:.0f} and inertia {self.inertia:.2g}; a bracket that is wrong by "
            f"{self.joint_error:.0f} % in joint accelerations changes its driving forces by {self.bracket:.2g} N "
            f"of {self.driving:.0f} N, {share:.2g} %."
        )


def _by_bracket(case: Case, bracket: Bracket) -> tuple[Array, Array]:
    """Driving forces [N] and joint accelerations chain by chain, by eqs. (44) and (26) under a bracket.

    Returns:
        Shapes (n, 4), (n, 5, m).
    """
    lay, side = case.lay, case.side
    beta, along = chain_accelerations(case, bracket)
    A = np.zeros_like(case.A)
    for joint in lay.mechanism.joints:
        chain, last = np.argwhere(side.used & (side.columns == lay.columns[joint.name][-1]))[0]
        A[:, lay.mechanism.body_index[joint.child]] = along[:, chain, last]
    return case.driving(case.wrench(A=A)), beta


def errata(case: Case, forces: Forces) -> list[Erratum]:
    return [row for measured in (gravity, levers, platform, right_inverse) for row in measured(case, forces)]
