"""The paper's case, solved: eq. (59) on the mechanism of Tables 1 to 3. All errata are measured on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.models.catalog import load_mechanism
from screwgauge.reference import dynamics
from screwgauge.reference.kinematics import Velocities, accelerations, positions, velocities
from screwgauge.reference.paper.scheme import Chains, chains
from screwgauge.reference.paper.twist import Driven, platform_screws
from screwgauge.reference.pose import Layout, layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene

SCENE = "3ups-upu-s"
TABLE_2 = "3ups-upu-s-table2"  # the mechanism with the wrist angles of the paper's Table 2; the bodies move alike
STEP = 0.05  # s: the curves of the case are smooth on a scale of seconds
DURATION = 10.0  # s, as in the paper
HALF = 0.3  # m, a leg half: the length beside p_3 in eq. (24)


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """The paper's case, solved.

    Attributes:
        t: Times [s]. Shape (n,).
        motion: The independent coordinates there.
        rate: Joint velocities and twists of the closed mechanism.
        beta: Joint accelerations. Shape (n, n_q).
        A: Acceleration screws of the bodies. Shape (n, n_body + 1, 6).
        bodies: Motion of the bodies.
        twist: Twist and acceleration screw of the platform, from the S joint's angles alone. Shape (n, 6) each.
        side: The five chains side by side.
        S, theta, w: Screws, coordinates and velocities chain by chain. Shapes (n, 5, m, 6), (n, 5, m), (n, 5, m).
    """

    scene: Scene
    lay: Layout
    t: Array
    motion: Driven
    rate: Velocities
    beta: Array
    A: Array
    bodies: dynamics.BodyMotion
    twist: tuple[Array, Array]
    side: Chains
    S: Array
    theta: Array
    w: Array

    @property
    def B(self) -> Array:
        """Velocities of the actuators per velocity of y. Shape (n, 4, 2)."""
        return self.rate.K[:, self.lay.mechanism.actuated_columns]

    def leg_ends(self, R: Array, p: Array) -> Array:
        """Points C [m] for poses of the platform, one or one a leg: (n, 1 or 4, 3, 3), (n, 1 or 4, 3) -> (n, 4, 3)."""
        wrists = [self.lay.mechanism.joint(f"leg{k}.wrist").child_frame.p for k in range(1, 5)]
        return np.asarray(p + (R @ np.stack(wrists)[..., None])[..., 0])

    def wrench(
        self, gravity: Array | None = None, *, loaded: bool = True, bodies: dynamics.BodyMotion | None = None
    ) -> tuple[Array, Array]:
        """Required force and moment of each body, by the case's gravity, loads and motion or others. (n, n_body, 3)."""
        applied = self.scene.applied
        gravity, loads = applied.g if gravity is None else gravity, applied.loads if loaded else ()
        return dynamics.required_wrench(self.lay, self.rate.pose, bodies or self.bodies, gravity, loads)

    def generalized(self, F: Array, T: Array) -> Array:
        """Generalised forces [N m]. Shape (n, 2)."""
        return dynamics.generalized_force(self.lay, self.rate, self.bodies, F, T)

    def driving(self, F: Array, T: Array) -> Array:
        """Actuator forces of smallest norm [N]. Shape (n, 4)."""
        return dynamics.min_norm(self.B, self.generalized(F, T))


def every(step: float) -> Array:
    """The 10 s of the case by steps. Shape (n,)."""
    return np.asarray(np.arange(round(DURATION / step) + 1) * step, dtype=np.float64)


def paper_case(t: Array) -> Case:
    """Solves the paper's case at times `t`, shape (n,)."""
    scene, lay = load_scene(SCENE), layout(load_mechanism(TABLE_2))
    motion = scene.moved(t)
    rate = velocities(lay, positions(lay, motion.y, t), motion.yd)
    beta, A = accelerations(lay, rate, motion.ydd)
    bodies, twist = dynamics.body_motion(lay, rate.pose, rate.V, A), platform_screws(lay, motion, t)
    side = chains(lay)
    theta, w = side.gather(rate.pose.q), side.gather(rate.w)
    return Case(scene, lay, t, motion, rate, beta, A, bodies, twist, side, side.walk(theta)[0], theta, w)


def largest(array: Array) -> float:
    """Largest magnitude of all entries."""
    return float(np.abs(array).max())


def longest(vectors: Array) -> float:
    """Largest length of the vectors along the last axis."""
    return float(np.linalg.norm(vectors, axis=-1).max())


def percent(wrong: Array, right: Array) -> float:
    """Largest error as a share of the largest value [%]."""
    return 100.0 * largest(wrong - right) / largest(right)
