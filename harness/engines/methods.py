"""Methods of time integration, from scipy, and how a step is made anew that met a pose of unsafe accelerations."""

from __future__ import annotations

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


class StagedDOP853(DOP853):  # type: ignore[misc]  # scipy has no types
    """scipy's method that asks for steps taken elsewhere first.

    Attributes:
        walk: Takes steps as far as it can and puts the solver there; whether there were any.
    """

    walk: Callable[[StagedDOP853], bool]

    def step(self) -> str | None:
        message: str | None = super().step()
        if self.status != "failed":
            self.t_old = self.t - self.h_previous
        return message

    def _step_impl(self) -> tuple[bool, str | None]:
        return (True, None) if self.walk(self) else super()._step_impl()


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
