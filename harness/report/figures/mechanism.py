"""A mechanism at its home pose."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.mechanism import GROUND, Joint, Mechanism
from screwgauge.reference.pose import layout, place, pose
from screwgauge.reference.rotations import Array
from screwgauge.report.figures.data import Axis, Diagram, Label, Look, Panel, Row, Series
from screwgauge.report.figures.looks import COLOURS, GREY, darker
from screwgauge.report.figures.render import EDGE, GAP

WIDTH, TALL, MARGIN = 576.0, 380.0, 24.0  # of the picture; of the drawing, at most; within it, for names and hatching
#: Parallel projection from above; turned so that what is symmetric about the axes of the world does not look flat.
(S1, S2), (C1, C2) = np.sin(np.radians([30.0, 20.0])), np.cos(np.radians([30.0, 20.0]))
VIEW = np.array([[-S1, C1, 0.0], [-S2 * C1, -S2 * S1, C2]])
KINDS = {"R": "revolute", "P": "prismatic", "U": "universal", "S": "spherical", "C": "cylindrical", "F": "free"}
MARKERS = {"R": "o", "P": "s", "U": "D", "S": "*", "C": "X", "F": "P"}
INK, HATCH = "#333333", Look(GREY)
#: A short line below a point, with strokes below it [pt].
FLOOR = [[-10, -6], [10, -6], *(at for x in (-6, -1, 4, 9) for at in ([np.nan] * 2, [x, -6], [x - 5, -11]))]
End = tuple[Array, bool]  # where a joint of a body is; whether it stands on the ground


def mechanism_figure(mechanism: Mechanism) -> Diagram:
    """Bodies as lines between their joints, joints as marks by kind, hatching where they stand on the ground.

    Seen from above; a mechanism that is flat at its home pose is seen face-on.
    """
    ends, joints, coms = _home(mechanism)
    points = np.array([*coms.values(), *(point for several in ends.values() for point, _ in several)])
    flat = [axis for axis in (2, 1, 0) if np.ptp(points[:, axis]) < 1e-9 * np.ptp(points, axis=0).max()]
    view = np.delete(np.eye(3), flat[0], axis=0) if flat else VIEW
    bodies = {name: _lines(ends[name], com, view) for name, com in coms.items()}
    everything = np.concatenate([*bodies.values(), [view @ point for _, point, _ in joints]])
    low, high, room = np.nanmin(everything, axis=0), np.nanmax(everything, axis=0), np.array([WIDTH - EDGE - GAP, TALL])
    unit = float(max((high - low) / (room - 2 * MARGIN)))  # metres to a point
    room[1] = (high[1] - low[1]) / unit + 2 * MARGIN
    x, y = (Axis("", mid - half, mid + half) for mid, half in zip((low + high) / 2, unit * room / 2, strict=True))
    series, labels, marks, legend = [], [], [], {"ground (hatched)": HATCH}
    for joint, point, standing in joints:
        look = Look(INK, None, 1.2, MARKERS[joint.kind], INK if joint.actuated else "white", 8.0)
        legend[KINDS[joint.kind] + ", actuated" * joint.actuated] = look
        marks.append(_series(view @ point, look))
        if standing:
            series.append(_series(view @ point + unit * np.array(FLOOR), HATCH))
    for i, (name, lines) in enumerate(bodies.items()):
        colour = INK if len(lines) > 2 else COLOURS[i % 6]
        series.append(_series(lines, Look(colour, (), 3.0)))
        u, v = lines[:2].mean(axis=0).tolist()
        labels.append(Label(u, v, name, darker(colour)))
        if len(ends[name]) == 1:  # no body goes on from here: a weight
            series.append(_series(view @ coms[name], Look(colour, None, 1.0, "o", size=9.0)))
    panel = Panel(x, y, (*series, *marks), labels=tuple(labels), bare=True)
    heading, row = f"{mechanism.title or mechanism.name}: home pose", Row((panel,), float(room[1]))
    return Diagram(heading, (row,), WIDTH, legends=(legend,))


def _home(mechanism: Mechanism) -> tuple[dict[str, list[End]], list[tuple[Joint, Array, bool]], dict[str, Array]]:
    """Body -> its ends; joints with their places, and whether they stand on the ground; body -> centre of mass."""
    at, index = pose(layout(mechanism), mechanism.home[None]), mechanism.body_index
    ends: dict[str, list[End]] = {name: [] for name in index}
    joints = []
    for joint in mechanism.joints:
        standing = GROUND in (joint.parent, joint.child)
        for name, frame in ((joint.parent, joint.parent_frame), (joint.child, joint.child_frame)):
            ends[name].append((place(at.R[0, index[name]], at.p[0, index[name]], frame)[1], standing))
        joints.append((joint, (ends[joint.parent][-1][0] + ends[joint.child][-1][0]) / 2, standing))
    return ends, joints, {b.name: at.p[0, index[b.name]] + at.R[0, index[b.name]] @ b.com for b in mechanism.bodies}


def _lines(ends: list[End], com: Array, view: Array) -> Array:
    """A rod; or a plate through all joints but those on the ground, with a spoke to each. Shape (n, 2), NaN between."""
    apart = list({tuple(np.round(point, 9)): (point @ view.T, standing) for point, standing in ends[::-1]}.values())
    middle = com @ view.T
    if len(apart) == 1:  # as far beyond its centre of mass, if another body goes on from there
        return np.array([apart[0][0], middle if len(ends) == 1 else 2.0 * middle - apart[0][0]])
    if len(apart) == 2:
        return np.array([point for point, _ in apart])
    ring = [point for point, standing in apart if not standing]
    within = np.mean(ring or [middle], axis=0)
    ring.sort(key=lambda point: float(np.arctan2(*(point - within))))
    spokes = [corner for point, _ in apart for corner in (point, middle, np.full(2, np.nan))]
    return np.array([*ring, *ring[:1], np.full(2, np.nan), *spokes])


def _series(places: Array, look: Look) -> Series:
    """Places on the page, shape (n, 2) or (2,)."""
    return Series(np.atleast_2d(places)[:, 0], np.atleast_2d(places)[:, 1], look)
