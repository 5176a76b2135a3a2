"""Simple integration steps with an open-tree engine's accelerations; each new state is projected onto the loops."""

from __future__ import annotations

import numpy as np

from screwgauge.engines.tree.applied_forces import TreeForces
from screwgauge.engines.tree.closed_states import project
from screwgauge.engines.tree.protocol import Mover
from screwgauge.reference.rotations import Array


class ProjectedStepper:
    """Stepper that uses semi-implicit Euler or RK4 with an engine's accelerations, and projects each state onto the
    loops.

    See `screwgauge.engines.tree.protocol.Stepper`.
    """

    work = True
    closing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __init__(self, mover: Mover, forces: TreeForces, integrator: str, dt: float) -> None:
        """Prepare the steps; `integrator` is one of `INTEGRATORS`."""
        name = "semi-implicit Euler" if integrator == "Euler" else integrator
        self.mover, self.forces, self.setting = mover, forces, f"{name} with projection, dt {dt:g} s"
        self.order = 1 if integrator == "Euler" else 4
        self.once = self._euler if integrator == "Euler" else self._rk4
        self.q = self.v = self.tau = np.zeros(len(mover.tree.coordinates))

    def begin(self, t: float, q: Array, v: Array) -> None:
        self.q, self.v, self.tau = q, v, np.zeros_like(q)

    def walk(self, t: float, h: float, n: int) -> tuple[Array, Array]:
        for i in range(n):
            self.q, self.v, _ = project(self.mover, *self.once(t + i * h, h))
        return self.q.copy(), self.v.copy()

    def accelerations(self, t: float) -> tuple[Array, Array]:
        return self._slope(t, self.q, self.v), np.zeros(0)

    def _slope(self, t: float, q: Array, v: Array) -> Array:
        """Return accelerations at the projected state, because redundant rows contradict each other in open loops."""
        q, v, _ = project(self.mover, q, v)
        self.forces.act(t, q, v, self.mover.body, self.tau)
        return self.mover.accelerate(self.tau)

    def _euler(self, t: float, h: float) -> tuple[Array, Array]:
        v = self.v + h * self._slope(t, self.q, self.v)
        return self.q + h * v, v

    def _rk4(self, t: float, h: float) -> tuple[Array, Array]:
        q, v, half = self.q, self.v, 0.5 * h
        a1 = self._slope(t, q, v)
        v2 = v + half * a1
        a2 = self._slope(t + half, q + half * v, v2)
        v3 = v + half * a2
        a3 = self._slope(t + half, q + half * v2, v3)
        v4 = v + h * a3
        a4 = self._slope(t + h, q + h * v3, v4)
        return q + h / 6.0 * (v + 2.0 * (v2 + v3) + v4), v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
