"""A mechanism at its home pose."""

from __future__ import annotations

import numpy as np
from matplotlib.path import Path

from screwgauge.reference.mechanism import GROUND, Joint, Mechanism
from screwgauge.reference.pose import layout, place, pose
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Picture
from screwgauge.report.figures import labels
from screwgauge.report.figures.page import EDGE, GAP, arrange, panels, saved
from screwgauge.report.figures.style import COLOURS, GREY, INK, Look, darker, styled

WIDTH, TALL, MARGIN = 576.0, 380.0, 24.0  # of page and drawing, at most [points]; within it, for names and hatching
#: Parallel projection from above; turned so that what is symmetric about the axes of the world does not look flat.
(S1, S2), (C1, C2) = np.sin(np.radians([30.0, 20.0])), np.cos(np.radians([30.0, 20.0]))
VIEW = np.array([[-S1, C1, 0.0], [-S2 * C1, -S2 * S1, C2]])
KINDS = {"R": "revolute", "P": "prismatic", "U": "universal", "S": "spherical", "C": "cylindrical", "F": "free"}
MARKERS = {"R": "o", "P": "s", "U": "D", "S": "*", "C": "X", "F": "P"}
SIZES = {"*": 11.0, "D": 7.0}
#: A short line below a point, with strokes below it [points].
HATCH = Path([(-10, -6), (10, -6), *(at for x in (-6, -1, 4, 9) for at in ((x, -6), (x - 5, -11)))], [1, 2] * 5)
FLOOR: Look = {"color": GREY, "linestyle": "", "marker": HATCH, "markersize": 22.0, "markeredgewidth": 1.2}
End = tuple[Array, bool]  # where a joint of a body is; whether it stands on the ground


@styled
def mechanism_plot(mechanism: Mechanism) -> Picture:
    """Bodies as lines between their joints, joints as marks by kind, hatching where they stand on the ground.

    Seen from above; a mechanism that is flat at its home pose is seen face-on.
    """
    ends, joints, coms = _home(mechanism)
    points = np.array([*coms.values(), *(point for several in ends.values() for point, _ in several)])
    flat = [axis for axis in (2, 1, 0) if np.ptp(points[:, axis]) < 1e-9 * np.ptp(points, axis=0).max()]
    view = np.delete(np.eye(3), flat[0], axis=0) if flat else VIEW
    bodies = {name: _lines(ends[name], com, view) for name, com in coms.items()}
    everything = np.concatenate([*bodies.values(), [view @ point for _, point, _ in joints]])
    low, size = np.nanmin(everything, axis=0), np.ptp(everything[~np.isnan(everything[:, 0])], axis=0)
    unit = float(max(size / (np.array([WIDTH - EDGE - GAP, TALL]) - 2 * MARGIN)))  # metres to a point
    page = panels(WIDTH, [float(size[1] / unit + 2 * MARGIN)])
    (ax,) = page.axes
    ax.set_axis_off()
    names, legend = [], {"ground (hatched)": FLOOR}
    for i, (name, lines) in enumerate(bodies.items()):
        colour = INK if len(lines) > 2 else COLOURS[i % 6]
        ax.plot(*lines.T, color=colour, linewidth=3.0)
        names.append(labels.beside(lines[:2].mean(axis=0), name, darker(colour)))
        if len(ends[name]) == 1:  # no body goes on from here: a weight
            ax.plot(*view @ coms[name], "o", color=colour, markersize=9.0)
    for joint, point, standing in joints:
        if standing:
            ax.plot(*view @ point, **FLOOR)
        mark, fill = MARKERS[joint.kind], INK if joint.actuated else "white"
        look: Look = {"color": INK, "linestyle": "", "marker": mark, "markerfacecolor": fill}
        look["markersize"] = SIZES.get(mark, 8.0)
        legend[KINDS[joint.kind] + ", actuated" * joint.actuated] = look
        ax.plot(*view @ point, zorder=3, **look)
    arrange(page, f"{mechanism.title or mechanism.name}: home pose", above=[legend])
    reach = unit * np.array([ax.bbox.width, ax.bbox.height]) / 2.0
    (left, bottom), (right, top) = low + size / 2.0 - reach, low + size / 2.0 + reach
    ax.set(xlim=(left, right), ylim=(bottom, top))
    labels.place(ax, names)
    return saved(page, "mechanism")


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
