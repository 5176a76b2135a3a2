"""Integrates the motion of idle coordinates, given the motion of all other coordinates, once for all engines.

The method is collocation at Radau points (Radau IIA) for all points of a time interval (stretch) at once, because
computing accelerations takes little more time for many poses than for one pose. Newton's method uses the Jacobian at
the start of the stretch; therefore, stiff springs and dampers do not require short stretches.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import legint, legroots, legvander

from screwgauge.reference.applied import Applied
from screwgauge.reference.closed.assembly_mode import AssemblyMode, BranchPose
from screwgauge.reference.closed.loops import read
from screwgauge.reference.closed.newton import OPEN, newton
from screwgauge.reference.closed_motion import ClosedMotion
from screwgauge.reference.equations.rounding import idle_rounding
from screwgauge.reference.errors import ScrewgaugeError, SingularPoseError
from screwgauge.reference.graph import layout
from screwgauge.reference.linear import EPS
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import near_singularity
from screwgauge.reference.rotations import Array

State = tuple[Array, Array, Array]
"""Coordinates and two derivatives. Shape (n, k) each."""

#: Number of points of a piece, and of a piece between samples; largest number of pieces between samples in a stretch.
POINTS, BETWEEN, MANY = 16, 12, 8
#: Largest magnitude of the last terms of a piece, relative to the largest acceleration.
TOLERANCE = 1e-13
#: Newton's method: largest number of steps; change that always counts as rounding, and change that counts as rounding
#: if the next change is not smaller; factor by which each change must decrease.
STEPS, SETTLED, FOUND, SLOW = 25, 1e-14, 1e-7, 0.7
#: Stretches: initial length [s], largest growth factor, and fraction of the total time below which they are too short.
FIRST, LONGER, SHORTEST = 0.25, 2.0, 1e-9
#: Fraction of its length by which a stretch may be extended to reach an end.
ROUNDED = 0.1
#: Condition number of a pose, or of its forces, above which a motion ends; and largest rate, relative to the rate of a
#: pendulum as long as the mechanism.
IMPASSABLE, RUNAWAY = 1e5, 1e4
#: Condition number that explains why no further step is possible.
SUSPECT = 1e3
#: Multiple of the observed rounding error up to which terms of a piece count as rounding; displacement of poses that
#: makes rounding errors observable.
ROUNDINGS, ASIDE = 8.0, 1e-7
#: Largest distance of a pose from the same pose in the preceding Newton step [rad or mechanism lengths].
NEAR = 0.3
#: Relative step of finite differences: the square root of the rounding error.
DIFFERENCE = 2.0**-26


Rule = tuple[Array, Array, Array, Array]
"""Collocation points of a piece of duration 1, shape (s,); then, shape (s, s) each, the matrices from
accelerations at these points to Legendre coefficients, to first integrals and to second integrals.
"""


@cache
def rule(s: int) -> Rule:
    """Build the Radau rule with s points, of which the last is the end of the interval."""
    x = legroots([0.0] * (s - 1) + [-1.0, 1.0])
    x[-1] = 1.0
    terms = np.asarray(np.linalg.inv(legvander(x, s - 1)), dtype=float)
    once, twice = (np.asarray(basis @ terms, dtype=float) for basis in _integrals(x, s))
    return 0.5 * (x + 1.0), terms, once, twice


def _integrals(x: Array, s: int) -> tuple[Array, Array]:
    """Return first and second integrals of s Legendre polynomials on [0, 1] at x = 2 c - 1. Shape (n,) -> (n, s)."""
    first = legint(np.eye(s), lbnd=-1) / 2.0
    second = legint(first, lbnd=-1) / 2.0
    return legvander(x, s) @ first, legvander(x, s + 1) @ second


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A piece of the motion with polynomial accelerations.

    Attributes:
        since, until: Start and end time [s].
        y, yd: Coordinates and rates at the start. Shape (m,).
        terms: Legendre coefficients of the accelerations. Shape (s, m).
    """

    since: float
    until: float
    y: Array
    yd: Array
    terms: Array

    def __call__(self, t: Array) -> State:
        """Evaluate the motion at times [s]. Shape (n,)."""
        h = self.until - self.since
        share = ((t - self.since) / (h or 1.0))[:, None]
        x = 2.0 * share[:, 0] - 1.0
        once, twice = (basis @ self.terms for basis in _integrals(x, len(self.terms)))
        yd = self.yd + h * once
        return self.y + h * share * self.yd + h * h * twice, yd, legvander(x, len(self.terms) - 1) @ self.terms


@dataclass(eq=False)
class IdleMotion:
    """The idle coordinates as a function of time, integrated on demand.

    Attributes:
        given: Function from times (n,) to y, yd, ydd of all independent coordinates; entries of idle coordinates are
            ignored.
        idle, resting: Indices of the coordinates that no actuator drives, see `Dynamics`.
        since: Start time [s].
        start, rates: Idle coordinates and their rates at the start. Shape (m,).
        breaks: Times between which the given motion is smooth, shape (b,); None if it is smooth throughout.
    """

    mechanism: Mechanism
    applied: Applied
    given: Callable[[Array], State]
    idle: tuple[int, ...]
    resting: tuple[int, ...]
    since: float
    start: Array
    rates: Array
    breaks: Array | None = None
    pieces: list[Piece] = field(default_factory=list)

    def __call__(self, t: Array) -> State:
        """Evaluate all independent coordinates at times [s] not before the start. Shape (n,).

        Raises:
            ScrewgaugeError: The motion ends before these times.
        """
        if self.idle:
            self._reach(float(t.max(initial=self.since)))
        y, yd, ydd = (np.array(x) for x in self.given(t))
        if not self.idle:
            return y, yd, ydd
        ends = [piece.since for piece in self.pieces[1:]]
        where = np.searchsorted(ends, t, side="right")
        for i in np.unique(where) if self.pieces else ():
            rows = np.flatnonzero(where == i)
            for out, part in zip((y, yd, ydd), self.pieces[i](t[rows]), strict=True):
                out[rows[:, None], [*self.idle]] = part
        return y, yd, ydd

    def accelerations(self, t: Array, y: Array, yd: Array, ydd: Array) -> Array:
        """Return second derivatives of all independent coordinates at given states. Shape (n, k) each."""
        mode = AssemblyMode(layout(self.mechanism))
        at = ClosedMotion(mode.system, mode.motion(y, t, (yd, ydd)), yd, ydd, self.applied, t)
        at.idle, at.resting = self.idle, self.resting
        return np.array(at.ydd)

    @property
    def until(self) -> float:
        """End of the integrated motion [s]."""
        return self.pieces[-1].until if self.pieces else self.since

    def _reach(self, end: float) -> None:
        """Integrate up to a time [s]."""
        if self.pieces and end <= self.until:
            return
        integration = _Integration(self)
        if not self.pieces:
            start = integration.start.ydd[0, self.idle]
            self.pieces.append(Piece(self.since, self.since, self.start, self.rates, start[None]))
        while self.until < end:
            self.pieces += integration.stretch(end)


class _Rejected(Exception):
    """Raised for a stretch that is too long."""


class _Integration:
    """The integration that continues a motion from its end.

    Attributes:
        start: State at which the integration continues.
    """

    def __init__(self, motion: IdleMotion) -> None:
        self.motion, self.mode, self.idle = motion, AssemblyMode(layout(motion.mechanism)), [*motion.idle]
        self.loops, mechanism = self.mode.system, motion.mechanism
        self.unit = self.loops.sizes[mechanism.independent_columns]
        self.floor = float(np.linalg.norm(motion.applied.g)) / self.loops.length
        self.duration, self.begin = FIRST, motion.until
        last = motion.pieces[-1] if motion.pieces else None
        self.y, self.yd = (motion.start, motion.rates) if last is None else _end(last)
        self.started = False
        self.start = self._motion_at(np.array([self.begin]), self.y[None], self.yd[None])
        self.started = True
        self.start.check()

    def stretch(self, end: float) -> list[Piece]:
        """Integrate the next pieces, at most up to the given time [s].

        Raises:
            ScrewgaugeError: The integration cannot continue.
        """
        jacobian, reason = self._jacobian(), self._reason_to_end()
        if reason:
            raise self._broken_off(reason)
        while True:
            ends, points = self._ends(end)
            if ends[-1] - self.begin < SHORTEST * max(end - self.motion.since, FIRST):
                raise self._broken_off(self._reason_to_end(SUSPECT) or reason)
            try:
                with np.errstate(all="ignore"):
                    pieces = self._solve(ends, rule(points), jacobian)
            except (_Rejected, ScrewgaugeError, np.linalg.LinAlgError) as error:
                reason, self.duration = f"{error}", 0.5 * (ends[-1] - self.begin)
                continue
            self.begin, (self.y, self.yd) = ends[-1], _end(pieces[-1])
            return pieces

    def _ends(self, end: float) -> tuple[list[float], int]:
        """Return the end times of the next pieces [s], and the number of points of each."""
        until, breaks = self.begin + self.duration, self.motion.breaks
        goals = np.array([end]) if breaks is None else breaks[breaks > self.begin]
        inside = goals[goals <= until + ROUNDED * self.duration][:MANY].tolist()
        return inside or [until], POINTS if breaks is None else BETWEEN

    def _solve(self, ends: list[float], by: Rule, jacobian: tuple[Array, Array]) -> list[Piece]:
        """Solve for the motion up to the given ends.

        Raises:
            _Rejected: Newton's method does not converge, or polynomials do not fit the accelerations.
        """
        h, m = np.diff([self.begin, *ends]), len(self.idle)
        sums = _sums(h, by)
        back = np.linalg.inv(np.eye(m * len(sums[2])) - np.kron(sums[1], jacobian[0]) - np.kron(sums[0], jacobian[1]))
        at, a, change, scale = self._accelerate(sums, back)
        pieces = self._pieces([self.begin, *ends], by, a.reshape(len(h), -1, m))
        tail = max(float(np.abs(piece.terms[-2:] / self.unit[self.idle]).max()) for piece in pieces)
        if tail > max(TOLERANCE * scale, ROUNDINGS * change) and tail > ROUNDINGS * self._noise(at):
            raise _Rejected("accelerations change too fast")
        at.check()
        y, yd = _end(pieces[-1])
        self.start = self._motion_at(np.array(ends[-1:]), y[None], yd[None], at.q[-1:])
        self.duration = (ends[-1] - self.begin) * (LONGER if tail < 1e-3 * TOLERANCE * scale else 1.0)
        return pieces

    def _accelerate(self, sums: tuple[Array, Array, Array], back: Array) -> tuple[ClosedMotion, Array, float, float]:
        """Solve for the accelerations at all points of a stretch with Newton's method.

        Args:
            sums: See `_sums`.
            back: Inverse of the derivative of the residual.

        Returns:
            Motion; accelerations, shape (n, m); their last change and their maximum, both in rad or mechanism lengths.

        Raises:
            _Rejected: Newton's method does not converge.
        """
        (once, twice, after), unit = sums, self.unit[self.idle]
        a, change, scale = np.tile(self.start.ydd[:, self.idle], (len(after), 1)), np.inf, self.floor
        near: Array | None = None
        for step in range(STEPS):
            y, yd = self.y + after[:, None] * self.yd + twice @ a, self.yd + once @ a
            at = self._motion_at(self.begin + after, y, yd, near)
            near, correction = at.q, (back @ (at.ydd[:, self.idle] - a).ravel()).reshape(a.shape)
            a = a + correction
            before, change = change, float(np.abs(correction / unit).max())
            speed = float(np.abs(at.yd / self.unit).max())
            scale = max(scale, speed**2, float(np.abs(at.ydd / self.unit).max()))
            stalls = step > 1 and change > SLOW * before
            if not np.isfinite(change) or (stalls and change > FOUND * scale):
                break
            if change <= SETTLED * scale or stalls:
                return at, a, change, scale
        raise _Rejected("the iteration for accelerations does not converge")

    def _noise(self, at: ClosedMotion) -> float:
        """Estimate the change in accelerations due to rounding: close the poses again, starting from nearby poses."""
        y, unit = at.q[:, self.loops.y_columns], self.unit[self.idle]
        aside = at.q + ASIDE * self.loops.sizes * np.cos(np.arange(at.q.shape[1]))
        again = self._motion_at(at.t, y[:, self.idle], at.yd[:, self.idle], aside)
        rounded = np.abs((again.ydd - at.ydd)[:, self.idle] / unit).max()
        return float(rounded) + EPS * float(idle_rounding(at).max())

    def _pieces(self, ends: list[float], by: Rule, a: Array) -> list[Piece]:
        pieces, y, yd = list[Piece](), self.y, self.yd
        for (since, until), each in zip(pairwise(ends), a, strict=True):
            pieces.append(Piece(since, until, y, yd, by[1] @ each))
            y, yd = _end(pieces[-1])
        return pieces

    def _motion_at(self, t: Array, y: Array, yd: Array, near: Array | None = None) -> ClosedMotion:
        """Compute closed poses and accelerations, given idle coordinates. Shapes (n,), (n, m), (n, m), (n, n_q)."""
        whole, rates, ydd = (np.array(x) for x in self.motion.given(t))
        whole[:, self.idle], rates[:, self.idle], ydd[:, self.idle] = y, yd, 0.0
        q = self._close_in_order(whole, t, (rates, ydd)) if near is None else self._close(whole, near)
        at = ClosedMotion(self.loops, q, rates, ydd, self.motion.applied, t)
        at.idle, at.resting = self.motion.idle, self.motion.resting
        return at

    def _close_in_order(self, y: Array, t: Array, rates: tuple[Array, Array]) -> Array:
        """Return joint coordinates of successive closed poses, starting at home or at the end of the known motion."""
        if not self.started:
            return self.mode.motion(y, t, rates)
        return read(self.loops.lay, BranchPose(self.loops.lay, self.start.q[0]).joints(y))

    def _close(self, y: Array, near: Array) -> Array:
        """Return joint coordinates of the closed poses near given poses. Shape (n, n_q)."""
        if (poses := self.mode.in_closed_form(y)) is not None:
            return self.mode.close(poses)
        begun = self.loops.unknowns(near)
        z, _, error = newton(self.loops.evaluate, begun, y / self.unit)[:3]
        if not (error < OPEN).all() or np.abs(z - begun).max() > NEAR:
            raise _Rejected("the loops do not close near the previous pose")
        return self.loops.coordinates(z, near)

    def _jacobian(self) -> tuple[Array, Array]:
        """Return derivatives of the initial accelerations with respect to y and yd. Shape (m, m) each."""
        m, state = len(self.idle), np.concatenate([self.y, self.yd])
        size = DIFFERENCE * np.maximum(np.abs(state), np.tile(self.unit[self.idle], 2))
        states = state + np.diag(size)
        with np.errstate(all="ignore"), suppress(_Rejected, ScrewgaugeError):
            at = self._motion_at(
                np.full(2 * m, self.begin), states[:, :m], states[:, m:], self.start.q.repeat(2 * m, axis=0)
            )
            J = ((at.ydd - self.start.ydd)[:, self.idle] / size[:, None]).T
            return J[:, :m], J[:, m:]
        return np.zeros((m, m)), np.zeros((m, m))  # near a pose where the loops open

    def _reason_to_end(self, limit: float = IMPASSABLE) -> str:
        """Return the reason why the motion ends (an impassable pose, or divergence), or an empty string."""
        at = self.start
        if at.condition[0] > limit:
            return f"the pose is nearly singular: {near_singularity(at.loops.lay, at.q)}"
        if at.idle_reluctance[0] > limit:
            return "the given motion nearly blocks these coordinates there, so the forces do not determine their motion"
        speed = np.abs(self.yd / self.unit[self.idle]) / max(self.floor, 1.0) ** 0.5
        return f"it diverges, reaching {np.abs(self.yd).max():.3g} rad/s or m/s" if speed.max() > RUNAWAY else ""

    def _broken_off(self, reason: str) -> ScrewgaugeError:
        mechanism = self.motion.mechanism
        labels = [*mechanism.independent]
        names = ", ".join(f"'{labels[i]}'" for i in self.idle)
        where = mechanism.pose_text(self.start.q[0, mechanism.independent_columns])
        return SingularPoseError(
            f"the motion of {names}, which no actuator drives, breaks off at {where}: {reason}",
            f"t = {self.begin:g} s",
            "shorten the motion, or give these coordinates a motion",
        )


def _end(piece: Piece) -> tuple[Array, Array]:
    """Return coordinates and rates at the end of a piece. Shape (m,) each."""
    y, yd, _ = piece(np.array([piece.until]))
    return y[0], yd[0]


def _sums(h: Array, by: Rule) -> tuple[Array, Array, Array]:
    """Build integration matrices over pieces of given durations.

    Returns:
        Matrices that map accelerations at all points to rates and coordinates at all points, shape (n, n) each; and the
        time of each point since the start [s], shape (n,).
    """
    points, _, first, second = by
    s, ends = len(points), np.cumsum(h)
    after = (ends - h)[:, None] + h[:, None] * points
    once, twice = (np.zeros((len(h), s, len(h), s)) for _ in range(2))
    for p, duration in enumerate(h):
        once[p, :, p], twice[p, :, p] = duration * first, duration**2 * second
        once[p + 1 :, :, p] = duration * first[-1]
        later = (after[p + 1 :] - ends[p])[..., None]
        twice[p + 1 :, :, p] = duration**2 * second[-1] + later * duration * first[-1]
    n = len(h) * s
    return once.reshape(n, n), twice.reshape(n, n), after.ravel()
