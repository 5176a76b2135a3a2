"""Parts of a URDF as text."""

from collections.abc import Sequence
from itertools import zip_longest

ENTRIES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def link(
    name: str, mass: float = 0.0, tensor: Sequence[float] = (1, 1, 1), com: str = "0 0 0", rpy: str = "0 0 0"
) -> str:
    """A link, without an inertial where it has no mass. Entries left out of `tensor`, xx yy zz xy xz yz, are zero."""
    entries = " ".join(f'{key}="{value}"' for key, value in zip_longest(ENTRIES, tensor, fillvalue=0))
    inertial = f'<inertial><origin xyz="{com}" rpy="{rpy}"/><mass value="{mass}"/><inertia {entries}/></inertial>'
    return f'<link name="{name}">{inertial if mass else ""}</link>'


def joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    more: str = "",
    *,
    xyz: str = "0 0 0",
    rpy: str = "0 0 0",
    axis: str = "1 0 0",
    limits: tuple[float, float] = (-3, 3),
) -> str:
    ends = f'<origin xyz="{xyz}" rpy="{rpy}"/><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
    if kind in ("revolute", "prismatic"):
        ends += '<limit lower="{}" upper="{}" effort="1" velocity="1"/>'.format(*limits)
    return f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'


def robot(*parts: str, name: str = "robot") -> str:
    return f'<robot name="{name}">{"".join(parts)}</robot>'
