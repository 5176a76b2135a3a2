"""Both machines of a diagnosis side by side in the home pose, with their differences marked."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.models.kinematics import rehome
from screwgauge.models.machine import at_closed_pose
from screwgauge.models.readings.reading import Reading
from screwgauge.models.shapes import DOUBT, PLAIN, face_on_view, view_axes
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Picture
from screwgauge.report.stage.drawing import CORNER, EDGE, FONT, corner, labels

if TYPE_CHECKING:
    from screwgauge.diagnosis.answer import Diagnosis
    from screwgauge.diagnosis.model import Model

#: Sizes of one machine and of the line above it [pixels]; number of names shown, beginning with the first causes.
SIDE, HEAD, NAMED = 290.0, 26.0, 8
#: Direction to the viewer of both machines, unless they are planar.
SEEN = np.array([0.62, -0.62, 0.48])
LOOK = (
    f".two text{{font:{FONT:g}px sans-serif;paint-order:stroke;stroke:#fff;stroke-width:3px;stroke-linejoin:round}}"
    f".two path{{fill:none;stroke:{PLAIN};stroke-width:3.5;stroke-linecap:round}}.two circle{{fill:#fff;stroke:#444}}"
    f".two .differs{{stroke:{DOUBT}}}.two .mass{{fill:{PLAIN};stroke:none;opacity:.45}}"
    f".two .mass.differs{{fill:{DOUBT}}}.two .thin{{stroke:#767676;stroke-width:1}}"
)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnMachine:
    """A machine placed in A's world frame, with its differing bodies and joints in the order of their causes."""

    title: str
    reading: Reading
    placement: Array
    differs: tuple[str, ...]

    def point(self, at: Array) -> Array:
        """Return the position of a point in A's world frame. Shape (3,)."""
        return np.asarray(self.placement[:3, :3] @ at + self.placement[:3, 3])

    def joints(self) -> dict[str, Array]:
        """Return the position of each joint."""
        return {name: self.point(joint.centre) for name, joint in self.reading.joints.items()}

    def closures(self) -> Iterator[tuple[str, Array]]:
        """Yield the bodies that closures connect, each with its point of attachment."""
        for name, frame in (end for closure in self.reading.closures for end in self.reading.ends(closure)):
            yield name, self.point(frame[:3, 3])

    def links(self) -> Iterator[tuple[str, Array, Array]]:
        """Yield the lines that represent each body; they connect its joints and closures, or its joint and its mass."""
        at, masses, held = self.joints(), self.masses(), [*self.closures()]
        behind = dict[str, list[str]]()
        for name, body in self.reading.bodies.items():
            behind.setdefault(body.near, []).append(name)
        for name in (GROUND, *self.reading.bodies):
            own = self.reading.bodies[name].joints if name in self.reading.bodies else ()
            start = at[own[-1]] if own else self.placement[:3, 3]
            for one, two in pairwise(own):
                yield name, at[one], at[two]
            others = [at[self.reading.bodies[each].joints[0]] for each in behind.get(name, ())]
            others += [point for body, point in held if body == name]
            for end in others or ([masses[name][0]] if name in masses else []):
                yield name, start, end

    def masses(self) -> dict[str, tuple[Array, float]]:
        """Return the position of each body's centre of mass, and the mass of the body [kg]."""
        bodies = self.reading.bodies.items()
        return {name: (self.point(body.centre), body.mass) for name, body in bodies if body.mass > 0.0}


def machines(diagnosis: Diagnosis) -> Picture:
    """Draw both machines; colour differing bodies and joints, and name the first of them."""
    causes = (cause for cause in diagnosis.causes if cause.kind != "digits")
    order = [diagnosis.differences[i] for cause in causes for i in cause.differences]
    ours, theirs = (
        tuple(dict.fromkeys(filter(None, (getattr(each, side) for each in order)))) for side in ("item_a", "item_b")
    )
    pair = diagnosis.found.pair  # here, B as a whole is aligned with A
    one, two = _in_one_pose(diagnosis)
    placement = pair.placed.get(GROUND, np.eye(4))
    sides = (
        DrawnMachine(_title("A", diagnosis.a), one, np.eye(4), ours),
        DrawnMachine(_title("B", diagnosis.b), two, placement, theirs),
    )
    points = [np.array([*side.joints().values(), *_further_points(side)]) for side in sides]
    view = view_axes(_view_direction(np.concatenate(points), sides)) * [[1.0], [-1.0]]
    cloud = np.concatenate(points) @ view.T
    low, size = cloud.min(axis=0), np.maximum(np.ptp(cloud, axis=0), 1e-9)
    scale = min((SIDE - 2 * EDGE) / size[0], (SIDE - 2 * EDGE) / size[1])
    tall = HEAD + scale * size[1] + 2 * EDGE + CORNER
    heaviest = max((mass for side in sides for _, mass in side.masses().values()), default=1.0)
    out = []
    for k, side in enumerate(sides):
        shift = np.array([k * SIDE + (SIDE - scale * size[0]) / 2.0, HEAD + EDGE]) - scale * low
        drawn = _draw(side, scale * view, shift, heaviest, tall - CORNER, k * SIDE)
        out.append(f'<g class="{("first", "second")[k]}">{drawn}</g>')
    out.append(f'<g class="foot">{corner(view, scale, tall)}{_legend(2 * SIDE - 300.0, tall - 16.0)}</g>')
    size_text = f'viewBox="0 0 {2 * SIDE:.0f} {tall:.0f}" width="{2 * SIDE:.0f}" height="{tall:.0f}"'
    size_text += f' style="--below:{tall - CORNER:.0f}"'  # page.css moves B down by this distance on a phone
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="two" {size_text}><style>{LOOK}</style>'
        f'<rect width="100%" height="100%" fill="#fff"/>{"".join(out)}</svg>\n'
    )
    return Picture("machines", "Both machines in the home pose, with differences in colour", svg)


def _in_one_pose(diagnosis: Diagnosis) -> tuple[Reading, Reading]:
    """Return both readings in the home pose of A, or in the home pose of B if only B's file locates the closures."""
    pair = diagnosis.found.pair
    a, b = pair.a.reading, pair.b.reading
    single = {n: x for n, x in pair.joints.items() if a.joints[n].kind == b.joints[x.name].kind in ("hinge", "slide")}
    if diagnosis.b.home and not diagnosis.a.home:
        q = {n: x.sign * (b.joints[x.name].home - x.zero) for n, x in single.items()}
        return at_closed_pose(rehome(a, q)[0]), b
    q = {x.name: x.sign * a.joints[n].home + x.zero for n, x in single.items()}
    return a, at_closed_pose(rehome(b, q)[0])


def _title(side: str, model: Model) -> str:
    return f"{side}: {len(model.reading.joints)} joints, {model.reading.mass:.6g} kg"


def _further_points(side: DrawnMachine) -> Iterator[Array]:
    """Yield the points other than joints that a picture must contain: closures and centres of mass."""
    yield from (point for _, point in side.closures())
    yield from (point for point, _ in side.masses().values())


def _legend(x: float, y: float) -> str:
    marks = (
        '<circle class="mass" r="6"/><text x="11" y="4">centre of mass</text>',
        '<circle r="3"/><text x="8" y="4">joint</text>',
        '<path class="differs" d="M-12,0H6"/><text x="12" y="4">difference</text>',
    )
    places = zip((0.0, 120.0, 190.0), marks, strict=True)
    drawn = (f'<g transform="translate({x + dx:.0f} {y:.0f})">{mark}</g>' for dx, mark in places)
    return f'<g class="legend">{"".join(drawn)}</g>'


def _view_direction(points: Array, sides: Sequence[DrawnMachine]) -> Array:
    """Return the direction to the viewer, which is normal to the plane if both machines are planar."""
    axes = np.array([side.placement[:3, :3] @ one.screw[:3] for side in sides for one in side.reading.joints.values()])
    planar = face_on_view(points / float(np.ptp(points, axis=0).max() or 1.0), axes.reshape(-1, 3))
    return SEEN / np.linalg.norm(SEEN) if planar is None else planar


def _draw(side: DrawnMachine, view: Array, shift: Array, heaviest: float, tall: float, left: float) -> str:
    """Draw lines, joints, names, and masses as circles with radii proportional to the cube root of the mass."""
    differs: Collection[str] = frozenset(side.differs)
    spots, out = {name: view @ at + shift for name, at in side.joints().items()}, list[str]()
    for name, a, b in side.links():
        p, q = view @ a + shift, view @ b + shift
        mark = ' class="differs"' if name in differs else ""
        out.append(f'<path{mark} d="M{p[0]:.1f},{p[1]:.1f}L{q[0]:.1f},{q[1]:.1f}"/>')
    for name, (at, mass) in side.masses().items():
        x, y = view @ at + shift
        mark, r = " differs" if name in differs else "", 9.0 * (mass / heaviest) ** (1.0 / 3.0)
        out.append(f'<circle class="mass{mark}" cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}"/>')
        spots.setdefault(name, np.array([x, y]))
    for name in side.reading.joints:
        (x, y), mark = spots[name], ' class="differs" stroke-width="2"' if name in differs else ""
        out.append(f'<circle{mark} cx="{x:.1f}" cy="{y:.1f}" r="3"/>')
    wanted = [(name, DOUBT, spots[name]) for name in side.differs if name in spots][:NAMED]
    out += labels(wanted, np.array([*spots.values()]), left + SIDE, tall, left)
    return f'<text x="{left + 8.0:.0f}" y="18">{escape(side.title)}</text>{"".join(out)}'
