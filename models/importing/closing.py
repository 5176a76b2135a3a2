"""The loop equations of a reading: how far closures and couplings are open, and Newton's method on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.models.kinematics import ReadingTree, home, length_of
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import equations, stepped
from screwgauge.witness.tree import TreeStates

#: Residual that counts as closed [rad or lengths of the model]; descriptions are held to 1e-9.
CLOSED = 1e-11
STEPS = 100
STUCK = 8  # steps without a gain of a hundredth: it ends there
LARGEST = 0.4  # step [rad or lengths]
LATEST = 8  # poses whose equations are kept: those of a step are asked for again by what judges it


@dataclass(frozen=True, eq=False)
class Loops:
    """The loop equations of a tree, lengths counted in lengths of the model; coordinates have shape (n_coordinate,)."""

    tree: ReadingTree

    @property
    def reading(self) -> Reading:
        """Of the tree."""
        return self.tree.reading

    @cached_property
    def home(self) -> Array:
        """Coordinates at home."""
        return np.asarray(home(self.reading).q[0])

    def values(self, q: Array) -> dict[str, float]:
        """Hinge or slide -> its coordinate [rad or m]."""
        places = self.tree.places.items()
        return {name: float(q[place.start]) for name, place in places if place.stop - place.start == 1}

    @cached_property
    def length(self) -> float:
        """Unit of distances [m]."""
        return length_of(self.reading)

    @cached_property
    def size(self) -> Array:
        """Unit of each velocity: 1 for angles, the model's length for distances. Shape (n_freedom,)."""
        turn, slide = [1.0], [self.length]
        kinds = {"hinge": turn, "slide": slide, "ball": 3 * turn, "free": 3 * turn + 3 * slide}
        return np.array([unit for joint in self.reading.joints.values() for unit in kinds[joint.kind]])

    @cached_property
    def units(self) -> dict[str, Array]:
        """Closure or coupling -> the unit of each of its residuals. Shape (3,), (6,) or (1,)."""
        turn, way, joints = [1.0] * 3, [self.length] * 3, self.reading.joints
        units = {name: way if c.kind == "point" else turn + way for name, c in self.reading.closures.items()}
        for name, coupling in self.reading.couplings.items():
            units[name] = way[:1] if joints[coupling.joint].kind == "slide" else turn[:1]
        return {name: np.array(some) for name, some in units.items()}

    @cached_property
    def closing(self) -> Array:
        """1 for the velocities that some loop or coupling depends on, else 0. Shape (n_freedom,)."""
        moves = dict(zip(self.reading.bodies, self.tree.moves, strict=True))
        out, still = np.zeros(len(self.size)), np.zeros(len(self.size))
        for closure in self.reading.closures.values():
            out += np.abs(moves.get(closure.second, still) - moves.get(closure.first, still))
        for coupling in self.reading.couplings.values():
            for joint in filter(None, (coupling.joint, coupling.of)):
                out[self.tree.freedoms[joint]] = 1.0
        return np.minimum(out, 1.0)

    def residuals(self, q: Array) -> dict[str, Array]:
        """How far each closure and coupling is open [rad or lengths]: 3, 6 or 1 numbers."""
        ends = np.cumsum([len(units) for units in self.units.values()])
        return dict(zip(self.units, np.split(self.system(q)[0], ends[:-1]), strict=True)) if self.units else {}

    def gaps(self, q: Array, least: float) -> list[str]:
        """How far closures and couplings that are open are so, in words, the widest first."""
        found = {name: r for name, r in self.residuals(q).items() if np.abs(r).max() > least}
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

    def system(self, q: Array) -> tuple[Array, Array]:
        """All residuals and their derivative by the velocities, without dimension. Shapes (m,), (m, n_freedom)."""
        key = q.tobytes()
        if key not in self._latest:
            if len(self._latest) == LATEST:
                del self._latest[next(iter(self._latest))]
            self._latest[key] = self._system(q)
        return self._latest[key]

    @cached_property
    def _latest(self) -> dict[bytes, tuple[Array, Array]]:
        return {}

    def _system(self, q: Array) -> tuple[Array, Array]:
        rest, unit = np.zeros((1, len(self.size))), np.concatenate([np.zeros(0), *self.units.values()])
        at = equations(self.tree, TreeStates(q[None], rest, rest))
        return at.gap[0] / unit, at.rows[0] / unit[:, None] * self.size

    def stepped(self, q: Array, step: Array) -> Array:
        """Coordinates after a step of all velocities without dimension, shape (n_freedom,)."""
        return np.asarray(stepped(self.tree, q[None], (step * self.size)[None])[0])

    def newton(self, q: Array) -> tuple[Array, float]:
        """Closes the loops from coordinates by the shortest steps (Levenberg-Marquardt).

        Returns:
            The coordinates reached and their largest residual.
        """
        r, J = self.system(q)
        damping, stuck = 1e-3, 0
        for _ in range(STEPS):
            error = float(np.abs(r).max(initial=0.0))
            if error <= CLOSED or damping > 1e6 or stuck > STUCK:
                break
            U, s, Vt = np.linalg.svd(J, full_matrices=False)
            step = -Vt.T @ (s / (s * s + damping * min(float(r @ r), 1.0) + 1e-16) * (U.T @ r))
            step *= min(1.0, LARGEST / max(float(np.abs(step).max(initial=0.0)), 1e-300))
            trial = self.stepped(q, step)
            r_trial, J_trial = self.system(trial)
            if r_trial @ r_trial < r @ r:
                stuck = stuck + 1 if r_trial @ r_trial > 0.99 * (r @ r) else 0
                q, r, J, damping = trial, r_trial, J_trial, damping / 10.0
            else:
                damping, stuck = max(damping, 1e-8) * 10.0, stuck + 1
        return q, float(np.abs(r).max(initial=0.0))
