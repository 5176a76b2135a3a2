"""Integrators of scipy, and how a step is retried whose accelerations proved unreliable."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sized

from scipy.integrate import BDF, DOP853, DenseOutput, OdeSolver, Radau

from screwgauge.reference.errors import check_choice
from screwgauge.reference.rotations import Array

#: DOP853 for smooth motion, the others for stiff springs and dampers.
METHODS: dict[str, type[OdeSolver]] = {"DOP853": DOP853, "Radau": Radau, "BDF": BDF}
#: More steps than this are not made anew: the motion does not lead through such poses, it leads there.
MOST = 100
#: Factors on the size of a step that met such a pose, one after the other.
SIZES = (0.8, 1.25, 0.65, 1.5, 0.5, 0.9, 1.1, 0.4, 0.3, 0.2)

#: Order of the error by which a method chooses its steps: an error of `tol` asks for steps of tol^(1/order) of the time
#: in which the motion changes. BDF, whose order varies, is taken for the lower one of the two.
ORDER = {"DOP853": 8, "Radau": 4, "BDF": 4}
#: However fast a phase of the motion is, it is over after the steps for so many of such times.
PHASES = 10.0
#: More steps than these take the better part of an hour. The fastest phases of `cart-pole` foretell 2e4 of them.
ENDLESS = 1e6


class Pace:
    """Distinguishes steps that have shrunk for good from those of a fast phase of the motion, at any size of either.

    Next to some singular poses accelerations vary with rounding, or with what an engine regularises, over ways that no
    motion has: the error is within tolerance only in steps so short that they lead nowhere, and nothing ends them.
    """

    def __init__(self, method: str, tolerance: float, end: float) -> None:
        """Watches the steps of a method with a tolerance until the `end` of the motion [s]."""
        self.end, self.window = end, int(PHASES * tolerance ** (-1.0 / ORDER[method]))
        self.times: deque[float] = deque(maxlen=self.window)

    def endless(self, t: float) -> bool:
        """Takes the time that a step has reached [s]: whether steps as those before it would never reach the end."""
        self.times.append(t)
        return len(self.times) == self.window and (t - self.times[0]) * ENDLESS < (self.end - t) * self.window


def check_method(name: str) -> type[OdeSolver]:
    """The method of a name.

    Raises:
        UnknownNameError: There is none.
    """
    check_choice("method", [name], METHODS)
    return METHODS[name]


def keep_passed(
    solver: OdeSolver, between: DenseOutput, times: Array, kept: Sized, keep: Callable[[float, Array], None]
) -> None:
    """Keeps the motion at all wanted times, of which `kept` has the first ones, that the last step passed."""
    while len(kept) < len(times) and times[len(kept)] <= solver.t:
        t = float(times[len(kept)])
        keep(t, solver.y if t == solver.t else between(t))
