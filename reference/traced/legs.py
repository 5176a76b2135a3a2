"""Closed-form positions of U-P-S and U-P-U legs, see `screwgauge.reference.chains`."""

from __future__ import annotations

from collections.abc import Mapping

from screwgauge.reference.chains import closed_form
from screwgauge.reference.graph import serial_chains
from screwgauge.reference.pose import Layout
from screwgauge.reference.traced.crossing import Coordinates, Motion, crossing, fixed
from screwgauge.reference.traced.equations import coordinates
from screwgauge.reference.traced.vectors import Scalar, cross, dot, sqrt, sub, turn_back, vector


def has_closed_form(lay: Layout, fixed_columns: tuple[int, ...]) -> bool:
    """Whether the branch of home is what the closed form gives, all of its wrists being cut."""
    mechanism = lay.mechanism
    chosen = set(mechanism.independent_columns)
    driver = next((columns for columns in lay.columns.values() if chosen <= set(columns)), [])
    if not set(driver) - chosen <= set(fixed_columns):
        return False
    if closed_form(lay, mechanism.home[None, mechanism.independent_columns]) is None:
        return False
    wrists = {chain[-1].joint.name for chain in serial_chains(mechanism) if len(chain) > 1}
    return wrists == {joint.name for joint in lay.tree.cuts}


def closed_coordinates(lay: Layout, y: Mapping[int, Scalar]) -> tuple[Coordinates, dict[int, tuple[Scalar, Scalar]]]:
    """Tree coordinates, and (sine, cosine) of the angles that are not given, for `atan2`."""
    chains = serial_chains(lay.mechanism)
    (driver,) = [chain[0].joint for chain in chains if len(chain) == 1]
    columns = lay.columns[driver.name]
    given = {c: y.get(c, float(lay.mechanism.home[c])) for c in columns}
    q = coordinates(lay, given)
    at = Motion()
    for step in crossing(driver, columns, q, reverse=False):
        at = step.outward(at, q)
    slide, angle, found = dict(q.slide), dict(q.angle), dict[int, tuple[Scalar, Scalar]]()
    for base, leg, wrist in [[edge.joint for edge in chain] for chain in chains if len(chain) > 1]:
        place = fixed(base.parent_frame).outward(Motion(), q)
        centre = fixed(wrist.child_frame).outward(at, q).p
        AC = turn_back(place.R, sub(centre, place.p))
        x, yy = (vector(axis) for axis in base.axes)
        u, v, w = dot(AC, x), dot(AC, yy), dot(AC, cross(x, yy))
        across = v * v + w * w
        h, rho = sqrt(across), sqrt(u * u + across)
        first, second = lay.columns[base.name]
        over_h, over_rho = 1.0 / h, 1.0 / rho
        found |= {first: (-(v * over_h), w * over_h), second: (u * over_rho, h * over_rho)}
        slide[lay.columns[leg.name][0]] = rho
    return Coordinates(slide, angle | found, {}, {}), found
