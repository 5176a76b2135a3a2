"""Mass properties as MuJoCo takes them: a tensor in full, or principal moments and axes where it refuses that.

MuJoCo refuses a moving body with less than `LEAST` of mass or of any principal moment, moments with A + B < C by as
little as a rounding, and a full tensor with an eigenvalue below 1e-14, which its own rounding of 1e-14 of the largest
one produces. Zero is therefore written as `LEAST`, and `without_stand_ins` takes it back from a loaded model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from screwgauge.models.placement import number_text, quaternion, tensor_text, vector_text
from screwgauge.reference.errors import first_few
from screwgauge.reference.mechanism import SLACK, Body, Mechanism
from screwgauge.reference.rotations import Array

#: The least mass and moment of a moving body that MuJoCo takes [kg, kg m^2]; it stands for none at all.
LEAST = 1e-15
#: A full tensor is written where its moments keep as far from what MuJoCo refuses: of the largest one, and [kg m^2].
#: Compilers before 3.14 turn a tensor to nine digits.
ROOM, ABOVE = 1e-8, 1e-13
#: Of the largest moment: what the rounding of a tensor's six numbers and of its turning leaves of a moment of zero, and
#: what a compiler leaves of it; a moment below both this and `LEAST` is written as none.
ROUNDING, NEGLIGIBLE = 8.0 * float(np.finfo(float).eps), 5e-14
#: Bodies that a sentence names.
SHOWN = 6


def inertial(body: Body) -> dict[str, str]:
    """The attributes of an ``<inertial>``."""
    said = {"pos": vector_text(body.com), "mass": number_text(body.mass or LEAST)}
    if not body.mass:
        return {**said, "diaginertia": vector_text([LEAST] * 3)}
    return {**said, **of_tensor(body.inertia)}


def of_tensor(I: Array) -> dict[str, str]:
    """A tensor in the axes of its body as attributes of an ``<inertial>``. Shape (3, 3)."""
    least, middle, largest = np.linalg.eigvalsh(I)
    room, excess = max(ROOM * largest, ABOVE), largest - least - middle
    if min(least, -excess) > room or max(-least, excess) > SLACK * np.trace(I):  # clearly taken, clearly refused
        return {"fullinertia": tensor_text(I)}
    moments, q = principal(I)
    turned = {} if q is None else {"quat": vector_text(q)}
    return {"diaginertia": vector_text(_taken(moments)), **turned}


def principal(I: Array) -> tuple[Array, Array | None]:
    """Principal moments of a tensor, shape (3,), and the quaternion of their axes, none for those of the body."""
    if not np.any(I - np.diag(np.diag(I))):
        return np.diag(I).copy(), None
    moments, axes = np.linalg.eigh(I)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return moments, quaternion(axes)


def _taken(moments: Array) -> Array:
    """Moments that MuJoCo takes in place of these. Shape (3,)."""
    taken = np.where(_none(moments), LEAST, np.where(moments == LEAST, np.nextafter(LEAST, 1.0), moments))
    low, mid, high = np.argsort(taken)
    taken[high] = min(taken[high], taken[low] + taken[mid])  # more only by rounding, or `Body` had refused it
    return taken


def _none(moments: Array) -> Array:
    """Which moments `LEAST` stands for. Shape (3,)."""
    return np.asarray((moments < LEAST) & (moments <= NEGLIGIBLE * float(moments.max())))


def without_stand_ins(mass: Array, moments: Array) -> tuple[Array, Array]:
    """Masses, shape (n,), and principal moments, (n, 3), of a loaded model, zero where `LEAST` stands for that."""
    moments = np.where(moments <= LEAST, 0.0, moments)
    return np.where((mass <= LEAST) & ~moments.any(axis=1), 0.0, mass), moments


def stood_in(names: Sequence[str]) -> Iterator[str]:
    """That moments of bodies stand for zero and are taken for it."""
    if names:
        yield (
            f"MuJoCo refuses a moment of inertia of zero: {LEAST:g} kg m^2 stands for it in "
            f"{first_few(names, SHOWN)}; the engine mujoco sets it to zero after loading, other programs do not"
        )


def stand_ins(mechanism: Mechanism) -> Iterator[str]:
    """Sentences on the moments of inertia that no MJCF can say, and on what it says instead."""
    moments = {body.name: principal(body.inertia)[0] for body in mechanism.bodies if body.mass}
    for sentence in stood_in([name for name, its in moments.items() if _none(its).any()]):
        yield f"MJCF: {sentence}"
    for name, its in moments.items():
        off = float(np.abs(without_stand_ins(np.ones(1), _taken(its)[None])[1] - its).max())
        if off > ROUNDING * float(its.max()):
            yield (
                f"MJCF: a principal moment of {name} is {off:.2g} kg m^2 off the description, as MuJoCo takes none so "
                "small and none that break A + B >= C"
            )
