"""Two machines and their matching: bodies, links and joints of A with their partners in B."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.models.machine import Link, Machine, fuse
from screwgauge.reference.rotations import Array

if TYPE_CHECKING:
    from screwgauge.diagnosis.facts.fact import Fact


@dataclass(frozen=True, slots=True)
class Partner:
    """A joint of B with the coordinate ``sign q + zero`` [rad or m], where q is its partner's coordinate in A."""

    name: str
    sign: float = 1.0
    zero: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Two machines with the matching of their bodies, links and joints.

    Attributes:
        bodies: Body of A -> body of B.
        placed: Body of A -> placement of B's world frame in A's that aligns the body's partner with it, with both
            machines at their closed poses. Shape (4, 4).
        links: Pairs of links, each seen from the body nearer to the ground.
        only_a, only_b: Links without a partner.
        joints: Joints of A with their partners, added while links are compared.
        lost: Facts about links and welds that only one model has and that were removed from the machines.
    """

    a: Machine
    b: Machine
    bodies: Mapping[str, str]
    placed: Mapping[str, Array]
    links: tuple[tuple[Link, Link], ...]
    only_a: tuple[Link, ...]
    only_b: tuple[Link, ...]
    joints: dict[str, Partner] = field(default_factory=dict)
    lost: tuple[Fact, ...] = ()

    @property
    def inverse(self) -> Pair:
        """The pair with A and B exchanged, and without matched joints."""
        bodies = {other: name for name, other in self.bodies.items()}
        ends = [(x, y) for one, other in self.links for x, y in ((one.near, other.near), (one.far, other.far))]
        known = {other: name for name, other in ends if name in self.placed} | bodies
        placed_ = {other: np.asarray(np.linalg.inv(self.placed[name])) for other, name in known.items()}
        links = tuple((other, one) for one, other in self.links)
        lost = tuple(replace(fact, a=fact.b, b=fact.a) for fact in self.lost)
        return Pair(self.b, self.a, bodies, placed_, links, self.only_b, self.only_a, lost=lost)

    def fuse(self, gone: Link, side: str) -> Pair:
        """Fuse an unmatched body of one machine into its neighbour."""
        if side == "B":
            return self.inverse.fuse(gone, "A").inverse
        links = tuple((one.rename_body(gone.far, gone.near), other) for one, other in self.links)
        only = (one.rename_body(gone.far, gone.near) for one in self.only_a)
        only_a = tuple(one for one in only if one.near != one.far)
        return replace(self, a=fuse(self.a, gone), links=links, only_a=only_a)

    @property
    def complete(self) -> bool:
        """True if every body and link has a partner."""
        return not (self.only_a or self.only_b) and len(self.bodies) == len(self.a.bodies) == len(self.b.bodies)

    @property
    def back(self) -> Mapping[str, str]:
        """Joint of B -> joint of A."""
        return {partner.name: name for name, partner in self.joints.items()}

    def displacement(self, near: str, far: str) -> Array:
        """Return the displacement from A's far body to B's far body, with the near bodies aligned. Shape (4, 4)."""
        return np.asarray(self.placed[far] @ np.linalg.inv(self.placed[near]))

    def crosses_names(self, joint: str) -> bool:
        """Return True if a joint of A or its partner has the name of a different joint in the other model."""
        other = self.joints[joint].name
        return other != joint and (joint in self.b.reading.joints or other in self.a.reading.joints)

    def partner(self, joint: str) -> Partner:
        """Return the partner of a joint of A; for an unmatched joint, the joint of B with the same name."""
        return self.joints.get(joint, Partner(joint))
