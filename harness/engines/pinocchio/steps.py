"""Fixed steps from Pinocchio's accelerations, brought back onto the closed loops after each."""

from __future__ import annotations

import numpy as np

from screwgauge.engines.pinocchio.mover import PinocchioMover
from screwgauge.engines.tree.forces import Exerted
from screwgauge.engines.tree.project import project
from screwgauge.engines.tree.protocol import BodyAt
from screwgauge.reference.rotations import Array

#: Its methods at a fixed step.
INTEGRATORS = ("Euler", "RK4")


class PinocchioStepper:
    """Semi-implicit Euler or RK4. See `screwgauge.engines.tree.protocol.Stepper`."""

    work = True
    closing: tuple[str, ...] = ()

    def __init__(self, mover: PinocchioMover, forces: Exerted, integrator: str, setting: str) -> None:
        self.mover, self.forces, self.setting = mover, forces, setting
        self.order = 1 if integrator == "Euler" else 4
        self.once = self._euler if integrator == "Euler" else self._rk4
        self.q = self.v = self.tau = np.zeros(mover.model.nv)

    def begin(self, t: float, q: Array, v: Array) -> None:
        self.q, self.v, self.tau = q, v, np.zeros_like(q)

    def walk(self, t: float, h: float, n: int) -> None:
        for i in range(n):
            found = project(self.mover, *self.once(t + i * h, h))
            self.q, self.v = found.q, found.v

    def state(self) -> tuple[Array, Array]:
        return self.q.copy(), self.v.copy()

    def accelerations(self, t: float) -> Array:
        return self._slope(t, self.q, self.v)

    def closing_forces(self) -> Array:
        return np.zeros(0)

    def notes(self) -> tuple[str, ...]:
        return ()

    def look(self, q: Array, v: Array) -> BodyAt:
        self.mover.place(q, v)
        return self.mover.body

    def _slope(self, t: float, q: Array, v: Array) -> Array:
        """Accelerations on the closed loops: beside them redundant rows contradict each other."""
        found = project(self.mover, q, v)
        self.forces.act(t, found.q, found.v, self.mover.body, self.tau)
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
