"""A mechanism at its home pose as SVG, by parallel projection."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from screwgauge.models.shapes import (
    AXIS,
    CUT,
    DOUBT,
    DRIVEN,
    Shape,
    across,
    cut_joints,
    joint_marks,
    placed,
    viewed_from,
)
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.pose import Pose
from screwgauge.reference.rotations import Array
from screwgauge.study.motion import DrawnMotion

WIDE, TALL, EDGE, FONT = 640.0, 400.0, 52.0, 11.0  # of the drawing, at most; its margin; of letters [pixels]
MOST_NAMES = 45  # beyond, only joints that are driven or independent are named
#: Kind of joint -> its name, and its mark.
MARKS = {
    "R": ("revolute", '<circle r="5.5"/>'),
    "P": ("prismatic", '<rect x="-8" y="-5" width="16" height="10"/>'),
    "U": ("universal", '<path d="M0,-7L7,0L0,7L-7,0Z"/>'),
    "S": ("spherical", '<circle r="7"/><circle r="3.5"/>'),
    "C": ("cylindrical", '<rect x="-9" y="-5" width="18" height="10" rx="5"/>'),
    "E": ("planar", '<path d="M-11,6L-4,-6H11L4,6Z"/><circle r="2.5"/>'),
}
TOWARDS, AWAY = '<circle r="1.6" fill="#222"/>', '<path d="M-3,-3L3,3M-3,3L3,-3" stroke="#222"/>'
#: A revolute joint is driven round, others along.
ROUND = '<path class="drive" d="M-8,8A11.5,11.5 0 1 1 8,8M8,8l1,-6M8,8l-6,-.5"/>'
ALONG = '<path class="drive" d="M12,0H23M23,0l-5,-4M23,0l-5,4M-12,0H-23M-23,0l5,-4M-23,0l5,4"/>'
CAGE, FOOT = '<circle class="cut" r="12"/>', '<path class="thin" d="M-12,8H12M-9,8l-5,6M-2,8l-5,6M5,8l-5,6M12,8l-5,6"/>'
ODD = f'<circle r="15" fill="none" stroke="{DOUBT}" stroke-width="1.5"/><text x="13" y="-10" fill="{DOUBT}">!</text>'
#: What a mark covers, with hatching or a cage around it.
RIM = [(r * np.cos(a), r * np.sin(a)) for r in (2.0, 7.0, 12.0) for a in np.radians(range(0, 360, 45))]
#: Where names may stand about what they name: distance, shape (n, 1), and direction, shape (n, 2).
_AROUND = np.array([(r, a) for r in (12, 18, 26, 36, 50, 66, 84) for a in np.radians(range(0, 360, 30))])
SPOTS = _AROUND[:, :1], np.stack([np.cos(_AROUND[:, 1]), np.sin(_AROUND[:, 1])], axis=1)
LOOK = f"""text{{font:{FONT:g}px sans-serif;paint-order:stroke;stroke:#fff;stroke-width:3px;stroke-linejoin:round}}
path,line{{fill:none}}.mark *{{fill:#fff;stroke:#222;stroke-width:1.5}}.driven *{{fill:{DRIVEN}}}
.drive{{stroke:{DRIVEN};stroke-width:2.2}}.cut{{fill:none;stroke:{CUT};stroke-width:2.2;stroke-dasharray:4 2.5}}
.thin{{stroke:#767676}}.slide{{stroke:#767676;stroke-width:2.5}}.axis{{stroke:{AXIS};stroke-width:1.2}}
.body{{stroke-width:4.5;stroke-linecap:round;opacity:.85}}
.other{{stroke:{DOUBT};stroke-width:1.6;stroke-dasharray:5 3}}"""


def frames(motion: DrawnMotion) -> list[str]:
    """A drawing for each sample of a motion, all alike in scale and without names, which would jump."""
    mechanism, poses = motion.lay.mechanism, [motion.at.rows([k]) for k in range(len(motion.t))]
    cloud = np.concatenate([_cloud(mechanism, placed(mechanism, at), joint_marks(mechanism, at)) for at in poses])
    return [
        drawing(mechanism, at=at, cloud=cloud, said=f"t = {t:.3f} s")
        for at, t in zip(poses, motion.t.tolist(), strict=True)
    ]


def _cloud(mechanism: Mechanism, solids: Sequence[Shape], joints: Sequence[tuple[Joint, Array, Array]]) -> Array:
    """What has to be within a picture, in its plane. Shape (n, 2)."""
    rods = [one for one in solids if one.group == "links" or one.kind == "slide" or one.group == "other"]
    points = [*(end for one in rods for end in (one.a, one.b)), *(place for _, place, _ in joints)]
    return np.array(points) @ _view(mechanism).T


def _view(mechanism: Mechanism) -> Array:
    """Right, and down the page. Shape (2, 3)."""
    return across(viewed_from(mechanism)) * [[1.0], [-1.0]]


def drawing(
    mechanism: Mechanism,
    beside: Sequence[Shape] = (),
    *,
    at: Pose | None = None,
    cloud: Array | None = None,
    said: str = "home pose",
) -> str:
    """Bodies as lines, joints as marks by kind, hatching where they stand on ground; at home with names and a legend.

    Args:
        beside: Of another mechanism, in the world.
        at: Pose of one sample, with what is within the picture, shape (n, 2), and what is said of it.
    """
    direction, view, solids = viewed_from(mechanism), _view(mechanism), [*placed(mechanism, at), *beside]
    marks = joint_marks(mechanism, at)
    joints = [(joint, view @ place, axis) for joint, place, axis in marks]
    cloud = _cloud(mechanism, solids, marks) if cloud is None else cloud
    low, size = cloud.min(axis=0), np.maximum(np.ptp(cloud, axis=0), 1e-9)
    scale = min((WIDE - 2 * EDGE) / size[0], (TALL - 2 * EDGE) / size[1])
    legend, head = _legend(mechanism, bool(beside))
    shift = np.array([(WIDE - scale * size[0]) / 2.0, head + EDGE]) - scale * low
    tall = head + scale * size[1] + 2 * EDGE
    joints = [(joint, scale * place + shift, axis) for joint, place, axis in joints]
    out, lines = list[str](), list[tuple[Shape, Array, Array]]()
    for one in sorted(solids, key=lambda one: (one.kind != "slide", one.group == "other")):
        a, b = (scale * view @ end + shift for end in (one.a, one.b.T[0] if one.kind == "ellipsoid" else one.b))
        if one.kind == "slide" or (one.group == "other" and one.kind in ("rod", "box", "arrow")):
            out.append(_line("other" if one.group == "other" else "slide", a, b, arrow=one.kind == "arrow"))
        elif one.group == "links":
            lines.append((one, a, b))
            out.append(f'<path class="body" stroke="{one.colour}" d="M{_xy(a)}L{_xy(b)}"/>')
        elif one.kind == "foot" or one.group == "doubts":
            out.append(f'<g transform="translate({_xy(a)})">{FOOT if one.kind == "foot" else ODD}</g>')
    cuts = cut_joints(mechanism)
    for joint, place, axis in joints:
        out.append(_joint(joint, place, view @ axis, float(axis @ direction), joint.name in cuts))
    few = len(mechanism.bodies) + len(joints) <= MOST_NAMES
    wanted = _wanted(mechanism, lines if few else (), [(joint, place) for joint, place, _ in joints])
    busy = [a + (b - a) * k for _, a, b in lines for k in np.linspace(0, 1, 2 + int(np.hypot(*(b - a)) / 8))]
    out += (
        [] if at else labels(wanted, np.array([*busy, *(place + d for _, place, _ in joints for d in RIM)]), WIDE, tall)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE:.0f} {tall:.0f}" width="{WIDE:.0f}" '
        f'height="{tall:.0f}"><style>{LOOK}</style><rect width="100%" height="100%" fill="#fff"/>'
        f'<text x="8" y="18">{escape(mechanism.title or mechanism.name)}: {said}</text>'
        f"{legend}{''.join(out)}</svg>\n"
    )


def _xy(p: Array) -> str:
    return f"{p[0]:.1f},{p[1]:.1f}"


def _line(look: str, a: Array, b: Array, *, arrow: bool = False) -> str:
    e = (b - a) / max(float(np.hypot(*(b - a))), 1e-9)
    n = np.array([-e[1], e[0]])
    head = f"M{_xy(b - 5 * e + 2.5 * n)}L{_xy(b)}L{_xy(b - 5 * e - 2.5 * n)}" if arrow else ""
    return f'<path class="{look}" d="M{_xy(a)}L{_xy(b)}{head}"/>'


def _joint(joint: Joint, place: Array, seen: Array, towards: float, cut: bool) -> str:
    """The mark of a joint and its last axis: an arrow, or in the mark where it points at the viewer or away."""
    turn = np.degrees(np.arctan2(seen[1], seen[0])) if joint.slides == 1 and np.hypot(*seen) > 0.05 else 0.0
    drive = "" if not joint.actuated else ROUND if joint.angles else ALONG
    steep = joint.angles == 1 and abs(towards) > 0.95
    arrow = _line("axis", place, place + 26.0 * seen, arrow=True) if joint.angles == 1 and not steep else ""
    inner = (TOWARDS if towards > 0 else AWAY) if steep else ""
    marks = f'<g class="mark{" driven" * joint.actuated}">{MARKS[joint.kind][1]}</g>{inner}{drive}{CAGE * cut}'
    return f'{arrow}<g transform="translate({_xy(place)}) rotate({turn:.0f})">{marks}</g>'


def _legend(mechanism: Mechanism, compared: bool) -> tuple[str, float]:
    """Marks with what they mean, and how far down they reach."""
    there = {joint.kind for joint in mechanism.joints}
    turning = any(joint.angles == 1 for joint in mechanism.joints)
    items = [(f'<g class="mark">{mark}</g>', name) for kind, (name, mark) in MARKS.items() if kind in there]
    if mechanism.actuators:
        way = ROUND if mechanism.actuators[0].angles else ALONG
        items.append((f'<g class="mark driven"><circle r="5.5"/></g>{way}', "driven"))
    items += [(CAGE, "cut: closes a loop")] * bool(cut_joints(mechanism))
    items += [(f'<g transform="translate(0 -8)">{FOOT}</g>', "ground")]
    items += [('<path class="axis" d="M-10,0H10l-5,-3M10,0l-5,3"/>', "axis (dot: towards you)")] * turning
    items += [('<path class="other" d="M-12,0H12"/>', "the other")] * compared
    out, x, y = [], 28.0, 40.0
    for shape, text in items:
        if x + 26 + 5.4 * len(text) > WIDE:
            x, y = 28.0, y + 28.0
        out.append(f'<g transform="translate({x:.0f} {y:.0f})">{shape}<text x="28" y="4" fill="#222">{text}</text></g>')
        x += 60 + 5.4 * len(text)
    return "".join(out), y


def labels(wanted: Sequence[tuple[str, str, Array]], busy: Array, wide: float, tall: float) -> list[str]:
    """Texts, each where it covers least; with a line to what it names if that is not beside it.

    Args:
        wanted: Texts with their colours and what they stand beside.
        busy: Points that are better left free. Shape (n, 2).
        wide, tall: Of the page.
    """
    lows, highs, out, (reach, d) = np.zeros((0, 2)), np.zeros((0, 2)), list[str](), SPOTS
    for text, colour, place in wanted:
        size = np.array([0.56 * FONT * len(text) + 2.0, FONT + 2.0])
        low = place + reach * d + np.stack([(0.5 * d[:, 0] - 0.5) * size[0], 4.0 * d[:, 1] - 0.5 * size[1]], axis=1)
        over = np.minimum(low[:, None] + size, highs) - np.maximum(low[:, None], lows)
        inside = ((busy > low[:, None]) & (busy < low[:, None] + size)).all(axis=2).sum(axis=1)
        outside = np.maximum([4.0, 48.0] - low, 0.0) + np.maximum(low + size - [wide - 4.0, tall - 4.0], 0.0)
        cost = 2.0 * np.maximum(over, 0.0).prod(axis=2).sum(axis=1) + 12.0 * inside + 50.0 * outside.sum(axis=1)
        best = int(np.argmin(cost + reach[:, 0]))
        lows, highs = np.vstack([lows, low[best]]), np.vstack([highs, low[best] + size])
        if reach[best] > 24.0:
            out.append(_line("thin", place, place + (reach[best] - 4.0) * d[best]))
        x, y = lows[-1, 0] + 1.0, highs[-1, 1] - 3.0
        out.append(f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}">{escape(text)}</text>')
    return out


def _wanted(
    mechanism: Mechanism, lines: Sequence[tuple[Shape, Array, Array]], joints: Sequence[tuple[Joint, Array]]
) -> list[tuple[str, str, Array]]:
    """Texts with their colours and what they stand beside; joints at one place have one text."""
    label, texts = {name: text for text, name in mechanism.independent.items()}, dict[tuple[float, ...], list[str]]()
    for joint, place in joints:
        own = [label[name] for name in joint.coordinates if name in label]
        if lines or own or joint.actuated:
            text = joint.name if not own or own == [joint.name] else f"{joint.name}: {', '.join(own)}"
            texts.setdefault(tuple(place.round(0)), []).append(text)
    bodies = {one.name: (one.colour, (a + b) / 2.0) for one, a, b in reversed(lines)}
    wanted = [(", ".join(several), "#222", np.array(place)) for place, several in texts.items()]
    return [*wanted, *((name, *rest) for name, rest in bodies.items())]
