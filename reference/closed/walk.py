"""Steps from anchor to anchor along straight paths and curves; each step stays in the ball of the preceding anchor.

All anchors lie in the connected set of regular closed poses that contains home, because even the smallest step does
not cross a singular pose.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.closed.anchors import CHANGE, NEAR, Anchor, Anchors, Flags, measure, offsets
from screwgauge.reference.closed.newton import CLOSED, OPEN, Curve, Evaluation, has_stalled, newton
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.rotations import TURN, Array, within_half_turn

#: Length of a path in y below which rounding dominates.
SHORTEST = 1e-13
#: Largest number of steps along a piece of motion: a constant, and a number per unit length [rad or mechanism lengths].
MOST, EACH = 400, 20
#: Largest number of halvings of a curve.
DEEPEST = 48
#: Largest number of Newton steps to an anchor, and residual below which one more step closes loops to less than `OPEN`.
NEWTON, CLOSE = 8, 1e-6
#: Largest change of the Jacobian in the last step, after which it is not reevaluated, relative to its smallest
#: singular value.
TURNED = 0.125
#: Largest deviation of a motion from the curve through its samples, as a fraction of a ball's radius.
MISS = 0.1
#: Fraction of a path by which a step passes a singular pose on the path; and fraction of the largest singular value
#: below which a singular direction does not indicate where the branch continues.
LEAP, BLUR = 1e-3, 1e-6


class Blocked(Exception):
    """Raised when no further step is possible.

    Attributes:
        singular: True if a singular pose blocks the path, False if it needs too many steps.
    """

    def __init__(self, *, singular: bool) -> None:
        super().__init__("singular" if singular else "too many steps")
        self.singular = singular


class Walk:
    """The anchors of one assembly mode, and the current position among them.

    Attributes:
        anchors: All known anchors.
        at: Number of the current anchor.
        left: Number of remaining steps.
        loops: Coordinate whose full turn leads back home -> unknowns along that turn. Shape (v, n_z).
    """

    def __init__(
        self,
        evaluate: Evaluation,
        start: tuple[Array, Array],
        angles: tuple[Flags, Flags],
        size: Array | float = 1.0,
        *,
        resting: bool = False,
        strict: bool = False,
    ) -> None:
        """Start at a pose that nearly closes the loops, such as home.

        Args:
            evaluate: Function that returns dimensionless residuals and their Jacobian, whose last k rows select y.
            start: Dimensionless unknowns, and independent coordinates [rad or m]. Shapes (n_z,), (k,).
            angles: True for unknowns, and for independent coordinates, that are angles. Shapes (n_z,), (k,).
            size: Scales of the independent coordinates. Shape (k,).
            resting: True if `evaluate` also returns the Jacobian that includes the columns of coordinates at rest.
            strict: Join samples that do not form a motion by straight paths only.

        Raises:
            ClosureError: The loops do not close at that pose.
        """
        self.evaluate, self.size, self.resting = evaluate, size, resting
        self.turns, self.strict, z, y = angles[1], strict, start[0], start[1] / size
        self.anchors, self.floor, self.left = Anchors(len(y), len(z), angles[0]), np.inf, MOST
        residual, J, *_ = evaluate(z[None], y[None])
        home = self._measure(z, y, residual[0], J[0]) if np.isfinite(J).all() else None
        if home is None:
            remedy = "correct the placements or the home coordinates"
            raise ClosureError("the loops do not close there", "home pose", remedy)
        self.at = self.anchors.add(home, 0)
        self.visits, self.path, self.last = [self.at], home.z[None], list[Array]()
        self.parent = {self.at: self.at}
        self.piece: Curve | None = None
        self.tried, self.loops, self.begun = set[int](), dict[int, Array](), False

    def _with_resting(self, J: Array, more: Sequence[Array]) -> Array:
        return more[0] if self.resting else J

    def restart(self, *, begun: bool = False) -> None:
        """Start the next motion at home; with `begun`, the path to its start counts as part of the motion."""
        self.at, self.visits, self.path, self.last = 0, [0], self.anchors.table["z"][:1], list[Array]()
        self.begun = begun

    def _step(self, target: Array) -> None:
        """Move to an anchor nearer to a target: a known anchor on the same branch, or a new anchor."""
        anchors, anchor = self.anchors, self.anchors[self.at]
        if not self.left:
            raise Blocked(singular=False)
        self.left -= 1
        way = anchors.difference(target, anchor.y)
        far = float(anchors.distance(target, self.at))
        goal = anchor.y + min(1.0, 1.0 / far) * way
        if (known := self._find_known(goal, target, float(np.linalg.norm(way)))) is not None:
            self._visit(known)
            return
        share, size = min(1.0, 1.0 / far), float(np.abs(way).max())
        while share * size > SHORTEST * max(1.0, float(np.abs(target).max())):
            if self._grow(anchor.y + share * way):
                return
            share *= 0.5
            anchors.shrink(self.at)
        raise Blocked(singular=True)

    def _find_known(self, goal: Array, target: Array, length: float) -> int | None:
        """Find an anchor of this sheet, nearer to the target than `length`, with the goal well inside its ball."""
        anchors = self.anchors
        kin = anchors.sheet_of(int(anchors.table["sheet"][self.at]))
        kin = kin[(anchors.distance(goal, kin) <= 0.5) & (kin != self.at)]
        remaining = np.linalg.norm(anchors.difference(target, anchors.table["y"][kin]), axis=1)
        for i in np.argsort(remaining)[:2]:
            if remaining[i] < length * (1.0 - 1e-9) and anchors.on_one_branch(self.at, int(kin[i])):
                return int(kin[i])
        return None

    def _grow(self, goal: Array) -> bool:
        """Create an anchor at a goal within the current ball and move there; return False if this is impossible."""
        base = self.anchors[self.at]
        start = base.z + base.K @ (goal - base.y)
        both = np.stack([start, 0.5 * (start + base.z)]), np.stack([goal, 0.5 * (goal + base.y)])
        begun = self.evaluate(*both)
        ahead, half = base.change(self._with_resting(begun[1], begun[2:]))
        if not (is_at_most(ahead, CHANGE) and is_at_most(half - 0.5 * ahead, 0.5 * CHANGE)):
            return False
        anchor = self._measure(start, goal, begun[0][0], begun[1][0], base)
        if anchor is None or not self.anchors.corrections((anchor.z - start)[None], np.array([self.at]))[0] <= NEAR:
            return False
        if not is_at_most(base.change((anchor.U * anchor.s) @ anchor.Vt), CHANGE):
            return False
        # near a singular pose, an anchor that leads away looks like an anchor of the crossing branch
        if anchor.beta > self.floor or 2.0 * anchor.beta < base.faint:
            raise Blocked(singular=True)
        sheet = int(self.anchors.table["sheet"][self.at])
        number = self.anchors.add(anchor, sheet)
        self.parent[number] = self.at
        self._sort(number, sheet)
        self._visit(number)
        return True

    def _measure(self, z: Array, y: Array, residual: Array, J: Array, base: Anchor | None = None) -> Anchor | None:
        """Compute an anchor with Newton's method from a nearby pose; return None if the method does not converge.

        The Jacobian and its derivatives are evaluated at the penultimate pose and kept, unless the last step would
        change the Jacobian, as even the smallest step does near a singular pose.
        """
        k, gap, closed = len(y), float(np.abs(residual).max(initial=0.0)), False
        for _ in range(NEWTON):
            closed = closed or gap <= CLOSED
            right = np.concatenate([-residual[:, None], np.eye(len(residual))[:, -k:]], axis=1)
            step, K = np.split(linear.solve(J[None], right[None])[0], [1], axis=1)
            there = z if closed else z + step[:, 0]
            ways, divisor = offsets(base.steady(K) if base else K)
            poses = np.concatenate([there[None], there + ways])
            residuals, matrices, *more = self.evaluate(poses, np.tile(y, (2 * k + 1, 1)))
            full, after = self._with_resting(matrices, more), float(np.abs(residuals[0]).max(initial=0.0))
            if not (np.isfinite(full).all() and after < 1.0):
                return None
            if has_stalled(gap, after) and not closed:
                closed = True
                continue
            z, residual, J, gap = there, residuals[0], matrices[0], after
            if gap <= CLOSE:
                slope = (full[1 : k + 1] - full[k + 1 :]) / divisor[:, None, None]
                anchor = measure(z, y, 0.0 * residual if closed else residual, J, full[0], slope, base)
                if closed or gap * anchor.beta**2 <= TURNED:
                    return anchor
        return None

    def _sort(self, new: int, sheet: int) -> None:
        """Move a new anchor to a different sheet if an anchor of its sheet has a different pose at the same y."""
        anchors, y = self.anchors, self.anchors[new].y
        for candidate in dict.fromkeys([sheet, *range(anchors.sheets + 1)]):
            rows = anchors.sheet_of(candidate)
            rows = rows[rows != new]
            near = rows[anchors.distance(y, rows) <= 0.7]
            if all(anchors.on_one_branch(new, int(one)) for one in near[:8]):
                if candidate != sheet:
                    anchors.move(new, candidate)
                return

    def _visit(self, a: int) -> None:
        self.at = a
        self.visits.append(a)

    def _walk(self, target: Array) -> None:
        """Move straight towards a target until it lies within the ball."""
        while not self.anchors.distance(target, self.at) <= 1.0:
            self._step(target)

    def _follow_curve(self, curve: Curve, depth: int = 0) -> None:
        """Move along a curve; halve the curve until each piece lies in one ball."""
        anchors, points, self.piece = self.anchors, curve.points, curve
        left, right, miss = curve.halves()

        def is_inside() -> bool:
            near = miss @ anchors.table["W"][self.at] @ miss <= MISS**2
            return bool(near and (anchors.distance(points, self.at) <= 1.0).all())

        if is_inside():
            return
        self._walk(points[0])
        if anchors.distance(points[0], self.at) > 0.5:  # move to the middle of a ball
            self._step(points[0])
        if is_inside():
            return
        if depth == DEEPEST:
            raise Blocked(singular=True)
        self._follow_curve(left, depth + 1)
        self._follow_curve(right, depth + 1)

    def _predict_beyond(self, y: Array) -> Anchor | None:
        """Predict an anchor just beyond a singular pose in regular directions; return None if the loops stay open."""
        anchor, k = self.anchors[self.at], len(y)
        _, J, *_ = self.evaluate(anchor.z[None], anchor.y[None])
        start = anchor.z + np.linalg.pinv(J[0], rcond=BLUR)[:, -k:] @ (y - anchor.y)
        z, J, error, *_ = newton(self.evaluate, start[None], y[None])
        closes = error[0] < OPEN and np.abs(z[0] - start).max() < 1.0
        return self._measure(z[0], y, np.zeros(len(J[0])), J[0]) if closes else None

    def _leap(self, way: Array, target: Array) -> bool:
        """Jump just beyond a singular pose; return True if the loops close there."""
        anchor = self.anchors[self.at]
        last = np.linalg.norm(target - anchor.y) <= LEAP * np.linalg.norm(way)
        y = target if last else anchor.y + LEAP * way
        if (beyond := self._predict_beyond(y)) is None:
            return False
        landed = self.anchors.add(beyond, self.anchors.sheets)
        self.parent[landed] = self.at
        self._visit(landed)
        return True

    def _ancestors(self) -> list[int]:
        """Return the anchors through which the current anchor was reached, back to home."""
        path, a = list[int](), self.at
        while a:
            a = self.parent[a]
            path.append(a)
        return path

    def _solve_sample(self, y: Array, a: int, near: Array) -> Array:
        """Compute the unknowns of a sample in the ball of an anchor, stepping up to the sample itself. Shape (n_z,)."""
        at, visits, self.at, self.left = self.at, self.visits[:], a, MOST
        try:
            short = SHORTEST * max(1.0, float(np.abs(y).max()))
            while np.abs(self.anchors.difference(y, self.anchors[self.at].y)).max() > short:
                self._step(y)
            z = self.anchors[self.at].z
        finally:
            self.at, self.visits = at, visits
        return np.asarray(z + TURN * np.where(self.anchors.angles, np.rint((near - z) / TURN), 0.0))

    def _look_for_turns(self, y: Array) -> None:
        """Find angles whose full turn leads back home, if samples are more than half a turn from home. Shape (n, k)."""
        far = np.abs(y - self.anchors[0].y).max(axis=0) > np.pi
        for i in np.flatnonzero(far & self.turns).tolist():
            if i not in self.tried:
                self.tried.add(i)
                self._turn(i)

    def _turn(self, i: int) -> None:
        """Test whether a full turn of an angle leads back home; store how other angles turn along the path."""
        at, visits, home = self.at, self.visits, self.anchors[0]
        self.at, self.visits, self.left = 0, [0], MOST
        try:
            for share in (0.25, 0.5, 0.75, 1.0):
                y = home.y.copy()
                y[i] += share * TURN
                self._walk(y)
            path = np.concatenate(
                [self.anchors.table["z"][self.visits], self.anchors.predict(y[None], np.array([self.at]))]
            )
            path = self._unwrap(path)
            z, _, error, *_ = newton(self.evaluate, path[-1:], y[None])
            off = np.where(self.anchors.angles, within_half_turn(z[0] - home.z), z[0] - home.z)
            if error[0] < OPEN and np.abs(off).max() < 1e-6:
                self.loops[i] = path
                self.anchors.turn(i)
        except Blocked:
            pass
        finally:
            self.at, self.visits = at, visits

    def _unwrap(self, path: Array) -> Array:
        """Add full turns to the unknowns of successive poses so that angles do not jump. Shape (v, n_z)."""
        jumps = np.where(self.anchors.angles, np.rint(np.diff(path, axis=0) / TURN), 0.0)
        return np.concatenate([path[:1], path[1:] - TURN * np.cumsum(jumps, axis=0)])

    @property
    def windings(self) -> Array:
        """Number of full turns of the unknowns per turn of each coordinate in `loops`. Shape (k, n_z)."""
        turns = np.zeros((len(self.turns), len(self.anchors.angles)))
        for i, path in self.loops.items():
            turns[i] = np.rint((path[-1] - path[0]) / TURN) * self.anchors.angles
        return turns


def is_at_most(A: Array, limit: float) -> bool:
    """Return True if a matrix is finite and its 2-norm is within a limit; test the larger Frobenius norm first."""
    if not np.isfinite(A).all():
        return False
    return bool(np.linalg.norm(A) <= limit or np.linalg.norm(A, 2) <= limit)
