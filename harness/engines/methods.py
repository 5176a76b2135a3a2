"""SciPy's integrators, retries after unreliable accelerations, and detectors of motions that get stuck."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence, Sized

import numpy as np
from scipy.integrate import BDF, DOP853, DenseOutput, OdeSolver, Radau
from scipy.optimize import brentq

from screwgauge.reference.errors import check_choice
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.resistance import DRY, REST, resistances
from screwgauge.reference.rotations import Array

#: DOP853 for smooth motion, the others for stiff springs and dampers.
METHODS: dict[str, type[OdeSolver]] = {"DOP853": DOP853, "Radau": Radau, "BDF": BDF}
#: Largest number of retried steps; a motion that needs more ends at a pose with unreliable accelerations.
MOST = 100
#: Factors applied in turn to the size of a step that met such a pose.
SIZES = (0.8, 1.25, 0.65, 1.5, 0.5, 0.9, 1.1, 0.4, 0.3, 0.2)

#: Order of the error estimate with which a method chooses its steps: an error of `tol` needs steps of tol^(1/order)
#: times the time scale of the motion. For BDF, whose order varies, a low order is assumed.
ORDER = {"DOP853": 8, "Radau": 4, "BDF": 4}
#: Longest duration of a fast phase of the motion, as a multiple of the time scale of the motion.
PHASES = 10.0
#: More steps than this take most of an hour. The fastest phases of `cart-pole` predict 2e4 steps.
ENDLESS = 1e6


class Pace:
    """Detector of steps that stay short forever, as opposed to a fast phase of the motion.

    Near some singular poses, rounding or an engine's regularisation makes accelerations vary over distances far shorter
    than those that any motion covers. The error is then within tolerance only for steps so short that the integration
    makes no progress.
    """

    def __init__(self, method: str, tolerance: float, end: float) -> None:
        """Watch the steps of a method with a given tolerance until the `end` of the motion [s]."""
        self.end, self.window = end, int(PHASES * tolerance ** (-1.0 / ORDER[method]))
        self.times: deque[float] = deque(maxlen=self.window)

    def endless(self, t: float) -> bool:
        """Record the time [s] reached by a step; return True if steps this short would never reach the end."""
        self.times.append(t)
        return len(self.times) == self.window and (t - self.times[0]) * ENDLESS < (self.end - t) * self.window


#: Rates on both sides of rest at which friction is examined [rad/s or m/s], and the interval [s] over which rates
#: are followed to estimate their accelerations.
BESIDE, MOMENT = 1e3 * REST, 1e-6
#: Derivative of a coordinate's rate with respect to the rates of the state below which the coordinate is at a dead
#: centre, where it reverses without sticking.
DEAD = 1e-6

State = tuple[float, Array]
"""Time, and an array of the coordinates, their rates and the work, of shape (2 n + 1,)."""


def interpolate_linearly(before: State, after: State) -> Callable[[float], Array]:
    """Interpolate a step linearly between its ends."""
    (begin, first), (end, last) = before, after
    return lambda t: first + (t - begin) / (end - begin) * (last - first)


class DryFriction:
    """Detector of joints that come to rest and stick, which a rate-dependent friction law cannot describe.

    A joint sticks if friction decelerates it on both sides of rest.
    """

    def __init__(
        self, joints: tuple[Joint, ...], rates: Callable[[Array, Sequence[str]], Array], slope: Callable[..., Array]
    ) -> None:
        """Watch the coordinates with dry friction.

        Args:
            rates: Reads the rates of named coordinates, shape (m,), from a state.
            slope: Returns the derivative of the state, shape (2 n + 1,), at a time and state.
        """
        self.names = [one.coordinate for one in resistances(joints, DRY)]
        self._rates, self._slope = rates, slope

    def holds(self, before: State, after: State, between: Callable[[float], Array]) -> str:
        """Return why the motion cannot continue over a step; empty if it can.

        Args:
            between: Returns the state at a time within the step.
        """
        if not self.names or not np.isfinite([before[1], after[1]]).all():
            return ""
        ends = [self._rates(state, self.names) for _, state in (before, after)]
        signs = [np.sign(rates) * (np.abs(rates) > REST) for rates in ends]
        for c in np.flatnonzero(signs[0] != signs[1]).tolist():
            t = after[0] if abs(ends[1][c]) < abs(ends[0][c]) else before[0]
            if signs[0][c] * signs[1][c] < 0:
                t = float(brentq(lambda t, c=c: self._rates(between(t), self.names)[c], before[0], after[0]))
            still = between(t)
            row = self._row(still, c)
            if row @ row < DEAD**2:
                continue
            way = row / float(row @ row)  # the smallest change that increases the rate by one
            if all(side * self._acceleration(t, still + side * BESIDE * way, c) <= 0 for side in (1, -1)):
                return f"'{self.names[c]}' comes to rest at {t:.6g} s, and its dry friction holds it there"
        return ""

    def _row(self, state: Array, c: int) -> Array:
        """Return the gradient of a coordinate's rate in the state, nonzero only for the state's rates. (2 n + 1,)."""
        n, row = len(state) // 2, np.zeros_like(state)
        for i, unit in enumerate(np.eye(n), n):
            row[i] = self._rates(np.concatenate([state[:n], unit, state[-1:]]), self.names)[c]
        return row

    def _acceleration(self, t: float, state: Array, c: int) -> float:
        change = MOMENT * self._slope(t, state)
        later, earlier = (self._rates(state + sign * change, self.names)[c] for sign in (1.0, -1.0))
        return float(later - earlier) / (2.0 * MOMENT)


def check_method(name: str) -> type[OdeSolver]:
    """Return the integration method with a given name.

    Raises:
        UnknownNameError: No method has this name.
    """
    check_choice("method", [name], METHODS)
    return METHODS[name]


def keep_passed(
    solver: OdeSolver, between: DenseOutput, times: Array, kept: Sized, keep: Callable[[float, Array], None]
) -> None:
    """Store the motion at the output times that the last step passed; `kept` counts the stored samples."""
    while len(kept) < len(times) and times[len(kept)] <= solver.t:
        t = float(times[len(kept)])
        keep(t, solver.y if t == solver.t else between(t))
