"""The loop equations of a reading: how far closures and couplings are open in a state, and Newton's method on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.models.importing.motion import Placed, State, at_home, exponential, length_of, place, unit_screws
from screwgauge.models.readings.reading import ClosureReading, Reading
from screwgauge.reference.rotations import Array, cross, rotation_vector

#: Residual that counts as closed [rad or lengths of the model]; descriptions are held to 1e-9.
CLOSED = 1e-11
STEPS = 100
STUCK = 8  # steps without a gain of a hundredth: it ends there
LARGEST = 0.4  # step [rad or lengths]


@dataclass(frozen=True, eq=False)
class Loops:
    """The loop equations of a reading, lengths counted in lengths of the model."""

    reading: Reading

    @cached_property
    def length(self) -> float:
        """Unit of distances [m]."""
        return length_of(self.reading)

    @cached_property
    def size(self) -> Array:
        """Unit of each velocity: 1 for angles, the model's length for distances. Shape (n,)."""
        units = [np.where(unit_screws(j)[:, :3].any(axis=1), 1.0, self.length) for j in self.reading.joints.values()]
        return np.concatenate([np.ones(0), *units])

    @cached_property
    def closing(self) -> Array:
        """1 for the velocities that some loop or coupling depends on, else 0. Shape (n,)."""
        carries = place(self.reading, at_home(self.reading)).carries
        out, freedoms = np.zeros(len(self.size)), self.reading.freedoms
        for closure in self.reading.closures.values():
            out += np.abs(carries[closure.second] - carries[closure.first])
        for coupling in self.reading.couplings.values():
            for joint in filter(None, (coupling.joint, coupling.of)):
                out[freedoms[joint]] = 1.0
        return np.minimum(out, 1.0)

    def residuals(self, state: State) -> dict[str, Array]:
        """How far each closure and coupling is open [rad or lengths]: 3, 6 or 1 numbers."""
        return self._evaluate(place(self.reading, state), state)[0]

    def gaps(self, state: State, least: float) -> list[str]:
        """How far closures and couplings that are open are so, in words, the widest first."""
        found = {name: r for name, r in self.residuals(state).items() if np.abs(r).max() > least}
        return [self._gap(name, found[name]) for name in sorted(found, key=lambda name: -np.abs(found[name]).max())]

    def _gap(self, name: str, r: Array) -> str:
        if len(r) > 1:
            gaps = {"rad": float(np.linalg.norm(r[:-3])), "m": float(np.linalg.norm(r[-3:]))}
            said = [
                f"{gap * (self.length if unit == 'm' else 1.0):.2g} {unit}"
                for unit, gap in gaps.items()
                if gap > CLOSED
            ]
            return f"'{name}' by {' and '.join(said)}"
        slides = self.reading.joints[self.reading.couplings[name].joint].kind == "slide"
        return f"'{name}' by {abs(r[0]) * self.length:.2g} m" if slides else f"'{name}' by {abs(r[0]):.2g} rad"

    def system(self, state: State) -> tuple[Array, Array]:
        """All residuals and their derivative by the velocities, without dimension. Shapes (m,), (m, n)."""
        residuals, rows = self._evaluate(place(self.reading, state), state)
        n = len(self.size)
        r = np.concatenate([np.zeros(0), *residuals.values()])
        return r, np.concatenate([np.zeros((0, n)), *rows.values()]) * self.size

    def _evaluate(self, placed: Placed, state: State) -> tuple[dict[str, Array], dict[str, Array]]:
        residuals, rows = {}, {}
        for name, closure in self.reading.closures.items():
            residuals[name], rows[name] = self._closure(closure, placed)
        freedoms, joints = self.reading.freedoms, self.reading.joints
        for name, coupling in self.reading.couplings.items():
            p = np.polynomial.Polynomial(coupling.polynomial)
            row, x = np.zeros((1, len(self.size))), state.values.get(coupling.of, 0.0)
            row[0, freedoms[coupling.joint]] = 1.0
            if coupling.of:
                row[0, freedoms[coupling.of]] -= p.deriv()(x)
            unit = self.length if joints[coupling.joint].kind == "slide" else 1.0
            residuals[name] = np.array([state.values[coupling.joint] - p(x)]) / unit
            rows[name] = row / unit
        return residuals, rows

    def _closure(self, closure: ClosureReading, placed: Placed) -> tuple[Array, Array]:
        T1 = placed.poses[closure.first] @ closure.first_frame
        T2 = placed.poses[closure.second] @ closure.second_frame
        moves = placed.carries[closure.second] - placed.carries[closure.first]
        S = placed.screws * moves[:, None]
        # the velocity of each side's own point, as far as it is moved at all
        at1, at2 = T1[:3, 3], T2[:3, 3]
        by1, by2 = placed.carries[closure.first][:, None], placed.carries[closure.second][:, None]
        v = by2 * (placed.screws[:, 3:] + cross(placed.screws[:, :3], np.tile(at2, (len(S), 1))))
        v = v - by1 * (placed.screws[:, 3:] + cross(placed.screws[:, :3], np.tile(at1, (len(S), 1))))
        shift, rows = (at2 - at1) / self.length, v.T / self.length
        if closure.kind == "point":
            return shift, rows
        return np.concatenate([rotation_vector(T2[:3, :3] @ T1[:3, :3].T), shift]), np.vstack([S[:, :3].T, rows])

    def stepped(self, state: State, step: Array) -> State:
        """A state after a step of all velocities without dimension, shape (n,)."""
        values, displaced, step = dict(state.values), dict(state.displaced), step * self.size
        for name, part in self.reading.freedoms.items():
            if name in values:
                values[name] += float(step[part][0])
                continue
            T = displaced[name]
            for screw, amount in zip(unit_screws(self.reading.joints[name]), step[part], strict=True):
                T = exponential(screw, float(amount)) @ T
            displaced[name] = T
        return State(values, displaced)

    def newton(self, state: State) -> tuple[State, float]:
        """Closes the loops from a state by the shortest steps (Levenberg-Marquardt).

        Returns:
            The state reached and its largest residual.
        """
        r, J = self.system(state)
        damping, stuck = 1e-3, 0
        for _ in range(STEPS):
            error = float(np.abs(r).max(initial=0.0))
            if error <= CLOSED or damping > 1e6 or stuck > STUCK:
                break
            U, s, Vt = np.linalg.svd(J, full_matrices=False)
            step = -Vt.T @ (s / (s * s + damping * min(float(r @ r), 1.0) + 1e-16) * (U.T @ r))
            step *= min(1.0, LARGEST / max(float(np.abs(step).max(initial=0.0)), 1e-300))
            trial = self.stepped(state, step)
            r_trial, J_trial = self.system(trial)
            if r_trial @ r_trial < r @ r:
                stuck = stuck + 1 if r_trial @ r_trial > 0.99 * (r @ r) else 0
                state, r, J, damping = trial, r_trial, J_trial, damping / 10.0
            else:
                damping, stuck = max(damping, 1e-8) * 10.0, stuck + 1
        return state, float(np.abs(r).max(initial=0.0))
