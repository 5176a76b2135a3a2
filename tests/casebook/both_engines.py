"""Reproductions that need both engines: one MJCF read by Pinocchio and MuJoCo, and one machine in both conventions."""

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from casebook import mujoco_discrepancies as mujoco
from casebook import pinocchio_discrepancies as pinocchio
from casebook.toy_models import ARM, INERTIAL, MASS, WEIGHT, Evidence, FourBar, body, joint, link, mjcf, robot


def _freedoms(text: str, mended: str) -> Evidence:
    return Evidence(pinocchio.load_mjcf(text).nv, mujoco.load(text).nv, pinocchio.load_mjcf(mended).nv, "")


def first_tree() -> Evidence:
    bars = body("a") + body("b", at="0 1 0")
    return _freedoms(mjcf(bars), mjcf(f'<body name="ground">{INERTIAL}{bars}</body>'))


def gravity() -> Evidence:
    text = mjcf(body("a"), before='<option gravity="0 0 -1.62"/>')
    model, other = pinocchio.load_mjcf(text), mujoco.load(text)
    raw = float(pinocchio.inverse(model)[0])
    model.gravity.linear[:] = other.opt.gravity
    return Evidence(raw, float(mujoco.inverse(other)[0]), float(pinocchio.inverse(model)[0]), "N m")


def gravcomp() -> Evidence:
    share = 1.0
    text = mjcf(body("a", attributes=f'gravcomp="{share}"'))
    raw = float(pinocchio.inverse(pinocchio.load_mjcf(text))[0])
    return Evidence(raw, float(mujoco.inverse(mujoco.load(text))[0]), raw - share * WEIGHT, "N m")


def include() -> Evidence:
    second = body("b", at=f"{ARM} 0 0")
    parts, whole = mjcf(body("a", '<include file="b.xml"/>')), mjcf(body("a", second))
    model = pinocchio.load_mjcf(parts, {"b.xml": f"<mujocoinclude>{second}</mujocoinclude>"})
    return Evidence(model.nv, mujoco.load(whole).nv, pinocchio.load_mjcf(whole).nv, "")


def defaults_first() -> Evidence:
    classes = '<default><default class="geared"><joint armature="0.5"/></default></default>'
    bar = body("a", joint='class="geared"')
    text = mjcf(bar, after=classes)
    value, refusal = _outcome(text, lambda model: float(model.armature[0]))
    mended = pinocchio.load_mjcf(mjcf(bar, before=classes)).armature[0]
    return Evidence(value, float(mujoco.load(text).dof_armature[0]), float(mended), "kg m^2", refusal)


def _outcome(text: str, measure: Callable[[Any], float]) -> tuple[float, str]:
    try:
        model = pinocchio.load_mjcf(text)
    except (
        IndexError,
        ValueError,
        RuntimeError,
    ) as error:  # an exception of Boost begins with its place in the sources
        return math.nan, " ".join(str(error).rpartition("message:")[2].split())
    return measure(model), ""


def bare_body() -> Evidence:
    named = mjcf(body("a"))
    bare = re.sub(r"<body [^>]*>", "<body>", named)
    value, refusal = _outcome(bare, lambda model: float(model.nv))
    return Evidence(value, mujoco.load(bare).nv, pinocchio.load_mjcf(named).nv, "", refusal)


def frame_element() -> Evidence:
    inside = body("b")
    framed, placed = f'<frame pos="{ARM} 0 0">{inside}</frame>', body("b", at=f"{ARM} 0 0")
    return _freedoms(mjcf(body("a", framed)), mjcf(body("a", placed)))


def cart_pole() -> Evidence:
    text = mjcf(body("cart", body("pole")).replace("<joint", '<joint type="slide"', 1))
    return _freedoms(text, text)


def one_joint_of_two() -> Evidence:
    two = body("a").replace(INERTIAL, f'<joint name="b" axis="1 0 0"/>{INERTIAL}')
    light = '<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>'
    inner = body("b").replace("0 1 0", "1 0 0")
    apart = mjcf(f'<body name="light"><joint name="a" axis="0 1 0"/>{light}{inner}</body>')
    count = pinocchio.load_mjcf(mjcf(two)).njoints - 1, pinocchio.load_mjcf(apart).njoints - 1
    return Evidence(count[0], mujoco.load(mjcf(two)).njnt, count[1], "")


def spring_and_damper() -> Evidence:
    text = mjcf(body("a", joint='damping="2" stiffness="3" springref="0.4"'))
    model, other = pinocchio.load_mjcf(text), mujoco.load(text)
    raw = float(pinocchio.inverse(model, v=1.0)[0])
    mended = raw + other.dof_damping[0] + other.jnt_stiffness[0] * (0.0 - other.qpos_spring[0])
    return Evidence(raw, float(mujoco.inverse(other, v=1.0)[0]), float(mended), "N m")


def site_on_world() -> Evidence:
    tip = '<site name="tip" pos="0.3 0 0"/>'
    bars = f'<site name="ground" pos="0.3 0 0"/>{body("a", tip)}'
    ends = ('body1="a" anchor="0.3 0 0"', 'site1="tip" site2="ground"')
    by_body, by_site = pinocchio.gaps(*(mjcf(bars, after=f"<equality><connect {pair}/></equality>") for pair in ends))
    return Evidence(by_site, 0.0, by_body, "m")


def closures_dropped() -> Evidence:
    bar, ends = FourBar(), 'site1="coupler" site2="rocker"'
    counts = []
    for kind in ("weld", "connect"):
        whole = bar.mjcf(f"<{kind} {ends}/>")
        rooted = whole.replace("<worldbody>", f'<worldbody><body name="ground">{INERTIAL}')
        counts.append(len(pinocchio.load_closed(rooted.replace("</worldbody>", "</body></worldbody>"))[1]))
    return Evidence(counts[0], mujoco.load(bar.mjcf(f"<weld {ends}/>")).neq, counts[1], "")


#: A free body at the origin, a right angle about y from upright: MuJoCo's coordinates, their order in Pinocchio, and
#: the rotation.
_AT = np.array([0.0, 0.0, 0.0, math.cos(math.pi / 4), 0.0, math.sin(math.pi / 4), 0.0])
_SCALAR_LAST = [0, 1, 2, 4, 5, 6, 3]
_TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def armature() -> Evidence:
    model, other = (
        pinocchio.load_urdf(robot(link("a"), joint("a"))),
        mujoco.load(mjcf(body("a", joint='armature="0.5"'))),
    )

    def moment() -> float:
        return float(pinocchio.inverse(model, a=1.0)[0] - pinocchio.inverse(model)[0])

    raw = moment()
    model.armature = np.array(other.dof_armature)
    return Evidence(raw, mujoco.moment(other), moment(), "kg m^2")


def damping() -> Evidence:
    text = robot(link("a"), joint("a", inside='<dynamics damping="2"/>'))
    model = pinocchio.load_urdf(text)
    raw = float(pinocchio.inverse(model, v=1.0)[0])
    right = float(mujoco.inverse(mujoco.load(text), v=1.0)[0])
    return Evidence(raw, right, raw + float(model.damping[0]), "N m")


def _free() -> tuple[Any, Any]:
    """A free body in both engines."""
    inertial = f'<inertial pos="0 0 0" mass="{MASS}" diaginertia="0.1 0.2 0.3"/>'
    text = mjcf(f'<body name="a"><freejoint/>{inertial}</body>')
    return pinocchio.load_mjcf(text), mujoco.load(text)


def quaternion_order() -> Evidence:
    model, other = _free()
    right = _TURN.T @ mujoco.inverse(other, _AT)[:3]
    forces = [float(pinocchio.inverse(model, q)[0]) for q in (_AT, _AT[_SCALAR_LAST])]
    return Evidence(forces[0], float(right[0]), forces[1], "N")


def free_velocity() -> Evidence:
    model, other = _free()
    v, omega = np.array([0.0, 3.0, 0.0]), np.array([0.0, 0.0, 2.0])
    right = float(mujoco.inverse(other, _AT, [*v, *omega])[2])
    local = _TURN.T @ v
    spatial = [*-np.cross(omega, local), 0.0, 0.0, 0.0]  # of a point that does not accelerate
    raw, mended = (
        float((_TURN @ pinocchio.inverse(model, _AT[_SCALAR_LAST], [*linear, *omega], a)[:3])[2])
        for linear, a in ((v, 0.0), (local, spatial))
    )
    return Evidence(raw, right, mended, "N")
