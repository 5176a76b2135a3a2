import math

import mujoco
import numpy as np

from casebook.mujoco_discrepancies import inverse, load, mass, measured, moment
from casebook.toy_models import (
    ARM,
    INERTIA,
    INERTIAL,
    MASS,
    WEIGHT,
    Evidence,
    G,
    body,
    joint,
    link,
    mjcf,
    numbers,
    robot,
)

_KEEP = '<mujoco><compiler fusestatic="false"/></mujoco>'
_QUARTER = f"0 0 {math.pi / 2!r}"


def turned_inertia() -> Evidence:
    tensor = (0.01, 0.02, 0.025)
    text = robot(link("a", com="0 0 0", turned=_QUARTER, tensor=tensor), joint("a"))
    unturned = robot(link("a", com="0 0 0", tensor=(tensor[1], tensor[0], tensor[2])), joint("a"))
    return Evidence(moment(load(text)), tensor[0], moment(load(unturned)), "kg m^2")


def _with_tool(inside: str = "", *, com: str, turned: str) -> str:
    tool = link("tool", mass=0.5, com=com, tensor=(0.01, 0.02, 0.025))
    held = joint("tool", "a", kind="fixed", origin=f'xyz="0 0 0.1" rpy="{turned}"')
    return robot(link("a"), joint("a"), tool, held, inside)


def fused_tensor() -> Evidence:
    expected = INERTIA + 0.01 + 0.5 * 0.1**2
    merged, kept = (moment(load(_with_tool(inside, com="0 0 0", turned=_QUARTER))) for inside in ("", _KEEP))
    return Evidence(merged, expected, kept, "kg m^2")


def fused_centre() -> Evidence:
    turned = f"0 {-math.pi / 2!r} 0"
    merged, kept = (float(inverse(load(_with_tool(inside, com="0.2 0 0", turned=turned)))[0]) for inside in ("", _KEEP))
    return Evidence(merged, WEIGHT, kept, "N m")


def fused_links() -> Evidence:
    merged, kept = (load(_with_tool(inside, com="0 0 0", turned="0 0 0")).nbody - 1 for inside in ("", _KEEP))
    return Evidence(merged, 3, kept, "")


def base_mass() -> Evidence:
    text = robot(link("a"), joint("a")).replace('<link name="base"/>', link("base", mass=5.0))
    lost, kept = (mass(load(text.replace("</robot>", f"{inside}</robot>"))) for inside in ("", _KEEP))
    return Evidence(lost, 5.0 + MASS, kept, "kg")


def base_fixed() -> Evidence:
    fixed = f'<robot name="sample">{link("base")}{link("a")}{joint("a")}{{}}</robot>'
    floating = fixed.format(f'<link name="world"/>{joint("base", "world", kind="floating")}')
    return Evidence(load(fixed.format("")).nv, 7, load(floating).nv, "")


def tensor_order() -> Evidence:
    xx, yy, zz, xy, xz, yz = (0.05, 0.045, 0.048, 0.004, 0.003, 0.002)

    def listed(*tensor: float) -> tuple[float, str]:
        inertial = f'<inertial pos="0 0 0" mass="1" fullinertia="{numbers(tensor)}"/>'
        return measured(mjcf(f'<body><joint axis="0 1 0"/>{inertial}</body>'), moment)

    wrong, message = listed(xx, xy, xz, yy, yz, zz)
    return Evidence(wrong, yy, listed(xx, yy, zz, xy, xz, yz)[0], "kg m^2", message)


def principal_axes() -> Evidence:
    tensor = np.array([[0.02, 6e-6, 8e-6], [6e-6, 0.023, -3e-6], [8e-6, -3e-6, 0.023]])
    moments, axes = np.linalg.eigh(tensor)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, (axes * np.linalg.det(axes)).ravel())

    def error(attributes: str) -> float:
        model = load(mjcf(f'<body><joint axis="0 1 0"/><inertial pos="0 0 0" mass="1" {attributes}/></body>'))
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, model.body_iquat[1])
        loaded = R.reshape(3, 3) * model.body_inertia[1] @ R.reshape(3, 3).T
        return float(np.abs(loaded - tensor).max() / moments[-1])

    six = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    written = f'fullinertia="{numbers(six)}"', f'diaginertia="{numbers(moments)}" quat="{numbers(quat)}"'
    return Evidence(error(written[0]), 0.0, error(written[1]), "")


def massless_link() -> Evidence:
    cross = robot('<link name="cross"/>', joint("cross"), link("a"), joint("a", "cross", axis="0 0 1"))
    both = mjcf(body("a").replace(INERTIAL, f'<joint axis="0 0 1"/>{INERTIAL}'))
    value, message = measured(cross, lambda model: float(inverse(model)[0]))
    return Evidence(value, WEIGHT, float(inverse(load(both))[0]), "N m", message)


def impossible_tensor() -> Evidence:
    pair = [
        measured(robot(link("a", com="0 0 0", tensor=tensor), joint("a")), moment)
        for tensor in ((0.01, 0.01, 0.05), (0.025, 0.025, 0.05))
    ]
    (value, message), (mended, _) = pair
    return Evidence(value, 0.025, mended, "kg m^2", message)


def degrees() -> Evidence:
    radians = mjcf(body("a", joint='range="-1.57 1.57"'))
    unmarked = radians.replace('<compiler angle="radian"/>', "")
    return Evidence(float(load(unmarked).jnt_range[0, 1]), 1.57, float(load(radians).jnt_range[0, 1]), "rad")


def printed_digits() -> Evidence:
    arm = 0.123456789012
    text = mjcf(body("a").replace(f'pos="{ARM} 0 0"', f'pos="{arm!r} 0 0"'))
    right = -MASS * G * arm
    saved = mujoco.MjSpec.from_string(text).to_xml()
    changes = [float(inverse(load(file))[0] / right - 1.0) for file in (saved, text)]
    return Evidence(changes[0], 0.0, changes[1], "")


def small_frames() -> Evidence:
    model = load(mjcf(body("a").replace(f'pos="{ARM} 0 0"', 'pos="5e-7 0 0"')))
    right, raw = -MASS * G * 5e-7, float(inverse(model)[0])
    model.body_sameframe[:] = 0
    return Evidence(raw / right, 1.0, float(inverse(model)[0]) / right, "")


def geoms_have_mass() -> Evidence:
    shape = '<geom type="box" size="0.1 0.1 0.1" {}/>'
    arm = f'<joint axis="0 1 0"/><geom type="sphere" size="0.05" mass="{MASS}"/>'
    masses = [mass(load(mjcf(f"<body>{arm}{shape.format(more)}</body>"))) for more in ("", 'density="0"')]
    return Evidence(masses[0], MASS, masses[1], "kg")
