"""Facts of closures: points of two bodies that coincide, and where they lie on either of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from screwgauge.diagnosis.facts.fact import TOLERANCE, Fact, Pair
from screwgauge.diagnosis.machine.alignment import assignment
from screwgauge.diagnosis.machine.features import EXACT
from screwgauge.diagnosis.properties import Change
from screwgauge.models.machine import Element, Link, Machine
from screwgauge.reference.rotations import Array

#: A place told by several numbers is the same up to so many times the tolerance.
SUM = 3.0


def end_facts(pair: Pair, one: Link, other: Link) -> Iterator[Fact]:
    """Points of closures that lie elsewhere on one of their bodies, or on both alike."""
    for x, y in zip(one.elements, other.elements, strict=True):
        for name, partner in closure_names(pair, x, y).items():
            ends = [*_ends(pair, name, partner)]
            if not ends:
                continue
            both = len(ends) == 2 and np.linalg.norm(ends[0].b - ends[1].b) < EXACT * pair.a.length
            yield replace(ends[0], of="", changes=ends[0].changes + ends[1].changes) if both else ends[0]
            yield from ends[1:] if not both else ()


def closure_names(pair: Pair, x: Element, y: Element) -> dict[str, str]:
    """Closures of two elements: by their names, else those whose points are nearest to each other."""
    if {*x.closures} == {*y.closures}:
        return {name: name for name in x.closures}
    T = pair.alignment.placed[pair.a.part_of(_first_end(pair.a, x.closures[0])[0])]
    points = [[_first_end(m, name)[1] for name in e.closures] for m, e in ((pair.a, x), (pair.b, y))]
    moved = [T[:3, :3] @ point + T[:3, 3] for point in points[1]]
    cost = np.array([[float(np.linalg.norm(p - q)) for q in moved] for p in points[0]])
    return {x.closures[i]: y.closures[k] for i, k in assignment(cost)}


def _first_end(machine: Machine, name: str) -> tuple[str, Array]:
    """The first body of a closure, and its point in the world. Shape (3,)."""
    (body, frame), _ = machine.reading.ends(name)
    return body, frame[:3, 3]


def _ends(pair: Pair, name: str, partner: str) -> Iterator[Fact]:
    """Ends of a closure that lie elsewhere on their bodies; one that the file derives from the other follows it."""
    a, b = pair.a.reading, pair.b.reading
    known = {pair.a.part_of(end): (end, frame) for end, frame in a.ends(name)}
    derived = a.closures[name].derived and b.closures[partner].derived
    for k, (end, frame) in enumerate(b.ends(partner)):
        body = next((n for n, o in pair.alignment.bodies.items() if o == pair.b.part_of(end)), "")
        if body not in known or (k == 1 and derived):
            continue
        own, here = known[body]
        there = pair.alignment.placed[body] @ frame
        way = there[:3, 3] - here[:3, 3]
        size = float(np.linalg.norm(way)) / pair.a.length
        if size > SUM * TOLERANCE:
            what = "first_frame" if own == a.closures[name].first else "second_frame"
            change = Change(name, what, np.asarray(np.linalg.inv(a.poses[own]) @ there))
            step = np.array([np.zeros(3), way])
            yield Fact(name, "end", np.zeros((2, 3)), step, "m", size, changes=(change,), partner=partner, of=body)
