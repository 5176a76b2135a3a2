"""Checks of a simulation before any engine runs: home pose, start, stiffness. For given motions, see `preflight`."""

from __future__ import annotations

import numpy as np

from screwgauge.models.home import check_home
from screwgauge.problem import InitialValue
from screwgauge.reference.applied import Applied
from screwgauge.reference.closed.assembly_mode import BranchPose, positions
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.errors import DescriptionError, JointLimitError, ScrewgaugeError
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.resistance import without_resistance
from screwgauge.reference.rotations import Array
from screwgauge.scene.preflight import FARTHEST, beyond_limits, check_regular
from screwgauge.scene.scene import Scene

EXPLICIT = ("DOP853",)
#: DOP853 with step h is stable for eigenvalues down to -6.3/h on the real axis and +-5.9i/h on the imaginary axis.
REACH = 6.0
#: Number of steps needed for stability alone above which a different method is worthwhile.
MANY = 1000
#: Relative step of central differences: the cube root of the rounding error.
DIFFERENCE = 2.0**-17


def check_start(scene: Scene) -> tuple[Layout, tuple[str, ...]]:
    """Reject an impossible initial state, and warn about a stiff scene.

    Returns:
        The layout of the mechanism, and warnings to show.

    Raises:
        ScrewgaugeError: The loops do not close at the home pose or at the start, the start exceeds a limit, or the
            inertia matrix is singular.
    """
    lay, task, mechanism = check_home(scene.mechanism), scene.start, scene.mechanism
    if len(task.grid) < 2:
        what = f"the only time, {task.since:g} s, is the start"
        raise DescriptionError(what, "times", "add later times")
    away = np.abs(task.start - mechanism.home[mechanism.independent_columns])
    if not away.max(initial=0.0) <= FARTHEST:
        k = int(away.argmax())
        unit = mechanism.units[mechanism.independent_columns[k]]
        what = f"the start is {away[k]:.3g} {unit} away from the home pose"
        raise DescriptionError(what, scene.name, f"start within {FARTHEST:g} (rad or m) of home, or check the units")
    since = np.array([task.since])
    q = positions(lay, task.start[None], since)
    check_regular(lay, q, since, task.start[None])
    if beyond := beyond_limits(mechanism, q):
        where, remedy = "start of the scene", "change the start or widen the limits"
        raise JointLimitError(f"joint coordinate {beyond[1]}", where, remedy)
    motion_at(lay, q, task.rates[None], applied=scene.applied, t=task.since).check()
    return lay, tuple(filter(None, [stiff_warning(stiffness(lay, scene.applied, task), task)]))


def eigenvalues(lay: Layout, applied: Applied, start: Array, yd: Array, t: float = 0.0) -> Array:
    """Return the eigenvalues of the linearised motion (y, yd) at a state [1/s]. Complex, shape (2 k,).

    Args:
        start, yd: Independent coordinates and their rates. Shape (k,).
        t: Time at which motor forces are evaluated [s].
    """
    k, state = len(start), np.concatenate([start, yd])
    size = DIFFERENCE * np.maximum(np.abs(state), 1.0)
    states = np.concatenate([state + np.diag(size), state - np.diag(size)])
    branch = BranchPose(lay, lay.mechanism.home)
    branch.move(start)
    at = motion_at(lay, branch.joints(states[:, :k]), states[:, k:], applied=applied, t=t)
    slopes = np.concatenate([states[:, k:], at.ydd], axis=1)
    return np.asarray(np.linalg.eigvals((slopes[: 2 * k] - slopes[2 * k :]).T / (2.0 * size)))


def stiffness(lay: Layout, applied: Applied, task: InitialValue) -> complex:
    """Return the fastest eigenvalue at the start [1/s]; 0 if the loops do not close near the start.

    Dry friction is omitted, because it is discontinuous at rest.
    """
    smooth = without_resistance(lay.mechanism, "friction")
    lay = lay if smooth is lay.mechanism else layout(smooth)
    try:
        fastest = complex(max(eigenvalues(lay, applied, task.start, task.rates, task.since), key=abs))
    except ScrewgaugeError:
        return 0j
    return fastest if np.isfinite(fastest) else 0j


def stiff_warning(fastest: complex, task: InitialValue) -> str:
    """Warn if an explicit method needs very many steps for stability alone; otherwise return an empty string.

    Args:
        fastest: The fastest eigenvalue at the start [1/s].
    """
    step = REACH / abs(fastest) if fastest else np.inf
    method, steps = task.integration.name, (float(task.t[-1]) - task.since) / step
    if method not in EXPLICIT or steps < MANY:
        return ""
    turning = f" +- {abs(fastest.imag):.3g}i" if abs(fastest.imag) > 1e-6 * abs(fastest) else ""
    return (
        f"The scene is stiff for {method}: its fastest eigenvalue at the start, {fastest.real:.3g}{turning} 1/s, "
        f"limits a stable step to about {step:.2g} s, i.e. {steps:.2g} steps for the whole motion; use Radau or BDF."
    )
