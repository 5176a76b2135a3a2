"""The paper's case, solved: eq. (59) on the mechanism of Tables 1 to 3. All errata are measured on it."""

import numpy as np

from screwgauge.models.catalog import load_mechanism
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.equations import recursion
from screwgauge.reference.graph import layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.study.bench.scheme import chains, platform_screws
from support import at_origin

SCENE = "3ups-upu-s"
TABLE_2 = "3ups-upu-s-table2"  # the mechanism with the wrist angles of the paper's Table 2; the bodies move alike
STEP = 0.05  # s: the curves of the case are smooth on a scale of seconds
DURATION = 10.0  # s, as in the paper
HALF = 0.3  # m, a leg half: the length that eq. (24) adds to p_3
UPU_CHAIN, S_CHAIN = 0, 4  # of the five


class Case:
    """Eq. (59) solved at times `t` [s], shape (n,), on the mechanism of Tables 1 to 3.

    Attributes:
        motion: The independent coordinates there.
        at: The closed mechanism in this motion.
        beta: Joint accelerations. Shape (n, n_q).
        A: Acceleration screws of the bodies. Shape (n, b, 6).
        twist: Twist and acceleration screw of the platform, from the S joint's angles alone. Shape (n, 6) each.
        B: Velocities of the actuators per velocity of y. Shape (n, 4, 2).
        side: The five chains side by side.
        screws, theta, w: Screws, coordinates and velocities chain by chain. Shapes (n, 5, m, 6), (n, 5, m), (n, 5, m).
    """

    def __init__(self, t: Array) -> None:
        self.scene, self.t = load_scene(SCENE), t
        self.lay = lay = layout(load_mechanism(TABLE_2))
        self.motion = self.scene.moved(t)
        q = positions(lay, self.motion.y, t)
        self.at = motion_at(lay, q, self.motion.yd, self.motion.ydd, self.scene.applied, t)
        self.beta, self.A = self.at.joint_acceleration, self.at.A
        self.twist = platform_screws(lay, self.motion)
        self.B = self.at.B
        self.side = chains(lay)
        self.theta, self.w = self.side.gather(q), self.side.gather(self.at.joint_velocity)
        self.screws = self.side.walk(self.theta)[0]

    def leg_ends(self, R: Array, p: Array) -> Array:
        """Points C [m] for poses of the platform, one or one a leg: (n, 1 or 4, 3, 3), (n, 1 or 4, 3) -> (n, 4, 3)."""
        wrists = [self.lay.mechanism.joint(f"leg{k}.wrist").child_frame.p for k in range(1, 5)]
        return p + (R @ np.stack(wrists)[..., None])[..., 0]

    def left_over(self, V: Array, chain: int) -> float:
        """What eq. (15) leaves over where eq. (26) makes a chain follow twists V, shape (n, 6): the largest."""
        w = self.side.solve(self.screws, V[:, None])[:, chain]
        return longest((self.screws[:, chain].swapaxes(1, 2) @ w[..., None])[..., 0] - V)

    def wrench(self, gravity: Array | None = None, *, loaded: bool = True, A: Array | None = None) -> Array:
        """What each body needs, by the case's gravity, loads and accelerations or others. Shape (n, b, 6)."""
        gravity = self.scene.applied.g if gravity is None else gravity
        need = at_origin.inertia(self.at, self.at.V, self.A if A is None else A, gravity)
        return need - recursion.at_origin(self.at.pose, self.at.applied_wrenches) if loaded else need

    def generalized(self, need: Array) -> Array:
        """Generalised forces [N m]. Shape (n, 2)."""
        return self.at.virtual_power(at_origin.along_tree(self.at, need)[:, self.at.loops.columns])

    def driving(self, need: Array) -> Array:
        return (self.generalized(need)[:, None] @ linear.invert(self.B)[0])[:, 0]


def every(step: float) -> Array:
    return np.arange(round(DURATION / step) + 1) * step


def largest(array: Array) -> float:
    """Largest magnitude of all entries."""
    return float(np.abs(array).max())


def longest(vectors: Array) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max())


def percent(wrong: Array, right: Array) -> float:
    return 100.0 * largest(wrong - right) / largest(right)
