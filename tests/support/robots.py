"""Robots with numbers at random, as URDF and as MJCF, in the forms that public models use.

Inertials have orientations, links may be fixed to others, joints have damping, friction and limits. The MJCF has the
same with principal moments, and on request what a URDF cannot: armature, springs, actuators.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.models.files.urdf import moments
from screwgauge.models.formats import number_text, quaternion, rpy, vector_text
from screwgauge.models.poses import matrix
from screwgauge.reference.rotations import Array, rotation

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

_KINDS = ("revolute", "revolute", "continuous", "prismatic", "fixed")


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
        limits: [m or rad]
    """

    near: int
    kind: str
    T: Array
    axis: Array
    mass: float
    com: Array
    moments: Array
    turn: Array
    passive: Sequence[float]
    limits: tuple[float, float] = (-1.5, 2.0)


def unit(rng: np.random.Generator) -> Array:
    """A random direction. Shape (3,)."""
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def tree(seed: int, count: int = 8) -> list[Part]:
    rng = np.random.default_rng([seed, 11])
    return [_part(i, rng) for i in range(count)]


def _part(i: int, rng: np.random.Generator) -> Part:
    def turn() -> Array:
        return rotation(unit(rng), np.array(rng.uniform(0.3, 2.5)))

    axis, mass = unit(rng), float(10.0 ** rng.uniform(-0.7, 0.8))
    squares = (0.05 * rng.uniform(0.5, 1.5, 3)) ** 2  # of a solid ellipsoid: any three give an inertia
    return Part(
        near=max(i - int(rng.integers(1, 3)), -1),
        kind=_KINDS[int(rng.integers(len(_KINDS)))] if i else "revolute",
        T=matrix(rng.uniform(-0.4, 0.4, 3), turn()),
        axis=axis,
        mass=mass,
        com=rng.uniform(-0.1, 0.1, 3),
        moments=mass * (squares.sum() - squares) / 2.0,
        turn=turn(),
        passive=rng.uniform(0.1, 1.0, 4).tolist(),
    )


def arm() -> list[Part]:
    """A chain of seven joints, the last but one of which slides; tests name their damping and limits."""
    return [
        replace(
            part,
            near=i - 1,
            kind="prismatic" if i == 5 else "revolute",
            passive=(0.1 + i / 100, 0.02 + i / 1000, *part.passive[2:]),
            limits=(round(-1.5 - i / 10, 3), round(1.2 + i / 10, 3)),
        )
        for i, part in enumerate(tree(7, 7))
    ]


def robots(most: int = 8) -> SearchStrategy[list[Part]]:
    from hypothesis import strategies as st  # a tenth of a second, which most tests do not need

    return st.builds(tree, st.integers(0, 2**32 - 1), st.integers(2, most))


def write(folder: Path, parts: Sequence[Part] | None = None) -> tuple[Path, Path]:
    parts = arm() if parts is None else parts
    paths = folder / "arm.urdf", folder / "arm.xml"
    for path, text in zip(paths, (urdf(parts), mjcf(parts, base=True)), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


def edited(path: Path, old: str, new: str, name: str) -> Path:
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{old} is {text.count(old)} times in {path.name}"
    copy = path.with_name(name)
    copy.write_text(text.replace(old, new), encoding="utf-8")
    return copy


def urdf(parts: Sequence[Part]) -> str:
    """As URDF."""
    links = [text for i, part in enumerate(parts) for text in (_link(i, part), _urdf_joint(i, part))]
    return "\n".join(['<robot name="robot">', '  <link name="base"/>', *links, "</robot>", ""])


def _link(i: int, part: Part) -> str:
    skewed = rotation(np.array([0.0, 0.0, 1.0]), np.array(0.4))  # not the principal axes: there are products
    I, R = skewed.T @ np.diag(part.moments) @ skewed, part.turn @ skewed
    entries = " ".join(f'{name}="{value}"' for name, value in moments(I).items())
    return f"""\
  <link name="link{i}">
    <inertial>
      <origin xyz="{vector_text(part.com)}" rpy="{vector_text(rpy(R))}"/>
      <mass value="{number_text(part.mass)}"/>
      <inertia {entries}/>
    </inertial>
  </link>"""


def _urdf_joint(i: int, part: Part) -> str:
    damping, friction = map(number_text, part.passive[:2])
    low, high = map(number_text, part.limits)
    dynamics = f"""
    <axis xyz="{vector_text(part.axis)}"/>
    <dynamics damping="{damping}" friction="{friction}"/>"""
    limit = f"""
    <limit lower="{low}" upper="{high}" effort="100" velocity="10"/>"""
    return f"""\
  <joint name="joint{i}" type="{part.kind}">
    <origin xyz="{vector_text(part.T[:3, 3])}" rpy="{vector_text(rpy(part.T[:3, :3]))}"/>
    <parent link="{f"link{part.near}" if part.near >= 0 else "base"}"/>
    <child link="link{i}"/>{dynamics * (part.kind != "fixed")}{limit * (part.kind in ("revolute", "prismatic"))}
  </joint>"""


def mjcf(parts: Sequence[Part], *, full: bool = False, base: bool = False) -> str:
    """As MJCF.

    Args:
        full: With what a URDF does not say: armature, springs, actuators.
        base: Its base is a body and not the world.
    """

    def body(i: int, indent: str) -> list[str]:
        part, inside = parts[i], indent + "  "
        where = f'pos="{vector_text(part.com)}" quat="{vector_text(quaternion(part.turn))}"'
        inertia = f'mass="{number_text(part.mass)}" diaginertia="{vector_text(part.moments)}"'
        return [
            f'{indent}<body name="link{i}" pos="{vector_text(part.T[:3, 3])}" '
            f'quat="{vector_text(quaternion(part.T[:3, :3]))}">',
            f"{inside}<inertial {where} {inertia}/>",
            *([inside + _mjcf_joint(i, part, full)] if part.kind != "fixed" else []),
            *(line for j, other in enumerate(parts) if other.near == i for line in body(j, inside)),
            f"{indent}</body>",
        ]

    world = [line for i, part in enumerate(parts) if part.near < 0 for line in body(i, "    ")]
    moving = [i for i, part in enumerate(parts) if part.kind != "fixed"] if full else []
    motors = [f'    <motor name="motor{i}" joint="joint{i}" gear="{number_text(1.0 + i)}"/>' for i in moving]
    return "\n".join(
        [
            '<mujoco model="robot">\n  <compiler angle="radian" balanceinertia="false"/>',
            '  <option gravity="0 0 -9.81"/>\n  <worldbody>',
            *(['    <body name="base">', *world, "    </body>"] if base else world),
            "  </worldbody>",
            *(["  <actuator>", *motors, "  </actuator>"] if motors else []),
            "</mujoco>\n",
        ]
    )


def _mjcf_joint(i: int, part: Part, full: bool) -> str:
    kind = "slide" if part.kind == "prismatic" else "hinge"
    limits = "" if part.kind == "continuous" else f' range="{vector_text(part.limits)}" limited="true"'
    values = {"damping": part.passive[0], "frictionloss": part.passive[1]}
    if full:
        values |= {"armature": 0.1 * part.passive[2], "stiffness": part.passive[3], "springref": 0.3}
    entries = " ".join(f'{name}="{number_text(value)}"' for name, value in values.items())
    return f'<joint name="joint{i}" type="{kind}" axis="{vector_text(part.axis)}"{limits} {entries}/>'
