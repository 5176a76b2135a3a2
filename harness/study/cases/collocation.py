"""A reference for stiff motion: Radau collocation of high order, all stages of a step evaluated at once.

Ten stages have order nineteen and damp what is too fast for the step, so that few steps reach rounding; nothing is
shared with the integrators that are measured.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre

from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array

STAGES = 10
MOST = 40  # iterations of the simplified Newton method
CLOSE = 1e-13  # change of the last iteration, relative to each component's largest value
DIFFERENCE = 2.0**-17  # of central differences: the cube root of the rounding error

Slope = Callable[[Array], Array]
"""Derivatives of states, one a row. Shape (n, m) -> (n, m)."""


@lru_cache(maxsize=4)
def tableau(stages: int) -> tuple[Array, Array]:
    """Nodes in (0, 1], shape (s,), and weights of Radau IIA, shape (s, s)."""
    ends = np.zeros(stages + 1)
    ends[stages - 1 :] = [-1.0, 1.0]
    x = np.sort(legendre.legroots(ends).real)
    x[-1] = 1.0
    values = legendre.legvander(x, stages - 1)
    integrals = np.column_stack([0.5 * legendre.legval(x, legendre.legint(row, lbnd=-1)) for row in np.eye(stages)])
    return 0.5 * (1.0 + x), integrals @ np.linalg.inv(values)


def collocate(slope: Slope, state: Array, times: Array) -> Array:
    """Integrates an autonomous system with one step from each time to the next.

    Args:
        state: At the first time. Shape (m,).
        times: Increasing. Shape (n,).

    Returns:
        States. Shape (n, m).

    Raises:
        ScrewgaugeError: A step does not converge.
    """
    found = [np.asarray(state, dtype=float)]
    largest = np.abs(found[0])
    for t, h in zip(times, np.diff(times), strict=False):
        found.append(_step(slope, found[-1], float(h), largest=largest, t=float(t)))
        largest = np.maximum(largest, np.abs(found[-1]))
    return np.array(found)


def _step(slope: Slope, state: Array, h: float, *, largest: Array, t: float) -> Array:
    A, m = tableau(STAGES)[1], len(state)
    size = DIFFERENCE * np.maximum(np.abs(state), 1.0)
    slopes = slope(np.concatenate([state + np.diag(size), state - np.diag(size)]))
    J = ((slopes[:m] - slopes[m:]) / (2.0 * size[:, None])).T
    inverse = np.linalg.inv(np.eye(STAGES * m) - h * np.kron(A, J))
    Y = np.tile(state, (STAGES, 1))
    last = np.inf
    for _ in range(MOST):
        left = state + h * (A @ slope(Y)) - Y
        change = (inverse @ left.ravel()).reshape(Y.shape)
        Y = Y + change
        # what has died away is measured by what it was
        scale = np.maximum(np.abs(Y).max(axis=0), 1e-3 * largest).clip(1e-300)
        relative = float((np.abs(change).max(axis=0) / scale).max())
        if relative < CLOSE or (relative < 1e-9 and relative > 0.5 * last):  # down to rounding
            return np.asarray(Y[-1])
        last = relative
    raise ScrewgaugeError(
        f"a step of {h:g} s does not converge ({last:.1e} is left)", f"t = {t:g} s", "take shorter steps"
    )
