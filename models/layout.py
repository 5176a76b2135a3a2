"""Cuts a mechanism into a tree and its closures; URDF, MJCF and loops files are written from these."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.graph import Edge, Layout, spanning_tree
from screwgauge.reference.mechanism import GROUND, POINTS, Body, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array

#: ``minimal`` selects the smallest tree; points close the joints outside it. ``full`` puts every joint in the tree; a
#: joint that closes a loop leads to a copy of its body, which is welded to the body itself. The minimal cut also uses
#: such copies for joints that points cannot close, and for joints that are actuated or have a rotor, which no engine
#: supports outside its tree.
CUTS = ("minimal", "full")


@dataclass(frozen=True, slots=True, eq=False)
class Freedom:
    """A single degree of freedom of a joint.

    Attributes:
        axis: Direction in the joint frame. Shape (3,).
        limits: Lower and upper limit [rad or m]. Shape (2,).
        rotor, damping, friction: See `Joint`.
    """

    coordinate: str
    turns: bool
    axis: Array
    home: float
    limits: Array
    rotor: float
    damping: float
    friction: float


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A body of the tree or a copy of a body, and the joint that leads to it.

    Attributes:
        name: Name of the body, or ``body@joint`` for a copy.
        original: Name of the body in the description.
        body: Body with this link's share of the original's mass and inertia.
        near: Parent link, on the ground side.
        reverse: True if the description declares the joint from this link towards `near`.
    """

    name: str
    original: str
    body: Body
    near: str
    joint: Joint
    reverse: bool

    @property
    def moves(self) -> tuple[Freedom, ...]:
        """Degrees of freedom of the joint in a model file; empty for a fixed joint."""
        return () if self.joint.fixed else self.freedoms

    @property
    def near_frame(self) -> Frame:
        """Frame of the joint in `near`."""
        return self.joint.child_frame if self.reverse else self.joint.parent_frame

    @property
    def far_frame(self) -> Frame:
        """Frame of the joint in this link."""
        return self.joint.parent_frame if self.reverse else self.joint.child_frame

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Degrees of freedom of the joint, from the ground outwards; coordinates keep their names and values."""
        joint, sign = self.joint, -1.0 if self.reverse else 1.0
        resists = joint.rotor, joint.damping, joint.friction
        numbers = joint.coordinates, joint.freedoms, joint.home, joint.limits, *resists
        declared = tuple(
            Freedom(coordinate, turns, sign * axis, float(home), limits, *map(float, more))
            for coordinate, (turns, axis), home, limits, *more in zip(*numbers, strict=True)
        )
        return declared[::-1] if self.reverse else declared


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """A constraint that closes a loop.

    Attributes:
        joint: Joint of the description that closes the loop.
        type: ``point`` (S joint), ``points`` (R joint: two points on its axis) or ``weld`` (of a copy).
        parent, child: Links on the two sides of the joint; for a weld, the original and its copy.
        parent_points, child_points: Coinciding points of the two links [m]. Shape (n, 3); empty for a weld.
        parent_frame, child_frame: Frames of the joint in the two links; for a weld, the coinciding frames.
    """

    joint: str
    type: str
    parent: str
    child: str
    parent_points: Array
    child_points: Array
    parent_frame: Frame
    child_frame: Frame

    @property
    def pairs(self) -> list[tuple[str, Frame, Frame]]:
        """Frames of parent and child that coincide (weld) or share an origin; two pairs of points are numbered."""
        if self.type == "weld":
            return [("", self.parent_frame, self.child_frame)]
        points = [*zip(self.parent_points, self.child_points, strict=True)]
        if self.type == "point":
            near, far = points[0]
            return [("", replace(self.parent_frame, p=near), replace(self.child_frame, p=far))]
        return [(str(i), Frame(near), Frame(far)) for i, (near, far) in enumerate(points, 1)]

    def frames(self) -> Iterator[tuple[tuple[str, str, Frame], tuple[str, str, Frame]]]:
        """Yield pairs of coinciding frames; each frame is given by its name, its link and its placement there."""
        for number, *placed in self.pairs:
            near, far = (frame if self.type == "weld" else Frame(frame.p) for frame in placed)
            yield (f"{self.joint}@parent{number}", self.parent, near), (f"{self.joint}@child{number}", self.child, far)

    def orient(self, joint: Joint) -> Closure:
        """Return the closure with its parent on the joint's parent side; for a weld, the original is the parent."""
        copy = f"@{self.joint}"
        if not (self.parent.endswith(copy) if self.type == "weld" else self.parent == joint.child):
            return self
        points, frames = (self.child_points, self.parent_points), (self.child_frame, self.parent_frame)
        return Closure(self.joint, self.type, self.child, self.parent, *points, *frames)


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """A cut mechanism. `links` are in depth-first order, each link after its `near`; they do not include the ground."""

    mechanism: Mechanism
    cut: str
    links: tuple[Link, ...]
    closures: tuple[Closure, ...]

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return tuple(freedom for link in self.links for freedom in link.freedoms)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the tree's coordinates, from the ground outwards."""
        return tuple(freedom.coordinate for freedom in self.freedoms)


def lay_out(mechanism: Mechanism, cut: str) -> Tree:
    """Cut the loops of a mechanism.

    Args:
        cut: Kind of cut, one of `CUTS`.

    Raises:
        UnknownNameError: The cut is not one of `CUTS`.
        DescriptionError: A body or coupling has a name that is reserved for the model files.
    """
    if cut not in CUTS:
        raise UnknownNameError("cut", cut, CUTS)
    spanning = spanning_tree(mechanism)
    cuts = spanning.cuts
    copies = [_copy(j) for j in cuts if cut == "full" or j.actuated or j.rotor.any() or j.kind not in POINTS]
    edges = [*spanning.edges, *copies]
    shares = Counter(edge.far for edge in edges)
    links = [_link(edge, mechanism, shares, edge in copies) for edge in edges]
    _check_names(links, mechanism)
    welds = {link.joint.name: _weld(link) for link in links[len(spanning.edges) :]}
    half = 0.5 * length_scale(mechanism)
    closures = tuple(welds.get(joint.name) or _points(joint, half) for joint in cuts)
    _check_couplings(mechanism, closures)
    return Tree(mechanism, cut, tuple(_depth_first(links, mechanism)), closures)


def open_tree(lay: Layout) -> tuple[Array, list[int]]:
    """Return the tree of the minimal model files, in which a body and its copies share the mass equally.

    Returns:
        Matrix of shape (n_body, n_q) that has +1 or -1 for each coordinate on the path to a body, averaged over the
        body and its copies; and the coordinates of the tree.
    """
    links, index = lay_out(lay.mechanism, "minimal").links, lay.mechanism.body_index
    parts = Counter(link.original for link in links)
    ways, path = {GROUND: np.zeros_like(lay.path[0])}, np.zeros_like(lay.path)
    for link in links:
        ways[link.name] = ways[link.near].copy()
        ways[link.name][lay.columns[link.joint.name]] = -1.0 if link.reverse else 1.0
        path[index[link.original]] += ways[link.name] / parts[link.original]
    return path[1:], sorted(c for link in links for c in lay.columns[link.joint.name])


def length_scale(mechanism: Mechanism) -> float:
    """Return the largest distance in the description [m], or 1 if it does not contain distances."""
    lengths = [1e-300]
    for joint in mechanism.joints:
        lengths += [float(np.linalg.norm(frame.p)) for frame in (joint.parent_frame, joint.child_frame)]
        lengths += [abs(float(home)) for (turns, _), home in zip(joint.freedoms, joint.home, strict=True) if not turns]
    return max(lengths) if max(lengths) > 1e-300 else 1.0


def _copy(joint: Joint) -> Edge:
    """Return the edge to the copy of a cut joint's child, or of its parent if the child is the ground."""
    return Edge(joint, GROUND if joint.child == GROUND else joint.parent)


def _link(edge: Edge, mechanism: Mechanism, shares: Counter[str], copied: bool) -> Link:
    name = f"{edge.far}@{edge.joint.name}" if copied else edge.far
    whole, parts = mechanism.body(edge.far), shares[edge.far]
    share = replace(whole, name=name, mass=whole.mass / parts, inertia=whole.inertia / parts)
    return Link(name, edge.far, share, edge.near, edge.joint, edge.reverse)


def _weld(link: Link) -> Closure:
    none, frame = np.zeros((0, 3)), link.far_frame
    return Closure(link.joint.name, "weld", link.original, link.name, none, none, frame, frame)


def _points(joint: Joint, half: float) -> Closure:
    """Build the point closure of a cut joint; a hinge gets two axis points at a distance `half` [m] from its origin."""
    kind, arms = "point", np.zeros((1, 3))
    if POINTS[joint.kind] == 2:
        kind, arms = "points", half * np.array([joint.axes[0], -joint.axes[0]])
    near, far = joint.parent_frame, joint.child_frame
    points = near.p + arms @ near.R.T, far.p + arms @ far.R.T
    return Closure(joint.name, kind, joint.parent, joint.child, points[0], points[1], near, far)


def _depth_first(links: list[Link], mechanism: Mechanism) -> list[Link]:
    """Order links chain by chain from the ground; side branches follow the order of the description."""
    order = {joint.name: i for i, joint in enumerate(mechanism.joints)}
    onward: dict[str, list[Link]] = {}
    for link in sorted(links, key=lambda link: -order[link.joint.name]):
        onward.setdefault(link.near, []).append(link)
    walked, stack = [], list(onward.get(GROUND, []))
    while stack:
        walked.append(stack.pop())
        stack += onward.get(walked[-1].name, [])
    return walked


def _check_names(links: list[Link], mechanism: Mechanism) -> None:
    names = ["world", *(link.name for link in links)]  # "world" is the name of MuJoCo's root
    for name in names:
        if names.count(name) > 1:
            where = mechanism.where or mechanism.name
            raise DescriptionError(f"the name '{name}' is reserved for the model files", where, "rename that body")


def _check_couplings(mechanism: Mechanism, closures: tuple[Closure, ...]) -> None:
    """Reject couplings named like closures: an MJCF lists both together, and numbers the two points of a hinge."""
    taken = {f"{closure.joint}{number}" for closure in closures for number in ("", ".1", ".2")}
    for coupling in mechanism.couplings:
        if coupling.name in taken:
            what = f"the name '{coupling.name}' is reserved for the model files"
            raise DescriptionError(what, coupling.where or mechanism.name, "rename that coupling")
