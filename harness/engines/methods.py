"""Methods of time integration, from scipy, and how a step is made anew that met a pose of unsafe accelerations."""

from __future__ import annotations

from scipy.integrate import BDF, DOP853, OdeSolver, Radau

from screwgauge.reference.errors import check_choice

#: DOP853 for smooth motion, the others for stiff springs and dampers.
METHODS: dict[str, type[OdeSolver]] = {"DOP853": DOP853, "Radau": Radau, "BDF": BDF}
#: More steps than this are not made anew: the motion does not lead through such poses, it leads there.
MOST = 100
#: Factors on the size of a step that met such a pose, one after the other.
SIZES = (0.8, 1.25, 0.65, 1.5, 0.5, 0.9, 1.1, 0.4, 0.3, 0.2)


def check_method(name: str) -> type[OdeSolver]:
    """The method of a name.

    Raises:
        UnknownNameError: There is none.
    """
    check_choice("method", [name], METHODS)
    return METHODS[name]
