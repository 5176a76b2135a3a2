"""Computes samples of the engine `truth`: all quantities in balls, at higher precision if balls are too wide.

The two routes to the forces are checked against each other.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx

from screwgauge.problem import GivenMotion, Problem, given_columns
from screwgauge.quantities import BODY_MOTION, OF_JOINTS, QUANTITIES
from screwgauge.reference.applied import Load
from screwgauge.reference.courses import Course, Samples
from screwgauge.reference.rotations import Array
from screwgauge.solution import Clock
from screwgauge.truth import cache
from screwgauge.truth.exact import Jet, MatrixJet, Vector, drive, number, read_terms, samples, vector
from screwgauge.truth.forces import (
    BallLoad,
    Component,
    RoutesDisagree,
    VaryingLoad,
    columns_of,
    generalized_force,
    idle_accelerations,
    jacobian,
    min_norm,
    newton_euler,
    required_wrenches,
    resisting_forces,
)
from screwgauge.truth.kinematics import (
    Certifier,
    LoopsOpen,
    NotCertified,
    State,
    check_closed,
    coarse_decimals,
    point,
    spin,
    state,
)
from screwgauge.truth.linkage import Linkage

Balls = dict[str, list[arb]]
"""Quantity -> its components."""

#: Relative radius of a ball above which a sample is enclosed again with more bits. Near singular poses or gimbal lock,
#: accelerations are small differences between terms that grow as 1 / distance^2.
WIDE = 1e-25


def needs_rule(problem: Problem) -> bool:
    """Return True if requested forces depend on a rule for redundant actuators."""
    return any(QUANTITIES[name].ruled for name in problem.wanted)


class Sampler:
    """Solver for samples of one problem, up to the stage that the requested quantities need: q, v, a or f."""

    def __init__(self, linkage: Linkage, problem: Problem, depth: str, clock: Clock, *, redundant: bool = True) -> None:
        """Read forces and motion in the current working precision, which is also used for the samples.

        Args:
            redundant: Whether redundant rows must close and the two routes must agree. If False, only rows chosen for
                the solution are used.
        """
        self.linkage, self.depth, self.clock, self.redundant = linkage, depth, clock, redundant
        self.certifier, self.bits, motion = Certifier(linkage), ctx.prec, problem.wording.motion
        labels = list(linkage.mechanism.independent)
        #: Indices of the coordinates whose motion is given as text; `terms` has their functions of time.
        self.said = [] if motion is None else [i for i, label in enumerate(labels) if label in motion]
        self.terms = read_terms(motion or {}, [labels[i] for i in self.said])
        self.ruled, self.resistance = needs_rule(problem), "resistance" in problem.wanted
        self.axial, index = problem.rule == "spherical_axial", linkage.mechanism.body_index
        points = [(index[one.body], vector(one.place.tolist())) for one in problem.points]
        self.points = points if "jacobian" in problem.wanted else None
        self.idle = problem.task.idle if isinstance(problem.task, GivenMotion) else ()
        if problem.applied.gravity is None:
            self.gravity = [arb(0), arb(0), number("-9.81")]
        else:
            self.gravity = vector(problem.wording.gravity or problem.applied.gravity.tolist())
        if problem.wording.loads is None:
            self.loads = [_load_of_doubles(load, index[load.body]) for load in problem.applied.loads]
        else:
            self.loads = [_load_of_text(table, index) for table in problem.wording.loads]

    def at(self, motion: GivenMotion, row: int, start: Sequence[float]) -> Balls:
        """Compute all quantities at one sample of the motion, see `sample`."""
        with ctx.workprec(self.bits):
            y = samples(motion, row)
            for i, series in zip(self.said, drive(self.terms, float(motion.t[row])), strict=True):
                y[i] = series
            return self.sample(y, start, float(motion.t[row]), motion.idle)

    def sample(self, y: Sequence[Jet], start: Sequence[float], t: float = 0.0, idle: Sequence[int] = ()) -> Balls:
        """Compute all quantities at one instant.

        Args:
            y: Series of the independent coordinates.
            start: An unverified guess of the joint coordinates.
            t: Time at which loads are evaluated [s].
            idle: Indices of coordinates that no actuator drives; their second derivatives follow from the forces.

        Raises:
            NotCertified: A quantity could not be enclosed.
        """
        if self.depth == "q":
            with self.clock.stage("positions"):
                q, _, _ = self.certifier.solve([x[0] for x in y], start)
                jets = [[x] for x in q]
                self._check_closed(jets, self.linkage.place(jets))
            return {"joint_position": q}
        with self.clock.stage("positions, rates and accelerations"):
            now = state(self.certifier, self._follow(y, start, t, idle) if idle else y, start)
            self._check_closed(now.q, now.bodies)
        out = _motion(self.linkage, now)
        if self.resistance:
            out["resistance"] = [force for _, force in resisting_forces(self.linkage, now)]
        if self.points is not None:
            out["jacobian"] = jacobian(self.linkage, now, self.points, self.idle)
        if self.depth == "f":
            out |= self._forces(now, t, idle)
        return out

    def _loads(self, now: State, t: float) -> list[BallLoad]:
        return [load.at(t, now.bodies[load.body][0]) for load in self.loads]

    def _follow(self, y: Sequence[Jet], start: Sequence[float], t: float, idle: Sequence[int]) -> list[Jet]:
        """Return series in which the idle coordinates have the second derivatives that follow from the forces."""

        def forces(moved: int | None) -> tuple[State, list[arb]]:
            """Return state and forces if the second derivatives of idle coordinates are zero, except 1 for `moved`."""
            some = [[a, b, arb(i == moved) / 2 if i in idle else c] for i, (a, b, c) in enumerate(y)]
            now = state(self.certifier, some, start)
            return now, generalized_force(self.linkage, now, self.gravity, self._loads(now, t))

        now, Q = forces(None)
        columns = [[a - b for a, b in zip(forces(i)[1], Q, strict=True)] for i in idle]
        x = idle_accelerations(self._drive(now), columns, Q, idle)
        return [[a, b, x[idle.index(i)] / 2 if i in idle else c] for i, (a, b, c) in enumerate(y)]

    def _drive(self, now: State) -> arb_mat:
        """Return the rates of the actuators per unit rate of each independent coordinate. Shape (n_actuator, k)."""
        rows, k = self.linkage.mechanism.actuated_columns, now.partial.ncols()
        return arb_mat(len(rows), k, [now.partial[row, j] for row in rows for j in range(k)])

    def _check_closed(self, q: Sequence[Jet], bodies: Sequence[MatrixJet]) -> None:
        if self.redundant:
            check_closed(self.linkage, q, bodies)

    def _forces(self, now: State, t: float, idle: Sequence[int]) -> Balls:
        linkage, given = self.linkage, given_columns(now.partial.ncols(), idle)
        loads = self._loads(now, t)
        with self.clock.stage("forces by virtual power"):
            Q = generalized_force(linkage, now, self.gravity, loads)
        if not self.ruled:
            return {"generalized_force": Q}
        if (driven := len(linkage.mechanism.actuated_columns)) < len(given):
            what = f"the actuated joints drive {driven} of {now.partial.ncols()} freedoms"
            raise NotCertified(what, "", "do not request actuator_force and reaction")
        B = self._drive(now)
        driving, freely = columns_of(B, given), [linkage.mechanism.independent_columns[i] for i in idle]
        f = min_norm(driving, [Q[j] for j in given])
        with self.clock.stage("forces by the balance of all bodies"):
            need = required_wrenches(linkage, now, self.gravity, loads)
            reactions, f_second, nothing = newton_euler(linkage, now, driving, need, freely, axial=self.axial)
        Q_second = (B.transpose() * f_second).entries() if driven else [arb(0)] * len(Q)
        pairs = [*zip(Q, Q_second, strict=True), *((force, arb(0)) for force in nothing)]
        if self.axial:
            f = f_second
        else:
            pairs += zip(f.entries(), f_second.entries(), strict=True)
        if self.redundant and not all(a.overlaps(b) for a, b in pairs):
            raise RoutesDisagree("the enclosures of the two routes to the forces do not overlap", "", "report this")
        return {"generalized_force": Q, "actuator_force": f.entries(), "reaction": reactions}


def _motion(linkage: Linkage, now: State) -> Balls:
    bodies = list(zip(now.bodies[1:], linkage.masses, strict=True))
    joints = {"q": [x[0] for x in now.q], "v": [x[1] for x in now.q], "a": [2 * x[2] for x in now.q]}
    moved = {
        "w": lambda T, mass: spin(T, 1),
        "b": lambda T, mass: spin(T, 2),
        "v": lambda T, mass: point(T[1], mass.com),
        "a": lambda T, mass: [2 * x for x in point(T[2], mass.com)],
    }
    return {
        **{name: joints[QUANTITIES[name].needs] for name in OF_JOINTS},
        **{name: [x for body in bodies for x in moved[what](*body)] for what, name in BODY_MOTION.items()},
    }


def _load_of_doubles(load: Load, body: int) -> VaryingLoad:
    """Convert a load, treating its doubles as exact."""
    at, turns = None if load.point is None else vector(load.point.tolist()), load.axes == "body"
    if not load.courses:
        each = [([arb(x)], list[Vector]()) for x in (*load.force.tolist(), *load.torque.tolist())]
        return VaryingLoad(body, at, each, turns)
    return VaryingLoad(body, at, [_exact(course) for course in load.courses], turns)


def _exact(course: Course | Samples) -> Component:
    if isinstance(course, Samples):
        return lambda t: arb(float(course(t)))
    return vector(course.polynomial.tolist()), [vector(row) for row in course.harmonics.tolist()]


def _load_of_text(table: Mapping[str, Any], index: Mapping[str, int]) -> VaryingLoad:
    """Convert a load's table; reverse the sign if the body exerts the load on the environment."""
    body, sign = (table["on"], 1) if table["by"] == "environment" else (table["by"], -1)
    at: Any = table.get("point", "com")
    components = [x for key in ("force", "torque") for x in table.get(key, [0, 0, 0])]
    texts = {str(i): x if isinstance(x, Mapping) else {"offset": x} for i, x in enumerate(components)}
    signed: list[Component] = [
        ([x * sign for x in polynomial], [[omega, c * sign, s * sign] for omega, c, s in harmonics])
        for polynomial, harmonics in read_terms(texts, [*texts])
    ]
    turns = table.get("axes") == "body"
    return VaryingLoad(index[body], None if at == "com" else vector(at), signed, turns)


def enclose_sample(samplers: Sequence[Sampler], motion: GivenMotion, row: int, start: Sequence[float]) -> Balls:
    """Compute a sample with the first sampler that gives narrow balls, or else with the last sampler.

    Raises:
        NotCertified: The last sampler could not enclose the sample either.
    """
    for sampler in samplers[:-1]:
        try:
            quantities = sampler.at(motion, row, start)
        except NotCertified:
            continue
        if all(_are_narrow(balls) for balls in quantities.values()):
            return quantities
    return samplers[-1].at(motion, row, start)


def recentre_sample(wide: Sampler, exact: Sampler, motion: GivenMotion, row: int, start: Sequence[float]) -> Balls:
    """Move the centres of the balls of `wide` to the values of `exact`, which ignores redundant rows.

    Ball arithmetic overestimates radii: if inputs are wide, the enclosed values may lie anywhere in the balls.

    Raises:
        LoopsOpen: The rounded decimals are too coarse to enclose the motion that exact decimals determine.
        NotCertified: The sample could not be enclosed with exact decimals.
    """
    values = exact.at(motion, row, start)
    try:
        enclosures = wide.at(motion, row, start)
    except (RoutesDisagree, LoopsOpen):
        raise
    except NotCertified as error:
        raise coarse_decimals(wide.linkage, str(error.what)) from None
    with ctx.workprec(wide.bits):
        return {
            name: [arb(b.mid(), (a - b.mid()).abs_upper()) for a, b in zip(balls, values[name], strict=True)]
            for name, balls in enclosures.items()
        }


def _are_narrow(balls: Sequence[arb]) -> bool:
    largest = max((float(ball.abs_upper()) for ball in balls), default=0.0)
    return all(float(ball.rad()) <= WIDE * largest for ball in balls)


@dataclass(frozen=True, slots=True, eq=False)
class SampleTable:
    """Midpoints and radii of each quantity at samples, shape (n_row, m) each, and reasons for missing samples.

    Attributes:
        rounded: Whether long decimals of the geometry were treated as rounded.
    """

    mid: dict[str, Array]
    radius: dict[str, Array]
    reasons: list[str]
    spent: dict[str, float]
    rounded: bool

    def pack(self) -> dict[str, Array]:
        return {
            **{f"mid.{name}": array for name, array in self.mid.items()},
            **{f"radius.{name}": array for name, array in self.radius.items()},
            "reasons": np.array(self.reasons, dtype=str),
            "stages": np.array(list(self.spent), dtype=str),
            "seconds": np.array(list(self.spent.values())),
            "rounded": np.array(self.rounded),
        }

    @classmethod
    def unpack(cls, stored: cache.Arrays) -> SampleTable:
        mid, radius = (
            {name.removeprefix(part): array for name, array in stored.items() if name.startswith(part)}
            for part in ("mid.", "radius.")
        )
        spent = dict(zip(stored["stages"].tolist(), map(float, stored["seconds"]), strict=True))
        return cls(mid, radius, list(map(str, stored["reasons"])), spent, bool(stored["rounded"]))

    def answers(self, wanted: Collection[str], sizes: Mapping[str, int], y: Array, columns: list[int]) -> bool:
        """Return True if the table contains all data that a problem requires.

        Args:
            wanted: Requested quantities.
            sizes: Number of components of every quantity.
            y: Independent coordinates. Shape (n_row, k).
            columns: Columns of the independent coordinates among the joint coordinates.
        """
        if not ({"joint_position", *wanted} <= self.mid.keys() == self.radius.keys() <= sizes.keys()):
            return False
        for name, array in [*self.mid.items(), *self.radius.items()]:
            if array.dtype != np.float64 or array.shape != (len(y), sizes[name]):
                return False
        q = self.mid["joint_position"]
        lost = np.isnan(q).any(axis=1)
        there = (np.isfinite(array[~lost]).all() and np.isnan(array[lost]).all() for array in self.mid.values())
        known = ((array[~lost] >= 0.0).all() for array in self.radius.values())
        same = np.isclose(q[:, columns], y, rtol=1e-9, atol=1e-9)[~lost].all()
        return bool(len(self.reasons) == lost.sum() < len(y) and all(there) and all(known) and same)


def enclosures(samples: list[Balls | None], rounded: bool) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return midpoints rounded to doubles, and upper bounds of the radii; NaN for missing samples.

    A ball that contains zero is centred at zero, so that values that vanish by symmetry are 0 rather than 1e-58. Balls
    of rounded decimals are not moved, because values that do not vanish may be as small as their radii.
    """
    first = next(one for one in samples if one is not None)
    mid = {name: np.full((len(samples), len(balls)), np.nan) for name, balls in first.items()}
    radius = {name: array.copy() for name, array in mid.items()}
    for i, one in enumerate(samples):
        for name, balls in (one or {}).items():
            centred = [not rounded and ball.contains(0) for ball in balls]
            mid[name][i] = [0.0 if zero else float(b.mid()) for b, zero in zip(balls, centred, strict=True)]
            size = [float(b.abs_upper() if zero else b.rad()) for b, zero in zip(balls, centred, strict=True)]
            radius[name][i] = np.nextafter(size, np.inf)
    return mid, radius
