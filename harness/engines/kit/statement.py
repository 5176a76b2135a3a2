"""Check the shapes of the arrays that an engine supplies, and check derivatives by finite differences.

Arrays are checked once, at the home pose. Without this check, a fault would only show later, as loops that do not
close.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from screwgauge.engines.kit.answers import at_samples
from screwgauge.problem import GivenMotion, Problem
from screwgauge.quantities import stages
from screwgauge.reference.applied import Applied
from screwgauge.reference.mechanism import GROUND, Mechanism
from screwgauge.reference.rotations import Array, vee

if TYPE_CHECKING:
    from screwgauge.engines.kit.closing import Placement
    from screwgauge.engines.kit.constrained import Constrained

#: Step of finite differences, in units of x.
STEP = 1e-5
#: Allowed error of a derivative relative to the largest rate, and lower bound of the largest rate: finite differences
#: have nine digits in common with a correct derivative, and none with a wrong derivative.
OFF, LEAST = 1e-4, 1e-4


def check_statement(engine: Constrained, problem: Problem) -> None:
    """Reject an engine whose arrays are inconsistent at the home pose; checks only arrays that the problem needs.

    Raises:
        ValueError: An array has the wrong shape, is not finite, or is not the required derivative. It is not a
            `ScrewgaugeError`, with which engines reject mechanisms, because the engine itself is wrong.
    """
    x, n_x, m = np.asarray(engine.home), np.size(engine.home), np.size(engine.gap_units)
    _check_arrays("", {"home": (x, (n_x,)), "units": (engine.units, (n_x,)), "gap_units": (engine.gap_units, (m,))})
    _check_rows(engine.rows, engine.mechanism, m)
    at, b = engine.place(x[None].copy()), len(engine.mechanism.bodies) + 1
    poses = {"R": (at.R, (1, b, 3, 3)), "p": (at.p, (1, b, 3)), "T": (at.T, (1, b, 6, n_x))}
    _check_arrays("place: ", poses | {"gaps": (at.gaps, (1, m)), "G": (at.G, (1, m, n_x))})
    v, depth = _direction(engine, at), stages(problem.wanted)
    beside = engine.place((x - STEP * v)[None]), engine.place((x + STEP * v)[None])
    _check_derivatives(engine, at, v, beside)
    if depth in "af":
        _check_bias(engine, x, v, beside)
    if depth == "f" or "mass_matrix" in problem.wanted:
        task, first = problem.task, at_samples(problem.applied, np.array([0]))
        _check_dynamics(engine, x, v, first.at(task.t[:1]) if isinstance(task, GivenMotion) else first)


def _pair(found: object, method: str, names: str) -> tuple[Array, Array]:
    """Return the two arrays that a method returned; reject anything else."""
    if not isinstance(found, tuple) or len(found) != 2:
        raise ValueError(f"{method} must return two arrays: {names}")
    return found


def _check_arrays(method: str, arrays: Mapping[str, tuple[ArrayLike, tuple[int, ...]]]) -> None:
    for name, (array, shape) in arrays.items():
        if np.shape(array) != shape:
            raise ValueError(f"{method}{name} must have shape {shape}, got {np.shape(array)}")
        if not np.isfinite(np.asarray(array, dtype=float)).all():
            raise ValueError(f"{method}{name} must be finite at the home pose")


def _check_rows(rows: Sequence[Sequence[int]], mechanism: Mechanism, m: int) -> None:
    if len(rows) != len(mechanism.joints):
        raise ValueError(f"rows must list the gaps of {len(mechanism.joints)} joints, got {len(rows)}")
    named = [row for some in rows for row in some]
    if len({*named}) != len(named) or not {*named} <= {*range(m)}:
        raise ValueError(f"rows must contain numbers from 0 to {m - 1}, each at most once")


def _direction(engine: Constrained, at: Placement) -> Array:
    """Return rates of x that keep closed all gaps that belong to no joint; such gaps relate redundant coordinates."""
    units = np.asarray(engine.units, dtype=float)
    v = units * np.cos(1.0 + 2.4 * np.arange(len(units)))
    own = [row for row in range(at.G.shape[1]) if row not in {row for some in engine.rows for row in some}]
    inner = at.G[0, own] * units
    return np.asarray(v - units * (np.linalg.pinv(inner) @ (inner @ (v / units))))


def _check_derivatives(engine: Constrained, at: Placement, v: Array, beside: tuple[Placement, Placement]) -> None:
    before, after = beside
    names = [GROUND, *(body.name for body in engine.mechanism.bodies)]
    V, change = (at.T @ v)[0], (after.R - before.R)[0] / (2.0 * STEP)
    turning, moving = vee(change @ at.R[0].swapaxes(1, 2)), (after.p - before.p)[0] / (2.0 * STEP)
    _check_same("place, T", V[:, :3], turning, "its first three rows are not the angular velocity of R", names)
    _check_same("place, T", V[:, 3:], moving, "its last three rows are not the velocity of p", names)
    units, joints = np.asarray(engine.gap_units), _gap_names(engine)
    opening = (after.gaps - before.gaps)[0] / (2.0 * STEP)
    _check_same(
        "place, G", (at.G @ v)[0] / units, opening / units, "it is not the derivative of the gaps", joints, "{}"
    )


def _check_bias(engine: Constrained, x: Array, v: Array, beside: tuple[Placement, Placement]) -> None:
    gaps, bodies = _pair(
        engine.bias(x[None].copy(), v[None]), "bias", "second derivatives of the gaps and body accelerations"
    )
    before, after = beside
    m, b = before.gaps.shape[1], before.p.shape[1]
    _check_arrays("bias: ", {"the first array": (gaps, (1, m)), "the second array": (bodies, (1, b, 6))})
    units = np.asarray(engine.gap_units)
    curve = ((after.G - before.G) @ v)[0] / (2.0 * STEP) / units
    what = "its first array is not the derivative of G along xd, times xd"
    _check_same("bias", gaps[0] / units, curve, what, _gap_names(engine), "{}")
    names = [GROUND, *(body.name for body in engine.mechanism.bodies)]
    rest = ((after.T - before.T) @ v)[0] / (2.0 * STEP)
    _check_same("bias", bodies[0], rest, "its second array is not the derivative of T along xd, times xd", names)


def _check_dynamics(engine: Constrained, x: Array, v: Array, applied: Applied) -> None:
    M, f = _pair(engine.dynamics(x[None].copy(), v[None], applied), "dynamics", "M and f")
    _check_arrays("dynamics: ", {"M": (M, (1, len(x), len(x))), "f": (f, (1, len(x)))})
    numbers = [str(i) for i in range(len(x))]
    _check_same("dynamics, M", M[0], M[0].T, "it is not symmetric", numbers, "number {} of x")


def _gap_names(engine: Constrained) -> list[str]:
    """Return a phrase for each gap that names its joint, if any."""
    names = [f"gap {row}, which belongs to no joint" for row in range(np.size(engine.gap_units))]
    for joint, rows in zip(engine.mechanism.joints, engine.rows, strict=True):
        for row in rows:
            names[row] = f"gap {row}, of joint '{joint.name}'"
    return names


def _check_same(
    method: str, found: Array, right: Array, what: str, names: Sequence[str], of: str = "body '{}'"
) -> None:
    """Reject values that differ from the expected values; both arrays have one row per name."""
    away = np.abs(found - right).reshape(len(names), -1).max(axis=1, initial=0.0)
    size, most = max(np.abs(some).max(initial=LEAST) for some in (found, right)), away.max(initial=0.0)
    if most > OFF * size:
        raise ValueError(f"{method}: {what}; the largest error is {most:.2g}, at {of.format(names[away.argmax()])}")
