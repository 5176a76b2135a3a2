"""How fast a forward scene is at its start, and how small an explicit method's steps must be for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.branch import Branch
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.forward import Forces, forward
from screwgauge.reference.kinematics import rates
from screwgauge.reference.pose import Layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.setting import EXPLICIT, Forward

#: A step h of DOP853 is stable for eigenvalues down to -6.3/h on the real axis and +-5.9i/h on the imaginary one.
REACH = 6.0
#: From so many steps on, all of them made only to stay stable, another method is worth while.
MANY = 1000
#: Relative step of central differences: the cube root of the rounding error.
DIFFERENCE = 2.0**-17


@dataclass(frozen=True, slots=True)
class Stiffness:
    """The fastest eigenvalue at the start [1/s], and the largest stable step of an explicit method [s]."""

    eigenvalue: complex
    step: float


def eigenvalues(lay: Layout, forces: Forces, start: Array, yd: Array) -> Array:
    """Eigenvalues of the linearised motion (y, yd) at a state [1/s]. Complex, shape (2 k,).

    Args:
        start, yd: Independent coordinates and their rates. Shape (k,).
    """
    k, state = len(start), np.concatenate([start, yd])
    size = DIFFERENCE * np.maximum(np.abs(state), 1.0)
    states = np.concatenate([state + np.diag(size), state - np.diag(size)])
    branch = Branch(lay, lay.mechanism.home)
    branch.move(start)
    rate = rates(lay, branch.poses(states[:, :k]), states[:, k:])
    slopes = np.concatenate([states[:, k:], forward(lay, rate, forces).ydd], axis=1)
    return np.asarray(np.linalg.eigvals((slopes[: 2 * k] - slopes[2 * k :]).T / (2.0 * size)))


def stiffness(lay: Layout, forces: Callable[[float], Forces], start: Forward) -> Stiffness:
    """The fastest eigenvalue at the start of a scene; none where poses beside the start do not exist."""
    try:
        found = eigenvalues(lay, forces(start.since), start.start, start.rates)
    except ScrewgaugeError:
        return Stiffness(0j, float("inf"))
    fastest = complex(found[np.argmax(np.abs(found))])
    if not fastest or not np.isfinite(fastest):
        return Stiffness(0j, float("inf"))
    return Stiffness(fastest, REACH / abs(fastest))


def stiff_warning(found: Stiffness, start: Forward, end: float) -> str:
    """A sentence if the method is explicit and stability alone asks for very many steps, else nothing."""
    steps = (end - start.since) / found.step
    if start.method.name not in EXPLICIT or steps < MANY:
        return ""
    return (
        f"The scene is stiff for {start.method.name}: its fastest eigenvalue at the start, "
        f"{_text(found.eigenvalue)} 1/s, bounds a stable step to about {found.step:.2g} s, "
        f"{steps:.2g} steps for the whole motion; use Radau or BDF."
    )


def _text(value: complex) -> str:
    """``-8117``, ``-20 +- 7.3i``."""
    if abs(value.imag) <= 1e-6 * abs(value):
        return f"{value.real:.3g}"
    return f"{value.real:.3g} +- {abs(value.imag):.3g}i"
