"""Kinds of change of mass properties and of joints, each made in the attributes of a file."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from campaigns.marks import Inertial, inertials, is_urdf, joints
from campaigns.mutant import EVERYWHERE, CannotError, Expected, Random
from support.robots import unit

from screwgauge.diagnosis.files.xml_text import Element, XmlText
from screwgauge.models.placement import number_text
from screwgauge.models.readings.assemble import steiner
from screwgauge.reference.rotations import Array

Mutation = Callable[[XmlText, Random, float], list[Expected]]


def _pick(xml: XmlText, rng: Random, fits: Callable[[Inertial], bool] = lambda mark: True) -> Inertial:
    """An inertial of those that a change has an effect on."""
    marks = [mark for mark in inertials(xml) if fits(mark)]
    if not marks:
        raise CannotError("no such inertial")
    return marks[rng.integers(len(marks))]


def _joint(xml: XmlText, rng: Random, fits: Callable[[Element], bool] = lambda joint: True) -> Element:
    found = [joint for joint in joints(xml) if fits(joint)]
    if not found:
        raise CannotError("no such joint")
    return found[rng.integers(len(found))]


def _asymmetric(mark: Inertial) -> bool:
    """Whether the three moments differ, and products are there."""
    I = mark.tensor
    moments = np.sort(np.linalg.eigvalsh(I))
    return bool(
        np.diff(moments).min() > 1e-2 * moments[-1] and np.abs(I - np.diag(np.diag(I))).max() > 1e-3 * moments[-1]
    )


def _three_moments(mark: Inertial) -> bool:
    moments = np.sort(np.diag(mark.tensor))
    return bool(np.diff(moments).min() > 1e-2 * moments[-1])


def _turned(mark: Inertial) -> bool:
    R = mark.turn
    return bool(np.abs(R - np.eye(3)).max() > 1e-2) and bool(np.abs(_change(mark, R.T @ mark.tensor @ R)).max() > 0.0)


def _change(mark: Inertial, tensor: Array) -> Array:
    return np.asarray(tensor - mark.tensor)


def _off(mark: Inertial) -> bool:
    """Whether the centre of mass is well off the origin of the link."""
    return bool(np.linalg.norm(mark.com) > 1e-3)


def _retensored(mark: Inertial, tensor: Array, slip: str = "") -> list[Expected]:
    """Writes another tensor, in the orientation of the old one."""
    step = float(np.linalg.norm(_change(mark, tensor)))
    if not step > 1e-9 * float(np.abs(mark.tensor).max()):
        raise CannotError("nothing would change")
    if np.linalg.eigvalsh(tensor).min() <= 0.0:
        raise CannotError("not an inertia tensor")
    mark.tensor = tensor
    return [Expected(mark.link, ("inertia",), step, slip)]


def mass_factor(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng)
    step = mark.mass * size
    mark.mass = mark.mass + step
    return [Expected(mark.link, ("mass",), step)]


def mass_in_grams(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng)
    step, mark.mass = 999.0 * mark.mass, 1000.0 * mark.mass
    return [Expected(mark.link, ("mass",), step, "in g")]


def masses_swapped(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    one = _pick(xml, rng)
    two = _pick(xml, rng, lambda mark: abs(mark.mass - one.mass) > 1e-3 * one.mass)
    step = abs(one.mass - two.mass)
    one.mass, two.mass = two.mass, one.mass
    return [Expected(mark.link, ("mass",), step) for mark in (one, two)]


def all_masses_factor(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    marks = inertials(xml)
    if len(marks) < 2:
        raise CannotError("fewer than two inertials")
    for mark in marks:
        mark.mass = mark.mass * (1.0 + size)
    return [Expected(EVERYWHERE, ("mass",), slip="all scaled")]


def com_shift(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng)
    step = size * 0.1  # of a length of 0.1 m
    mark.com = mark.com + step * unit(rng)
    return [Expected(mark.link, ("com",), step)]


def com_in_millimetres(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng, _off)
    step, mark.com = 999.0 * float(np.linalg.norm(mark.com)), 1000.0 * mark.com
    return [Expected(mark.link, ("com",), step, "in mm")]


def com_mirrored(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng, _off)
    signs = np.ones(3)
    signs[int(np.abs(mark.com).argmax())] = -1.0
    step, mark.com = 2.0 * float(np.abs(mark.com).max()), signs * mark.com
    return [Expected(mark.link, ("com",), step, "mirrored")]


def com_lost(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng, _off)
    step, mark.com = float(np.linalg.norm(mark.com)), np.zeros(3)
    return [Expected(mark.link, ("com",), step, "left out")]


def moment_factor(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng)
    I = mark.tensor
    k = rng.integers(3)
    I[k, k] *= 1.0 + size
    return _retensored(mark, I)


def tensor_factor(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng)
    return _retensored(mark, (1.0 + size) * mark.tensor)


def product_shift(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng)
    I = mark.tensor
    i, j = ((0, 1), (0, 2), (1, 2))[rng.integers(3)]
    I[i, j] = I[j, i] = I[i, j] + size * np.diag(I).min()
    return _retensored(mark, I)


def products_negated(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng, _asymmetric)
    moments = np.diag(np.diag(mark.tensor))
    return _retensored(mark, 2.0 * moments - mark.tensor, "products of inertia of the other sign")


def products_in_other_order(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    """xy, xz, yz as yz, xz, xy."""
    mark = _pick(xml, rng, lambda mark: abs(mark.tensor[0, 1] - mark.tensor[1, 2]) > 1e-3 * np.abs(mark.tensor).max())
    I = mark.tensor
    I[0, 1], I[1, 2] = I[1, 2], I[0, 1]
    I[1, 0], I[2, 1] = I[0, 1], I[1, 2]
    return _retensored(mark, I, "products of inertia in another order")


def axes_permuted(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    """The moments in another order: xx as yy, yy as zz, zz as xx."""
    mark = _pick(xml, rng, _three_moments)
    I = mark.tensor
    moments = np.diag(I)
    diagonal = not np.any(I - np.diag(moments))
    slip = "principal moments on other axes" if diagonal else "moments of inertia in another order"
    return _retensored(mark, I - np.diag(moments) + np.diag(np.roll(moments, 1)), slip)


def orientation_lost(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng, _turned)
    R = mark.turn
    step = float(np.linalg.norm(R @ mark.tensor @ R.T - mark.tensor))
    mark.turn = np.eye(3)
    return [Expected(mark.link, ("inertia",), step, "not turned by its orientation")]


def orientation_transposed(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng, _turned)
    R = mark.turn
    step = float(np.linalg.norm(R @ mark.tensor @ R.T - R.T @ mark.tensor @ R))
    if step <= 1e-9 * np.abs(mark.tensor).max():
        raise CannotError("nothing would change")
    mark.turn = R.T
    return [Expected(mark.link, ("inertia",), step, "transposed")]


def about_the_origin(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng, _off)
    R = mark.turn
    return _retensored(mark, mark.tensor + mark.mass * R.T @ steiner(mark.com) @ R, "about the origin")


def tensor_in_gram_millimetres(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    mark = _pick(xml, rng)
    return _retensored(mark, 1e9 * mark.tensor, "in g mm^2")


def passive(what: str, urdf: str, mjcf: str) -> Mutation:
    """Another damping, friction, armature, stiffness of a joint; by the empty name a format has none."""

    def mutation(xml: XmlText, rng: Random, size: float) -> list[Expected]:
        name = urdf if is_urdf(xml) else mjcf
        if not name:
            raise CannotError(f"the format has no {what}")
        joint = _joint(xml, rng, lambda joint: is_urdf(xml) or bool(joint.get(name)))
        holder = joint.find("dynamics") if is_urdf(xml) else joint
        old = float((holder.get(name, "0") if holder else "0").split()[0])
        step = size * (old or 1.0)
        if is_urdf(xml):
            xml.set_in(joint, "dynamics", **{name: number_text(old + step)})
        else:
            xml.set(joint, **{name: number_text(old + step)})
        return [Expected(joint.get("name"), (what,), step)]

    return mutation
