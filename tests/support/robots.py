"""Random robots as URDF and as MJCF, in the forms that public models use.

Inertials have orientations, some links are fixed to others, joints have damping, friction and limits. The MJCF says the
same with principal moments, and has armature, springs and actuators of its own on request.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.models.placement import number_text, quaternion, rpy, vector_text
from screwgauge.models.readings.assemble import matrix
from screwgauge.models.urdf import moments
from screwgauge.reference.rotations import Array, rotation

_KINDS = ("revolute", "revolute", "continuous", "prismatic", "fixed")


def unit(rng: np.random.Generator) -> Array:
    """A random direction. Shape (3,)."""
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A link with the joint that leads to it.

    Attributes:
        near: Number of the part before it; -1 of the base.
        kind: Type of its joint in URDF.
        T: Placement on the part before it. Shape (4, 4).
        axis: Unit vector. Shape (3,).
        mass: [kg]; `com` [m]; `moments` principal ones, [kg m^2]; `turn` their axes. Shapes (), (3,), (3,), (3, 3).
        passive: Damping, friction, armature, stiffness.
    """

    near: int
    kind: str
    T: Array
    axis: Array
    mass: float
    com: Array
    moments: Array
    turn: Array
    passive: Array


def tree(seed: int, parts: int = 8) -> list[Part]:
    """A random robot."""
    rng = np.random.default_rng([seed, 11])

    def turn() -> Array:
        return rotation(unit(rng), np.array(rng.uniform(0.3, 2.5)))

    out = []
    for i in range(parts):
        axis = unit(rng)
        mass = float(10.0 ** rng.uniform(-0.7, 0.8))
        radii = 0.05 * rng.uniform(0.5, 1.5, 3)  # of a solid ellipsoid: any three give an inertia
        squares = radii**2
        out.append(
            Part(
                max(i - int(rng.integers(1, 3)), -1),
                _KINDS[int(rng.integers(len(_KINDS)))] if i else "revolute",
                matrix(rng.uniform(-0.4, 0.4, 3), turn()),
                axis,
                mass,
                rng.uniform(-0.1, 0.1, 3),
                mass * (squares.sum() - squares) / 2.0,
                turn(),
                rng.uniform(0.1, 1.0, 4),
            )
        )
    return out


def urdf(parts: list[Part]) -> str:
    """As URDF."""
    lines = ['<robot name="tree">', '  <link name="base"/>']
    for i, part in enumerate(parts):
        skewed = rotation(np.array([0.0, 0.0, 1.0]), np.array(0.4))  # not the principal axes: there are products
        I, R = skewed.T @ np.diag(part.moments) @ skewed, part.turn @ skewed
        entries = " ".join(f'{name}="{value}"' for name, value in moments(I).items())
        lines += [
            f'  <link name="link{i}">',
            "    <inertial>",
            f'      <origin xyz="{vector_text(part.com)}" rpy="{vector_text(rpy(R))}"/>',
            f'      <mass value="{number_text(part.mass)}"/>',
            f"      <inertia {entries}/>",
            "    </inertial>",
            "  </link>",
            f'  <joint name="joint{i}" type="{part.kind}">',
            f'    <origin xyz="{vector_text(part.T[:3, 3])}" rpy="{vector_text(rpy(part.T[:3, :3]))}"/>',
            f'    <parent link="{_name(part.near)}"/>',
            f'    <child link="link{i}"/>',
        ]
        if part.kind != "fixed":
            damping, friction = (number_text(value) for value in part.passive[:2])
            lines += [
                f'    <axis xyz="{vector_text(part.axis)}"/>',
                f'    <dynamics damping="{damping}" friction="{friction}"/>',
            ]
        if part.kind in ("revolute", "prismatic"):
            lines.append('    <limit lower="-1.5" upper="2" effort="100" velocity="10"/>')
        lines.append("  </joint>")
    return "\n".join([*lines, "</robot>", ""])


def _name(near: int) -> str:
    return f"link{near}" if near >= 0 else "base"


def mjcf(parts: list[Part], *, full: bool = False) -> str:
    """As MJCF.

    Args:
        full: With what a URDF does not say: armature, springs, actuators.
    """

    def body(i: int, indent: str) -> list[str]:
        part = parts[i]
        inside = indent + "  "
        place = f'pos="{vector_text(part.T[:3, 3])}" quat="{vector_text(quaternion(part.T[:3, :3]))}"'
        lines = [f'{indent}<body name="link{i}" {place}>']
        if part.kind != "fixed":
            lines.append(inside + _mjcf_joint(i, part, full))
        where = f'pos="{vector_text(part.com)}" quat="{vector_text(quaternion(part.turn))}"'
        lines.append(
            f'{inside}<inertial {where} mass="{number_text(part.mass)}" diaginertia="{vector_text(part.moments)}"/>'
        )
        for j, other in enumerate(parts):
            if other.near == i:
                lines += body(j, inside)
        return [*lines, f"{indent}</body>"]

    world = [line for i, part in enumerate(parts) if part.near < 0 for line in body(i, "    ")]
    moving = [i for i, part in enumerate(parts) if part.kind != "fixed"] if full else []
    motors = [f'    <motor name="motor{i}" joint="joint{i}" gear="{number_text(1.0 + i)}"/>' for i in moving]
    head = ['<mujoco model="tree">', '  <compiler angle="radian" balanceinertia="false"/>', "  <worldbody>"]
    actuators = ["  <actuator>", *motors, "  </actuator>"] if motors else []
    option = ['  <option gravity="0 0 -9.81"/>'] if full else []
    return "\n".join([head[0], head[1], *option, head[2], *world, "  </worldbody>", *actuators, "</mujoco>", ""])


def _mjcf_joint(i: int, part: Part, full: bool) -> str:
    kind = "slide" if part.kind == "prismatic" else "hinge"
    limits = "" if part.kind == "continuous" else ' range="-1.5 2" limited="true"'
    said = {"damping": part.passive[0], "frictionloss": part.passive[1]}
    if full:
        said |= {"armature": 0.1 * part.passive[2], "stiffness": part.passive[3], "springref": 0.3}
    entries = " ".join(f'{name}="{number_text(float(value))}"' for name, value in said.items())
    return f'<joint name="joint{i}" type="{kind}" axis="{vector_text(part.axis)}"{limits} {entries}/>'
