"""A mechanism at its home pose as SVG, by parallel projection."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from itertools import product

import numpy as np

from screwgauge.reference.mechanism import GROUND, Joint, Mechanism
from screwgauge.reference.pose import layout, pose
from screwgauge.reference.rotations import Array
from screwgauge.models.shapes import CUT, DRIVEN, KINDS, colour_of, cut_joints, ends, mark, segments

WIDE, TALL, EDGE, FONT = 640.0, 400.0, 56.0, 11.0  # of the drawing, at most; its margin; of letters [pixels]
MOST_NAMES = 45  # beyond, only joints that are driven, cut or independent are named
MARKS = {
    "R": '<circle r="5"/>',
    "P": '<rect x="-8" y="-5" width="16" height="10"/>',
    "U": '<path d="M0,-7L7,0L0,7L-7,0Z"/>',
    "S": '<circle r="6.5"/><circle r="2.5"/>',
    "C": '<rect x="-9" y="-5" width="18" height="10" rx="5"/>',
}
#: A revolute joint is driven round, others along.
ROUND = '<path class="drive" d="M-8,8A11.5,11.5 0 1 1 8,8M8,8l1,-6M8,8l-6,-.5"/>'
ALONG = '<path class="drive" d="M12,0H23M23,0l-5,-4M23,0l-5,4M-12,0H-23M-23,0l5,-4M-23,0l5,4"/>'
CAGE = '<circle class="cut" r="12"/>'
FOOT = '<path class="foot" d="M-12,8H12M-9,8l-5,6M-2,8l-5,6M5,8l-5,6M12,8l-5,6"/>'
#: What a mark covers, with hatching or a cage around it.
RIM = [(r * np.cos(a), r * np.sin(a)) for r in (2.0, 7.0, 12.0) for a in np.radians(range(0, 360, 45))]
LOOK = f"""text{{font:{FONT:g}px sans-serif;fill:#222;paint-order:stroke;stroke:#fff;stroke-width:3px;stroke-linejoin:round}}
.mark{{fill:#fff;stroke:#222;stroke-width:1.5}}.driven{{fill:{DRIVEN}}}.drive{{fill:none;stroke:{DRIVEN};stroke-width:2.2}}
.cut{{fill:none;stroke:{CUT};stroke-width:2.2;stroke-dasharray:4 2.5}}.foot,.slide,.lead{{fill:none;stroke:#767676;stroke-width:1.2}}
.slide{{stroke-width:2.5}}.lead{{stroke-width:.7}}.body{{stroke-width:4.5;stroke-linecap:round;fill:none;opacity:.85}}"""


def viewed_from(mechanism: Mechanism) -> Array:
    """Direction to who looks: face-on where it is flat, else from above, so that joints do not hide each other."""
    points = _joint_points(mechanism)
    flat = [axis for axis in (2, 1, 0) if np.ptp(points[:, axis]) < 1e-3 * np.ptp(points, axis=0).max()]
    if len(flat) == 1 or not len(points):
        return np.asarray(np.eye(3)[flat[0] if flat else 2] * (-1.0 if flat == [1] else 1.0))
    apart = np.unique(points.round(6), axis=0)
    i, j = np.triu_indices(len(apart), 1)

    def hidden(direction: Array) -> float:
        seen = apart @ across(direction).T
        return float(np.sum(1.0 / (np.sum((seen[i] - seen[j]) ** 2, axis=1) + 1e-3 * np.ptp(seen) ** 2)))

    angles = product(np.radians([-70, -55, -40, -25, 20, 35, 50, 65]), np.radians([18, 25, 32]))
    views = [np.array([np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)]) for a, h in angles]
    return min(views, key=hidden)


def across(direction: Array) -> Array:
    """Right and up of who looks, z being up where it can be. Shape (2, 3)."""
    up = np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, direction)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(direction, right)])


def _joint_points(mechanism: Mechanism) -> Array:
    at, index = pose(layout(mechanism), mechanism.home[None]), mechanism.body_index
    sides = [(j.parent, mark(j)) for j in mechanism.joints if j.kind != "F"]
    sides += [(body.name, body.com) for body in mechanism.bodies]
    return np.array([at.p[0, index[name]] + at.R[0, index[name]] @ p for name, p in sides])


def drawing(mechanism: Mechanism) -> str:
    """Bodies as lines, joints as marks by kind, hatching where they stand on ground; with names and a legend."""
    at, index, its = pose(layout(mechanism), mechanism.home[None]), mechanism.body_index, ends(mechanism)
    view = across(viewed_from(mechanism)) * [[1.0], [-1.0]]  # down the page

    def seen(body: str, p: Array) -> Array:
        return np.asarray(view @ (at.p[0, index[body]] + at.R[0, index[body]] @ p))

    lines = [(b.name, seen(b.name, p), seen(b.name, q)) for b in mechanism.bodies for p, q in segments(b, its[b.name])]
    joints = [joint for joint in mechanism.joints if joint.kind != "F"]
    places = [seen(joint.parent, mark(joint)) for joint in joints]
    cloud = np.array([*(p for _, *pair in lines for p in pair), *places])
    low, size = cloud.min(axis=0), np.ptp(cloud, axis=0)
    scale = min((WIDE - 2 * EDGE) / max(size[0], 1e-9), (TALL - 2 * EDGE) / max(size[1], 1e-9))
    legend, head = _legend(mechanism, joints)
    shift = np.array([(WIDE - scale * size[0]) / 2.0, head + EDGE]) - scale * low
    lines = [(name, scale * p + shift, scale * q + shift) for name, p, q in lines]
    places = [scale * p + shift for p in places]
    sides = [[scale * seen(*side) + shift for side in _sides(joint)] for joint in joints]
    slides = (
        f'<path class="slide" d="M{_xy(p)}L{_xy(q)}"/>'
        for joint, (p, q) in zip(joints, sides, strict=True)
        if joint.kind in "PC"
    )
    out = [*slides]
    out += [
        f'<path class="body" stroke="{colour_of(mechanism, index[n])}" d="M{_xy(p)}L{_xy(q)}"/>' for n, p, q in lines
    ]
    for joint, place, feet in zip(joints, places, sides, strict=True):
        out += _joint(
            joint,
            place,
            feet,
            joint.name in cut_joints(mechanism),
            view @ at.R[0, index[joint.parent]] @ joint.parent_frame.R @ joint.freedoms[-1][1],
        )
    tall = head + scale * size[1] + 2 * EDGE
    out += _names(mechanism, lines, list(zip(joints, places, strict=True)), (WIDE, tall))
    title = f'<text x="8" y="18" font-weight="bold">{escape(mechanism.title or mechanism.name)}: home pose</text>'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE:.0f} {tall:.0f}" width="{WIDE:.0f}" height="{tall:.0f}">'
        f'<style>{LOOK}</style><rect width="100%" height="100%" fill="#fff"/>{title}{legend}{"".join(out)}</svg>\n'
    )


def _sides(joint: Joint) -> tuple[tuple[str, Array], tuple[str, Array]]:
    return (joint.parent, joint.parent_frame.p), (joint.child, joint.child_frame.p)


def _xy(p: Array) -> str:
    return f"{p[0]:.1f},{p[1]:.1f}"


def _joint(joint: Joint, place: Array, sides: list[Array], cut: bool, axis: Array) -> list[str]:
    """Slide, feet and mark of a joint; `axis` is its last one as it is seen."""
    turn = np.degrees(np.arctan2(axis[1], axis[0])) if joint.kind in "PC" and np.hypot(*axis) > 0.05 else 0.0
    drive = "" if not joint.actuated else ROUND if joint.kind == "R" else ALONG
    out = [
        f'<g transform="translate({_xy(p)})">{FOOT}</g>'
        for p, (n, _) in zip(sides, _sides(joint), strict=True)
        if n == GROUND
    ]
    looks = f"mark{' driven' * joint.actuated}"
    return [
        *out,
        f'<g transform="translate({_xy(place)}) rotate({turn:.0f})"><g class="{looks}">{MARKS[joint.kind]}</g>{drive}{CAGE * cut}</g>',
    ]


def _legend(mechanism: Mechanism, joints: Iterable[Joint]) -> tuple[str, float]:
    """Marks with what they mean, and how far down they reach."""
    kinds = [kind for kind in KINDS if any(joint.kind == kind for joint in joints)]
    items = [(f'<g class="mark">{MARKS[kind]}</g>', KINDS[kind]) for kind in kinds]
    if {*kinds} and mechanism.actuators:
        items.append(
            (
                f'<g class="mark driven"><circle r="5"/></g>{ROUND if mechanism.actuators[0].kind == "R" else ALONG}',
                "driven",
            )
        )
    items += [(CAGE, "cut: closes a loop")] * bool(cut_joints(mechanism))
    items += [(f'<g transform="translate(0 -6)">{FOOT}</g>', "ground")]
    out, x, y = [], 22.0, 38.0
    for shape, text in items:
        if x + 26 + 5.4 * len(text) > WIDE:
            x, y = 22.0, y + 28.0
        out.append(
            f'<g transform="translate({x:.0f} {y:.0f})">{shape}<text x="{28 if text == "driven" else 18}" y="4">{text}</text></g>'
        )
        x += (58 if text == "driven" else 42) + 5.4 * len(text)
    return "".join(out), y


def _names(
    mechanism: Mechanism,
    lines: list[tuple[str, Array, Array]],
    joints: list[tuple[Joint, Array]],
    page: tuple[float, float],
) -> list[str]:
    """Names of bodies and joints, each where it covers least; with a line to what it names if that is not beside it."""
    chosen, few = {*mechanism.independent.values()}, len(mechanism.bodies) + len(joints) <= MOST_NAMES
    label = {name: text for text, name in mechanism.independent.items()}
    texts: dict[tuple[float, ...], list[str]] = {}
    for joint, place in joints:
        own = [label[name] for name in joint.coordinates if name in chosen]
        if few or own or joint.actuated:
            text = joint.name if not own or own == [joint.name] else f"{joint.name}: {', '.join(own)}"
            texts.setdefault(tuple(place.round(1)), []).append(text)
    wanted = [(", ".join(several), "#222", np.array(place)) for place, several in texts.items()]
    firsts = {name: (p + q) / 2.0 for name, p, q in reversed(lines)}
    wanted += [(name, colour_of(mechanism, mechanism.body_index[name]), p) for name, p in firsts.items() if few]
    busy = [p + (q - p) * k for _, p, q in lines for k in np.linspace(0, 1, 2 + int(np.hypot(*(q - p)) / 8))]
    busy += [place + d for _, place in joints for d in RIM]
    points, boxes, out = np.array(busy), np.zeros((0, 4)), []
    for text, colour, place in wanted:
        wide = 0.56 * FONT * len(text)
        best, box, at = np.inf, np.zeros(4), place
        for reach, angle in product((12, 18, 26, 36, 50, 66, 84), np.radians(range(0, 360, 30))):
            c, s = np.cos(angle), np.sin(angle)
            x, y = place[0] + reach * c + (0.5 * c - 0.5) * wide, place[1] + reach * s + 4.0 * s - 0.5 * FONT
            new = np.array([x - 1, y - 1, x + wide + 1, y + FONT + 1])
            over = (
                np.clip(np.minimum(new[2:], boxes[:, 2:]) - np.maximum(new[:2], boxes[:, :2]), 0.0, None)
                .prod(axis=1)
                .sum()
            )
            inside = np.count_nonzero(((points > new[:2]) & (points < new[2:])).all(axis=1))
            out_of_page = np.clip([4 - new[0], 48 - new[1], new[2] - page[0] + 4, new[3] - page[1] + 4], 0, None).sum()
            cost = 2.0 * over + 12.0 * inside + 50.0 * out_of_page + reach
            if cost < best:
                best, box, at = cost, new, place + (reach - 4) * np.array([c, s])
        boxes = np.concatenate([boxes, box[None]])
        if np.hypot(*(at - place)) > 20:
            out.append(f'<path class="lead" d="M{_xy(place)}L{_xy(at)}"/>')
        out.append(f'<text x="{box[0] + 1:.1f}" y="{box[3] - 3:.1f}" style="fill:{colour}">{escape(text)}</text>')
    return out
