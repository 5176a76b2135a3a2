"""Methods of time integration, from scipy, and how a step is made anew that met a pose of unsafe accelerations."""

from __future__ import annotations

from collections.abc import Callable, Sized

import numpy as np
from scipy.integrate import BDF, DOP853, DenseOutput, OdeSolver, Radau

from screwgauge.reference.errors import check_choice
from screwgauge.reference.rotations import Array

#: DOP853 for smooth motion, the others for stiff springs and dampers.
METHODS: dict[str, type[OdeSolver]] = {"DOP853": DOP853, "Radau": Radau, "BDF": BDF}
#: More steps than this are not made anew: the motion does not lead through such poses, it leads there.
MOST = 100
#: Factors on the size of a step that met such a pose, one after the other.
SIZES = (0.8, 1.25, 0.65, 1.5, 0.5, 0.9, 1.1, 0.4, 0.3, 0.2)
#: How a step of DOP853 follows its error: Hairer, Norsett and Wanner, section II.4.
SHRINK, GROW, SAFETY = 0.2, 10.0, 0.9


class StagedDOP853(DOP853):  # type: ignore[misc]  # scipy has no types
    """scipy's method with all stages of a step computed at once.

    Attributes:
        stages: (t, state, its slope, size) -> slopes at all stages, the last at the end; None to go one by one.
    """

    stages: Callable[[float, Array, Array, float], Array | None]
    t: float
    h_abs: float
    y: Array
    f: Array

    def _step_impl(self) -> tuple[bool, str | None]:
        t, y = self.t, self.y
        smallest, rejected = 10.0 * (np.nextafter(t, np.inf) - t), False
        self.h_abs = max(self.h_abs, smallest)
        while self.h_abs >= smallest:
            t_new = min(t + self.h_abs, self.t_bound)
            h = t_new - t
            slopes = self.stages(t, y, self.f, h)
            if slopes is None:
                return super()._step_impl()  # type: ignore[no-any-return]
            y_new = y + h * (self.B @ slopes[:-1])
            scale = self.atol + np.maximum(np.abs(y), np.abs(y_new)) * self.rtol
            error = self._estimate_error_norm(slopes, h, scale)
            factor = SAFETY * error**self.error_exponent if error else GROW
            if error < 1.0:
                self.h_abs = h * min(factor, 1.0 if rejected else GROW)
                self.K[:], self.f = slopes, slopes[-1].copy()
                self.h_previous, self.y_old, self.t, self.y = h, y, t_new, y_new
                return True, None
            self.h_abs, rejected = h * max(SHRINK, factor), True
        return False, self.TOO_SMALL_STEP


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
