"""SVG drawing of a mechanism in the home pose, in parallel projection."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from html import escape

import numpy as np

from screwgauge.models.shapes import (
    AXIS,
    CUT,
    DOUBT,
    DRIVEN,
    SPRING,
    Shape,
    cut_joints,
    joint_marks,
    place_shapes,
    view_axes,
    viewed_from,
)
from screwgauge.reference.equations.kinematics import length
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.rotations import Array

WIDE, TALL, EDGE, FONT = 640.0, 400.0, 52.0, 11.0  # largest size of the drawing; its margin; font size [pixels]
LETTER, CORNER = 0.62 * FONT, 44.0  # a letter's width; the height of world axes and scale bar [pixels]
MOST_NAMES = 45  # number above which only driven or independent joints are named
#: Kind of joint -> name and mark.
MARKS = {
    "R": ("revolute", '<circle r="5.5"/>'),
    "P": ("prismatic", '<rect x="-8" y="-5" width="16" height="10"/>'),
    "U": ("universal", '<path d="M0,-7L7,0L0,7L-7,0Z"/>'),
    "S": ("spherical", '<circle r="7"/><circle r="3.5"/>'),
    "C": ("cylindrical", '<rect x="-9" y="-5" width="18" height="10" rx="5"/>'),
    "fixed": ("fixed", '<path d="M-6,-6L6,6M-6,6L6,-6"/>'),
    "E": ("planar", '<path d="M-11,6L-4,-6H11L4,6Z"/><circle r="2.5"/>'),
}
WORLD = ("#C62828", "#2E7D32", "#1565C0")  # colours of the world axes
TOWARDS, AWAY = '<circle r="1.6" fill="#222"/>', '<path d="M-3,-3L3,3M-3,3L3,-3" stroke="#222"/>'
#: Mark of a driven revolute joint; marks of other driven joints are along the axis.
ROUND = '<path class="drive" d="M-8,8A11.5,11.5 0 1 1 8,8M8,8l1,-6M8,8l-6,-.5"/>'
ALONG = '<path class="drive" d="M12,0H23M23,0l-5,-4M23,0l-5,4M-12,0H-23M-23,0l5,-4M-23,0l5,4"/>'
CAGE, FOOT = '<circle class="cut" r="12"/>', '<path class="thin" d="M-12,8H12M-9,8l-5,6M-2,8l-5,6M5,8l-5,6M12,8l-5,6"/>'
ODD = f'<circle r="15" fill="none" stroke="{DOUBT}" stroke-width="1.5"/><text x="13" y="-10" fill="{DOUBT}">!</text>'
#: Points covered by a mark, including hatching or a cage around it.
RIM = [(r * np.cos(a), r * np.sin(a)) for r in (2.0, 7.0, 12.0) for a in np.radians(range(0, 360, 45))]
#: Candidate positions of labels around their targets: distance, shape (n, 1), and direction, shape (n, 2).
_AROUND = np.array([(r, a) for r in (15, 20, 28, 38, 50, 66, 84) for a in np.radians(range(0, 360, 30))])
SPOTS = _AROUND[:, :1], np.stack([np.cos(_AROUND[:, 1]), np.sin(_AROUND[:, 1])], axis=1)
LOOK = f"""
.drawn text{{font:{FONT:g}px sans-serif;paint-order:stroke;stroke:#fff;stroke-width:3px;stroke-linejoin:round}}
.drawn path,.drawn line{{fill:none}}
.drawn .mark *{{fill:#fff;stroke:#222;stroke-width:1.5}}
.drawn .driven *{{fill:{DRIVEN}}}
.drawn .drive{{stroke:{DRIVEN};stroke-width:2.2}}
.drawn .cut{{fill:none;stroke:{CUT};stroke-width:2.2;stroke-dasharray:4 2.5}}
.drawn .thin{{stroke:#767676}}
.drawn .slide{{stroke:#767676;stroke-width:2.5}}
.drawn .axis{{stroke:{AXIS};stroke-width:1.2}}
.drawn .body{{stroke-width:4.5;stroke-linecap:round;opacity:.85}}
.drawn .spring{{stroke:{SPRING};stroke-width:1.6}}
.drawn .other{{stroke:{DOUBT};stroke-width:1.6;stroke-dasharray:5 3}}
"""


def _cloud(mechanism: Mechanism, solids: Sequence[Shape], joints: Sequence[tuple[Joint, Array, Array]]) -> Array:
    """Return the points that a picture must contain, projected into its plane. Shape (n, 2)."""
    rods = [one for one in solids if one.group == "links" or one.kind == "slide" or one.group == "other"]
    points = [*(end for one in rods for end in (one.a, one.b)), *(place for _, place, _ in joints)]
    return np.array(points) @ _view(mechanism).T


def _view(mechanism: Mechanism) -> Array:
    """Return the world directions that point right and down on the page, as rows. Shape (2, 3)."""
    return view_axes(viewed_from(mechanism)) * [[1.0], [-1.0]]


def drawing(
    mechanism: Mechanism,
    others: Sequence[Shape] = (),
    coils: Sequence[Shape] = (),
    idle: Collection[str] = (),
) -> str:
    """Draw a mechanism in the home pose: bodies as lines, marks for joint kinds, hatched ground, names, a legend.

    Args:
        others: Shapes of a second mechanism, in the world frame.
        coils: Shapes of springs, in the frames of bodies.
        idle: Labels of coordinates that no actuator drives.
    """
    direction, view, solids = viewed_from(mechanism), _view(mechanism), [*place_shapes(mechanism, coils), *others]
    marks = joint_marks(mechanism)
    joints = [(joint, view @ place, axis) for joint, place, axis in marks]
    cloud = _cloud(mechanism, solids, marks)
    low, size = cloud.min(axis=0), np.maximum(np.ptp(cloud, axis=0), 1e-9)
    scale = min((WIDE - 2 * EDGE) / size[0], (TALL - 2 * EDGE) / size[1])
    odd = any(one.group == "doubts" for one in solids)
    legend, head = _legend(mechanism, {"second mechanism": bool(others), "spring": bool(coils), "suspicious": odd})
    shift = np.array([(WIDE - scale * size[0]) / 2.0, head + EDGE]) - scale * low
    tall = head + scale * size[1] + 2 * EDGE + CORNER
    joints = [(joint, scale * place + shift, axis) for joint, place, axis in joints]
    out, lines, sprung = list[str](), list[tuple[Shape, Array, Array]](), list[tuple[str, str, Array]]()
    for one in sorted(solids, key=lambda one: (one.kind != "slide", one.group == "other")):
        a, b = (scale * view @ end + shift for end in (one.a, one.b.T[0] if one.kind == "ellipsoid" else one.b))
        if one.group == "springs" and one.kind != "foot":
            out.append(f'<path class="spring" d="{_coil(a, b)}"/>' if one.kind == "slide" else _spiral(a))
            sprung.append((one.name, SPRING, 0.5 * (a + b)))
        elif one.kind == "slide" or (one.group == "other" and one.kind in ("rod", "box", "arrow")):
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
    wanted = [
        *_wanted_labels(mechanism, lines if few else (), [(joint, place) for joint, place, _ in joints], idle),
        *sprung,
    ]
    busy = [a + (b - a) * k for _, a, b in lines for k in np.linspace(0, 1, 2 + int(np.hypot(*(b - a)) / 8))]
    out += labels(wanted, np.array([*busy, *(place + d for _, place, _ in joints for d in RIM)]), WIDE, tall - CORNER)
    out.append(corner(view, scale / length(layout(mechanism)), tall))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="drawn" viewBox="0 0 {WIDE:.0f} {tall:.0f}" width="{WIDE:.0f}" '
        f'height="{tall:.0f}"><style>{LOOK}</style><rect width="100%" height="100%" fill="#fff"/>'
        f'<text x="8" y="18">{escape(mechanism.title or mechanism.name)}: home pose</text>'
        f"{legend}{''.join(out)}</svg>\n"
    )


def corner(view: Array, pixels: float, tall: float) -> str:
    """Draw world axes, and a scale bar with a round length, at the lower left.

    Args:
        view: World directions that point right and down on the page. Shape (2, 3).
        pixels: Pixels per metre.
        tall: Height of the page.
    """
    place, towards, out = np.array([34.0, tall - 30.0]), -np.cross(view[0], view[1]), list[str]()
    for name, colour, way, near in zip("xyz", WORLD, view.T, towards, strict=True):
        flat = np.hypot(*way) < 0.2
        tip = place + (22.0 * way if not flat else 0.0)
        text = place + (31.0 * way if not flat else np.array([-12.0, 12.0]))
        mark = TOWARDS if near > 0 else AWAY
        out.append(
            f'<g transform="translate({_xy(place)})"><circle r="4.5" style="fill:#fff;stroke:{colour}"/>{mark}</g>'
            if flat
            else _line("", place, tip, arrow=True).replace('class=""', f'style="stroke:{colour};stroke-width:1.6"')
        )
        spot = f'x="{text[0]:.1f}" y="{text[1] + 4.0:.1f}" text-anchor="middle"'
        out.append(f'<text {spot} fill="{colour}">{name}</text>')
    long = round_length(110.0 / pixels)
    a, b = np.array([90.0, tall - 16.0]), np.array([90.0 + long * pixels, tall - 16.0])
    ends = f"M{_xy(a)}v-6v6H{b[0]:.1f}v-6v6"
    out.append(f'<path d="{ends}" style="stroke:#222;stroke-width:1.5"/>')
    out.append(f'<text x="{a[0] + 6.0:.1f}" y="{a[1] - 5.0:.1f}" fill="#222">{metres(long)}</text>')
    return "".join(out)


def round_length(most: float) -> float:
    """Return the largest number of the form 1, 2 or 5 times a power of ten that does not exceed a limit."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= most * (1 + 1e-9)))


def metres(long: float) -> str:
    """Format a length: ``0.2 m``, ``50 mm``."""
    return f"{1e3 * long:.6g} mm" if long < 0.1 else f"{long:.6g} m"


def _xy(p: Array) -> str:
    return f"{p[0]:.1f},{p[1]:.1f}"


def _line(look: str, a: Array, b: Array, *, arrow: bool = False) -> str:
    e = (b - a) / max(float(np.hypot(*(b - a))), 1e-9)
    n = np.array([-e[1], e[0]])
    head = f"M{_xy(b - 5 * e + 2.5 * n)}L{_xy(b)}L{_xy(b - 5 * e - 2.5 * n)}" if arrow else ""
    return f'<path class="{look}" d="M{_xy(a)}L{_xy(b)}{head}"/>'


def _coil(a: Array, b: Array) -> str:
    """Draw a zigzag between straight ends."""
    e = (b - a) / max(float(np.hypot(*(b - a))), 1e-9)
    turns = max(4, int(np.hypot(*(b - a)) / 7.0))
    n, points = np.array([-e[1], e[0]]), [a + (b - a) * k for k in np.linspace(0.1, 0.9, turns)]
    zigzag = [point + (5.0, -5.0)[k % 2] * n for k, point in enumerate(points)]
    return f"M{_xy(a)}" + "".join(f"L{_xy(point)}" for point in (points[0], *zigzag, points[-1], b))


def _spiral(a: Array) -> str:
    return f'<path class="spring" transform="translate({_xy(a)})" d="M0,-9A9,9 0 1 1 -9,0A12,12 0 0 0 3,12"/>'


def _joint(joint: Joint, place: Array, seen: Array, towards: float, cut: bool) -> str:
    """Draw a joint's symbol and last axis: an arrow, or a dot or cross inside the symbol for a perpendicular axis."""
    turn = np.degrees(np.arctan2(seen[1], seen[0])) if joint.slides == 1 and np.hypot(*seen) > 0.05 else 0.0
    drive = "" if not joint.actuated else ROUND if joint.angles else ALONG
    turns = joint.angles == 1 and not joint.fixed
    steep = turns and abs(towards) > 0.95
    arrow = _line("axis", place, place + 26.0 * seen, arrow=True) if turns and not steep else ""
    inner = (TOWARDS if towards > 0 else AWAY) if steep else ""
    marks = f'<g class="mark{" driven" * joint.actuated}">{MARKS[joint.kind][1]}</g>{inner}{drive}{CAGE * cut}'
    return f'{arrow}<g transform="translate({_xy(place)}) rotate({turn:.0f})">{marks}</g>'


#: Kind of additional element -> mark.
FURTHER = {
    "spring": '<path class="spring" d="M-12,0l3,0l2,-5l4,10l4,-10l4,10l2,-5h5"/>',
    "second mechanism": '<path class="other" d="M-12,0H12"/>',
    "suspicious": f'<g transform="translate(-3 0)">{ODD}</g>',
}


def _legend(mechanism: Mechanism, more: Mapping[str, bool]) -> tuple[str, float]:
    """Draw marks with their meanings; return the drawing and the height of the legend.

    Args:
        more: Entry of `FURTHER` -> True if the drawing contains such an element.
    """
    there = {joint.kind for joint in mechanism.joints}
    turning = any(joint.angles == 1 and not joint.fixed for joint in mechanism.joints)
    items = [(f'<g class="mark">{mark}</g>', name) for kind, (name, mark) in MARKS.items() if kind in there]
    if mechanism.actuators:
        first = mechanism.actuators[0]
        way = ROUND if first.angles else ALONG
        items.append((f'<g class="mark driven">{MARKS[first.kind][1]}</g>{way}', "driven"))
    items += [(CAGE, "cut: closes a loop")] * bool(cut_joints(mechanism))
    items += [(f'<g transform="translate(0 -8)">{FOOT}</g>', "ground")]
    items += [('<path class="axis" d="M-10,0H10l-5,-3M10,0l-5,3"/>', "axis (dot: towards the viewer)")] * turning
    items += [(mark, name) for name, mark in FURTHER.items() if more[name]]
    out, x, y = [], 28.0, 40.0
    for shape, text in items:
        if x + 30 + LETTER * len(text) > WIDE:
            x, y = 28.0, y + 28.0
        out.append(f'<g transform="translate({x:.0f} {y:.0f})">{shape}<text x="28" y="4" fill="#222">{text}</text></g>')
        x += 60 + LETTER * len(text)
    return "".join(out), y


def labels(
    wanted: Sequence[tuple[str, str, Array]], busy: Array, wide: float, tall: float, left: float = 0.0
) -> list[str]:
    """Place labels where they cover least, with a leader line if they are distant; labels do not overlap.

    Labels that do not fit are omitted.

    Args:
        wanted: Text, colour and target of each label.
        busy: Points to leave uncovered if possible. Shape (n, 2).
        left, wide, tall: Bounds of the labels.
    """
    lows, highs, out, (reach, d) = np.zeros((0, 2)), np.zeros((0, 2)), list[str](), SPOTS
    for text, colour, place in wanted:
        size = np.array([LETTER * len(text) + 2.0, FONT + 2.0])
        low = place + reach * d + np.stack([(0.5 * d[:, 0] - 0.5) * size[0], 4.0 * d[:, 1] - 0.5 * size[1]], axis=1)
        over = np.minimum(low[:, None] + size, highs) - np.maximum(low[:, None], lows)
        free = ~(over > 0.0).all(axis=2).any(axis=1)
        free &= (low >= [left + 4.0, 48.0]).all(axis=1) & (low + size <= [wide - 4.0, tall - 4.0]).all(axis=1)
        if not free.any():
            continue
        inside = ((busy > low[:, None]) & (busy < low[:, None] + size)).all(axis=2).sum(axis=1)
        best = int(np.argmin(np.where(free, 12.0 * inside + reach[:, 0], np.inf)))
        lows, highs = np.vstack([lows, low[best]]), np.vstack([highs, low[best] + size])
        if reach[best] > 24.0:
            out.append(_line("thin", place, place + (reach[best] - 4.0) * d[best]))
        x, y = lows[-1, 0] + 1.0, highs[-1, 1] - 3.0
        out.append(f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}">{escape(text)}</text>')
    return out


def _wanted_labels(
    mechanism: Mechanism,
    lines: Sequence[tuple[Shape, Array, Array]],
    joints: Sequence[tuple[Joint, Array]],
    idle: Collection[str],
) -> list[tuple[str, str, Array]]:
    """Return labels with their colours and targets; joints at the same place share a label."""
    texts = dict[tuple[float, ...], list[str]]()
    label = {name: f"{text}{' (idle)' * (text in idle)}" for text, name in mechanism.independent.items()}
    for joint, place in joints:
        own = [label[name] for name in joint.coordinates if name in label]
        if lines or own or joint.actuated:
            text = joint.name if not own or own == [joint.name] else f"{joint.name}: {', '.join(own)}"
            texts.setdefault(tuple(place.round(0)), []).append(text)
    bodies = {one.name: (one.colour, (a + b) / 2.0) for one, a, b in reversed(lines)}
    wanted = [(", ".join(several), "#222", np.array(place)) for place, several in texts.items()]
    return [*wanted, *((name, *rest) for name, rest in bodies.items())]
