"""Pinocchio's proximal settings: mu over many decades, on loops of full rank and of deficient rank."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.rotations import Array
from screwgauge.study.stress.case import GOOD, Case, Finding, Rung

ITERATIONS = (1, 2, 5)
SAMPLES = 3
_NAME = "joint_acceleration"


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """States of a closed loop, what acts, and the true accelerations.

    Attributes:
        label: Follows the engine's name.
        parts: Model, data, constraint models and their data.
        q, v, tau: Shape (n, n_v).
        right: True joint accelerations. Shape (n, n_v).
    """

    label: str
    parts: tuple[Any, Any, Any, Any]
    q: Array
    v: Array
    tau: Array
    right: Array


def proximal() -> Case:
    """`constraintDynamics` over mu and the number of iterations."""
    return Case(
        name="proximal",
        title="Proximal settings of Pinocchio",
        axis="mu [1]",
        about=(
            "Accelerations by `constraintDynamics`. Full rank: the loaded default scene, twelve closure rows of rank "
            "twelve. Deficient: a planar four-bar closed by a 3D point, three rows of rank two, where mu = 0 divides "
            "by zero and returns NaN without a word. One iteration leaves an error ~ mu, k iterations ~ mu^k (1x, 2x, "
            "5x). Closing rows are off by exactly mu times the last change of the multipliers, which Pinocchio returns "
            "as `relative_residual`: so much is admitted. safe: the settings by which the harness integrates."
        ),
        drawn=_NAME,
        low=0.0,
        high=1e-2,
        full=(0.0, *(10.0**-k for k in range(14, 1, -1))),
        quick=(0.0, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2),
        rung=lambda mu, quick: Rung(mu, lambda: climb(mu)),
    )


def climb(mu: float) -> Iterator[Finding]:
    """Both loops at one mu, and with the settings by which the harness integrates, whatever mu."""
    from screwgauge.engines.pinocchio.mover import ITERATIONS as SAFE_ITERATIONS
    from screwgauge.engines.pinocchio.mover import MU as SAFE_MU
    from screwgauge.study.stress.driven.loaded import loaded, screw

    yield screw(loaded())
    for loop in (_full_rank(), _deficient()):
        for iterations in ITERATIONS:
            yield _measure(loop, f"{iterations}x", mu, iterations)
        yield _measure(loop, "safe", SAFE_MU, SAFE_ITERATIONS)


def _full_rank() -> Loop:
    from screwgauge.study.bench.contestants_pinocchio import contacts
    from screwgauge.study.stress.driven.loaded import loaded, pinocchio_given

    start = pinocchio_given(loaded())
    right = loaded().given(start.tree.coordinates)[2]
    return Loop("full rank", contacts(start), start.q, start.v, start.applied(), right)


def _deficient() -> Loop:
    from screwgauge.study.bench.four_bar import TORQUE, accelerations, make_model, states

    parts, (q, v) = make_model(), states(SAMPLES)
    tau = np.tile([TORQUE, 0.0, 0.0], (SAMPLES, 1))
    return Loop("deficient", parts, q, v, tau, accelerations(*parts[:2], q, v))


def _measure(loop: Loop, label: str, mu: float, iterations: int) -> Finding:
    import pinocchio as pin

    model, data, models, datas = loop.parts
    settings = pin.ProximalSettings(0.0, 0.0, mu, iterations)  # accuracy 0: all iterations are made
    found, change = np.empty_like(loop.q), np.empty(len(loop.q))
    clock = perf_counter()
    for i in range(len(found)):
        found[i] = pin.constraintDynamics(model, data, loop.q[i], loop.v[i], loop.tau[i], models, datas, settings)
        change[i] = settings.relative_residual
    seconds = perf_counter() - clock
    condition, lift = _rows(loop, mu)
    scale = float(np.abs(loop.right).max())
    error = float(np.abs(found - loop.right).max()) / scale  # NaN stays NaN
    admitted = float(np.fmax(GOOD, mu * change.max() * lift / scale))
    words = f"mu times the last change of the multipliers (relative_residual) admits {admitted:.1e}"
    return Finding(
        f"pinocchio {loop.label} {label}",
        _NAME,
        error,
        admitted,
        condition,
        seconds,
        words if error > GOOD else "",  # where it is not a number Pinocchio says nothing
    )


def _rows(loop: Loop, mu: float) -> tuple[float, float]:
    """Condition of ``D + mu``, D = J M^-1 J^T, and the norm of what turns residuals of rows into accelerations.

    That is ``M^-1 J^T D^+``; both at their worst.
    """
    import pinocchio as pin

    model, data, models, datas = loop.parts
    worst, lift, safe = 0.0, 0.0, pin.ProximalSettings(0.0, 0.0, 1e-10, 2)
    for q, v, tau in zip(loop.q, loop.v, loop.tau, strict=True):
        pin.constraintDynamics(model, data, q, v, tau, models, datas, safe)  # places the constraints
        upper = np.triu(pin.crba(model, data, q))
        pin.computeJointJacobians(model, data, q)
        J = pin.getConstraintsJacobian(model, data, models, datas)
        moved = np.linalg.solve(upper + np.triu(upper, 1).T, J.T)
        D = J @ moved
        worst = max(worst, float(linear.condition(D + mu * np.eye(len(D)))))
        lift = max(lift, float(np.linalg.norm(moved @ np.linalg.pinv(D, rcond=1e-10), ord=np.inf)))
    return worst, lift
