"""What the errata of the paper are measured on, and how one of them is recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.models.catalog import load_mechanism
from screwgauge.reference import dynamics
from screwgauge.reference.kinematics import Rates, accelerations, positions, rates
from screwgauge.reference.paper.scheme import Chains, chains
from screwgauge.reference.paper.twist import Driven
from screwgauge.reference.pose import Layout, layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene, load_scene

SCENE = "3ups-upu-s"
CHART = "3ups-upu-s-table2"  # wrist angles of the paper's Table 2; the bodies move alike
STEP = 0.05  # s: the curves of the case are smooth on a scale of seconds
DURATION = 10.0  # s, as in the paper

KINDS = {"E": "error", "A": "ambiguity", "N": "numbering"}


@dataclass(frozen=True, slots=True)
class Erratum:
    """One measured erratum; a number may have several.

    Attributes:
        number: Number in the list of errata.
        kind: E error, A ambiguity, N numbering.
        equation: Where it stands.
        measure: What was measured.
        printed_form, right_form: The two forms that were run, in words.
        printed, right: What they gave, in `unit`.
        effect: Size of the erratum, in `unit`.
    """

    number: int
    kind: str
    equation: str
    measure: str
    printed_form: str
    right_form: str
    printed: float
    right: float
    effect: float
    unit: str


def erratum(
    number: int,
    equation: str,
    measure: str,
    forms: tuple[str, str],
    values: tuple[float, float],
    unit: str,
    *,
    kind: str = "E",
    effect: float | None = None,
) -> Erratum:
    """An erratum whose effect is the difference of what the two forms give, unless told otherwise."""
    printed, right = (float(value) for value in values)
    size = abs(printed - right) if effect is None else float(effect)
    return Erratum(number, kind, equation, measure, *forms, printed, right, size, unit)


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """The paper's case, solved: eq. (59) on the mechanism of Tables 1 to 3.

    Attributes:
        t: Times [s]. Shape (n,).
        motion: The independent coordinates there.
        rate: Joint rates and twists of the closed mechanism.
        beta: Joint accelerations. Shape (n, n_q).
        A: Acceleration screws of the bodies. Shape (n, n_body + 1, 6).
        bodies: Motion of the bodies.
        side: The five chains side by side.
        S, theta, w: Screws, coordinates and rates chain by chain. Shapes (n, 5, m, 6), (n, 5, m), (n, 5, m).
    """

    scene: Scene
    lay: Layout
    t: Array
    motion: Driven
    rate: Rates
    beta: Array
    A: Array
    bodies: dynamics.BodyMotion
    side: Chains
    S: Array
    theta: Array
    w: Array

    @property
    def loads(self) -> list[tuple[str, Array | None, Array, Array]]:
        return [(load.body, load.point, load.force, load.torque) for load in self.scene.loads]

    @property
    def B(self) -> Array:
        """Rates of the actuators per rate of y. Shape (n, 4, 2)."""
        return self.rate.K[:, self.lay.mechanism.actuated_columns]

    def wrench(self, gravity: Array, loads: Sequence[tuple[str, Array | None, Array, Array]]) -> tuple[Array, Array]:
        """Required force and moment of each body. Shape (n, n_body, 3) each."""
        return dynamics.required_wrench(self.lay, self.rate.pose, self.bodies, gravity, loads)

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
    scene, lay = load_scene(SCENE), layout(load_mechanism(CHART))
    motion = scene.drive(t)
    rate = rates(lay, positions(lay, motion.y, t), motion.yd)
    beta, A = accelerations(lay, rate, motion.ydd)
    side = chains(lay)
    theta = side.gather(rate.pose.q)
    return Case(
        scene=scene,
        lay=lay,
        t=t,
        motion=motion,
        rate=rate,
        beta=beta,
        A=A,
        bodies=dynamics.body_motion(lay, rate.pose, rate.V, A),
        side=side,
        S=side.walk(theta)[0],
        theta=theta,
        w=side.gather(rate.w),
    )


def largest(array: Array) -> float:
    """Largest magnitude of all entries."""
    return float(np.abs(array).max())


def longest(vectors: Array) -> float:
    """Largest length of the vectors along the last axis."""
    return float(np.linalg.norm(vectors, axis=-1).max())


def percent(wrong: Array, right: Array) -> float:
    """Largest error as a share of the largest value [%]."""
    return 100.0 * largest(wrong - right) / largest(right)
