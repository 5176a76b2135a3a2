"""Creates shapes for drawing a mechanism, and geoms, contacts and sensors for an MJCF."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.formats import number_text, vector_text
from screwgauge.models.layout import Link, Tree, length_scale
from screwgauge.reference.applied import JointSpring, Spring
from screwgauge.reference.equations.kinematics import length, pose
from screwgauge.reference.graph import layout
from screwgauge.reference.lint import suspicious
from screwgauge.reference.mechanism import GROUND, Body, Frame, Joint, Mechanism
from screwgauge.reference.reciprocal import pose_joints
from screwgauge.reference.rotations import Array

#: Colours of bodies; they are dark enough for text.
COLOURS = ("#0072B2", "#00795B", "#B04A87", "#8C6D31", "#5E5AA8", "#3A7D9C")
PLAIN, DRIVEN, CUT, STANDING = "#8A9199", "#E69F00", "#D55E00", "#5F666D"
MASS, AXIS, DOUBT, SPRING = "#B58900", "#4477AA", "#CC0077", "#3D8B37"
SIGNED = "RPUC"  # kinds of joints whose axes are directed
LINK, JOINT, DISTINCT = 0.012, 0.022, 1e-3  # radius of a link, size of a joint, smallest visible distance


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A solid in the frame of a body.

    Attributes:
        group: Switch that shows or hides the shape: ``links``, ``joints``, ``axes``, ``frames``, ``masses``,
            ``ellipsoids``, ``springs``, ``doubts``, and ``other`` for shapes of a second mechanism.
        kind: ``rod`` and ``box`` from `a` to `b`; ``slide``, a rod whose end `b` is in the frame of body `other`;
            ``ball``, ``cage``, ``foot`` at `a`; ``ring`` about `b` - `a`; ``arrow`` from `a` to `b`; ``ellipsoid`` at
            `a` with the columns of `b` as semi-axes.
        body, other: Index of the body; 0 for the ground.
        a, b: Shape (3,); for an ellipsoid, `b` has shape (3, 3).
        size: Radius, or half the thickness.
    """

    group: str
    kind: str
    body: int
    a: Array
    b: Array
    size: float
    colour: str
    name: str = ""
    other: int = 0


def cut_joints(mechanism: Mechanism) -> frozenset[str]:
    """Return the names of the joints that are cut in the models of the engines."""
    return frozenset(joint.name for joint in layout(mechanism).cuts)


def hardware(mechanism: Mechanism) -> list[Joint]:
    """List the joints, except joints that only assign coordinates to a pose."""
    return [joint for joint in mechanism.joints if joint.name not in pose_joints(mechanism)]


def joints_at(mechanism: Mechanism, body: str) -> list[tuple[Joint, Frame]]:
    """Return the joints of a body with their frames in the body."""
    return [(joint, frame) for joint in hardware(mechanism) for name, frame in joint.sides if name == body]


def segments(body: Body, its: list[tuple[Joint, Frame]]) -> list[tuple[Array, Array]]:
    """Represent a body by line segments between its joints (a rod or plate), in the body frame [m]."""
    apart = {tuple(np.round(frame.p, 9)): (joint, frame.p) for joint, frame in its[::-1]}
    points = [point for _, point in apart.values()]
    if len(points) < 2:  # up to the centre of mass; twice as far if the body slides there
        start = points[0] if points else body.com
        return [(start, 2.0 * body.com - start if any(joint.slides for joint, _ in its) and len(its) > 1 else body.com)]
    if len(points) == 2:
        return [(points[0], points[1])]
    ring = [point for joint, point in apart.values() if GROUND not in joint.bodies]
    hub = np.mean(ring or points, axis=0)
    spokes = [(hub, point) for point in points if np.linalg.norm(point - hub) > 1e-9]
    if len(ring) < 3:
        return spokes
    across = np.linalg.svd(np.array(ring) - hub)[2][:2]
    ring.sort(key=lambda point: float(np.arctan2(*(across @ (point - hub)))))
    return [*zip(ring, [*ring[1:], ring[0]], strict=True), *(spokes if len(ring) < len(points) else [])]


def colour_of(i: int) -> str:
    """Return the colour of the body with index `i`."""
    return STANDING if i == 0 else COLOURS[(i - 1) % len(COLOURS)]


def shapes(mechanism: Mechanism) -> list[Shape]:
    """Return the shapes of a mechanism."""
    unit, index = length(layout(mechanism)), mechanism.body_index
    drawn: list[Shape] = []
    for body in mechanism.bodies:
        drawn += _body(body, index[body.name], joints_at(mechanism, body.name), unit, colour_of(index[body.name]))
    cuts = cut_joints(mechanism)
    for joint in hardware(mechanism):
        drawn += _joint(joint, index[joint.parent], index[joint.child], unit, joint.name in cuts)
        drawn += _foot(joint, unit)
    for odd in suspicious(mechanism):
        at = odd.point / unit
        drawn.append(Shape("doubts", "cage", index[odd.body], at, at, 3.0 * JOINT, DOUBT, odd.sentence))
    return drawn


def springs(mechanism: Mechanism, given: Iterable[Spring]) -> list[Shape]:
    """Return shapes of springs and dampers: a coil between two points, or a ring about a hinge axis."""
    unit, index, drawn = length(layout(mechanism)), mechanism.body_index, list[Shape]()
    owner = {name: (joint, i) for joint in mechanism.joints for i, name in enumerate(joint.coordinates)}
    for one in given:
        if isinstance(one, JointSpring):
            joint, i = owner[one.coordinate]
            (turns, axis), (body, place) = joint.freedoms[i], mark(joint)
            name = f"spring of {one.coordinate}"
            if turns:
                frame, at = joint.parent_frame if body == joint.parent else joint.child_frame, place / unit
                ends = at, at + JOINT * (frame.R @ axis)
                drawn.append(Shape("springs", "ring", index[body], *ends, 2.8 * JOINT, SPRING, name))
                continue
            (first, a), (second, b) = ((side, frame.p) for side, frame in joint.sides)
        else:
            name, first, second = f"spring {one.first} - {one.second}", one.first, one.second
            a, b = one.first_point, one.second_point
            drawn += [shape for end in ((first, a), (second, b)) for shape in _attachment(mechanism, *end, unit)]
        drawn.append(
            Shape("springs", "slide", index[first], a / unit, b / unit, 0.6 * LINK, SPRING, name, index[second])
        )
    return drawn


def _attachment(mechanism: Mechanism, body: str, point: Array, unit: float) -> Iterator[Shape]:
    """Yield the support of a spring's end: a ground symbol, or a rod to the nearest joint of the body."""
    i, points = mechanism.body_index[body], [frame.p for _, frame in joints_at(mechanism, body)]
    if body == GROUND:
        yield Shape("springs", "foot", i, point / unit, point / unit, JOINT, STANDING)
    elif points:
        nearest = min(points, key=lambda other: float(np.linalg.norm(other - point)))
        yield Shape("links", "rod", i, nearest / unit, point / unit, 0.6 * LINK, colour_of(i), body)


def place_shapes(mechanism: Mechanism, more: Iterable[Shape] = ()) -> list[Shape]:
    """Return the shapes of a mechanism, and further shapes, in the world frame at the home pose."""
    lay = layout(mechanism)
    at, unit, drawn = pose(lay, mechanism.home[None]), length(lay), list[Shape]()
    for one in (*shapes(mechanism), *more):
        ends = (one.body, one.a), (one.other if one.kind == "slide" else one.body, one.b.T)
        a, b = (at.p[0, i] / unit + v @ at.R[0, i].T for i, v in ends)
        drawn.append(replace(one, body=0, other=0, a=a, b=b.T))
    return drawn


def differences(mechanism: Mechanism, other: Mechanism, unsigned: Collection[str] = ()) -> list[Shape]:
    """Return world-frame shapes of the other mechanism's joints, bodies and axes that differ at the home pose.

    Two joints are equal if their screws span the same motions and both or neither are driven; location along a
    sliding axis, order of parent and child, and names do not matter. Lengths are relative to the first mechanism.

    Args:
        unsigned: Joints of the other mechanism whose axes are undirected, e.g. axes in loops closed by points.
    """
    unit = length(layout(mechanism))
    known, there = _freedoms(mechanism, unit), _freedoms(other, unit)
    moved, turned = set[str](), set[str]()
    for joint, span, screws in there:
        same = [one for one in known if one[0].actuated == joint.actuated and _close(one[1], span)]
        if not same:
            moved.add(joint.name)
        elif joint.kind in SIGNED and joint.name not in unsigned:
            ways = [-way if (one.parent, one.child) == (joint.child, joint.parent) else way for one, _, way in same]
            if not all(any(_close(screw, each) for way in ways for each in way) for screw in screws):
                turned.add(joint.name)
    lines = [one for one in place_shapes(mechanism) if one.group == "links"]
    held = {body for joint, *_ in there if joint.name in moved for body in (joint.parent, joint.child)}
    found, ratio = list[Shape](), length(layout(other)) / unit
    for one in place_shapes(other):
        one = replace(one, a=ratio * one.a, b=ratio * one.b)
        if (
            (one.group in ("joints", "axes") and one.name in moved)
            or (one.group == "axes" and one.name in turned)
            or (one.group == "links" and one.name in held and not any(_same_line(one, line) for line in lines))
        ):
            found.append(replace(one, group="other", colour=DOUBT))
    return found


def _freedoms(mechanism: Mechanism, unit: float) -> list[tuple[Joint, Array, Array]]:
    """Return each joint, the projector onto its motions, and its screws at the home pose, with lengths in `unit`."""
    lay, found = layout(mechanism), list[tuple[Joint, Array, Array]]()
    at = pose(lay, mechanism.home[None])
    for joint in mechanism.joints:
        if joint.constrains and not joint.fixed:
            screws = at.S[0, lay.columns[joint.name]] / np.repeat([1.0, unit], 3)
            screws /= np.maximum(np.abs(screws).max(axis=1, keepdims=True), 1e-12) if not joint.angles else 1.0
            basis = np.linalg.qr(screws.T)[0]
            found.append((joint, basis @ basis.T, screws))
    return found


def _close(a: Array, b: Array) -> bool:
    return a.shape == b.shape and bool(np.abs(a - b).max() < DISTINCT)


def _same_line(one: Shape, other: Shape) -> bool:
    return any(_close(np.stack([one.a, one.b]), np.stack(ends)) for ends in ((other.a, other.b), (other.b, other.a)))


def _body(body: Body, i: int, its: list[tuple[Joint, Frame]], unit: float, colour: str) -> Iterator[Shape]:
    for a, b in segments(body, its):
        yield Shape("links", "rod", i, a / unit, b / unit, LINK, colour, body.name)
    for axis, tone in zip(np.eye(3), ("#D62728", "#2CA02C", "#1F77B4"), strict=True):
        yield Shape("frames", "arrow", i, np.zeros(3), 0.08 * axis, 0.004, tone, body.name)
    com = body.com / unit
    yield Shape("masses", "ball", i, com, com, 1.6 * LINK, MASS, body.name)
    if body.mass > 0.0:  # semi-axes of the homogeneous ellipsoid with equal mass and moments
        moments, axes = np.linalg.eigh(body.inertia)
        half = np.sqrt(np.maximum(2.5 * (moments.sum() - 2.0 * moments) / body.mass, 0.0)) / unit
        yield Shape("ellipsoids", "ellipsoid", i, com, axes * np.maximum(half, 1e-3), 1.0, colour, body.name)


def mark(joint: Joint) -> tuple[str, Array]:
    """Return the body on which the mark of a joint is drawn, and the mark's position in that body [m]. Shape (3,).

    A slide on the ground is marked on the sliding body; between moving bodies, the mark is halfway along the slide at
    the home pose.
    """
    if joint.slides == 1 and GROUND in joint.bodies:
        return next((body, frame.p) for body, frame in joint.sides if body != GROUND)
    slides = [(q, axis) for q, (turns, axis) in zip(joint.home, joint.freedoms, strict=True) if not turns]
    along = sum((0.5 * q * axis for q, axis in slides), np.zeros(3))
    return joint.parent, joint.parent_frame.p + joint.parent_frame.R @ along


def _joint(joint: Joint, parent: int, child: int, unit: float, cut: bool) -> Iterator[Shape]:
    """Yield the axes of a joint, each in the body that carries it, and the marks of driven and cut joints."""
    colour, name, (body, place) = DRIVEN if joint.actuated else PLAIN, joint.name, mark(joint)
    first, at = parent if body == joint.parent else child, place / unit
    if joint.fixed:
        e = JOINT * joint.parent_frame.R[:, 2]
        yield Shape("joints", "box", first, at - e, at + e, JOINT, colour, name)
        return
    second = child if joint.angles == 2 else first
    for (turns, axis), i in zip(joint.freedoms, (first, second, child), strict=False):
        frame = joint.parent_frame if i == parent else joint.child_frame
        p = at if i == first else joint.child_frame.p / unit
        e, kind = frame.R @ axis, "rod" if turns else "box"
        if joint.angles == 3:
            yield Shape("joints", "ball", first, p, p, JOINT, colour, name)
            break
        half, size = (3.4 if turns and joint.slides == 1 else 1.9) * JOINT * e, (0.6 if turns else 0.9) * JOINT
        yield Shape("joints", kind, i, p - half, p + half, size, colour, name)
        yield Shape("axes", "arrow", i, p - 0.12 * e, p + 0.18 * e, 0.003, AXIS, name)
        if joint.actuated and turns:
            yield Shape("joints", "ring", i, p, p + JOINT * e, 2.0 * JOINT, DRIVEN, name)
        for way in (e, -e) if joint.actuated and not turns else ():
            yield Shape("joints", "arrow", i, p + 2.2 * JOINT * way, p + 5.5 * JOINT * way, 0.007, DRIVEN, name)
    if joint.slides:
        ends = joint.parent_frame.p / unit, joint.child_frame.p / unit
        yield Shape("joints", "slide", parent, *ends, 0.5 * LINK, colour, name, child)
    if cut:
        yield Shape("joints", "cage", first, at, at, 2.4 * JOINT, CUT, name)


def _foot(joint: Joint, unit: float) -> Iterator[Shape]:
    """Yield the ground symbol of a joint on the ground."""
    for p in (frame.p / unit for body, frame in joint.sides if body == GROUND):
        yield Shape("joints", "foot", 0, p, p, 2.0 * JOINT, STANDING, joint.name)


@lru_cache(maxsize=2)
def viewed_from(mechanism: Mechanism) -> Array:
    """Return the direction to the viewer: face-on for a planar mechanism; otherwise from the front, showing joints."""
    every = place_shapes(mechanism)
    points = np.array([one.a for one in every if one.group == "masses" or one.kind in ("slide", "ball")])
    places = [place for _, place, _ in joint_marks(mechanism)]  # empty if all bodies are free
    points = np.unique(np.concatenate([points, np.reshape(places, (-1, 3))]).round(6), axis=0)
    lay = layout(mechanism)
    screws = pose(lay, mechanism.home[None]).S[0]
    planar = face_on_view(points, screws[:, :3])
    if planar is not None:
        return planar
    i, j = np.triu_indices(len(points), 1)

    def overlap(direction: Array) -> float:
        seen = points @ view_axes(direction).T
        return float(np.sum(1.0 / (np.sum((seen[i] - seen[j]) ** 2, axis=1) + 1e-3)))

    angles = product(np.radians([-55, -70, -40, -25, -110, -125, -140, -155]), np.radians([25, 18, 32]))
    return min((np.array([np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)]) for a, h in angles), key=overlap)


def face_on_view(points: Array, axes: Array) -> Array | None:
    """Return the direction that shows a planar mechanism face-on; None for a spatial mechanism.

    Args:
        points: Points of joints and bodies, in units of the mechanism's length. Shape (n, 3).
        axes: Axes of all rotations; a row of zeros stands for a translation. Shape (m, 3).
    """
    flat = [axis for axis in (2, 1, 0) if np.ptp(points[:, axis]) < 1e-3]
    if flat:
        return np.asarray(np.eye(3)[flat[0]] * (-1.0 if flat[0] == 1 else 1.0))
    turns = axes[np.linalg.norm(axes, axis=1) > 0.5]
    if len(turns) < 2 or np.abs(np.cross(turns, turns[0])).max() > 1e-6:
        return None
    largest = int(np.argmax(np.abs(turns[0])))
    return np.asarray(turns[0] * np.sign(turns[0, largest]) * (-1.0 if largest == 1 else 1.0))


def view_axes(direction: Array) -> Array:
    """Return the viewer's right and up directions, with z up if possible. Shape (2, 3)."""
    right = np.cross([0.0, 0.0, 1.0] if abs(direction[2]) < 0.99 else [0.0, 1.0, 0.0], direction)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(direction, right)])


def joint_marks(mechanism: Mechanism) -> list[tuple[Joint, Array, Array]]:
    """Return the joints with their last axes and world positions (in mechanism lengths) at the home pose."""
    lay = layout(mechanism)
    at, index, unit = pose(lay, mechanism.home[None]), mechanism.body_index, length(lay)
    found = list[tuple[Joint, Array, Array]]()
    for joint in hardware(mechanism):
        (body, place), base = mark(joint), index[joint.parent]
        point = at.p[0, index[body]] + at.R[0, index[body]] @ place
        found.append((joint, point / unit, at.R[0, base] @ joint.parent_frame.R @ joint.freedoms[-1][1]))
    return found


def add_geoms(bodies: Mapping[str, ET.Element], tree: Tree, *, solid: bool) -> None:
    """Add a ball at each body's centre of mass, and bars from there to its joints; skip copies of bodies.

    Args:
        solid: True if the geoms collide, False if they are only visible.
    """
    radius = 0.02 * length_scale(tree.mechanism)
    for link in tree.links:
        if link.name != link.original:
            continue
        body = bodies[link.name]
        _geom(body, "sphere", 1.5 * radius, solid).set("pos", vector_text(link.body.com))
        for end in _bar_ends(link, tree):
            if np.linalg.norm(end - link.body.com) > radius:
                bar = _geom(body, "capsule", radius, solid)
                bar.set("fromto", vector_text([*link.body.com, *end]))


def _bar_ends(link: Link, tree: Tree) -> list[Array]:
    """Return the joint points of a body; if it has only one, add its mirror image about the centre of mass."""
    ends: dict[tuple[float, ...], Array] = {}
    for joint in tree.mechanism.joints:
        for side, frame in joint.sides:
            if side == link.original:
                ends[tuple(np.round(frame.p, 9))] = frame.p
    if len(ends) == 1:
        (end,) = ends.values()
        return [end, 2.0 * link.body.com - end]
    return list(ends.values())


def _geom(body: ET.Element, kind: str, radius: float, solid: bool) -> ET.Element:
    geom = ET.SubElement(body, "geom", type=kind, size=number_text(radius), mass="0")
    if not solid:
        geom.set("contype", "0")
        geom.set("conaffinity", "0")
    return geom


def add_contact_pairs(root: ET.Element, tree: Tree) -> None:
    """Exclude contacts between bodies that share a joint, since they overlap there."""
    contact = ET.SubElement(root, "contact")
    for first, second in sorted({(joint.parent, joint.child) for joint in tree.mechanism.joints}):
        ET.SubElement(contact, "exclude", body1=first, body2=second)


def add_sensors(root: ET.Element, tree: Tree) -> None:
    """Add sensors for the poses of all bodies, and the positions and rates of all joints of the tree."""
    sensor = ET.SubElement(root, "sensor")
    for link in tree.links:
        for kind in ("framepos", "framequat"):
            ET.SubElement(sensor, kind, name=f"{link.name}.{kind}", objtype="xbody", objname=link.name)
    for name in (freedom.coordinate for link in tree.links for freedom in link.moves):
        for kind in ("jointpos", "jointvel"):
            ET.SubElement(sensor, kind, name=f"{name}.{kind}", joint=name)
